//! Guides: normals, planes of pixels, ids, and albedo at borders of bodies.

use crate::planes::{CHUNK, Chunk, Padded, Size, fill};
use crate::tuning::{BORDER_COLOR, BORDER_NORMAL, END, PLANE};
use syntable_model::context::Workers;

/// Id of the margin. Taps ignore pixels with a negative id.
pub(super) const NOTHING: f32 = -1.0;

/// Id of pixels that show a light, the sky or nothing.
pub(super) const NO_SURFACE: f32 = -2.0;

/// The guides of an image.
pub(super) struct Guides {
    /// Mean normal, camera frame.
    pub normal: [Padded; 3],
    /// Luminance of the mean base color.
    pub color: Padded,
    /// 1 / depth, 1/m: affine in pixel coordinates on a plane, for any focal length. 0 without a surface.
    pub disparity: Padded,
    /// Id of the body, [`NO_SURFACE`] or [`NOTHING`].
    pub id: Padded,
    /// Change of the disparity from one pixel to the next, along x and y.
    slope: [Padded; 2],
    /// 1 if another body, or a pixel without a surface, is among the eight neighbors, else 0.
    pub border: Padded,
}

impl Guides {
    /// Computes slopes and borders.
    pub fn new(
        size: Size,
        workers: &dyn Workers,
        normal: [Padded; 3],
        color: Padded,
        disparity: Padded,
        id: Padded,
    ) -> Self {
        let zero = || Padded::new(size, 0.0);
        let (mut along_x, mut along_y, mut border) = (zero(), zero(), zero());
        let stride = size.stride();
        fill(size, workers, [&mut along_x, &mut along_y, &mut border], |position| {
            let at = position.at;
            [
                slope(&disparity, &id, at, 1),
                slope(&disparity, &id, at, stride),
                border_of(id.chunk(at), around(at, stride).map(|there| id.chunk(there))),
            ]
        });
        Self { normal, color, disparity, id, slope: [along_x, along_y], border }
    }

    /// The cost of the taps at an offset of `(dx, dy)` px from a chunk, before comparing light: minus the logarithm of
    /// their weight. A cost of [`END`] or more means no weight. `per_normal` is the cost of a squared difference of
    /// normals.
    ///
    /// Inside a body, taps must be on that body and near its plane. A border pixel shows two bodies, but has the depth
    /// and id of only one of them, so only the mean normal and color count there.
    #[inline(always)]
    pub fn cost(&self, here: usize, there: usize, dx: f32, dy: f32, per_normal: &Chunk) -> Chunk {
        let [nx, ny, nz] = &self.normal;
        let (px, py, pz) = (nx.chunk(here), ny.chunk(here), nz.chunk(here));
        let (qx, qy, qz) = (nx.chunk(there), ny.chunk(there), nz.chunk(there));
        let (pw, qw) = (self.disparity.chunk(here), self.disparity.chunk(there));
        let (sx, sy) = (self.slope[0].chunk(here), self.slope[1].chunk(here));
        let (pi, qi) = (self.id.chunk(here), self.id.chunk(there));
        let (pc, qc) = (self.color.chunk(here), self.color.chunk(there));
        let border = self.border.chunk(here);
        let mut out = [0.0; CHUNK];
        for i in 0..CHUNK {
            let (x, y, z) = (px[i] - qx[i], py[i] - qy[i], pz[i] - qz[i]);
            let turned = (x * x + y * y + z * z) * per_normal[i];
            let off = (qw[i] - (pw[i] + sx[i] * dx + sy[i] * dy)).abs();
            let inside = turned + off / (PLANE * pw[i] + 1e-9);
            let color = pc[i] - qc[i];
            let mixed = turned * BORDER_NORMAL + color * color * BORDER_COLOR;
            let inside = if pi[i] == qi[i] { inside } else { END };
            let mixed = if qi[i] >= 0.0 { mixed } else { END };
            out[i] = if border[i] > 0.0 { mixed } else { inside };
        }
        out
    }
}

/// The indices of the eight neighbors.
fn around(at: usize, stride: usize) -> [usize; 8] {
    let (up, down) = (at - stride, at + stride);
    [up - 1, up, up + 1, at - 1, at + 1, down - 1, down, down + 1]
}

fn border_of(ids: &Chunk, neighbors: [&Chunk; 8]) -> Chunk {
    std::array::from_fn(|i| {
        let other = neighbors.iter().any(|ids_there| ids_there[i] != NOTHING && ids_there[i] != ids[i]);
        if ids[i] >= 0.0 && other { 1.0 } else { 0.0 }
    })
}

/// The smaller of the differences to the two neighbors on the same body; 0 without such a neighbor.
fn slope(disparity: &Padded, id: &Padded, at: usize, step: usize) -> Chunk {
    let [before, here, after] = [at - step, at, at + step].map(|i| (disparity.chunk(i), id.chunk(i)));
    std::array::from_fn(|i| {
        let back = if before.1[i] == here.1[i] { here.0[i] - before.0[i] } else { f32::INFINITY };
        let forth = if after.1[i] == here.1[i] { after.0[i] - here.0[i] } else { f32::INFINITY };
        let least = if back.abs() < forth.abs() { back } else { forth };
        if least.is_finite() { least } else { 0.0 }
    })
}

/// About exp(−x) for x ≥ 0, and exactly 0 from [`END`] on.
#[inline(always)]
pub(super) fn falloff(x: f32) -> f32 {
    let t = 1.0 - x * (1.0 / END);
    let t = if t > 0.0 { t } else { 0.0 };
    let t2 = t * t;
    let t4 = t2 * t2;
    t4 * t4
}
