//! How textures are laid on bodies: from a hit to texture coordinates, and from those to texels.

use crate::approx::{log2_rough, sin_cos_turns};
use crate::cache::SceneCache;
use crate::real::max;
use crate::texture::MipTexture;
use crate::vec3::{Rgb, Vec3, vec3};
use std::sync::Arc;
use syntable_model::scene::{TextureRef, UvTransform};

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
pub(super) struct Laid {
    texture: Arc<MipTexture>,
    pub(super) by: Affine,
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
    pub(super) fn new(t: &UvTransform) -> Self {
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
    pub(super) fn turn(&self, tangent: Vec3, bitangent: Vec3) -> (Vec3, Vec3) {
        let [[a, b], [c, d]] = self.m;
        // Rows of the inverse transpose, up to the determinant's size; its sign keeps mirrored pictures mirrored.
        let sign = 1.0_f32.copysign(a * d - b * c);
        ((tangent * d - bitangent * c) * sign, (bitangent * a - tangent * b) * sign)
    }
}

impl Laid {
    pub(super) fn new(used: &TextureRef, cache: &SceneCache) -> Self {
        let (texture, by) = (cache.texture(&used.texture), Affine::new(&used.transform));
        Self { level_bias: texture.log2_size() + by.log2_scale, texture, by }
    }

    #[inline(always)]
    pub(super) fn color(&self, at: Coordinates) -> Rgb {
        self.texture.color(self.by.apply(at.uv), at.log2_width + self.level_bias)
    }

    #[inline(always)]
    pub(super) fn channel(&self, at: Coordinates, channel: u8) -> f32 {
        self.texture.channel(self.by.apply(at.uv), at.log2_width + self.level_bias, channel)
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
