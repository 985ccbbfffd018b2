//! Views with poses from the recipe.

use crate::views::look_at::rolled;
use nalgebra::{Point3, Translation3, Vector3};
use syntable_model::geometry::{look_at, rigid};
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Camera poses from a list, the same in every scene: view `i` takes entry `i`, and the number of views equals the
/// number of entries.
///
/// An entry is `{ look_at = { eye_m = [x, y, z], target_m = [x, y, z] } }` or
/// `{ world_from_camera = [[..], [..], [..], [..]] }`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixedPoses {
    /// Poses of the views, in order; at least one.
    #[schemars(length(min = 1))]
    poses: Vec<PoseEntry>,
    /// Origin of the coordinates in `poses`, along the world's axes.
    #[serde(default)]
    relative_to: Origin,
    /// Name of the support that the poses are around. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
}

/// Origin of listed poses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Origin {
    /// Center of the support, such as the tabletop, whose height differs between tables.
    #[default]
    TabletopCenter,
    /// Origin of the world, on the floor.
    World,
}

/// A camera pose.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum PoseEntry {
    /// Position, target and up vector.
    LookAt(LookAtPose),
    /// Rigid 4 × 4 matrix, row by row. Its columns are the camera's right, down and forward axes and its position in
    /// meters, from −1000 to 1000.
    WorldFromCamera(#[schemars(inner(inner(range(min = -1000.0, max = 1000.0))))] [[f64; 4]; 4]),
}

/// A camera pose from a position and a target.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LookAtPose {
    /// Position of the camera, meters, from −1000 to 1000.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    eye_m: [f64; 3],
    /// Point that the camera looks at, meters, from −1000 to 1000; the origin by default.
    #[serde(default)]
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    target_m: [f64; 3],
    /// Direction that points up in the image; z by default. Must not be parallel to the viewing direction.
    #[serde(default = "z_axis")]
    up: [f64; 3],
    /// Rotation of the camera about its optical axis, degrees; positive is clockwise seen from behind the camera. 0 by
    /// default.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    roll_deg: f64,
}

fn z_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl Config for FixedPoses {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "fixed_poses";
    const EXAMPLE: &'static str = "poses = [\n    \
        { look_at = { eye_m = [0.9, 0.0, 0.7], target_m = [0.0, 0.0, 0.05] } },\n    \
        { look_at = { eye_m = [0.0, 0.0, 1.2], up = [0.0, 1.0, 0.0] } },\n]";

    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        let pose = |(i, entry): (usize, PoseEntry)| match entry {
            PoseEntry::LookAt(pose) => {
                Ok((pose.pose(&format!("poses[{i}].look_at"))?, Some(Point3::from(pose.target_m))))
            }
            PoseEntry::WorldFromCamera(rows) => Ok((rigid(rows, &format!("poses[{i}].world_from_camera"))?, None)),
        };
        let poses = self.poses.into_iter().enumerate().map(pose).collect::<Result<_, ConfigError>>()?;
        Ok(Box::new(ListedPoses { poses, relative_to: self.relative_to, support: self.support }))
    }
}
register!(FixedPoses);

impl LookAtPose {
    fn pose(&self, key: &str) -> Result<Pose, ConfigError> {
        let (eye, target) = (Point3::from(self.eye_m), Point3::from(self.target_m));
        let up = Vector3::from(self.up);
        if (target - eye).norm() < 1e-9 {
            let message = format!("`eye_m` and `target_m` are the same point, {:?}", self.eye_m);
            return Err(ConfigError::new(key, message).help("move one of them"));
        }
        if (target - eye).cross(&up).norm() < 1e-9 {
            let message = format!("`up = {:?}` is parallel to the viewing direction", self.up);
            return Err(ConfigError::new(key, message).help("set `up` to another axis, such as [0, 1, 0]"));
        }
        Ok(rolled(look_at(eye, target, up), self.roll_deg))
    }
}

struct ListedPoses {
    /// Each with the point that it looks at, if the recipe states the point.
    poses: Vec<(Pose, Option<Point3<f64>>)>,
    relative_to: Origin,
    support: Option<SupportName>,
}

impl ListedPoses {
    fn origin(&self, scene: &Scene) -> Result<Translation3<f64>> {
        Ok(match self.relative_to {
            Origin::TabletopCenter => Translation3::from(scene.support(self.support.as_ref())?.center().coords),
            Origin::World => Translation3::identity(),
        })
    }

    /// Center of the support. Without one, poses in the world are around the mean of the points that they look at.
    fn center(&self, scene: &Scene) -> Result<Point3<f64>> {
        match (scene.support(self.support.as_ref()), self.relative_to) {
            (Ok(support), _) => Ok(support.center()),
            (Err(error), Origin::TabletopCenter) => Err(error),
            (Err(_), Origin::World) => {
                let targets: Vec<Vector3<f64>> = self.poses.iter().filter_map(|(_, at)| Some((*at)?.coords)).collect();
                Ok((targets.iter().sum::<Vector3<f64>>() / targets.len().max(1) as f64).into())
            }
        }
    }
}

impl ViewSampler for ListedPoses {
    fn needs(&self) -> Option<Part> {
        (self.relative_to == Origin::TabletopCenter && self.support.is_none()).then_some(Part::MainSupport)
    }

    fn pose(&self, scene: &Scene, view: ViewId, _: &Context) -> Result<Pose> {
        let (pose, _) = self.poses.get(view.0 as usize).ok_or_else(|| {
            Error::new(format!("view {} has no pose; {} are listed", view.0, self.poses.len()))
                .help("set dataset.views_per_scene to the number of poses, or list more")
        })?;
        Ok(self.origin(scene)? * pose)
    }

    fn target(&self, scene: &Scene, view: ViewId) -> Option<Point3<f64>> {
        let (_, target) = self.poses.get(view.0 as usize)?;
        Some(self.origin(scene).ok()? * (*target)?)
    }

    /// The shell around the center of the support that contains all poses.
    fn shell(&self, scene: &Scene) -> Result<Shell> {
        let (center, origin) = (self.center(scene)?, self.origin(scene)?);
        let radius = self
            .poses
            .iter()
            .map(|(pose, _)| ((origin * pose).translation.vector - center.coords).norm())
            .fold([f64::INFINITY, 0.0], |[low, high], r| [r.min(low), r.max(high)]);
        Ok(Shell { center, radius })
    }

    fn count(&self) -> Option<u32> {
        Some(self.poses.len() as u32)
    }
}
