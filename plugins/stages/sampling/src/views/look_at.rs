//! The point that a camera looks at.

use crate::common::shell::center;
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::geometry::{Aabb, Pose};
use syntable_model::random::Stream;
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

/// The point that a camera looks at: the same in all views of a scene, or drawn for each view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ViewTarget {
    /// One point of the scene.
    Point(LookAt),
    /// An object, drawn for each view.
    Object(DrawnObject),
}

/// The center of the object that is nearest to the mean center of some objects, which each view draws.
///
/// This is the point of interest of BlenderProc's recipes for the BOP challenge, which draw 15 objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawnObject {
    /// Number of objects whose mean center is taken; all objects if the scene has fewer.
    #[schemars(range(min = 1, max = 10000))]
    near_mean_of: u32,
}

impl ViewTarget {
    /// The point, if all views of the scene look at it.
    pub fn fixed(self) -> Option<LookAt> {
        match self {
            Self::Point(point) => Some(point),
            Self::Object(_) => None,
        }
    }
}

impl DrawnObject {
    /// The center of the object in the world, meters. `otherwise` is the point for a scene without objects.
    pub fn point(self, scene: &Scene, stream: &mut Stream, otherwise: Point3<f64>) -> Point3<f64> {
        let mut centers: Vec<Point3<f64>> = scene.objects().iter().map(|body| body.world_bounds().center()).collect();
        stream.shuffle(&mut centers);
        centers.truncate(self.near_mean_of as usize);
        let sum: Vector3<f64> = centers.iter().map(|center| center.coords).sum();
        let mean = Point3::from(sum / centers.len().max(1) as f64);
        let distance = |center: &Point3<f64>| (center - mean).norm();
        centers.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(otherwise)
    }
}

/// Rotates a camera about its optical axis, clockwise seen from behind it; the image rotates the other way.
pub fn rolled(world_from_camera: Pose, degrees: f64) -> Pose {
    world_from_camera * Pose::rotation(Vector3::new(0.0, 0.0, degrees.to_radians()))
}
