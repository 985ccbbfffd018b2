//! Random decisions on a scene that the journal records.

use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// A condition on a camera pose, in the order in which conditions are tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// The camera is above the support.
    AboveSupport,
    /// The camera is outside all bodies.
    OutsideBodies,
    /// The camera sees the point that it looks at.
    LineOfSight,
    /// Nothing in the view is too near.
    Clearance,
    /// Enough objects are in the view.
    MinObjects,
}

impl Condition {
    /// The option of `[views.conditions]` that states it.
    pub fn option(self) -> &'static str {
        match self {
            Self::AboveSupport => "above_support",
            Self::OutsideBodies => "outside_bodies",
            Self::LineOfSight => "line_of_sight",
            Self::Clearance => "clearance_m",
            Self::MinObjects => "min_objects",
        }
    }
}

/// Numbers of refused poses by the condition that refused them.
pub type Refusals = BTreeMap<Condition, u32>;

/// Refused poses in words: `min_objects 80, clearance_m 20`, the most frequent condition first.
pub fn in_words(refusals: &Refusals) -> String {
    let mut counts: Vec<(Condition, u32)> = refusals.iter().map(|(condition, count)| (*condition, *count)).collect();
    counts.sort_by_key(|(condition, count)| (Reverse(*count), *condition));
    let words = counts.iter().map(|(condition, count)| format!("`{}` {count}", condition.option()));
    words.collect::<Vec<_>>().join(", ")
}

/// The poses that were drawn for the views of a scene.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PoseDraws {
    /// Number of drawn poses.
    pub drawn: u32,
    /// Numbers of refused poses by the condition that refused them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub refused: Refusals,
    /// Views without a pose that meets the conditions, which have the best drawn pose.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unmet: Vec<u32>,
}

impl PoseDraws {
    /// Whether no view had conditions.
    pub fn is_empty(&self) -> bool {
        self.drawn == 0
    }

    /// Adds the draws of another scene or view.
    pub fn add(&mut self, other: &Self) {
        self.drawn += other.drawn;
        for (condition, count) in &other.refused {
            *self.refused.entry(*condition).or_default() += count;
        }
        self.unmet.extend(&other.unmet);
    }
}

/// The random decisions on a scene.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneDraws {
    /// Camera poses that were drawn under conditions.
    pub poses: PoseDraws,
    /// Drawn alternatives of stages by stage, from 0: one of a scene, or one of each view.
    pub choices: BTreeMap<String, Vec<u32>>,
}
