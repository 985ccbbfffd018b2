//! Policy of labels, the same for every renderer.
//!
//! Labels are taken at pixel centers and never filtered, so a surface is there or not. Of bodies at equal depth the one
//! with the lower id is in front: objects come before distractors, supports and room parts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::scene::InstanceId;
use syntable_model::stage::LabelSurface;

/// How labels treat what can be seen through: materials that blend by alpha, such as the glass of old files, and that transmit
/// light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlendedLabels {
    /// The first surface counts, glass too. The texture's alpha is the shape: the surface is there where that is one half or
    /// more, and everywhere without a texture, however transparent the material is as a whole.
    #[default]
    Shape,
    /// The surface is there where it covers one half or more of what is behind it by its alpha; what transmits light is.
    Coverage,
    /// The first opaque surface counts: as `coverage`, and what transmits one half or more of the light that enters is not
    /// there either.
    Opaque,
}

/// Part of the light that enters a surface and passes it, from which on it is glass for [`BlendedLabels::Opaque`].
pub const GLASS: f32 = 0.5;

impl BlendedLabels {
    /// The same for the policy of labels.
    pub fn surface(self) -> LabelSurface {
        match self {
            Self::Shape => LabelSurface::First,
            Self::Coverage => LabelSurface::AlphaThreshold,
            Self::Opaque => LabelSurface::FirstOpaque,
        }
    }
}

/// Number that selects the base of a layered material, whose normal labels show.
pub const BASE_LAYER: f32 = 1.0 - f32::EPSILON;

/// Id of the body at an index of the scene: 0 is the background, so ids are one higher.
#[inline]
pub fn instance_id(index: u32) -> InstanceId {
    InstanceId(index as u16 + 1)
}
