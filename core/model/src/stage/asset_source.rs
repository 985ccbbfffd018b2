//! Sources of objects, materials and environment maps.

use crate::context::Log;
use crate::error::Result;
use crate::scene::{Asset, AssetClass, Catalog};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Lists and loads assets of one class. Selection, scale, centering, mass and caching are the pool's work, alike for
/// all sources.
pub trait AssetSource: Send + Sync {
    /// Class of the assets.
    fn class(&self) -> AssetClass;
    /// The catalog, found without loading the assets. Called once.
    fn catalog(&self, log: &dyn Log) -> Result<Catalog>;
    /// Loads one entry. Called from several threads. An error refuses the asset, a warning reports it.
    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset>;
    /// License of all its assets, as an SPDX expression or name; none if it knows none or they differ.
    fn license(&self) -> Option<&str> {
        None
    }
    /// Whether lengths are in meters for certain. If not, the pool warns of objects of an unlikely size.
    fn states_units(&self) -> bool {
        true
    }
    /// Sets the limits of one asset. Called once, before anything else. Sources that read files keep the limits; others
    /// have nothing to limit.
    fn limit(&mut self, limits: AssetLimits) {
        let _ = limits;
    }
}

/// Limits of one asset. An asset that would take more is refused before memory is allocated for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AssetLimits {
    /// Triangles of the mesh, instances expanded; three times as many vertices.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub triangles: u64,
    /// Pixels of all images together, millions.
    #[schemars(range(min = 1, max = 10_000))]
    pub megapixels: u64,
    /// Bytes of all files together, and of what they hold in other encodings, millions.
    #[schemars(range(min = 1, max = 100_000))]
    pub megabytes: u64,
}

impl Default for AssetLimits {
    fn default() -> Self {
        Self { triangles: 4_000_000, megapixels: 256, megabytes: 1024 }
    }
}
