//! Policy of labels, the same for every renderer.
//!
//! Labels are taken at pixel centers and never filtered, so a surface is there or not. Of bodies at equal depth the one
//! with the lower id is in front: objects come before distractors, supports and room parts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::scene::InstanceId;

/// How labels treat materials that blend by alpha, such as the glass of old files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlendedLabels {
    /// The texture's alpha is the shape: the surface is there where that is one half or more, and everywhere without a
    /// texture, however transparent the material is as a whole.
    #[default]
    Shape,
    /// The surface is there where it covers one half or more of what is behind it; thin glass is not.
    Coverage,
}

/// Number that selects the base of a layered material, whose normal labels show.
pub const BASE_LAYER: f32 = 1.0 - f32::EPSILON;

/// Id of the body at an index of the scene: 0 is the background, so ids are one higher.
#[inline]
pub fn instance_id(index: u32) -> InstanceId {
    InstanceId(index as u16 + 1)
}
