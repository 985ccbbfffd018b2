//! Loaded assets, kept while a scene uses them or while memory allows.

use parking_lot::Mutex;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Weak};
use syntable_model::error::Error;
use syntable_model::scene::{Asset, AssetRef, EnvironmentMap, Material, Object};

/// Bytes of loaded assets that are kept for the next scene. The least recently used assets are dropped first.
const KEEP_BYTES: u64 = 256 << 20;

/// Assets loaded from pools, for the next scene and for the next recipe with the same pools.
pub struct Loaded {
    pub(super) kept: Cache<AssetRef, Asset, ByBytes>,
    /// Loaded assets that scenes may still use.
    pub(super) in_use: Mutex<BTreeMap<AssetRef, InUse>>,
    /// Assets whose warnings were reported.
    pub(super) told: Mutex<BTreeSet<AssetRef>>,
    pub(super) bad: Mutex<BTreeMap<AssetRef, Error>>,
}

impl Default for Loaded {
    fn default() -> Self {
        Self::within(KEEP_BYTES)
    }
}

impl Loaded {
    /// An empty cache. Limits the bytes of the assets that no scene uses.
    pub(super) fn within(bytes: u64) -> Self {
        Self { kept: cache(bytes), in_use: Mutex::default(), told: Mutex::default(), bad: Mutex::default() }
    }

    /// Drops the assets of all pools except the ones that are the same. Also forgets all bad assets, because the user
    /// may have repaired them.
    pub fn keep(&self, is_same: impl Fn(&str) -> bool) {
        self.kept.retain(|asset, _| is_same(&asset.pool));
        self.in_use.lock().retain(|asset, _| is_same(&asset.pool));
        self.told.lock().retain(|asset| is_same(&asset.pool));
        self.bad.lock().clear();
    }
}

/// Weighs cached assets by their size in memory.
#[derive(Clone)]
pub(super) struct ByBytes;

impl Weighter<AssetRef, Asset> for ByBytes {
    fn weight(&self, _: &AssetRef, asset: &Asset) -> u64 {
        bytes(asset) as u64
    }
}

/// A cache with a single shard. Several shards would share the capacity, so each would keep only small assets, and the
/// more processors, the smaller.
pub(super) fn cache(bytes: u64) -> Cache<AssetRef, Asset, ByBytes> {
    let options = OptionsBuilder::new().estimated_items_capacity(1024).weight_capacity(bytes).shards(1).build();
    match options {
        Ok(options) => {
            Cache::with_options(options, ByBytes, DefaultHashBuilder::default(), DefaultLifecycle::default())
        }
        Err(_) => Cache::with_weighter(1024, bytes, ByBytes),
    }
}

/// A weak reference to an asset, which scenes may still hold.
pub(super) enum InUse {
    Object(Weak<Object>),
    Material(Weak<Material>),
    Environment(Weak<EnvironmentMap>),
    Gone,
}

impl InUse {
    pub(super) fn of(asset: &Asset) -> Self {
        match asset {
            Asset::Object(object) => Self::Object(Arc::downgrade(object)),
            Asset::Material(material) => Self::Material(Arc::downgrade(material)),
            Asset::Environment(map) => Self::Environment(Arc::downgrade(map)),
            _ => Self::Gone,
        }
    }

    pub(super) fn get(&self) -> Option<Asset> {
        match self {
            Self::Object(object) => object.upgrade().map(Asset::Object),
            Self::Material(material) => material.upgrade().map(Asset::Material),
            Self::Environment(map) => map.upgrade().map(Asset::Environment),
            Self::Gone => None,
        }
    }
}

/// Approximate size of an asset in memory, bytes.
fn bytes(asset: &Asset) -> usize {
    match asset {
        Asset::Material(material) => material_bytes(material),
        Asset::Environment(map) => map.texels().len() * 12,
        Asset::Object(object) => {
            let data = object.mesh.data();
            data.positions.len() * 24
                + data.uvs.len() * 8
                + data.colors.len() * 12
                + data.triangles.len() * 14
                + object.materials.iter().map(|material| material_bytes(material)).sum::<usize>()
        }
        _ => 0,
    }
}

fn material_bytes(material: &Material) -> usize {
    material.textures().map(|used| used.texture.texels.len()).sum::<usize>() + 256
}
