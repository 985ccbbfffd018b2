//! How often lights are sampled.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How often lights are sampled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Per {
    /// Once per view, as in the paper.
    #[default]
    View,
    /// Once per scene: all views of a scene have the same lights.
    Scene,
}
