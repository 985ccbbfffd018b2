//! How often lights are drawn.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How often lights are drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Per {
    /// Anew for every view, as in the paper.
    #[default]
    View,
    /// Once: all views of a scene have the same.
    Scene,
}
