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
pub enum LookAt {
    /// Center of the support, such as the tabletop.
    #[default]
    TabletopCenter,
    /// Center of the camera positions, `center_offset_m` above the support.
    ShellCenter,
    /// Center of the bounding box of all objects.
    ObjectsCenter,
    /// The center of the object that is nearest to the mean center of this many objects, which are drawn for each view; all objects if
    /// the scene has fewer. This is the point of interest of BlenderProc's recipes for the BOP challenge, which draw 15 objects.
    NearMeanOf(#[schemars(range(min = 1, max = 10000))] u32),
}

impl LookAt {
    /// The point in the world, meters, if all views of the scene look at it.
    pub fn fixed(self, scene: &Scene, support: &Support, center_offset_m: f64) -> Option<Point3<f64>> {
        match self {
            Self::TabletopCenter => Some(support.center()),
            Self::ShellCenter => Some(center(support, center_offset_m)),
            Self::ObjectsCenter => {
                let corners = scene
                    .objects()
                    .iter()
                    .flat_map(|body| body.object.mesh.bounds().corners().map(|p| body.world_from_body * p));
                Some(Aabb::of(corners).center())
            }
            Self::NearMeanOf(_) => None,
        }
    }

    /// The point in the world, meters, for a view with a stream of random numbers.
    pub fn point(self, scene: &Scene, support: &Support, center_offset_m: f64, stream: &mut Stream) -> Point3<f64> {
        let count = match self {
            Self::NearMeanOf(count) => count as usize,
            _ => 0,
        };
        let fixed = self.fixed(scene, support, center_offset_m);
        fixed.or_else(|| near_mean_of(count, scene, stream)).unwrap_or_else(|| support.center())
    }
}

/// The center of the object nearest to the mean center of some objects; none if the scene has no objects.
fn near_mean_of(count: usize, scene: &Scene, stream: &mut Stream) -> Option<Point3<f64>> {
    let mut centers: Vec<Point3<f64>> = scene.objects().iter().map(|body| body.world_bounds().center()).collect();
    stream.shuffle(&mut centers);
    centers.truncate(count);
    let sum: Vector3<f64> = centers.iter().map(|center| center.coords).sum();
    let mean = Point3::from(sum / centers.len().max(1) as f64);
    let distance = |center: &Point3<f64>| (center - mean).norm();
    centers.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Rotates a camera about its optical axis, clockwise seen from behind it; the image rotates the other way.
pub fn rolled(world_from_camera: Pose, degrees: f64) -> Pose {
    world_from_camera * Pose::rotation(Vector3::new(0.0, 0.0, degrees.to_radians()))
}
