//! A line of the journal.

use crate::run::dataset::draws::PoseDraws;
use crate::run::dataset::journal::notice::Notice;
use crate::run::dataset::loss::Loss;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::digest::Digest;

/// A line of the journal: a finished scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct JournalEntry {
    /// Number of the scene.
    pub scene: u32,
    /// The successful attempt, from 0; the last attempt if the scene failed.
    pub attempt: u32,
    /// Outcome of the scene.
    #[serde(flatten)]
    pub outcome: SceneOutcome,
    /// Anomalies of the scene as a whole.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub notices: BTreeSet<Notice>,
    /// Anomalies of some but not all views, with the numbers of these views, ascending.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub odd_views: BTreeMap<Notice, Vec<u32>>,
    /// Camera poses that were drawn under the conditions of `[views]`.
    #[serde(default, skip_serializing_if = "PoseDraws::is_empty")]
    pub poses: PoseDraws,
    /// Drawn alternatives of stages with `one_of`, by stage, from 0: one of a scene, or one of each view.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub choices: BTreeMap<String, Vec<u32>>,
    /// The component of a mixture that made the scene; empty if the recipe is no mixture.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub component: String,
    /// Data that stages omitted from the scene's images, by stage.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<Loss>,
    /// Whether the scene keeps files of writers that the line does not name. A run writes them again, or removes them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub stale: bool,
    /// Messages of the failed attempts, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<String>,
    /// Digests of assets that were drawn for the scene, by `pool/name`; `bad` for an unusable asset. A written line lacks
    /// the digests that the journal had before.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub assets: BTreeMap<String, String>,
}

/// Outcome of a finished scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum SceneOutcome {
    /// The scene is in the dataset.
    Made {
        /// Number of written views.
        views: u32,
        /// Number of objects in the scene after settling.
        objects: u32,
        /// Ids of the writers of the scene, sorted.
        writers: Vec<String>,
        /// Products that were recorded for the annotators of the dataset, sorted.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        recorded: Vec<String>,
        /// Digest of the scene's list of files, `.syntable/scenes/<scene>.json`.
        #[schemars(with = "String")]
        manifest: Digest,
    },
    /// All attempts failed, or a device failed. The dataset has no file of the scene.
    Failed,
}

impl JournalEntry {
    /// The entry of a scene that had no anomaly, error or draw.
    pub fn new(scene: u32, attempt: u32, outcome: SceneOutcome) -> Self {
        let (notices, odd_views, poses, choices, component, left_out, stale, errors, assets) = Default::default();
        Self { scene, attempt, outcome, notices, odd_views, poses, choices, component, left_out, stale, errors, assets }
    }

    /// Whether all attempts failed.
    pub fn failed(&self) -> bool {
        self.outcome == SceneOutcome::Failed
    }

    /// Number of views in the dataset.
    pub fn views(&self) -> u32 {
        match self.outcome {
            SceneOutcome::Made { views, .. } => views,
            SceneOutcome::Failed => 0,
        }
    }

    /// Ids of the writers that wrote the scene.
    pub fn writers(&self) -> &[String] {
        match &self.outcome {
            SceneOutcome::Made { writers, .. } => writers,
            SceneOutcome::Failed => &[],
        }
    }

    /// The line of a scene without the writers `anew`, whose files are written again or removed. Records for dataset
    /// annotators are dropped too, because the annotators may have changed.
    pub fn without(&self, anew: &BTreeSet<String>) -> Self {
        let mut entry = self.clone();
        if let SceneOutcome::Made { writers, recorded, .. } = &mut entry.outcome
            && writers.iter().any(|id| anew.contains(id))
        {
            writers.retain(|id| !anew.contains(id));
            recorded.clear();
            entry.stale = true;
        }
        entry.left_out.retain(|loss| !loss.stage.strip_prefix("write.").is_some_and(|id| anew.contains(id)));
        entry
    }

    /// Products that were recorded of the scene.
    pub fn recorded(&self) -> &[String] {
        match &self.outcome {
            SceneOutcome::Made { recorded, .. } => recorded,
            SceneOutcome::Failed => &[],
        }
    }

    /// Digest of the scene's manifest, if it has one.
    pub fn manifest(&self) -> Option<Digest> {
        match self.outcome {
            SceneOutcome::Made { manifest, .. } => Some(manifest),
            SceneOutcome::Failed => None,
        }
    }
}
