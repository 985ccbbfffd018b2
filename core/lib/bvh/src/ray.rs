//! Values that a walk precomputes for a ray, once per frame of reference.

use super::{Ray, axes::each_axis, wide::Column};
use syntable_simd::Wide;

/// Half-width of the error band around every box, as a multiple of the largest coordinate involved. The error of
/// shearing a corner in [`super::walk`] is below `2 ε` of it, and the error of the slab test is below `1.5 ε` (`ε =
/// f32::EPSILON`). So a box never loses a triangle that the exact same ray would hit.
pub(super) const BAND: f32 = 4.0 * f32::EPSILON;

/// Like [`BAND`], for boxes of instances, where moving the ray to the object's frame adds an error of its own.
pub(super) const PLACED_BAND: f32 = 16.0 * f32::EPSILON;

/// Direction components below this fraction of the largest count as this fraction: a parallel slab then
/// gives finite distances, and over the whole range the ray strays far less than [`BAND`].
const FLATTEST: f32 = 1e-12;

/// Directions whose components are all below this count as zero; keeps reciprocals finite.
const SHORTEST: f32 = 1e-24;

/// Orders for [`Wide::shuffle`]: one of x, y and z everywhere, and the three rotated by one and by two.
const X: i32 = 0b00_00_00_00;
const Y: i32 = 0b01_01_01_01;
const Z: i32 = 0b10_10_10_10;
const ROUND: i32 = 0b11_00_10_01;
const ROUND_TWICE: i32 = 0b11_01_00_10;

/// A ray in some frame. Both halves of the lanes hold x, y, z and any finite number.
#[derive(Clone, Copy)]
pub(super) struct Line<L: Wide> {
    origin: L::V,
    direction: L::V,
}

impl<L: Wide> Line<L> {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        // SAFETY: a ray is six numbers in a row.
        let &[ox, oy, oz, dx, dy, dz] = unsafe { &*std::ptr::from_ref(ray).cast::<[f32; 6]>() };
        let direction = L::twice(&[oz, dx, dy, dz]);
        Self { origin: L::twice(&[ox, oy, oz, dx]), direction: L::shuffle::<0b00_11_10_01>(direction) }
    }

    /// The ray seen from another frame. The direction keeps its length there, so distances along the
    /// ray mean the same in both. `m` holds the columns of a 3×4 matrix.
    #[inline(always)]
    pub fn seen_from(&self, m: &[Column; 4]) -> Self {
        let (x, y, z, shift) = (L::load(&m[0]), L::load(&m[1]), L::load(&m[2]), L::load(&m[3]));
        let (o, d) = (self.origin, self.direction);
        let origin = L::mul_add(z, L::shuffle::<Z>(o), shift);
        let origin = L::mul_add(y, L::shuffle::<Y>(o), origin);
        let direction = L::mul_add(y, L::shuffle::<Y>(d), L::mul(z, L::shuffle::<Z>(d)));
        Self {
            origin: L::mul_add(x, L::shuffle::<X>(o), origin),
            direction: L::mul_add(x, L::shuffle::<X>(d), direction),
        }
    }

    /// Prepares the ray for boxes and triangles whose largest absolute coordinate is `reach`, with one of the bands.
    /// `None` if the direction is zero or any number is not finite: such a ray hits nothing.
    #[inline(always)]
    pub fn aim(&self, reach: f32, band: f32) -> Option<(Slabs<L>, Shear)> {
        let (o, d) = (self.origin, self.direction);
        let (sign, rest) = (L::splat(-0.0), L::splat(f32::from_bits(0x7fff_ffff)));
        let (size, distance) = (L::and(d, rest), L::and(o, rest));
        let (largest, farthest) = (widest::<L>(size), widest::<L>(distance));
        let most = L::splat(f32::MAX);
        let finite = L::and(L::le(size, most), L::le(distance, most));
        let sound = L::bits(L::and(finite, L::le(L::splat(SHORTEST), largest)));
        if sound & 7 != 7 {
            return None;
        }
        let flattest = L::mul(largest, L::splat(FLATTEST));
        let steepness = L::div(L::splat(1.0), L::max(size, flattest));
        let inverse = L::or(steepness, L::and(d, sign));
        let band = L::mul(L::mul(L::add(farthest, L::splat(reach)), L::splat(band)), steepness);
        let near_shift = L::neg_mul_add(o, inverse, L::or(band, sign));
        let far_shift = L::neg_mul_add(o, inverse, band);
        let negative = L::bits(d) as usize;
        let slabs = Slabs {
            inverse: spread::<L>(inverse),
            near_shift: spread::<L>(near_shift),
            far_shift: spread::<L>(far_shift),
            near: each_axis!(a => size_of::<Column>() * (2 * a + (negative >> a & 1))),
        };
        let along = L::bits(L::le(largest, size)).trailing_zeros() as usize % 4;
        let shear = Shear { origin: L::store(o), direction: L::store(d), inverse: L::store(inverse), along };
        Some((slabs, shear))
    }
}

/// The largest of x, y and z, in the lanes of all three.
#[inline(always)]
fn widest<L: Wide>(v: L::V) -> L::V {
    L::max(L::max(v, L::shuffle::<ROUND>(v)), L::shuffle::<ROUND_TWICE>(v))
}

/// x, y and z, each in all lanes.
#[inline(always)]
fn spread<L: Wide>(v: L::V) -> [L::V; 3] {
    [L::shuffle::<X>(v), L::shuffle::<Y>(v), L::shuffle::<Z>(v)]
}

/// A ray ready to be tested against boxes.
pub(super) struct Slabs<L: Wide> {
    /// 1 / direction, finite.
    pub inverse: [L::V; 3],
    /// A plane at `p` is met at `p · inverse + shift`. The shifts for near and far planes differ by
    /// the error band, so that boxes grow.
    pub near_shift: [L::V; 3],
    pub far_shift: [L::V; 3],
    /// Byte offsets of the near planes in a node; the offsets of the far planes differ in one bit.
    pub near: [usize; 3],
}

/// A ray ready to be tested against triangles, in the frame in which it runs along an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shear {
    pub origin: Column,
    pub direction: Column,
    pub inverse: Column,
    /// Axis of the direction's largest component, below 3.
    pub along: usize,
}

/// A rigid or affine placement: rows of a 3×4 matrix, translation in the last column.
pub type Affine = [[f32; 4]; 3];

/// The identity placement.
pub const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The columns of a matrix, for [`Line::seen_from`].
pub(super) fn columns(m: &Affine) -> [Column; 4] {
    [0, 1, 2, 3].map(|c| {
        let [x, y, z] = [m[0][c], m[1][c], m[2][c]];
        Column([x, y, z, 0.0, x, y, z, 0.0])
    })
}

/// Inverse in `f64`, rounded once; `None` if singular or not finite.
pub(super) fn invert(m: &Affine) -> Option<Affine> {
    let m = m.map(|row| row.map(f64::from));
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let det = (0..3).map(|c| m[0][c] * minor(0, c)).sum::<f64>();
    let mut inverse = [[0.0_f32; 4]; 3];
    for (r, row) in inverse.iter_mut().enumerate() {
        let linear = [0, 1, 2].map(|c| minor(c, r) / det);
        let shift = -(0..3).map(|c| linear[c] * m[c][3]).sum::<f64>();
        *row = [linear[0] as f32, linear[1] as f32, linear[2] as f32, shift as f32];
    }
    inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
}
