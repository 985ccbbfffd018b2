//! Policy of labels, the same for every renderer.
//!
//! Labels are taken at pixel centers and never filtered, so a surface is there or not. Of bodies at equal depth the one
//! with the lower id is in front: objects come before distractors, supports and room parts.

use syntable_model::scene::InstanceId;

/// Number to compare the coverage of a partly transparent surface with ([`Material::is_solid`](crate::Material::is_solid)):
/// for labels it is there from one half on.
pub const LABEL_ALPHA: f32 = 0.5 - f32::EPSILON;

/// Number that selects the base of a layered material, whose normal labels show.
pub const BASE_LAYER: f32 = 1.0 - f32::EPSILON;

/// Id of the body at an index of the scene: 0 is the background, so ids are one higher.
#[inline]
pub fn instance_id(index: u32) -> InstanceId {
    InstanceId(index as u16 + 1)
}
