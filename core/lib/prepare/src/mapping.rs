//! Texture coordinates of hits.

use syntable_model::scene::UvTransform;
use syntable_simd::functions::{log2_rough, sin_cos_turns};
use syntable_simd::{Vec3, max};

/// Source of texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    /// The mesh.
    Uv(UvAffine),
    /// A projection along the dominant axis of the face.
    Box {
        /// Tiles per meter.
        per_m: f32,
        /// Applied to the coordinates in tiles.
        transform: UvAffine,
    },
}

/// (u, v) ↦ M (u, v) + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct UvAffine {
    /// Rows of M.
    pub m: [[f32; 2]; 2],
    /// Added last.
    pub offset: [f32; 2],
    /// Base-2 logarithm of the mean factor on lengths.
    pub log2_scale: f32,
}

/// Texture coordinates at a point, and the width of the look-up.
#[derive(Clone, Copy, Debug)]
pub struct TextureCoordinates {
    /// u to the right, v upwards.
    pub uv: [f32; 2],
    /// Base-2 logarithm of the footprint's width in (u, v).
    pub log2_width: f32,
}

impl UvAffine {
    /// Matrix of a transform. The identity's values replace non-finite values.
    pub fn new(t: &UvTransform) -> Self {
        let sane = |x: f32, or: f32| if x.is_finite() { x } else { or };
        let [su, sv] = t.scale.map(|s| sane(s, 1.0));
        let (sin, cos) = sin_cos_turns(sane(t.rotation, 0.0) * (0.5 * std::f32::consts::FRAC_1_PI));
        Self {
            m: [[su * cos, -sv * sin], [su * sin, sv * cos]],
            offset: t.offset.map(|o| sane(o, 0.0)),
            log2_scale: 0.5 * log2_rough(max((su * sv).abs(), 1e-12)),
        }
    }

    /// Applies the map.
    #[inline(always)]
    pub fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [[a, b], [c, d]] = self.m;
        [a * u + b * v + self.offset[0], c * u + d * v + self.offset[1]]
    }

    /// Tangent frame (along u, along v) of the new coordinates, computed from the frame of the old ones; length is
    /// arbitrary.
    #[inline(always)]
    pub fn tangent_frame(&self, tangent: Vec3, bitangent: Vec3) -> (Vec3, Vec3) {
        let [[a, b], [c, d]] = self.m;
        // Rows of the inverse transpose, up to the determinant's size; its sign keeps mirrored textures mirrored.
        let sign = 1.0_f32.copysign(a * d - b * c);
        ((tangent * d - bitangent * c) * sign, (bitangent * a - tangent * b) * sign)
    }
}

impl Mapping {
    /// Coordinates of the mesh, for a look-up that is `width_m` meters wide.
    #[inline(always)]
    pub fn by_uv(affine: &UvAffine, uv: [f32; 2], uv_per_m: f32, width_m: f32) -> TextureCoordinates {
        let log2_width = log2_rough(max(uv_per_m * width_m, 1e-20)) + affine.log2_scale;
        TextureCoordinates { uv: affine.apply(uv), log2_width }
    }

    /// Coordinates of the box projection, from a point and a face normal in the body's frame.
    #[inline(always)]
    pub fn by_box(per_m: f32, transform: &UvAffine, p: Vec3, normal: Vec3, width_m: f32) -> TextureCoordinates {
        let (u, v) = BoxSide::frame(normal);
        let uv = transform.apply([p.dot(u) * per_m, p.dot(v) * per_m]);
        TextureCoordinates { uv, log2_width: log2_rough(max(per_m * width_m, 1e-20)) }
    }

    /// Tangent frame of the coordinates in the body's frame, from the frame of the mesh or the box.
    #[inline(always)]
    pub fn frame(&self, tangent: Vec3, bitangent: Vec3) -> (Vec3, Vec3) {
        match self {
            Self::Uv(affine) => affine.tangent_frame(tangent, bitangent),
            Self::Box { transform, .. } => transform.tangent_frame(tangent, bitangent),
        }
    }
}

/// Side of the box for a face: the dominant axis of the face's normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoxSide(u8);

impl BoxSide {
    /// Number of sides.
    pub const COUNT: usize = 6;

    /// The side for a face normal of any length. If components are equal, z comes before x, and x before y.
    #[inline(always)]
    pub fn of([x, y, z]: [f64; 3]) -> Self {
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let (axis, outward) = if az >= ax && az >= ay {
            (2, z)
        } else if ax >= ay {
            (0, x)
        } else {
            (1, y)
        };
        Self(2 * axis + u8::from(outward.is_sign_negative()))
    }

    /// 0 … 5: +x, −x, +y, −y, +z, −z.
    #[inline(always)]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// Unit vectors of increasing u and v, body frame. Seen from outside, textures are upright and never mirrored.
    #[inline(always)]
    pub fn axes<F: From<i8>>(self) -> [[F; 3]; 2] {
        const AXES: [[[i8; 3]; 2]; BoxSide::COUNT] = [
            [[0, 1, 0], [0, 0, 1]],
            [[0, -1, 0], [0, 0, 1]],
            [[-1, 0, 0], [0, 0, 1]],
            [[1, 0, 0], [0, 0, 1]],
            [[1, 0, 0], [0, 1, 0]],
            [[-1, 0, 0], [0, 1, 0]],
        ];
        AXES[self.index()].map(|axis| axis.map(F::from))
    }

    /// [`Self::axes`] of the side of a face.
    #[inline(always)]
    pub fn frame(normal: Vec3) -> (Vec3, Vec3) {
        let [u, v] = Self::of(normal.array().map(f64::from)).axes::<f32>();
        (u.into(), v.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_simd::vec3;

    #[test]
    fn transforms_scale_then_turn_counter_clockwise_then_shift() {
        let quarter = UvTransform { scale: [2.0, 1.0], rotation: std::f32::consts::FRAC_PI_2, offset: [0.1, 0.2] };
        let affine = UvAffine::new(&quarter);
        let [u, v] = affine.apply([1.0, 0.0]);
        assert!((u - 0.1).abs() < 1e-6 && (v - 2.2).abs() < 1e-6);
        assert!((affine.log2_scale - 0.5).abs() < 1e-6);
        // New u = −old v: it grows against the old bitangent; new v = 2 old u grows along the old tangent.
        let (x, y) = (vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0));
        let (along_u, along_v) = affine.tangent_frame(x, y);
        assert!((along_u.normalized() + y).length() < 1e-6 && (along_v.normalized() - x).length() < 1e-6);
    }

    #[test]
    fn box_textures_are_upright_and_not_mirrored() {
        // Seen from outside, u is to the right and v up: on the sides v is z.
        for (index, normal, u, v) in [
            (4, [0.0, 0.1, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            (5, [0.0, 0.1, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            (0, [1.0, 0.2, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            (1, [-1.0, 0.2, 0.1], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]),
            (2, [0.1, 1.0, 0.2], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
            (3, [0.1, -1.0, 0.2], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ] {
            let side = BoxSide::of(normal);
            assert_eq!((side.index(), side.axes::<f64>()), (index, [u, v]), "{normal:?}");
            let (u, v) = BoxSide::frame(Vec3::from(normal.map(|x| x as f32)));
            assert!(u.cross(v).dot(Vec3::from(normal.map(|x| x as f32))) > 0.9, "{normal:?} is right-handed");
        }
    }
}
