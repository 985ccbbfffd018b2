//! Texel directions of an equirectangular map, and integrals over it.

use std::f64::consts::{PI, TAU};
use syntable_model::error::Result;
use syntable_model::geometry::Vector3;
use syntable_model::scene::EnvironmentMap;

/// The texel grid of an equirectangular map.
pub(super) struct Raster {
    width: u32,
    height: u32,
}

impl Raster {
    /// A map of `width` texels, half as high.
    pub(super) fn with_width(width: u32) -> Self {
        Self { width, height: (width / 2).max(1) }
    }

    /// Directions through the texel centers, row by row.
    pub(super) fn directions(&self) -> impl Iterator<Item = Vector3<f64>> {
        let (width, height) = (self.width, self.height);
        (0..height).flat_map(move |row| {
            (0..width).map(move |column| {
                let [u, v] = [(f64::from(column) + 0.5) / f64::from(width), (f64::from(row) + 0.5) / f64::from(height)];
                EnvironmentMap::direction([u, v])
            })
        })
    }

    /// Illuminance on a level plane of luminances by texel, lux: over a row's band from θ₁ to θ₂ of width Δφ, the
    /// integral of `cos θ sin θ` is `Δφ (sin² θ₂ - sin² θ₁) / 2`.
    pub(super) fn illuminance(&self, luminance: &[f64]) -> f64 {
        let edge = |row: u32| libm::sin((PI * f64::from(row) / f64::from(self.height)).min(PI / 2.0)).powi(2);
        let across = TAU / f64::from(self.width);
        let rows = (0..).zip(luminance.chunks(self.width as usize));
        rows.map(|(row, texels)| across * (edge(row + 1) - edge(row)) / 2.0 * texels.iter().sum::<f64>()).sum()
    }

    /// The map of luminances with colors of luminance one.
    pub(super) fn map(
        &self,
        name: &str,
        luminance: &[f64],
        color: impl Fn(usize) -> [f64; 3],
    ) -> Result<EnvironmentMap> {
        let texels = luminance.iter().enumerate().map(|(i, l)| color(i).map(|c| (c * l) as f32)).collect();
        EnvironmentMap::new(name, self.width, self.height, texels)
    }
}
