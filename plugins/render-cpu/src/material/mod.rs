//! Materials laid out for look-ups: factors, textures and how they are laid on the body.

mod extras;
mod mapping;
mod quantity;

pub(crate) use mapping::{Coordinates, Mapping, box_axes};

use crate::bsdf::{Layers, Lobe, Substance};
use crate::cache::SceneCache;
use crate::real::max;
use crate::vec3::{Rgb, Vec3};
use extras::Extras;
use mapping::{Affine, Laid};
use quantity::{Bumps, Layer, Number, Tint, share};
use syntable_model::scene::{self, TextureMapping, UvTransform};

/// How much shorter than one the normals of an even map may be, for they are stored in 8 bits.
const ROUNDING: f32 = 0.01;

/// A material on a body.
#[derive(Debug)]
pub(crate) struct Material {
    base_color: Tint,
    roughness: Number,
    metallic: Number,
    normal: Option<Bumps>,
    emission: Tint,
    dielectric_f0: f32,
    /// What few materials have.
    layers: Option<Box<Extras>>,
    pub alpha: Alpha,
    pub mapping: Mapping,
}

/// How alpha is understood; an opaque surface has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Alpha {
    Opaque,
    /// Below the cutoff there is no surface.
    Mask(f32),
    /// There is a surface with this probability, times the texture's alpha.
    Blend(f32),
}

/// The layer that a path meets, drawn at random.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Component {
    pub lobe: Lobe,
    pub substance: Substance,
    /// One over the probability of the draw, times the layer's share.
    pub weight: f32,
    /// What lies above.
    pub above: Layers,
    /// Index of refraction of the inside.
    pub ior: f32,
    /// Whether the varnish was drawn, which may have bumps of its own.
    pub is_coat: bool,
}

impl Material {
    /// Lays a material on a body. Wild factors are brought into range.
    pub fn new(material: &scene::Material, mapping: TextureMapping, cache: &SceneCache) -> Self {
        let layer = Layer(cache);
        let ior = if material.ior.is_finite() && material.ior >= 1.0 { material.ior } else { 1.5 };
        let emission = material.emission.factor.map(|x| if x > 0.0 && x.is_finite() { x } else { 0.0 });
        let emission_texture = material.emission.texture.as_ref().filter(|_| emission != [0.0; 3]);
        Self {
            base_color: layer.tint(&material.base_color),
            roughness: layer.number(&material.roughness),
            metallic: layer.number(&material.metallic),
            normal: layer.bumps(&material.normal),
            emission: Tint {
                factor: Rgb::from(emission),
                texture: emission_texture.map(|used| Laid::new(used, cache)),
            },
            dielectric_f0: ((ior - 1.0) / (ior + 1.0)).powi(2),
            layers: Extras::new(&layer, material, ior),
            alpha: match (material.alpha, &material.base_color.texture) {
                (scene::Alpha::Mask { cutoff }, Some(_)) => Alpha::Mask(share(cutoff)),
                (scene::Alpha::Blend { factor }, None) if share(factor) == 1.0 => Alpha::Opaque,
                (scene::Alpha::Blend { factor }, _) => Alpha::Blend(share(factor)),
                _ => Alpha::Opaque,
            },
            mapping: match mapping {
                TextureMapping::Uv(transform) => Mapping::Uv(Affine::new(&transform)),
                TextureMapping::Box { rotation, offset } => {
                    let tile =
                        if material.tile_m > 1e-6 && material.tile_m.is_finite() { material.tile_m } else { 1.0 };
                    let laid = Affine::new(&UvTransform { scale: [1.0; 2], rotation, offset });
                    Mapping::Box { per_m: 1.0 / tile, laid }
                }
            },
        }
    }

    /// Whether nothing of it depends on texture coordinates.
    #[inline(always)]
    pub fn is_plain(&self) -> bool {
        self.base_color.texture.is_none()
            && self.roughness.texture.is_none()
            && self.metallic.texture.is_none()
            && self.normal.is_none()
            && self.emission.texture.is_none()
            && self.layers.is_none()
    }

    /// Whether there are layers to draw from.
    #[inline(always)]
    pub fn is_layered(&self) -> bool {
        self.layers.is_some()
    }

    /// Whether it has bumps, so that tangents are needed; the varnish's own count where it was drawn.
    #[inline(always)]
    pub fn has_bumps(&self, is_coat: bool) -> bool {
        self.bumps(is_coat).is_some()
    }

    #[inline(always)]
    fn bumps(&self, is_coat: bool) -> Option<&Bumps> {
        match (&self.layers, is_coat) {
            (Some(layers), true) => layers.coat_bumps(),
            _ => self.normal.as_ref(),
        }
    }

    /// The substance of the base at a point; `tint` is the vertex colour.
    #[inline]
    pub fn substance(&self, at: Coordinates, tint: Rgb) -> Substance {
        Substance {
            base_color: self.base_color.at(at) * tint,
            roughness: self.roughness.at(at),
            metallic: self.metallic.at(at),
            dielectric_f0: self.dielectric_f0,
        }
    }

    /// Draws the layer that a path meets, by a number in [0, 1); `mu` is the cosine of its direction.
    #[inline(always)]
    pub fn component(&self, at: Coordinates, substance: Substance, mu: f32, u: f32) -> Component {
        let base =
            Component { lobe: Lobe::Base, substance, weight: 1.0, above: Layers::default(), ior: 1.0, is_coat: false };
        match &self.layers {
            None => base,
            Some(layers) => layers.draw(at, base, mu, u),
        }
    }

    /// Share of the light that is left after a way through the filling, metres.
    #[inline]
    pub fn passage(&self, metres: f32) -> Rgb {
        match &self.layers {
            Some(layers) => layers.passage(metres),
            None => Rgb::ONE,
        }
    }

    /// Emitted radiance at a point, nits.
    #[inline(always)]
    pub fn emission(&self, at: Coordinates) -> Rgb {
        self.emission.at(at)
    }

    /// Whether it glows.
    pub fn glows(&self) -> bool {
        !self.emission.factor.is_black()
    }

    /// Whether there is a surface at a point, by its finest texels; `u` in [0, 1) decides where it covers in part.
    #[inline]
    pub fn is_solid(&self, uv: [f32; 2], u: f32) -> bool {
        let alpha = || match &self.base_color.texture {
            Some(texture) => texture.channel(Coordinates { uv, log2_width: -100.0 }, 3),
            None => 1.0,
        };
        match self.alpha {
            Alpha::Opaque => true,
            Alpha::Mask(cutoff) => alpha() >= cutoff,
            Alpha::Blend(factor) => alpha() * factor > u,
        }
    }

    /// The normal of the map, given the frame of the mapping's coordinates around the unit normal `n`; and how much the
    /// slopes of bumps vary that are too fine for the look-up, by axis.
    #[inline]
    pub fn mapped_normal(
        &self,
        at: Coordinates,
        tangent: Vec3,
        bitangent: Vec3,
        n: Vec3,
        is_coat: bool,
    ) -> (Vec3, f32) {
        let Some(Bumps(map, strength)) = self.bumps(is_coat) else { return (n, 0.0) };
        let c = map.color(at);
        // The mean of unit normals is the shorter the more they differ (Toksvig, 2005).
        let mean = (c * 2.0 + Vec3::from([-1.0; 3])).length();
        let variance = max((1.0 - mean) / max(mean, 0.1) - ROUNDING, 0.0) * strength * strength;
        let [x, y] = [c.x, c.y].map(|c| (c * 2.0 - 1.0) * strength);
        let z = c.z * 2.0 - 1.0;
        let (along_u, along_v) = map.by.turn(tangent, bitangent);
        let along_u = (along_u - n * along_u.dot(n)).normalized_or(Vec3::ZERO);
        let along_v = (along_v - n * along_v.dot(n)).normalized_or(Vec3::ZERO);
        ((along_u * x + along_v * y + n * max(z, 0.05)).normalized_or(n), variance)
    }
}
