//! Materials laid out for look-ups: factors, textures and how they are laid on the body.

use crate::approx::{log2_rough, sin_cos_turns};
use crate::bsdf::Substance;
use crate::cache::SceneCache;
use crate::real::max;
use crate::texture::MipTexture;
use crate::vec3::{Rgb, Vec3, vec3};
use std::sync::Arc;
use syntable_model::scene::{self, Alpha, TextureMapping, TextureRef, UvTransform};

/// A material on a body.
#[derive(Debug)]
pub(crate) struct Material {
    base_color: Rgb,
    base_texture: Option<Laid>,
    roughness: f32,
    roughness_texture: Option<(Laid, u8)>,
    metallic: f32,
    metallic_texture: Option<(Laid, u8)>,
    normal: Option<(Laid, f32)>,
    emission: Rgb,
    emission_texture: Option<Laid>,
    dielectric_f0: f32,
    /// Alpha below which there is no surface.
    pub cutoff: Option<f32>,
    pub mapping: Mapping,
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

impl Material {
    /// Lays a material on a body. Wild factors are brought into range.
    pub fn new(material: &scene::Material, mapping: TextureMapping, cache: &SceneCache) -> Self {
        let laid = |texture: &Option<TextureRef>| texture.as_ref().map(|used| Laid::new(used, cache));
        let scalar = |s: &scene::Scalar| s.texture.as_ref().map(|(used, channel)| (Laid::new(used, cache), *channel));
        let ior = if material.ior.is_finite() && material.ior >= 1.0 { material.ior } else { 1.5 };
        let emission = material.emission.factor.map(|x| if x > 0.0 && x.is_finite() { x } else { 0.0 });
        Self {
            base_color: Rgb::from(material.base_color.factor.map(share)),
            base_texture: laid(&material.base_color.texture),
            roughness: share(material.roughness.factor),
            roughness_texture: scalar(&material.roughness),
            metallic: share(material.metallic.factor),
            metallic_texture: scalar(&material.metallic),
            normal: material
                .normal
                .as_ref()
                .map(|n| (Laid::new(&n.map, cache), if n.strength.is_finite() { n.strength } else { 1.0 })),
            emission: Rgb::from(emission),
            emission_texture: if emission == [0.0; 3] { None } else { laid(&material.emission.texture) },
            dielectric_f0: ((ior - 1.0) / (ior + 1.0)).powi(2),
            cutoff: match (material.alpha, &material.base_color.texture) {
                (Alpha::Mask { cutoff }, Some(_)) => Some(share(cutoff)),
                _ => None,
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
        self.base_texture.is_none()
            && self.roughness_texture.is_none()
            && self.metallic_texture.is_none()
            && self.normal.is_none()
            && self.emission_texture.is_none()
    }

    /// Whether it needs tangents.
    #[inline(always)]
    pub fn has_normal_map(&self) -> bool {
        self.normal.is_some()
    }

    /// The substance at a point; `tint` is the vertex colour.
    #[inline]
    pub fn substance(&self, at: Coordinates, tint: Rgb) -> Substance {
        let mut base_color = self.base_color * tint;
        if let Some(texture) = &self.base_texture {
            base_color = base_color * texture.color(at);
        }
        let scalar = |factor: f32, texture: &Option<(Laid, u8)>| match texture {
            Some((texture, channel)) => factor * texture.channel(at, *channel),
            None => factor,
        };
        Substance {
            base_color,
            roughness: scalar(self.roughness, &self.roughness_texture),
            metallic: scalar(self.metallic, &self.metallic_texture),
            dielectric_f0: self.dielectric_f0,
        }
    }

    /// Emitted radiance at a point, nits.
    #[inline]
    pub fn emission(&self, at: Coordinates) -> Rgb {
        match &self.emission_texture {
            Some(texture) => self.emission * texture.color(at),
            None => self.emission,
        }
    }

    /// Whether there is a surface at a point, by its finest texels.
    #[inline]
    pub fn is_solid(&self, uv: [f32; 2]) -> bool {
        match (&self.base_texture, self.cutoff) {
            (Some(texture), Some(cutoff)) => texture.channel(Coordinates { uv, log2_width: -100.0 }, 3) >= cutoff,
            _ => true,
        }
    }

    /// The normal of the map, given the frame of the mapping's coordinates around the unit normal `n`.
    #[inline]
    pub fn mapped_normal(&self, at: Coordinates, tangent: Vec3, bitangent: Vec3, n: Vec3) -> Vec3 {
        let Some((map, strength)) = &self.normal else { return n };
        let c = map.color(at);
        let [x, y] = [c.x, c.y].map(|c| (c * 2.0 - 1.0) * strength);
        let z = c.z * 2.0 - 1.0;
        let (along_u, along_v) = map.by.turn(tangent, bitangent);
        let along_u = (along_u - n * along_u.dot(n)).normalized_or(Vec3::ZERO);
        let along_v = (along_v - n * along_v.dot(n)).normalized_or(Vec3::ZERO);
        (along_u * x + along_v * y + n * max(z, 0.05)).normalized_or(n)
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
