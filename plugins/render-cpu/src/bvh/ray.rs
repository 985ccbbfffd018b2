//! What a walk precomputes about a ray, once per frame of reference.

use super::{Ray, walk::each_axis, wide::Bounds};

/// Half-width of the error band put around every box, as a multiple of the largest coordinate in
/// play. Shearing a corner in [`super::walk`] errs by less than `2 ε` of it and the slab test by
/// less than `1.5 ε` (`ε = f32::EPSILON`), so a box never loses a triangle the exact same ray would hit.
pub(super) const BAND: f32 = 4.0 * f32::EPSILON;

/// The same for boxes of instances, where moving the ray to the object's frame adds its own error.
pub(super) const PLACED_BAND: f32 = 16.0 * f32::EPSILON;

/// Direction components below this share of the largest count as this share: a parallel slab then
/// gives finite distances, and over the whole range the ray strays far less than [`BAND`].
const FLATTEST: f32 = 1e-12;

/// Directions whose every component is below this count as zero; keeps reciprocals finite.
const SHORTEST: f32 = 1e-24;

/// A ray ready to be tested against boxes, in one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    /// 1 / direction, finite.
    pub inverse: [f32; 3],
    /// A plane at `p` is met at `p · inverse + shift`. The shifts for near and far planes differ by
    /// the error band, so that boxes grow.
    pub near_shift: [f32; 3],
    pub far_shift: [f32; 3],
    /// 1 where the direction is negative, so that the high plane is the near one; else 0.
    pub negative: [usize; 3],
}

impl Slab {
    /// `None` if the direction is zero or anything is not finite: such a ray hits nothing.
    /// `reach` is the largest absolute coordinate of what will be tested, `band` one of the bands.
    #[inline(always)]
    pub fn new(ray: &Ray, reach: f32, band: f32) -> Option<Self> {
        let (o, d) = (ray.origin, ray.direction);
        let size = each_axis!(a => d[a].abs());
        let largest = max(max(size[0], size[1]), size[2]);
        let farthest = max(max(o[0].abs(), o[1].abs()), o[2].abs());
        let band = (farthest + reach) * band;
        // Negated so that a NaN fails it too; the sum bounds every number used below.
        let sum = (size[0] + size[1] + size[2]) + (o[0].abs() + o[1].abs() + o[2].abs()) + band;
        if !(largest >= SHORTEST && sum <= f32::MAX) {
            return None;
        }
        let flattest = largest * FLATTEST;
        let sign = each_axis!(a => band.copysign(d[a]));
        let inverse = each_axis!(a => 1.0 / max(size[a], flattest).copysign(d[a]));
        Some(Self {
            inverse,
            near_shift: each_axis!(a => -(o[a] + sign[a]) * inverse[a]),
            far_shift: each_axis!(a => (sign[a] - o[a]) * inverse[a]),
            negative: each_axis!(a => (d[a].to_bits() >> 31) as usize),
        })
    }
}

/// A ray ready to be tested against triangles: the frame in which it runs along z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shear {
    pub origin: [f32; 3],
    /// Axes of the sheared frame, each below 3; the last is the direction's largest.
    pub axes: [usize; 3],
    /// Minus x and y per unit of z along the ray, and ray parameter per unit of z.
    pub shear: [f32; 3],
}

impl Shear {
    /// For a ray of which a [`Slab`] could be made.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let d = &ray.direction;
        let size = each_axis!(a => d[a].abs());
        let first = usize::from(size[1] > size[0]);
        let z = if size[2] > max(size[0], size[1]) { 2 } else { first };
        // The next two axes, looked up in the bits of two small tables.
        let (x, y) = (0b00_10_01 >> (2 * z) & 3, 0b01_00_10 >> (2 * z) & 3);
        // SAFETY: z is at most 2, and the tables hold nothing above it.
        let [dx, dy, dz] = unsafe { [*d.get_unchecked(x), *d.get_unchecked(y), *d.get_unchecked(z)] };
        let along = 1.0 / dz;
        Self { origin: ray.origin, axes: [x, y, z], shear: [-dx * along, -dy * along, along] }
    }
}

#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A rigid or affine placement: rows of a 3×4 matrix, translation in the last column.
pub type Affine = [[f32; 4]; 3];

/// The identity placement.
pub const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

#[inline(always)]
pub(super) fn transform_point(m: &Affine, p: [f32; 3]) -> [f32; 3] {
    each_axis!(r => m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3])
}

#[inline(always)]
pub(super) fn transform_vector(m: &Affine, v: [f32; 3]) -> [f32; 3] {
    each_axis!(r => m[r][0] * v[0] + m[r][1] * v[1] + m[r][2] * v[2])
}

/// The ray seen from another frame. The direction keeps its length there, so distances along the
/// ray mean the same in both.
#[inline(always)]
pub(super) fn transform_ray(m: &Affine, ray: &Ray) -> Ray {
    Ray { origin: transform_point(m, ray.origin), direction: transform_vector(m, ray.direction) }
}

/// The box of a transformed box.
pub(super) fn transform_bounds(m: &Affine, b: &Bounds) -> Bounds {
    let mut out = Bounds::EMPTY;
    for corner in 0..8 {
        let pick = |a: usize| if corner >> a & 1 == 0 { b.lo[a] } else { b.hi[a] };
        out.include(transform_point(m, [pick(0), pick(1), pick(2)]));
    }
    out
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
