//! Pools for tests.

use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::context::Assets;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Asset, AssetRef, CatalogEntry, EnvironmentMap, Material, Object};

/// No pools.
#[derive(Debug, Default, Clone, Copy)]
pub struct NoAssets;

impl Assets for NoAssets {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        Err(Error::new(format!("unknown pool `{pool}`")))
    }
    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        Err(Error::new(format!("unknown asset {asset}")))
    }
}

/// Pools in memory.
#[derive(Debug, Default)]
pub struct Pools {
    entries: BTreeMap<String, Vec<CatalogEntry>>,
    assets: BTreeMap<AssetRef, Asset>,
}

impl Pools {
    /// Adds an object to a pool, under its own name.
    pub fn object(mut self, pool: &str, object: Arc<Object>) -> Self {
        let asset = self.enter(pool, &object.name, &object.category);
        self.assets.insert(asset, Asset::Object(object));
        self
    }

    /// Adds a material to a pool, under its own name.
    pub fn material(mut self, pool: &str, material: Material) -> Self {
        let asset = self.enter(pool, &material.name, "material");
        self.assets.insert(asset, material.into());
        self
    }

    /// Adds an environment map to a pool, under its own name.
    pub fn environment(mut self, pool: &str, map: EnvironmentMap) -> Self {
        let asset = self.enter(pool, &map.name, "environment");
        self.assets.insert(asset, map.into());
        self
    }

    fn enter(&mut self, pool: &str, name: &str, category: &str) -> AssetRef {
        let entries = self.entries.entry(pool.to_owned()).or_default();
        entries.push(CatalogEntry::new(name, category));
        entries.sort();
        AssetRef { pool: pool.to_owned(), name: name.to_owned() }
    }
}

impl Assets for Pools {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.entries.get(pool).map(Vec::as_slice).ok_or_else(|| Error::new(format!("unknown pool `{pool}`")))
    }
    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        self.assets.get(asset).cloned().ok_or_else(|| Error::new(format!("unknown asset {asset}")))
    }
}
