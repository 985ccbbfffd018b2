//! Directional albedo of the GGX lobe, tabulated at first use.
//!
//! With Schlick's Fresnel term the albedo is linear in the reflectance at normal incidence:
//! `E(μ) = f₀ · facing(μ) + grazing(μ)`. With f₀ = 1 it is the albedo of a perfect rough mirror without multiple
//! scattering, less than one by what Smith's model loses.

use super::ggx;
use crate::vec3::{max, vec3};
use std::sync::LazyLock;

/// Cells along the cosine and along the roughness.
const SIZE: usize = 32;

/// Samples of every table entry.
const SAMPLES: u32 = 512;

/// Albedo of the single-scattering lobe, split by Fresnel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Albedo {
    /// Multiplies the reflectance at normal incidence.
    pub facing: f32,
    /// Added.
    pub grazing: f32,
}

impl Albedo {
    /// Without Fresnel losses.
    #[inline(always)]
    pub fn white(self) -> f32 {
        self.facing + self.grazing
    }

    #[inline(always)]
    fn lerp(self, to: Self, t: f32) -> Self {
        Self {
            facing: self.facing + (to.facing - self.facing) * t,
            grazing: self.grazing + (to.grazing - self.grazing) * t,
        }
    }
}

/// The albedo at one roughness, by cosine; made for every shaded point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<'a> {
    lower: &'a [Albedo; SIZE],
    upper: &'a [Albedo; SIZE],
    weight: f32,
}

impl Row<'_> {
    #[inline(always)]
    pub fn at(&self, mu: f32) -> Albedo {
        let (i, w) = cell(mu);
        self.lower[i].lerp(self.lower[i + 1], w).lerp(self.upper[i].lerp(self.upper[i + 1], w), self.weight)
    }
}

struct Table {
    /// By roughness, then by cosine, both over [0, 1].
    directional: [[Albedo; SIZE]; SIZE],
    /// Cosine-weighted means of the rows, exact for the interpolated table.
    mean: [Albedo; SIZE],
}

static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| Box::new(Table::new()));

/// Makes the table now rather than in the first picture.
pub(crate) fn prepare() {
    LazyLock::force(&TABLE);
}

/// The albedo by cosine at a roughness (the root of α), and its cosine-weighted mean.
#[inline(always)]
pub(super) fn at_roughness(roughness: f32) -> (Row<'static>, Albedo) {
    let (i, weight) = cell(roughness);
    let table = &**TABLE;
    let row = Row { lower: &table.directional[i], upper: &table.directional[i + 1], weight };
    (row, table.mean[i].lerp(table.mean[i + 1], weight))
}

#[inline(always)]
fn cell(x: f32) -> (usize, f32) {
    let x = if x > 0.0 { x * (SIZE - 1) as f32 } else { 0.0 };
    let i = (x as usize).min(SIZE - 2);
    (i, x - i as f32)
}

impl Table {
    fn new() -> Self {
        let grid = |i: usize| i as f32 / (SIZE - 1) as f32;
        let directional: [[Albedo; SIZE]; SIZE] = std::array::from_fn(|r| {
            std::array::from_fn(|m| integrate(max(grid(r) * grid(r), ggx::MIN_ALPHA), max(grid(m), 1e-3)))
        });
        let mean = directional.map(|row| {
            // 2 ∫ E(μ) μ dμ over every cell of the piecewise linear E.
            let h = 1.0 / (SIZE - 1) as f32;
            let mut mean = Albedo::default();
            for i in 0..SIZE - 1 {
                let a = grid(i);
                let (left, right) = (h * (a + h / 3.0), h * (a + 2.0 * h / 3.0));
                mean.facing += left * row[i].facing + right * row[i + 1].facing;
                mean.grazing += left * row[i].grazing + right * row[i + 1].grazing;
            }
            mean
        });
        Self { directional, mean }
    }
}

fn integrate(alpha: f32, mu: f32) -> Albedo {
    let wo = vec3(max(1.0 - mu * mu, 0.0).sqrt(), 0.0, mu);
    let (mut facing, mut grazing) = (0.0_f64, 0.0_f64);
    for i in 0..SAMPLES {
        let u = (i as f32 + 0.5) / SAMPLES as f32;
        let v = (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32;
        let wi = ggx::sample(alpha, wo, [u, v]);
        if wi.z > 0.0 {
            let h = (wo + wi).normalized();
            let density = ggx::density(alpha * alpha, h);
            let pdf = ggx::pdf(alpha, wo, density);
            let weight = density * ggx::visibility(alpha * alpha, wo.z, wi.z) * wi.z / pdf;
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
        let (row, mean) = at_roughness(0.0);
        for mu in [0.05, 0.3, 0.7, 1.0] {
            assert!((row.at(mu).white() - 1.0).abs() < 0.01, "{mu}: {:?}", row.at(mu));
        }
        assert!((mean.white() - 1.0).abs() < 0.01);
        // Schlick's mean over the hemisphere is 1/21.
        assert!((mean.grazing - 1.0 / 21.0).abs() < 2e-3, "{mean:?}");
        // Rough ones, by quadrature.
        let (row, _) = at_roughness(1.0);
        let want = quadrature(1.0, 1.0);
        assert!((row.at(1.0).white() - want).abs() < 3e-3, "{} not {want}", row.at(1.0).white());
        let (row, _) = at_roughness(0.7);
        let want = quadrature(0.49, 0.4);
        assert!((row.at(0.4).white() - want).abs() < 3e-3, "{} not {want}", row.at(0.4).white());
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
