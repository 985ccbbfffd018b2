//! Conditions on camera poses, which every kind of `[views]` has.

use crate::tables::rig::{Rig, RigCamera};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::error::ConfigError;

/// Options of every `[views]` table, in addition to the options of its kind. No kind may have an option of the same name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ViewOptions {
    /// Conditions on the poses that the kind draws: a pose that does not meet them is drawn again. Without the table, every
    /// pose is accepted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conditions: Option<ViewConditions>,
    /// Cameras that are fixed to each other, such as a stereo pair: `[{ name = "left" }, { name = "right", position_m = [0.06, 0,
    /// 0] }]`. Each pose that the kind draws is the pose of the rig, and gives one view per camera, in this order;
    /// `views_per_scene` counts all of them. All cameras have the options of `[camera]`, and the views of a pose share their lights.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 64))]
    pub rig: Vec<RigCamera>,
}

/// Conditions on camera poses. They are tested by rays against the bodies of the scene, before the view is rendered. All
/// bodies are opaque to these rays, glass too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ViewConditions {
    /// Minimum number of objects in the view, or `"all"`. An object is in the view if it meets `categories`, `min_visible`,
    /// `uncut` and `distance_m`. 0 accepts views without objects.
    pub min_objects: ObjectCount,
    /// Categories of the objects that count. Empty counts all objects.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub categories: Vec<String>,
    /// Minimum fraction of an object's outline that is visible. Other bodies hide the rest, or it is beyond the border of the
    /// image. 0 accepts any visible part.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_visible: f64,
    /// Whether only objects count that the border of the image does not cut, even where they are hidden.
    pub uncut: bool,
    /// Minimum and maximum distance from the camera to the center of an object's bounding box, meters.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    pub distance_m: Option<[f64; 2]>,
    /// Minimum distance from the camera to any surface in the view, meters. Tested by a grid of 48 rays along the longer edge
    /// of the image, so very thin parts can be missed.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
    /// Whether the camera must see the point that it looks at past walls, furniture and distractors. Objects may hide the point.
    /// Needs a kind of `[views]` that looks at a point.
    pub line_of_sight: bool,
    /// Whether the camera must be outside all bodies.
    pub outside_bodies: bool,
    /// Whether the camera must be above the surface of the support that the views are around.
    pub above_support: bool,
    /// Maximum number of poses drawn for a view. Kinds that draw no random numbers, such as `fixed_poses`, have one.
    #[schemars(range(min = 1, max = 10_000))]
    pub attempts: u32,
    /// Response if no pose meets the conditions.
    pub on_failure: OnFailure,
}

impl Default for ViewConditions {
    fn default() -> Self {
        Self {
            min_objects: ObjectCount::AtLeast(1),
            categories: Vec::new(),
            min_visible: 0.0,
            uncut: false,
            distance_m: None,
            clearance_m: 0.0,
            line_of_sight: false,
            outside_bodies: true,
            above_support: true,
            attempts: 100,
            on_failure: OnFailure::Error,
        }
    }
}

/// A number of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ObjectCount {
    /// At least this many.
    AtLeast(#[schemars(range(min = 0, max = 10_000))] u32),
    /// All that can count.
    All(AllObjects),
}

/// The word for all objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AllObjects {
    /// All of them.
    All,
}

/// Response to a view without a pose that meets the conditions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// The attempt at the scene fails, and the next attempt makes another scene.
    #[default]
    Error,
    /// The view gets the pose that meets most conditions. The run counts such views in a warning.
    Best,
}

impl ViewOptions {
    /// Refuses options that contradict each other.
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        Rig::of(&self.rig)?;
        let Some(conditions) = &self.conditions else { return Ok(()) };
        match conditions.distance_m {
            Some([low, high]) if low > high => {
                let message = format!("`distance_m = [{low}, {high}]` is empty");
                Err(ConfigError::new("conditions.distance_m", message).help("write the smaller bound first"))
            }
            _ => Ok(()),
        }
    }
}
