//! Sheen fibers that stand off a cloth: the distribution of Estevez and Kulla ("Production Friendly Microfacet Sheen
//! BRDF", 2017) with the visibility of Neubelt and Pettineo (2013), as in glTF's KHR_materials_sheen.
//!
//! At grazing angles and low roughness, the published lobe reflects more than it receives. It is then divided by the
//! larger of its two directions' albedos, so that it stays reciprocal and never creates energy.

use super::albedo::{CELLS, cell};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::LazyLock;
use syntable_simd::functions::{pow, sin_cos_turns};
use syntable_simd::{Int, Real, at_least, at_most, complement, inverse, max};
use syntable_simd::{Vec3, vec3};

/// Smallest α, at roughness 0.2: below it, the lobe is a thin rim that no image resolves.
const MIN_ALPHA: f32 = 0.04;

/// The lobe at a point for one outgoing direction, without color.
#[derive(Clone, Copy, Debug)]
pub struct Sheen<T: Real = f32> {
    wo: Vec3<T>,
    per_alpha: T,
    row: SheenRow<T>,
    own: T,
}

impl<T: Real> Sheen<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(roughness: T, wo: Vec3<T>) -> Self {
        let row = SheenRow::new(roughness);
        Self { wo, per_alpha: per_alpha(roughness), row, own: row.raw(wo.z) }
    }

    /// BSDF times cosine, and the density of sampling a direction.
    #[inline(always)]
    pub fn evaluate(&self, wi: Vec3<T>) -> (T, T) {
        let raw = lobe(self.wo, wi, self.per_alpha);
        let excess = at_least(max(self.own, self.row.raw(wi.z)), 1.0);
        (raw * wi.z * inverse(excess), T::splat(1.0 / TAU))
    }

    /// Samples a direction, uniformly.
    #[inline(always)]
    pub fn sample([u, v]: [T; 2]) -> Vec3<T> {
        let (sin, cos) = sin_cos_turns(v);
        let r = at_least(complement(u * u), 0.0).sqrt();
        vec3(r * cos, r * sin, at_least(u, 1e-5))
    }
}

/// 1/α of a perceptual roughness.
#[inline(always)]
pub fn per_alpha<T: Real>(roughness: T) -> T {
    inverse(at_least(roughness * roughness, MIN_ALPHA))
}

/// D · V as published.
#[inline(always)]
pub fn lobe<T: Real>(wo: Vec3<T>, wi: Vec3<T>, per_alpha: T) -> T {
    let h = wo + wi;
    let h = h * inverse(at_least(h.dot(h), 1e-20).sqrt());
    let sin2 = at_least(complement(h.z * h.z), 1e-12);
    let density = (per_alpha + 2.0_f32) * pow(sin2, per_alpha * 0.5_f32) * (0.5 * FRAC_1_PI);
    density * inverse(at_least((wo.z + wi.z - wo.z * wi.z) * 4.0_f32, 1e-6))
}

/// The lobe's albedo at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct SheenRow<T: Real> {
    row: T::Int,
    weight: T,
}

impl<T: Real> SheenRow<T> {
    /// The row of a perceptual roughness in [0, 1].
    #[inline(always)]
    pub fn new(roughness: T) -> Self {
        let (row, weight) = cell(roughness);
        Self { row, weight }
    }

    /// The albedo of the published lobe, which may exceed one.
    #[inline(always)]
    pub fn raw(&self, mu: T) -> T {
        let (column, weight) = cell(mu);
        let index = self.row.times(T::Int::splat(CELLS as u32)).plus(column);
        let [a, b, c, d, ..] = T::lookup(&TABLE, index);
        let (lower, upper) = (a + (b - a) * weight, c + (d - c) * weight);
        lower + (upper - lower) * self.weight
    }

    /// The albedo, at most one.
    #[inline(always)]
    pub fn albedo(&self, mu: T) -> T {
        at_most(self.raw(mu), 1.0)
    }
}

/// Albedo of the published lobe at the corners of cells of roughness and cosine, computed at first use.
static TABLE: LazyLock<Vec<[f32; 8]>> = LazyLock::new(|| {
    let grid = |i: usize| i as f32 / CELLS as f32;
    let rows: Vec<Vec<f32>> = (0..=CELLS)
        .map(|r| (0..=CELLS).map(|m| integrate(per_alpha(grid(r)), at_least(grid(m), 0.01))).collect())
        .collect();
    let corners =
        |r: usize, m: usize| [rows[r][m], rows[r][m + 1], rows[r + 1][m], rows[r + 1][m + 1], 0.0, 0.0, 0.0, 0.0];
    (0..CELLS * CELLS).map(|i| corners(i / CELLS, i % CELLS)).collect()
});

/// Albedo of the published lobe, in cells by roughness, then by cosine: at the lower cosine and at the higher, and both
/// again at the higher roughness; the rest is 0.
pub fn sheen_table() -> &'static [[f32; 8]] {
    &TABLE
}

/// ∫ D V cos over the hemisphere, by midpoints in cosine and half a turn.
fn integrate(per_alpha: f32, mu: f32) -> f32 {
    const STEPS: u32 = 32;
    let wo = vec3(at_least(1.0 - mu * mu, 0.0).sqrt(), 0.0, mu);
    let mut sum = 0.0;
    for i in 0..STEPS {
        let z = (i as f32 + 0.5) / STEPS as f32;
        let r = (1.0 - z * z).sqrt();
        for j in 0..STEPS {
            let (sin, cos) = sin_cos_turns((j as f32 + 0.5) / (2 * STEPS) as f32);
            sum += lobe(wo, vec3(r * cos, r * sin, z), per_alpha) * z;
        }
    }
    sum * TAU / (STEPS * STEPS) as f32
}
