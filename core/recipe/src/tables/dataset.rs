//! `[dataset]` and `[lock]`: the sections of a recipe that are not stages.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::digest::Hasher;

/// Name, seed and size of the dataset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetTable {
    /// Name of the dataset, repeated in its files.
    #[serde(default = "default_name")]
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Seed of all random numbers: the same recipe and seed give the same dataset on any machine.
    #[serde(default)]
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    pub seed: u64,
    /// Number of scenes.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub scenes: u32,
    /// Number of views per scene; may be left out if `[views]` lists its poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub views_per_scene: Option<u32>,
    /// Number of attempts per scene, each with other random numbers, before the scene is recorded as failed.
    #[serde(default = "default_max_attempts")]
    #[schemars(range(min = 1, max = 100))]
    pub max_attempts: u32,
    /// Reaction to an asset that cannot be loaded: draw another asset, or stop the run.
    #[serde(default)]
    pub on_bad_asset: OnBadAsset,
}

fn default_name() -> String {
    "syntable".to_owned()
}

fn default_max_attempts() -> u32 {
    3
}

/// Name, seed and size of the dataset: `[dataset]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dataset {
    /// The dataset's name.
    pub name: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of scenes.
    pub scenes: u32,
    /// Number of views per scene.
    pub views_per_scene: u32,
    /// Number of attempts before a scene is recorded as failed; at least 1.
    pub max_attempts: u32,
    /// Reaction to an asset that cannot be loaded.
    pub on_bad_asset: OnBadAsset,
}

/// Reaction to an asset that cannot be loaded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnBadAsset {
    /// Draw another asset and report the failure once.
    #[default]
    Skip,
    /// Stop the run.
    Fail,
}

/// Versions and digests that a resolved recipe was made with; written by the program.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LockTable {
    /// Version of the program.
    pub syntable: String,
    /// Graphics cards that rendered scenes, with driver and interface: on another graphics card, images may differ by
    /// rounding.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub devices: BTreeSet<String>,
    /// Versions of the plugin crates in use, by name.
    pub plugins: BTreeMap<String, String>,
    /// Contents of each pool: a pool with other names, categories or numbers is an error.
    pub catalogs: BTreeMap<String, CatalogLock>,
    /// Digests of files that options name, by the option: a file with another content is an error.
    pub files: BTreeMap<String, String>,
    /// Digests of the drawn assets, by `pool/name`, or `bad` for one that could not be used: an asset with another digest
    /// is an error.
    pub assets: BTreeMap<String, String>,
}

/// Contents of a pool.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CatalogLock {
    /// Number of assets.
    pub assets: usize,
    /// Digest of their names, categories and numbers.
    pub digest: String,
}

/// The assets of a pool by name.
pub type CatalogNames = BTreeMap<String, CatalogAsset>;

/// The record of an asset of a pool in a dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CatalogAsset {
    /// Its category.
    pub category: String,
    /// Its number, if it is an object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obj_id: Option<u32>,
}

impl CatalogLock {
    /// The lock of a pool with these assets.
    pub fn of(catalog: &CatalogNames) -> Self {
        let add = |hasher: Hasher, (name, CatalogAsset { category, obj_id }): (&String, &CatalogAsset)| {
            let hasher = hasher.text(name).text(category);
            match obj_id {
                Some(id) => hasher.bytes(&id.to_le_bytes()),
                None => hasher,
            }
        };
        let hasher = catalog.iter().fold(Hasher::new("catalog"), add);
        Self { assets: catalog.len(), digest: hasher.finish().to_string() }
    }
}

/// The inputs of a dataset. They may not change while it is made, nor when its resolved recipe runs again.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lock {
    /// Devices that rendered scenes and may round otherwise than others do.
    pub devices: BTreeSet<String>,
    /// Contents of each pool.
    pub catalogs: BTreeMap<String, CatalogLock>,
    /// Digests of files that options of stages name, by the option.
    pub files: BTreeMap<String, String>,
    /// Digests of the drawn assets, by `pool/name`.
    pub assets: BTreeMap<String, String>,
}

impl From<LockTable> for Lock {
    fn from(LockTable { devices, catalogs, files, assets, .. }: LockTable) -> Self {
        Self { devices, catalogs, files, assets }
    }
}
