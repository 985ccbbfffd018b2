//! The option of writers for the depth that they store.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, DEPTH_SENSED};

/// Source of the depth that is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthSource {
    /// Exact depth of the surfaces.
    #[default]
    Rendered,
    /// Measurements of a depth camera, with its noise and holes.
    Sensed,
}

impl DepthSource {
    /// Whether the depth is the default one, which a recipe omits.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The product of this source.
    pub fn key(self) -> Key<Plane<f32>> {
        match self {
            Self::Rendered => DEPTH,
            Self::Sensed => DEPTH_SENSED,
        }
    }

    /// The product as an input of a writer, which the option `depth` names.
    pub fn input(self) -> Input {
        Input { option: Some("depth".into()), ..Input::of(self.key()) }
    }
}
