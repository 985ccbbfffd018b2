//! The axis that points up in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The axis that points up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Up {
    /// z points up.
    #[default]
    Z,
    /// y points up; the mesh is rotated to z up.
    Y,
}
