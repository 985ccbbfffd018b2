//! Where objects and materials come from.

use crate::context::Log;
use crate::error::Result;
use crate::scene::{Asset, AssetClass, Catalog};

/// Lists and loads assets of one class. Selection, scale, centering, mass and caching are the pool's work, alike for
/// all sources.
pub trait AssetSource: Send + Sync {
    /// What this source gives.
    fn class(&self) -> AssetClass;
    /// What there is, without loading it. Called once.
    fn catalog(&self, log: &dyn Log) -> Result<Catalog>;
    /// Loads one entry. Called from several threads. An error refuses the asset, a warning reports it.
    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset>;
}
