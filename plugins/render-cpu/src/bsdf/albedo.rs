//! Directional albedo of the GGX lobe, tabulated at first use.
//!
//! With Schlick's Fresnel term the albedo is linear in the reflectance at normal incidence:
//! `E(μ) = f₀ · facing(μ) + grazing(μ)`. With f₀ = 1 it is the albedo of a perfect rough mirror without multiple
//! scattering, less than one by what Smith's model loses.

use super::ggx::{self, Ggx};
use crate::real::{Int, Real, at_least, at_most};
use crate::vec3::vec3;
use std::sync::LazyLock;

/// Cells along the cosine and along the roughness.
const SIZE: usize = 32;

/// Samples of every table entry.
const SAMPLES: u32 = 512;

/// Albedo of the single-scattering lobe, split by Fresnel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Albedo<T = f32> {
    /// Multiplies the reflectance at normal incidence.
    pub facing: T,
    /// Added.
    pub grazing: T,
}

impl<T: Real> Albedo<T> {
    /// Without Fresnel losses.
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

    /// The entries at an index, and at the next along the cosine, blended.
    #[inline(always)]
    fn read(entries: &[f32], index: T::Int, weight: T) -> Self {
        let at = |offset: u32| T::lookup(entries, index.plus(T::Int::splat(offset)));
        Self { facing: at(0), grazing: at(1) }.lerp(Self { facing: at(2), grazing: at(3) }, weight)
    }
}

/// The albedo at one roughness, by cosine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<T: Real> {
    /// Where the row below the roughness starts.
    start: T::Int,
    weight: T,
}

impl<T: Real> Row<T> {
    #[inline(always)]
    pub fn new(roughness: T) -> Self {
        let (row, weight) = cell(roughness);
        Self { start: row.times(T::Int::splat(2 * SIZE as u32)), weight }
    }

    #[inline(always)]
    pub fn at(&self, table: &Table, mu: T) -> Albedo<T> {
        let (column, weight) = cell(mu);
        let index = self.start.plus(column << 1);
        let lower = Albedo::read(&table.directional, index, weight);
        let upper = Albedo::read(&table.directional, index.plus(T::Int::splat(2 * SIZE as u32)), weight);
        lower.lerp(upper, self.weight)
    }

    /// The cosine-weighted mean.
    #[inline(always)]
    pub fn mean(&self, table: &Table) -> Albedo<T> {
        // Rows are 2 · SIZE numbers long, means 2.
        let shift = (SIZE as u32).trailing_zeros();
        Albedo::read(&table.mean, self.start >> shift, self.weight)
    }
}

/// Pairs (facing, grazing) of the directional albedo by roughness and by cosine, both over [0, 1], and the means of the
/// rows, exact for the interpolated table.
#[derive(Debug)]
pub(crate) struct Table {
    directional: Vec<f32>,
    mean: Vec<f32>,
}

/// The table, made at first use.
pub(crate) fn table() -> &'static Table {
    static TABLE: LazyLock<Table> = LazyLock::new(Table::new);
    &TABLE
}

/// Number of the cell and place in it, of a number in [0, 1].
#[inline(always)]
fn cell<T: Real>(x: T) -> (T::Int, T) {
    let x = at_most(at_least(x, 0.0), 1.0) * (SIZE - 1) as f32;
    // The last cell holds the end too.
    let i = at_most(x, (SIZE - 2) as f32).truncate();
    (i, x - i.signed_to_real())
}

impl Table {
    fn new() -> Self {
        let grid = |i: usize| i as f32 / (SIZE - 1) as f32;
        let (mut directional, mut mean) = (Vec::new(), Vec::new());
        for r in 0..SIZE {
            let alpha = at_least(grid(r) * grid(r), ggx::MIN_ALPHA);
            let row: Vec<Albedo> = (0..SIZE).map(|m| integrate(alpha, at_least(grid(m), 1e-3))).collect();
            // 2 ∫ E(μ) μ dμ over every cell of the piecewise linear E.
            let h = 1.0 / (SIZE - 1) as f32;
            let mut sum = [0.0; 2];
            for i in 0..SIZE - 1 {
                let (left, right) = (h * (grid(i) + h / 3.0), h * (grid(i) + 2.0 * h / 3.0));
                sum[0] += left * row[i].facing + right * row[i + 1].facing;
                sum[1] += left * row[i].grazing + right * row[i + 1].grazing;
            }
            directional.extend(row.iter().flat_map(|a| [a.facing, a.grazing]));
            mean.extend(sum);
        }
        Self { directional, mean }
    }
}

fn integrate(alpha: f32, mu: f32) -> Albedo {
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
    Albedo { facing: (facing / n) as f32, grazing: (grazing / n) as f32 }
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
        // Rough ones, by quadrature.
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
