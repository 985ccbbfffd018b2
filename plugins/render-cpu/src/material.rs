//! Materials laid out for look-ups: factors, textures and how they are laid on the body.

use crate::approx::{exp2, log2, log2_rough, sin_cos_turns};
use crate::bsdf::{COAT_F0, Layers, Lobe, Substance, coat_albedo, sheen_albedo, table};
use crate::cache::SceneCache;
use crate::real::max;
use crate::texture::MipTexture;
use crate::vec3::{Rgb, Vec3, vec3};
use std::sync::Arc;
use syntable_model::scene::{self, TextureMapping, TextureRef, UvTransform};

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

/// Layers above the base, and passage through it.
#[derive(Debug)]
struct Extras {
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
struct Coat {
    strength: Number,
    roughness: Number,
    normal: Option<Bumps>,
}

/// A colour: factor times texture.
#[derive(Debug)]
struct Tint {
    factor: Rgb,
    texture: Option<Laid>,
}

/// A number: factor times a channel of a texture.
#[derive(Debug)]
struct Number {
    factor: f32,
    texture: Option<(Laid, u8)>,
}

/// A normal map and its strength.
#[derive(Debug)]
struct Bumps(Laid, f32);

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

/// Where texture coordinates come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Mapping {
    /// The mesh's own.
    Uv(Affine),
    /// Projected along the face's dominant axis, in tiles of a given number per metre.
    Box { per_m: f32, laid: Affine },
}

/// (u, v) ↦ M (u, v) + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Affine {
    m: [[f32; 2]; 2],
    offset: [f32; 2],
    /// Base-2 logarithm of how much it stretches lengths.
    log2_scale: f32,
}

/// A texture and how it is laid over the mapping's coordinates.
#[derive(Clone, Debug)]
struct Laid {
    texture: Arc<MipTexture>,
    by: Affine,
    /// Added to the base-2 logarithm of a footprint in (u, v) to give the level.
    level_bias: f32,
}

/// Texture coordinates at a point, and how wide a look-up should be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coordinates {
    pub uv: [f32; 2],
    /// Base-2 logarithm of the footprint's width in (u, v).
    pub log2_width: f32,
}

impl Affine {
    fn new(t: &UvTransform) -> Self {
        let sane = |x: f32, or: f32| if x.is_finite() { x } else { or };
        let [su, sv] = t.scale.map(|s| sane(s, 1.0));
        let (sin, cos) = sin_cos_turns(sane(t.rotation, 0.0) * (0.5 * std::f32::consts::FRAC_1_PI));
        Self {
            m: [[su * cos, -sv * sin], [su * sin, sv * cos]],
            offset: t.offset.map(|o| sane(o, 0.0)),
            log2_scale: 0.5 * log2_rough(max((su * sv).abs(), 1e-12)),
        }
    }

    #[inline(always)]
    fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [[a, b], [c, d]] = self.m;
        [a * u + b * v + self.offset[0], c * u + d * v + self.offset[1]]
    }

    /// The tangent frame (along u, along v) of the new coordinates, given the old ones', up to length.
    #[inline(always)]
    fn turn(&self, tangent: Vec3, bitangent: Vec3) -> (Vec3, Vec3) {
        let [[a, b], [c, d]] = self.m;
        // Rows of the inverse transpose, up to the determinant's size; its sign keeps mirrored pictures mirrored.
        let sign = 1.0_f32.copysign(a * d - b * c);
        ((tangent * d - bitangent * c) * sign, (bitangent * a - tangent * b) * sign)
    }
}

impl Laid {
    fn new(used: &TextureRef, cache: &SceneCache) -> Self {
        let (texture, by) = (cache.texture(&used.texture), Affine::new(&used.transform));
        Self { level_bias: texture.log2_size() + by.log2_scale, texture, by }
    }

    #[inline(always)]
    fn color(&self, at: Coordinates) -> Rgb {
        self.texture.color(self.by.apply(at.uv), at.log2_width + self.level_bias)
    }

    #[inline(always)]
    fn channel(&self, at: Coordinates, channel: u8) -> f32 {
        self.texture.channel(self.by.apply(at.uv), at.log2_width + self.level_bias, channel)
    }
}

/// A number in [0, 1]; NaN counts as 0.
fn share(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

impl Tint {
    #[inline(always)]
    fn at(&self, at: Coordinates) -> Rgb {
        match &self.texture {
            Some(texture) => self.factor * texture.color(at),
            None => self.factor,
        }
    }
}

impl Number {
    #[inline(always)]
    fn at(&self, at: Coordinates) -> f32 {
        match &self.texture {
            Some((texture, channel)) => self.factor * texture.channel(at, *channel),
            None => self.factor,
        }
    }
}

/// Lays textures on a body.
struct Layer<'a>(&'a SceneCache);

impl Layer<'_> {
    fn tint(&self, color: &scene::Color) -> Tint {
        let texture = color.texture.as_ref().map(|used| Laid::new(used, self.0));
        Tint { factor: Rgb::from(color.factor.map(share)), texture }
    }

    fn number(&self, scalar: &scene::Scalar) -> Number {
        let texture = scalar.texture.as_ref().map(|(used, channel)| (Laid::new(used, self.0), *channel));
        Number { factor: share(scalar.factor), texture }
    }

    fn bumps(&self, normal: &Option<scene::NormalMap>) -> Option<Bumps> {
        let normal = normal.as_ref()?;
        let strength = if normal.strength.is_finite() { normal.strength } else { 1.0 };
        Some(Bumps(Laid::new(&normal.map, self.0), strength))
    }

    fn extras(&self, material: &scene::Material, ior: f32) -> Option<Box<Extras>> {
        let coat = material.clearcoat.as_ref().map(|coat| Coat {
            strength: self.number(&coat.strength),
            roughness: self.number(&coat.roughness),
            normal: self.bumps(&coat.normal),
        });
        let sheen = material.sheen.as_ref().map(|sheen| (self.tint(&sheen.color), self.number(&sheen.roughness)));
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
        Some(Box::new(Extras {
            coat,
            sheen,
            transmission: transmission.map(|passing| self.number(&passing.share)),
            filled: volume.is_some(),
            absorption,
            ior,
        }))
    }
}

impl Extras {
    /// Draws a layer; `drawn` is the base.
    #[inline(never)]
    fn draw(&self, at: Coordinates, mut drawn: Component, mu: f32, mut u: f32) -> Component {
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
            layers: layer.extras(material, ior),
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
            (Some(layers), true) => layers.coat.as_ref().and_then(|coat| coat.normal.as_ref()),
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
            Some(layers) if !layers.absorption.is_black() => {
                layers.absorption.map(|k| exp2(k * metres * -std::f32::consts::LOG2_E))
            }
            _ => Rgb::ONE,
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

impl Mapping {
    /// Coordinates by the mesh.
    #[inline(always)]
    pub fn by_uv(affine: &Affine, uv: [f32; 2], uv_per_m: f32, width_m: f32) -> Coordinates {
        let log2_width = log2_rough(max(uv_per_m * width_m, 1e-20)) + affine.log2_scale;
        Coordinates { uv: affine.apply(uv), log2_width }
    }

    /// Coordinates by the box, from a point and face normal in the body's frame.
    #[inline(always)]
    pub fn by_box(per_m: f32, laid: &Affine, p: Vec3, normal: Vec3, width_m: f32) -> Coordinates {
        let (u, v) = box_axes(normal);
        let uv = laid.apply([p.dot(u) * per_m, p.dot(v) * per_m]);
        Coordinates { uv, log2_width: log2_rough(max(per_m * width_m, 1e-20)) }
    }

    /// The frame of the coordinates in the body's frame, from that of the mesh or the box.
    #[inline(always)]
    pub fn frame(&self, tangent: Vec3, bitangent: Vec3) -> (Vec3, Vec3) {
        match self {
            Self::Uv(affine) => affine.turn(tangent, bitangent),
            Self::Box { laid, .. } => laid.turn(tangent, bitangent),
        }
    }
}

/// The axes along u and v on a face, so that the picture is never mirrored seen from outside.
#[inline(always)]
pub(crate) fn box_axes(normal: Vec3) -> (Vec3, Vec3) {
    let a = normal.map(f32::abs);
    if a.z >= a.x && a.z >= a.y {
        (vec3(1.0_f32.copysign(normal.z), 0.0, 0.0), vec3(0.0, 1.0, 0.0))
    } else if a.x >= a.y {
        (vec3(0.0, 1.0_f32.copysign(normal.x), 0.0), vec3(0.0, 0.0, 1.0))
    } else {
        (vec3(-1.0_f32.copysign(normal.y), 0.0, 0.0), vec3(0.0, 0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_scale_then_turn_counter_clockwise_then_shift() {
        let quarter = UvTransform { scale: [2.0, 1.0], rotation: std::f32::consts::FRAC_PI_2, offset: [0.1, 0.2] };
        let affine = Affine::new(&quarter);
        let [u, v] = affine.apply([1.0, 0.0]);
        assert!((u - 0.1).abs() < 1e-6 && (v - 2.2).abs() < 1e-6);
        assert!((affine.log2_scale - 0.5).abs() < 1e-6);
        // New u = −old v: it grows against the old bitangent; new v = 2 old u grows along the old tangent.
        let (x, y) = (vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0));
        let (along_u, along_v) = affine.turn(x, y);
        assert!((along_u.normalized() + y).length() < 1e-6 && (along_v.normalized() - x).length() < 1e-6);
    }

    #[test]
    fn box_axes_make_right_handed_frames() {
        for n in
            [[1.0, 0.2, 0.1], [-1.0, 0.2, 0.1], [0.1, 1.0, 0.2], [0.1, -1.0, 0.2], [0.1, 0.2, 1.0], [0.1, 0.2, -1.0]]
        {
            let (u, v) = box_axes(n.into());
            assert!(u.cross(v).dot(n.into()) > 0.9, "{n:?}");
        }
    }
}
