//! Light of environment maps: look-ups, and tables for importance sampling.

use std::sync::Arc;
use syntable_model::scene::EnvironmentMap;
use syntable_simd::Rgb;
use syntable_simd::functions::floor;

/// An environment map with the cumulative distribution of its light, by row and within each row.
#[derive(Debug)]
pub struct EnvironmentDistribution {
    map: Arc<EnvironmentMap>,
    /// Cumulative light of the rows, over the total: entry `y` is the probability of the rows up to `y`.
    rows: Vec<f32>,
    /// Cumulative light of the texels of each row, over the row; row-major.
    texels: Vec<f32>,
    /// Mean luminance over all directions.
    pub luminance: f32,
}

impl EnvironmentDistribution {
    /// Weights every texel by its luminance times its solid angle.
    pub fn new(map: &Arc<EnvironmentMap>) -> Self {
        let (width, height) = (map.width() as usize, map.height() as usize);
        let mut rows = Vec::with_capacity(height);
        let mut texels = Vec::with_capacity(width * height);
        let mut total = 0.0_f64;
        for (y, row) in map.texels().chunks(width).enumerate() {
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
            total += sum / width as f64 * ring(y, height);
            rows.push(total as f32);
        }
        for (y, row) in rows.iter_mut().enumerate() {
            *row = if total > 0.0 { (f64::from(*row) / total) as f32 } else { (y + 1) as f32 / height as f32 };
        }
        if let Some(last) = rows.last_mut() {
            *last = 1.0;
        }
        Self { map: map.clone(), rows, texels, luminance: mean_luminance(map) }
    }

    /// The environment map.
    pub fn map(&self) -> &Arc<EnvironmentMap> {
        &self.map
    }

    /// Cumulative probabilities of the rows.
    pub fn rows(&self) -> &[f32] {
        &self.rows
    }

    /// Cumulative probabilities of the texels within each row, row-major.
    pub fn texels(&self) -> &[f32] {
        &self.texels
    }

    /// Size, bytes.
    pub fn size(&self) -> usize {
        self.map.texels().len() * 12 + (self.rows.len() + self.texels.len()) * 4
    }

    /// Samples a point of the unit square, v downwards. Returns the point and its density over the square.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> ([f32; 2], f32) {
        let width = self.map.width() as usize;
        let (y, dy, row) = select(&self.rows, v);
        let (x, dx, texel) = select(&self.texels[y * width..(y + 1) * width], u);
        let at = [(x as f32 + dx) / width as f32, (y as f32 + dy) / self.rows.len() as f32];
        (at, row * texel * (width * self.rows.len()) as f32)
    }

    /// The density of [`Self::sample`].
    #[inline]
    pub fn density(&self, [u, v]: [f32; 2]) -> f32 {
        let width = self.map.width() as usize;
        let y = ((v * self.rows.len() as f32) as usize).min(self.rows.len() - 1);
        let x = ((u * width as f32) as usize).min(width - 1);
        probability(&self.rows, y)
            * probability(&self.texels[y * width..(y + 1) * width], x)
            * (width * self.rows.len()) as f32
    }
}

/// Radiance of a map at a point of the unit square, v downwards, interpolated between texels; periodic in u.
#[inline]
pub fn look_up(map: &EnvironmentMap, [u, v]: [f32; 2]) -> Rgb {
    let (width, height) = (map.width() as i32, map.height() as i32);
    let (x, wx) = floor(u * width as f32 - 0.5);
    let (y, wy) = floor(v * height as f32 - 0.5);
    let texel = |x: i32, y: i32| {
        let (x, y) = (x.rem_euclid(width), y.clamp(0, height - 1));
        Rgb::from(map.texels()[(y * width + x) as usize])
    };
    let (above, below) = (texel(x, y).lerp(texel(x + 1, y), wx), texel(x, y + 1).lerp(texel(x + 1, y + 1), wx));
    above.lerp(below, wy)
}

/// Mean luminance of a map over all directions.
pub fn mean_luminance(map: &EnvironmentMap) -> f32 {
    let (width, height) = (map.width() as usize, map.height() as usize);
    let (mut total, mut solid) = (0.0_f64, 0.0_f64);
    for (y, row) in map.texels().chunks(width).enumerate() {
        let sum: f64 = row.iter().map(|texel| f64::from(Rgb::from(*texel).luminance())).sum();
        total += sum / width as f64 * ring(y, height);
        solid += ring(y, height);
    }
    (total / solid) as f32
}

/// Solid angle of a row of `height`, over 2π.
fn ring(y: usize, height: usize) -> f64 {
    let edge = |y: usize| libm::cos(std::f64::consts::PI * y as f64 / height as f64);
    edge(y) - edge(y + 1)
}

/// The entry that a number in [0, 1) selects, the position within it, and its probability.
#[inline]
fn select(sums: &[f32], u: f32) -> (usize, f32, f32) {
    let i = sums.partition_point(|&sum| sum <= u).min(sums.len() - 1);
    let width = probability(sums, i);
    let before = sums[i] - width;
    (i, ((u - before) / width.max(1e-30)).clamp(0.0, 1.0 - f32::EPSILON), width)
}

#[inline]
fn probability(sums: &[f32], i: usize) -> f32 {
    if i == 0 { sums[0] } else { sums[i] - sums[i - 1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_match_luminance_per_solid_angle() {
        // One bright texel of 4 × 2: its fraction of the light is 9 / (9 + 7), since both rows have equal solid angles.
        let texels = (0..8).map(|i| if i == 6 { [9.0; 3] } else { [1.0; 3] }).collect();
        let map = Arc::new(EnvironmentMap::new("test", 4, 2, texels).expect("sound"));
        let distribution = EnvironmentDistribution::new(&map);
        assert!((distribution.luminance - 2.0).abs() < 1e-6, "the mean of 16 over 8");
        // Density over the unit square: probability over the area of an eighth.
        assert!((distribution.density([0.6, 0.7]) - 8.0 * 9.0 / 16.0).abs() < 1e-4);
        assert!((distribution.density([0.1, 0.2]) - 8.0 / 16.0).abs() < 1e-4);
        let inside = |i: u32| {
            let ([u, v], density) = distribution.sample([(i % 64) as f32 / 64.0, (i / 64) as f32 / 64.0]);
            assert!((density - distribution.density([u, v])).abs() < 1e-4);
            (0.5..0.75).contains(&u) && v >= 0.5
        };
        let count = (0..4096).filter(|&i| inside(i)).count();
        assert!((count as f32 / 4096.0 - 9.0 / 16.0).abs() < 0.02, "{count}");
    }
}
