//! Environment maps ready for look-ups and for sampling in proportion to their light.

use crate::approx::floor;
use crate::vec3::Rgb;
use std::sync::Arc;
use syntable_model::scene::EnvironmentMap;

/// A map, and its light by row and within each row. Shared by all views that have it.
#[derive(Debug)]
pub(crate) struct Sky {
    map: Arc<EnvironmentMap>,
    /// Sums of the rows' light up to each row's end; the last is the whole.
    rows: Vec<f32>,
    /// Sums within each row up to each texel's end; the last of a row is 1.
    texels: Vec<f32>,
    /// Mean luminance over all directions.
    pub luminance: f32,
}

impl Sky {
    /// A texel's light is its luminance times its solid angle.
    pub fn new(map: &Arc<EnvironmentMap>) -> Self {
        let (width, height) = (map.width() as usize, map.height() as usize);
        let mut rows = Vec::with_capacity(height);
        let mut texels = Vec::with_capacity(width * height);
        let (mut total, mut solid) = (0.0_f64, 0.0_f64);
        for (y, row) in map.texels().chunks(width).enumerate() {
            let edge = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
            let angle = edge(y) - edge(y + 1);
            let start = texels.len();
            let mut sum = 0.0_f64;
            for texel in row {
                sum += f64::from(Rgb::from(*texel).luminance());
                texels.push(sum as f32);
            }
            for (x, value) in texels[start..].iter_mut().enumerate() {
                *value = if sum > 0.0 { (f64::from(*value) / sum) as f32 } else { (x + 1) as f32 / width as f32 };
            }
            if let Some(last) = texels.last_mut() {
                *last = 1.0;
            }
            total += sum / width as f64 * angle;
            solid += angle;
            rows.push(total as f32);
        }
        for (y, row) in rows.iter_mut().enumerate() {
            *row = if total > 0.0 { (f64::from(*row) / total) as f32 } else { (y + 1) as f32 / height as f32 };
        }
        if let Some(last) = rows.last_mut() {
            *last = 1.0;
        }
        Self { map: map.clone(), rows, texels, luminance: (total / solid) as f32 }
    }

    /// Bytes held.
    pub fn size(&self) -> usize {
        self.map.texels().len() * 12 + (self.rows.len() + self.texels.len()) * 4
    }

    /// A point of the unit square, v downwards, and its density over the square.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> ([f32; 2], f32) {
        let width = self.map.width() as usize;
        let (y, dy, row) = pick(&self.rows, v);
        let (x, dx, texel) = pick(&self.texels[y * width..(y + 1) * width], u);
        let at = [(x as f32 + dx) / width as f32, (y as f32 + dy) / self.rows.len() as f32];
        (at, row * texel * (width * self.rows.len()) as f32)
    }

    /// The density of [`Self::sample`].
    #[inline]
    pub fn density(&self, [u, v]: [f32; 2]) -> f32 {
        let width = self.map.width() as usize;
        let y = ((v * self.rows.len() as f32) as usize).min(self.rows.len() - 1);
        let x = ((u * width as f32) as usize).min(width - 1);
        share(&self.rows, y) * share(&self.texels[y * width..(y + 1) * width], x) * (width * self.rows.len()) as f32
    }

    /// Radiance at a point of the unit square, between texels interpolated; goes round in u.
    #[inline]
    pub fn radiance(&self, [u, v]: [f32; 2]) -> Rgb {
        let (width, height) = (self.map.width() as i32, self.map.height() as i32);
        let (x, wx) = floor(u * width as f32 - 0.5);
        let (y, wy) = floor(v * height as f32 - 0.5);
        let texel = |x: i32, y: i32| {
            let (x, y) = (x.rem_euclid(width), y.clamp(0, height - 1));
            Rgb::from(self.map.texels()[(y * width + x) as usize])
        };
        let (above, below) = (texel(x, y).lerp(texel(x + 1, y), wx), texel(x, y + 1).lerp(texel(x + 1, y + 1), wx));
        above.lerp(below, wy)
    }
}

/// The entry that a number in [0, 1) falls in, where in it, and its share.
#[inline]
fn pick(sums: &[f32], u: f32) -> (usize, f32, f32) {
    let i = sums.partition_point(|&sum| sum <= u).min(sums.len() - 1);
    let share = share(sums, i);
    let before = sums[i] - share;
    (i, ((u - before) / share.max(1e-30)).clamp(0.0, 1.0 - f32::EPSILON), share)
}

#[inline]
fn share(sums: &[f32], i: usize) -> f32 {
    if i == 0 { sums[0] } else { sums[i] - sums[i - 1] }
}
