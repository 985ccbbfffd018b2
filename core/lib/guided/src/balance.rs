//! Restores the energy that the filter lost.
//!
//! Images with few samples have many dark pixels and few bright ones. Clamping fireflies, and weighing taps by
//! similarity, favors the dark pixels. The filtered image is therefore too dark, by several hundredths at one or two
//! samples. Over wide areas, the mean of the noisy image is correct, so the filtered image is scaled to it.

use crate::luminance;
use crate::tuning::{CELL_WEIGHTS, LEAST_RESTORED, MOST_RESTORED};

/// Edge of the squares over which light is summed, px. Neighboring squares are averaged with a standard deviation of
/// one square.
const CELL: usize = crate::tuning::CELL as usize;

/// Light in squares, before and after the filter.
struct Cells {
    columns: usize,
    rows: usize,
    /// Sums of luminance before and after the filter.
    sums: Vec<[f64; 2]>,
}

/// Scales `after` to the brightness of `before`; pixels without `surface` stay unchanged.
pub(super) fn restore(width: usize, before: &[[f32; 3]], after: &mut [[f32; 3]], surface: impl Fn(usize) -> bool) {
    let is_surface: Vec<bool> = (0..after.len()).map(surface).collect();
    let lit = after.iter().zip(&is_surface).filter(|(_, surface)| **surface);
    let (sum, count) = lit.fold((0.0, 0_u32), |(sum, n), (light, _)| (sum + f64::from(luminance(*light)), n + 1));
    let least = LEAST_RESTORED * (sum / f64::from(count.max(1))) as f32;
    let mut cells = Cells::new(width, after.len() / width.max(1));
    for (pixel, (before, after)) in before.iter().zip(&*after).enumerate().filter(|(pixel, _)| is_surface[*pixel]) {
        let (before, after) = (luminance(*before), luminance(*after));
        cells.add(pixel % width, pixel / width, before.min(MOST_RESTORED * after.max(least)), after);
    }
    let factors = cells.factors();
    for (pixel, light) in after.iter_mut().enumerate().filter(|(pixel, _)| is_surface[*pixel]) {
        let factor = cells.between(&factors, pixel % width, pixel / width);
        *light = light.map(|x| x * factor);
    }
}

impl Cells {
    fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
        Self { columns, rows, sums: vec![[0.0; 2]; columns * rows] }
    }

    fn add(&mut self, x: usize, y: usize, before: f32, after: f32) {
        let sums = &mut self.sums[y / CELL * self.columns + x / CELL];
        *sums = [sums[0] + f64::from(before), sums[1] + f64::from(after)];
    }

    /// The factor of every square.
    fn factors(&self) -> Vec<f32> {
        let along_rows = blurred(&self.sums, self.columns, 1);
        let sums = blurred(&along_rows, self.rows, self.columns);
        let factor =
            |[before, after]: [f64; 2]| if after > 0.0 && before > 0.0 { (before / after) as f32 } else { 1.0 };
        sums.into_iter().map(factor).collect()
    }

    /// The factor of a pixel, interpolated linearly between the centers of the squares.
    fn between(&self, factors: &[f32], x: usize, y: usize) -> f32 {
        let place = |at: usize, count: usize| {
            let at = ((at as f32 + 0.5) / CELL as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let first = (at as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), at - first as f32)
        };
        let ((left, right, u), (top, bottom, v)) = (place(x, self.columns), place(y, self.rows));
        let row = |row: usize| {
            let (a, b) = (factors[row * self.columns + left], factors[row * self.columns + right]);
            a + (b - a) * u
        };
        let (above, below) = (row(top), row(bottom));
        above + (below - above) * v
    }
}

/// Weighted sums over neighbors along one axis, with `count` squares at a distance of `stride`.
fn blurred(sums: &[[f64; 2]], count: usize, stride: usize) -> Vec<[f64; 2]> {
    let sum = |at: usize| {
        let place = at / stride % count;
        let mut total = [0.0; 2];
        for (offset, weight) in (-2_isize..).zip(CELL_WEIGHTS.map(f64::from)) {
            let Some(there) = place.checked_add_signed(offset).filter(|there| *there < count) else { continue };
            let light = sums[at + there * stride - place * stride];
            total = [total[0] + weight * light[0], total[1] + weight * light[1]];
        }
        total
    };
    (0..sums.len()).map(sum).collect()
}
