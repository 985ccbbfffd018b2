//! The point that a camera looks at.

use crate::common::shell::center;
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::geometry::{Aabb, Pose};
use syntable_model::scene::{Scene, Support};

/// The point that the camera looks at.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(clippy::enum_variant_names, reason = "the names of the choices in recipes")]
pub enum LookAt {
    /// Center of the support, such as the tabletop.
    #[default]
    TabletopCenter,
    /// Center of the camera positions, `center_offset_m` above the support.
    ShellCenter,
    /// Center of the bounding box of all objects.
    ObjectsCenter,
}

impl LookAt {
    /// The point in the world, meters.
    pub fn point(self, scene: &Scene, support: &Support, center_offset_m: f64) -> Point3<f64> {
        match self {
            Self::TabletopCenter => support.center(),
            Self::ShellCenter => center(support, center_offset_m),
            Self::ObjectsCenter => {
                let corners = scene
                    .objects()
                    .iter()
                    .flat_map(|body| body.object.mesh.bounds().corners().map(|p| body.world_from_body * p));
                Aabb::of(corners).center()
            }
        }
    }
}

/// Rotates a camera about its optical axis, clockwise seen from behind it; the image rotates the other way.
pub fn rolled(world_from_camera: Pose, degrees: f64) -> Pose {
    world_from_camera * Pose::rotation(Vector3::new(0.0, 0.0, degrees.to_radians()))
}
