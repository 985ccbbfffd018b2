//! Directional albedo of the GGX lobe, tabulated at first use.
//!
//! With Schlick's Fresnel term, the albedo is linear in the reflectance at normal incidence: `E(μ) = f₀ · facing(μ) +
//! grazing(μ)`. With f₀ = 1, it is the albedo of a perfect rough mirror without multiple scattering, below one because
//! Smith's model loses energy.

use super::ggx::{self, Ggx};
use std::sync::LazyLock;
use syntable_simd::vec3;
use syntable_simd::{Int, Real, at_least, at_most};

/// Cells along the cosine and along the roughness; few, so that the table fits into the nearest cache with other data.
pub const CELLS: usize = 20;

/// Samples of every table entry.
const SAMPLES: u32 = 512;

/// Albedo of the single-scattering lobe, split by Fresnel.
#[derive(Clone, Copy, Debug)]
pub struct Albedo<T = f32> {
    /// Factor of the reflectance at normal incidence.
    pub facing: T,
    /// Constant term.
    pub grazing: T,
}

impl<T: Real> Albedo<T> {
    /// The albedo without Fresnel losses.
    #[inline(always)]
    pub fn white(self) -> T {
        self.facing + self.grazing
    }

    #[inline(always)]
    fn lerp(self, to: Self, t: T) -> Self {
        Self {
            facing: self.facing + (to.facing - self.facing) * t,
            grazing: self.grazing + (to.grazing - self.grazing) * t,
        }
    }
}

/// The albedo at one roughness, by cosine.
#[derive(Clone, Copy, Debug)]
pub struct Row<T: Real> {
    /// Number of the cell's row.
    row: T::Int,
    weight: T,
}

impl<T: Real> Row<T> {
    /// The row of a perceptual roughness in [0, 1].
    #[inline(always)]
    pub fn new(roughness: T) -> Self {
        let (row, weight) = cell(roughness);
        Self { row, weight }
    }

    /// The albedo at a cosine in [0, 1].
    #[inline(always)]
    pub fn at(&self, table: &AlbedoTable, mu: T) -> Albedo<T> {
        let (column, weight) = cell(mu);
        let index = self.row.times(T::Int::splat(CELLS as u32)).plus(column);
        let [a, b, c, d, e, f, g, h] = T::lookup(&table.directional, index);
        let lower = Albedo { facing: a, grazing: b }.lerp(Albedo { facing: c, grazing: d }, weight);
        let upper = Albedo { facing: e, grazing: f }.lerp(Albedo { facing: g, grazing: h }, weight);
        lower.lerp(upper, self.weight)
    }

    /// The cosine-weighted mean.
    #[inline(always)]
    pub fn mean(&self, table: &AlbedoTable) -> Albedo<T> {
        let [a, b, c, d, ..] = T::lookup(&table.mean, self.row);
        Albedo { facing: a, grazing: b }.lerp(Albedo { facing: c, grazing: d }, self.weight)
    }
}

/// Directional albedo by roughness and by cosine, both over [0, 1], and the means of the rows, exact for the
/// interpolated table. Every cell holds (facing, grazing) at its corners: at the lower cosine, at the higher; both
/// again at the higher roughness.
#[derive(Debug)]
pub struct AlbedoTable {
    directional: Vec<[f32; 8]>,
    mean: Vec<[f32; 8]>,
}

/// The table, computed at first use.
pub fn table() -> &'static AlbedoTable {
    static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::new);
    &TABLE
}

/// Cell number of a number in [0, 1], and its position in the cell.
#[inline(always)]
pub fn cell<T: Real>(x: T) -> (T::Int, T) {
    let x = at_most(at_least(x, 0.0), 1.0) * CELLS as f32;
    // The last cell includes the end.
    let i = at_most(x, (CELLS - 1) as f32).truncate();
    (i, x - i.signed_to_real())
}

impl AlbedoTable {
    /// Cells by roughness, then by cosine: (facing, grazing) at the lower cosine and at the higher, and both again at
    /// the higher roughness.
    pub fn directional(&self) -> &[[f32; 8]] {
        &self.directional
    }

    /// Cosine-weighted means by roughness: (facing, grazing) at the lower roughness and at the higher; the rest is 0.
    pub fn mean(&self) -> &[[f32; 8]] {
        &self.mean
    }

    fn new() -> Self {
        let grid = |i: usize| i as f32 / CELLS as f32;
        let alpha = |r: usize| at_least(grid(r) * grid(r), ggx::MIN_ALPHA);
        let rows: Vec<Vec<[f32; 2]>> =
            (0..=CELLS).map(|r| (0..=CELLS).map(|m| integrate(alpha(r), at_least(grid(m), 1e-3))).collect()).collect();
        // 2 ∫ E(μ) μ dμ over every cell of the piecewise linear E.
        let step = 1.0 / CELLS as f32;
        let mean = |row: &[[f32; 2]]| {
            [0, 1].map(|i| {
                let cell = |m: usize| {
                    let (left, right) = (grid(m) + step / 3.0, grid(m) + 2.0 * step / 3.0);
                    step * (left * row[m][i] + right * row[m + 1][i])
                };
                (0..CELLS).map(cell).sum::<f32>()
            })
        };
        let means: Vec<[f32; 2]> = rows.iter().map(|row| mean(row)).collect();
        let corners =
            |a: [f32; 2], b: [f32; 2], c: [f32; 2], d: [f32; 2]| [a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]];
        let cell = |r: usize, m: usize| corners(rows[r][m], rows[r][m + 1], rows[r + 1][m], rows[r + 1][m + 1]);
        Self {
            directional: (0..CELLS * CELLS).map(|i| cell(i / CELLS, i % CELLS)).collect(),
            mean: (0..CELLS).map(|r| corners(means[r], means[r + 1], [0.0; 2], [0.0; 2])).collect(),
        }
    }
}

/// Albedo of the lobe: the factor of the reflectance at normal incidence, and the constant term.
fn integrate(alpha: f32, mu: f32) -> [f32; 2] {
    let wo = vec3(at_least(1.0 - mu * mu, 0.0).sqrt(), 0.0, mu);
    let ggx = Ggx::new(alpha, wo);
    let (mut facing, mut grazing) = (0.0_f64, 0.0_f64);
    for i in 0..SAMPLES {
        let u = (i as f32 + 0.5) / SAMPLES as f32;
        let v = (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32;
        let wi = ggx.sample([u, v]);
        if wi.z > 0.0 {
            let h = (wo + wi).normalized();
            let density = ggx.density(h);
            let weight = density * ggx.visibility(wi.z) * wi.z / ggx.pdf(density);
            let rise = ggx::schlick(wo.dot(h));
            facing += f64::from(weight * (1.0 - rise));
            grazing += f64::from(weight * rise);
        }
    }
    let n = f64::from(SAMPLES);
    [(facing / n) as f32, (grazing / n) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_facets_lose_nothing_and_rough_ones_the_known_share() {
        let table = table();
        let white = |roughness: f32, mu: f32| Row::new(roughness).at(table, mu).white();
        for mu in [0.05, 0.3, 0.7, 1.0] {
            assert!((white(0.0, mu) - 1.0).abs() < 0.01, "{mu}: {}", white(0.0, mu));
        }
        let mean = Row::new(0.0_f32).mean(table);
        assert!((mean.white() - 1.0).abs() < 0.01);
        // Schlick's mean over the hemisphere is 1/21.
        assert!((mean.grazing - 1.0 / 21.0).abs() < 2e-3, "{mean:?}");
        // Rough surfaces, by quadrature.
        for (roughness, mu) in [(1.0, 1.0), (0.7, 0.4)] {
            let want = quadrature(f64::from(roughness * roughness), f64::from(mu));
            assert!((white(roughness, mu) - want).abs() < 3e-3, "{} not {want}", white(roughness, mu));
        }
    }

    /// ∫ D V cos over the hemisphere of incoming directions on a grid, f64, without importance sampling.
    fn quadrature(alpha: f64, mu: f64) -> f32 {
        let (n, m) = (800, 800);
        let wo = [(1.0 - mu * mu).sqrt(), 0.0, mu];
        let a2 = alpha * alpha;
        let stretch = |c: f64| (a2 + (1.0 - a2) * c * c).sqrt();
        let mut sum = 0.0;
        for i in 0..n {
            let z = (i as f64 + 0.5) / n as f64;
            let r = (1.0 - z * z).sqrt();
            for j in 0..m {
                let phi = std::f64::consts::TAU * (j as f64 + 0.5) / m as f64;
                let h = [wo[0] + r * phi.cos(), r * phi.sin(), mu + z];
                let length = h.iter().map(|x| x * x).sum::<f64>().sqrt();
                let hz2 = (h[2] / length).powi(2);
                let d = a2 / (std::f64::consts::PI * (hz2 * (a2 - 1.0) + 1.0).powi(2));
                sum += d * 0.5 / (z * stretch(mu) + mu * stretch(z)) * z;
            }
        }
        (sum * std::f64::consts::TAU / (n * m) as f64) as f32
    }
}
