//! Layers above a material's base, and passage through it.

use super::Component;
use super::mapping::Coordinates;
use super::quantity::{Bumps, Layer, Number, Tint, share};
use crate::approx::{exp2, log2};
use crate::bsdf::{COAT_F0, Lobe, Substance, coat_albedo, sheen_albedo, table};
use crate::vec3::Rgb;
use syntable_model::scene;

/// Layers above the base, and passage through it.
#[derive(Debug)]
pub(super) struct Extras {
    coat: Option<Coat>,
    sheen: Option<(Tint, Number)>,
    transmission: Option<Number>,
    /// Whether the body is filled, so that light is bent.
    filled: bool,
    /// What a metre of the filling takes, base e.
    absorption: Rgb,
    ior: f32,
}

#[derive(Debug)]
pub(super) struct Coat {
    strength: Number,
    roughness: Number,
    normal: Option<Bumps>,
}

impl Extras {
    /// Lays the layers of a material on a body; none if it has none.
    pub fn new(layer: &Layer, material: &scene::Material, ior: f32) -> Option<Box<Self>> {
        let coat = material.clearcoat.as_ref().map(|coat| Coat {
            strength: layer.number(&coat.strength),
            roughness: layer.number(&coat.roughness),
            normal: layer.bumps(&coat.normal),
        });
        let sheen = material.sheen.as_ref().map(|sheen| (layer.tint(&sheen.color), layer.number(&sheen.roughness)));
        let coat = coat.filter(|coat| coat.strength.factor > 0.0);
        let sheen = sheen.filter(|(color, _)| !color.factor.is_black());
        let transmission = material.transmission.as_ref().filter(|passing| passing.share.factor > 0.0);
        if coat.is_none() && sheen.is_none() && transmission.is_none() {
            return None;
        }
        let volume = transmission.and_then(|passing| passing.volume);
        let absorption = volume.map_or(Rgb::ZERO, |volume| {
            let distance = volume.attenuation_distance_m;
            let of = |left: f32| {
                if distance > 0.0 && distance.is_finite() {
                    -log2(share(left).max(1e-6)) * std::f32::consts::LN_2 / distance
                } else {
                    0.0
                }
            };
            Rgb::from(volume.attenuation_color.map(of))
        });
        Some(Box::new(Self {
            coat,
            sheen,
            transmission: transmission.map(|passing| layer.number(&passing.share)),
            filled: volume.is_some(),
            absorption,
            ior,
        }))
    }

    /// Draws a layer; `drawn` is the base.
    #[inline(never)]
    pub fn draw(&self, at: Coordinates, mut drawn: Component, mu: f32, mut u: f32) -> Component {
        drawn.ior = self.ior;
        if let Some(coat) = &self.coat {
            let (strength, roughness) = (coat.strength.at(at), coat.roughness.at(at));
            if strength > 0.0 {
                let chance = (strength * coat_albedo(roughness, mu, table())).clamp(0.15, 0.85);
                if u < chance {
                    drawn.substance =
                        Substance { base_color: Rgb::ZERO, roughness, metallic: 0.0, dielectric_f0: COAT_F0 };
                    return Component { weight: strength / chance, is_coat: true, ..drawn };
                }
                u = (u - chance) / (1.0 - chance);
                drawn.weight = 1.0 / (1.0 - chance);
                (drawn.above.coat, drawn.above.coat_roughness) = (strength, roughness);
            }
        }
        if let Some((color, roughness)) = &self.sheen {
            let (color, roughness) = (color.at(at), roughness.at(at));
            let strength = color.x.max(color.y).max(color.z);
            if strength > 0.0 {
                let chance = (strength * sheen_albedo(roughness, mu)).clamp(0.15, 0.6);
                if u < chance {
                    let substance = Substance { base_color: color, roughness, metallic: 0.0, dielectric_f0: 0.0 };
                    return Component { lobe: Lobe::Sheen, substance, weight: drawn.weight / chance, ..drawn };
                }
                u = (u - chance) / (1.0 - chance);
                drawn.weight /= 1.0 - chance;
                (drawn.above.sheen, drawn.above.sheen_roughness) = (strength, roughness);
            }
        }
        if let Some(transmission) = &self.transmission {
            // Light passes where it would else be scattered below the surface, which metals do not do.
            let passing = transmission.at(at) * (1.0 - drawn.substance.metallic);
            if u < passing {
                drawn.lobe = if self.filled { Lobe::Glass } else { Lobe::Pane };
            } else {
                drawn.substance.metallic = (drawn.substance.metallic / (1.0 - passing)).min(1.0);
            }
        }
        drawn
    }
}

impl Extras {
    /// Share of the light that is left after a way through the filling, metres.
    pub fn passage(&self, metres: f32) -> Rgb {
        self.absorption.map(|k| exp2(k * metres * -std::f32::consts::LOG2_E))
    }

    /// Bumps of the varnish.
    pub fn coat_bumps(&self) -> Option<&Bumps> {
        self.coat.as_ref()?.normal.as_ref()
    }
}
