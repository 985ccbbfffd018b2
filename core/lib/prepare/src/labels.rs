//! Policy of labels, the same for every renderer.
//!
//! Labels are taken at pixel centers and never filtered, so a surface is either present or absent. If several bodies
//! have equal depth, the body with the lowest id is in front: objects come before distractors, supports and room parts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::scene::InstanceId;
use syntable_model::stage::LabelSurface;

/// Treatment of transparent materials in labels: materials that blend by alpha, such as the glass of old files, and
/// materials that transmit light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlendedLabels {
    /// The first surface counts, including glass. The texture's alpha is a shape: the surface exists where alpha is at
    /// least one half, and everywhere without a texture, however transparent the material is overall.
    #[default]
    Shape,
    /// A surface exists where its alpha covers at least one half of the background. Materials that transmit light
    /// always exist.
    Coverage,
    /// The first opaque surface counts: as with `coverage`, but materials that transmit at least one half of the
    /// entering light do not exist either.
    Opaque,
}

/// Minimum transmitted fraction of the entering light of glass, for [`BlendedLabels::Opaque`].
pub const GLASS: f32 = 0.5;

impl BlendedLabels {
    /// The policy as the labels' own type.
    pub fn surface(self) -> LabelSurface {
        match self {
            Self::Shape => LabelSurface::First,
            Self::Coverage => LabelSurface::AlphaThreshold,
            Self::Opaque => LabelSurface::FirstOpaque,
        }
    }
}

/// Random number that selects the base of a layered material, whose normal the labels show.
pub const BASE_LAYER: f32 = 1.0 - f32::EPSILON;

/// Id of the body at an index of the scene. 0 is the background, so ids are one higher.
#[inline]
pub fn instance_id(index: u32) -> InstanceId {
    InstanceId(index as u16 + 1)
}
