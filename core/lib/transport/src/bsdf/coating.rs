//! Attenuation of the lower layers by clearcoat and sheen.
//!
//! A coating with albedo V(μ) transmits `1 − max(V(μₒ), V(μᵢ))` to a glossy lobe, which is reciprocal and never exceeds
//! the remaining energy. Below clearcoat, diffuse light has the weight `(1 − V(μₒ)) (1 − V(μᵢ)) / (1 − V̄)`, which
//! conserves all of it.

use super::albedo::{AlbedoTable, Row};
use super::sheen::SheenRow;
use super::{Interface, multiple_reflectance};
use syntable_simd::{Real, at_least, complement, inverse, max};

/// Reflectance of clearcoat at normal incidence: an index of 1.5, as in KHR_materials_clearcoat.
pub const CLEARCOAT_F0: f32 = 0.04;

/// Strength and roughness of the layers over a lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CoatingParameters<T = f32> {
    /// Fraction of the surface under clearcoat.
    pub clearcoat: T,
    /// Perceptual roughness of the clearcoat.
    pub clearcoat_roughness: T,
    /// Largest reflectance of the sheen fibers.
    pub sheen: T,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: T,
}

/// Both layers for one outgoing direction.
#[derive(Clone, Copy, Debug)]
pub struct CoatingAttenuation<T: Real = f32> {
    parameters: CoatingParameters<T>,
    table: &'static AlbedoTable,
    coat_row: Row<T>,
    coat: Interface<T>,
    coat_own: T,
    per_coat_mean: T,
    sheen_row: SheenRow<T>,
    sheen_own: T,
}

impl<T: Real> CoatingAttenuation<T> {
    /// `mu_o` is the cosine of the outgoing direction, above 0.
    #[inline(always)]
    pub fn new(parameters: CoatingParameters<T>, mu_o: T, table: &'static AlbedoTable) -> Self {
        let coat_row = Row::new(parameters.clearcoat_roughness);
        let mean = coat_row.mean(table);
        let (f0, f90) = (T::splat(CLEARCOAT_F0), T::splat(1.0));
        let coat = Interface { f0, f90, multiple: multiple_reflectance(f0, f90, mean.white()) };
        let sheen_row = SheenRow::new(parameters.sheen_roughness);
        Self {
            parameters,
            table,
            coat_row,
            coat,
            coat_own: coat.albedo(coat_row.at(table, mu_o)) * parameters.clearcoat,
            per_coat_mean: inverse(at_least(complement(coat.albedo(mean) * parameters.clearcoat), 1e-3)),
            sheen_row,
            sheen_own: sheen_row.albedo(mu_o) * parameters.sheen,
        }
    }

    /// Remaining fractions of glossy and of diffuse light from `mu_i`.
    #[inline(always)]
    pub fn factors(&self, mu_i: T) -> [T; 2] {
        let coat = self.coat.albedo(self.coat_row.at(self.table, mu_i)) * self.parameters.clearcoat;
        let sheen = complement(max(self.sheen_own, self.sheen_row.albedo(mu_i) * self.parameters.sheen));
        let matte = at_least(complement(self.coat_own), 0.0) * at_least(complement(coat), 0.0) * self.per_coat_mean;
        [at_least(complement(max(self.coat_own, coat)), 0.0) * sheen, matte * sheen]
    }
}

/// Albedo of full clearcoat seen from a direction.
#[inline(always)]
pub fn clearcoat_albedo(roughness: f32, mu: f32, table: &'static AlbedoTable) -> f32 {
    CoatingAttenuation::new(
        CoatingParameters { clearcoat: 1.0, clearcoat_roughness: roughness, ..CoatingParameters::default() },
        mu,
        table,
    )
    .coat_own
}

/// Albedo of white sheen fibers seen from a direction.
#[inline(always)]
pub fn sheen_albedo(roughness: f32, mu: f32) -> f32 {
    SheenRow::new(roughness).albedo(mu)
}
