//! View sampler `fixed_poses`: cameras where the recipe puts them.

use syntable_model::geometry::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Cameras at listed poses, in order; there are as many views as poses.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixedPoses {
    /// The poses: { eye_m = [x, y, z], target_m = [x, y, z] } or { world_from_camera = 4×4 matrix }.
    #[schemars(length(min = 1))]
    poses: Vec<PoseOption>,
    /// Frame of the poses.
    #[serde(default)]
    relative_to: Frame,
}

/// One camera pose.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseOption {
    /// Where the camera is, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    eye_m: Option<[f64; 3]>,
    /// What it looks at, m; the origin if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    target_m: Option<[f64; 3]>,
    /// Rotation about the viewing direction, clockwise seen from behind the camera, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    roll_deg: Option<f64>,
    /// The pose as a matrix, row by row: camera x right, y down, z forward.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    world_from_camera: Option<[[f64; 4]; 4]>,
}

/// What poses are given relative to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// The middle of the tabletop.
    #[default]
    TabletopCentre,
    /// The world's origin, on the floor under the table.
    World,
}

impl Config for FixedPoses {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "fixed_poses";
    const EXAMPLE: &'static str =
        "poses = [{ eye_m = [0.8, 0.0, 0.6], target_m = [0, 0, 0] }, { eye_m = [0.0, 0.8, 0.6], roll_deg = 10 }]";
    fn build(self) -> Result<Box<dyn ViewSampler>, Invalid> {
        let poses = self
            .poses
            .iter()
            .enumerate()
            .map(|(i, pose)| pose.build().map_err(|message| Invalid::new(format!("poses[{i}]"), message)))
            .collect::<Result<Vec<_>, _>>()?;
        if poses.is_empty() {
            return Err(Invalid::new("poses", "`poses` is empty").help("list one pose a view"));
        }
        Ok(Box::new(Built { poses, relative_to: self.relative_to }))
    }
}
register!(FixedPoses);

impl PoseOption {
    fn build(&self) -> Result<Pose, String> {
        match (self.eye_m, self.world_from_camera) {
            (Some(eye), None) => {
                let (eye, target) = (Point3::from(eye), Point3::from(self.target_m.unwrap_or_default()));
                if !(eye - target).norm().is_normal() {
                    return Err(format!("the camera at {eye} looks at itself; give another `target_m`"));
                }
                let roll =
                    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.roll_deg.unwrap_or(0.0).to_radians());
                Ok(look_at(eye, target, Vector3::z()) * roll)
            }
            (None, Some(matrix)) if self.target_m.is_none() && self.roll_deg.is_none() => {
                let rotation = Matrix3::from_fn(|i, j| matrix[i][j]);
                let error = (rotation.transpose() * rotation - Matrix3::identity()).amax();
                if !(error < 1e-4) || rotation.determinant() < 0.0 || matrix[3] != [0.0, 0.0, 0.0, 1.0] {
                    return Err("`world_from_camera` is not a rotation and a translation".to_owned());
                }
                let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
                Ok(Pose::from_parts(Translation3::new(matrix[0][3], matrix[1][3], matrix[2][3]), rotation))
            }
            _ => {
                Err("give either `eye_m`, with `target_m` and `roll_deg` if needed, or `world_from_camera`".to_owned())
            }
        }
    }
}

struct Built {
    poses: Vec<Pose>,
    relative_to: Frame,
}

impl Built {
    fn offset(&self, scene: &Scene) -> Translation3<f64> {
        match self.relative_to {
            Frame::World => Translation3::identity(),
            Frame::TabletopCentre => scene.tabletop.centre().into(),
        }
    }
}

impl ViewSampler for Built {
    fn pose(&self, scene: &Scene, view: ViewId, _: &Context) -> Result<Pose> {
        let pose = self.poses.get(view.0 as usize).ok_or_else(|| {
            Error::new(format!("view {} has no pose: {} are listed", view.0, self.poses.len()))
                .help("list more poses, or lower dataset.views_per_scene")
        })?;
        Ok(self.offset(scene) * pose)
    }

    fn shell(&self, scene: &Scene) -> Shell {
        let centre = scene.tabletop.centre();
        let distances =
            self.poses.iter().map(|pose| ((self.offset(scene) * pose).translation.vector - centre.coords).norm());
        let radius = distances.fold([f64::INFINITY, 0.0], |[low, high], d| [low.min(d), f64::max(high, d)]);
        Shell { centre, radius }
    }

    fn count(&self) -> Option<u32> {
        Some(self.poses.len() as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eyes_and_matrices_give_the_same_pose() {
        let eye: PoseOption = toml::from_str("eye_m = [1.0, 0.5, 0.7]\nroll_deg = 20.0").expect("well-formed");
        let pose = eye.build().expect("sound");
        let rows = pose.to_homogeneous();
        let matrix = std::array::from_fn(|i| std::array::from_fn(|j| rows[(i, j)]));
        let option = PoseOption { eye_m: None, target_m: None, roll_deg: None, world_from_camera: Some(matrix) };
        let again = option.build().expect("sound");
        assert!((again.to_homogeneous() - rows).amax() < 1e-9);
        let ahead = pose * Vector3::z();
        assert!((ahead + Vector3::new(1.0, 0.5, 0.7).normalize()).norm() < 1e-9, "it looks at the origin");
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        for text in [
            "eye_m = [0.0, 0.0, 0.0]",
            "roll_deg = 3.0",
            "world_from_camera = [[2.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]",
            "world_from_camera = [[0, 1.0, 0, 0], [1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]",
        ] {
            let option: PoseOption = toml::from_str(text).expect("well-formed");
            assert!(option.build().is_err(), "{text}");
        }
        let empty: FixedPoses = toml::from_str("poses = []").expect("well-formed");
        assert_eq!(empty.build().err().expect("empty").key, "poses");
    }
}
