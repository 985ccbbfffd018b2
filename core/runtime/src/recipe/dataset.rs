//! `[dataset]` and `[lock]`: the parts of a recipe that are no stage.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the dataset is called and how large it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetTable {
    /// The dataset's name, which its files repeat.
    #[serde(default = "default_name")]
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Seed of every random choice: the same recipe and seed give the same dataset on any machine.
    #[serde(default)]
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    pub seed: u64,
    /// Number of scenes.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub scenes: u32,
    /// Number of views of each scene; may be left out if `[views]` lists its poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub views_per_scene: Option<u32>,
    /// How often a scene is begun anew, with other random numbers, before it is recorded as failed.
    #[serde(default = "default_max_attempts")]
    #[schemars(range(min = 1, max = 100))]
    pub max_attempts: u32,
    /// What to do about an asset that cannot be loaded: draw another one, or stop the run.
    #[serde(default)]
    pub on_bad_asset: OnBadAsset,
}

fn default_name() -> String {
    "syntable".to_owned()
}

fn default_max_attempts() -> u32 {
    3
}

/// What the dataset is called and how large it is: `[dataset]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dataset {
    /// The dataset's name.
    pub name: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Number of scenes.
    pub scenes: u32,
    /// Number of views of each scene.
    pub views_per_scene: u32,
    /// How often a scene is begun before it is recorded as failed; at least 1.
    pub max_attempts: u32,
    /// What to do about an asset that cannot be loaded.
    pub on_bad_asset: OnBadAsset,
}

/// What to do about an asset that cannot be loaded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnBadAsset {
    /// Draw another one, and report it once.
    #[default]
    Skip,
    /// Stop the run.
    Fail,
}

/// What a resolved recipe was made with; written by the program.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LockTable {
    /// Version of the program.
    pub syntable: String,
    /// Versions of the plugin crates that the recipe uses, by name.
    pub plugins: BTreeMap<String, String>,
    /// Digests of the assets that were drawn, by `pool/name`: an asset with another digest is an error.
    pub assets: BTreeMap<String, String>,
}
