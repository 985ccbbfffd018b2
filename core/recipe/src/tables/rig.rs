//! The cameras of a rig, which every kind of `[views]` can have.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use syntable_model::error::ConfigError;
use syntable_model::geometry::{Pose, UnitQuaternion, rigid};
use syntable_model::scene::{RigView, ViewId};

/// Limits of a camera's position in its rig, meters.
const POSITION_M: f64 = 100.0;

/// Limits of a camera's rotation, degrees.
const ROTATION_DEG: f64 = 360.0;

/// A camera of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigCamera {
    /// Name of the camera, which the product `camera` states as `rig_camera`.
    #[schemars(length(min = 1, max = 64))]
    name: String,
    /// Position in the frame of the rig (x right, y down, z forward), meters, from −100 to 100.
    #[serde(default)]
    #[schemars(inner(range(min = -POSITION_M, max = POSITION_M)))]
    position_m: [f64; 3],
    /// Rotations about the rig's x, y and z axes, in this order, degrees, from −360 to 360.
    #[serde(default)]
    #[schemars(inner(range(min = -ROTATION_DEG, max = ROTATION_DEG)))]
    rotation_deg: [f64; 3],
    /// Pose in the frame of the rig as a rigid 4 × 4 matrix, row by row, instead of position and rotation. For OpenCV's
    /// `stereoCalibrate`, whose R and T map points of the first camera to the second one, the second camera has the inverse of
    /// `[R | T]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rig_from_camera: Option<[[f64; 4]; 4]>,
}

impl RigCamera {
    fn pose(&self) -> Result<Pose, ConfigError> {
        let Some(rows) = self.rig_from_camera else {
            let [x, y, z] = self.rotation_deg.map(f64::to_radians);
            let rotation = UnitQuaternion::from_euler_angles(x, y, z);
            return Ok(Pose::from_parts(self.position_m.into(), rotation));
        };
        if (self.position_m, self.rotation_deg) != ([0.0; 3], [0.0; 3]) {
            let message = format!("the camera `{}` has its pose twice", self.name);
            return Err(
                ConfigError::new("rig_from_camera", message).help("remove it, or `position_m` and `rotation_deg`")
            );
        }
        rigid(rows, "rig_from_camera")
    }
}

/// The cameras that take the views: a rig, or the camera at each pose of the view sampler.
#[derive(Debug, Clone, Default)]
pub struct Rig(Vec<(String, Pose)>);

impl Rig {
    /// The rig of cameras; without cameras, each pose is one of the camera itself.
    pub(crate) fn of(cameras: &[RigCamera]) -> Result<Self, ConfigError> {
        let mut names = BTreeSet::new();
        let mut rig = Vec::new();
        for (index, camera) in cameras.iter().enumerate() {
            let at = |error: ConfigError| ConfigError { key: format!("rig[{index}].{}", error.key), ..error };
            if !names.insert(&camera.name) {
                let message = format!("two cameras have the name `{}`", camera.name);
                return Err(at(ConfigError::new("name", message).help("rename one of them")));
            }
            rig.push((camera.name.clone(), camera.pose().map_err(at)?));
        }
        Ok(Self(rig))
    }

    /// The number of views of a pose.
    pub fn cameras(&self) -> u32 {
        self.0.len().max(1) as u32
    }

    /// The number of the pose at which a view is taken.
    pub fn pose(&self, view: ViewId) -> ViewId {
        ViewId(view.0 / self.cameras())
    }

    /// The poses of all cameras in the frame of the rig.
    pub fn poses(&self) -> Vec<Pose> {
        if self.0.is_empty() { vec![Pose::identity()] } else { self.0.iter().map(|(_, pose)| *pose).collect() }
    }

    /// Whether a view is the first of its pose.
    pub fn is_first(&self, view: ViewId) -> bool {
        view.0.is_multiple_of(self.cameras())
    }

    /// The camera that takes a view; none without a rig.
    pub fn view(&self, view: ViewId) -> Option<RigView> {
        let (name, pose) = self.0.get((view.0 % self.cameras()) as usize)?;
        Some(RigView { camera: name.clone(), pose: self.pose(view).0, rig_from_camera: *pose })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::Vector3;

    fn cameras(text: &str) -> Result<Rig, ConfigError> {
        #[derive(Deserialize)]
        struct Table {
            rig: Vec<RigCamera>,
        }
        Rig::of(&toml::from_str::<Table>(text).expect("cameras").rig)
    }

    #[test]
    fn views_are_numbered_pose_by_pose() {
        let rig = cameras(
            "rig = [{ name = \"left\" }, { name = \"right\", position_m = [0.1, 0, 0], rotation_deg = [0, -90, 0] },\n\
             { name = \"top\", rig_from_camera = [[1, 0, 0, 0], [0, 0, 1, -0.5], [0, -1, 0, 0], [0, 0, 0, 1]] }]",
        )
        .expect("a rig");
        assert_eq!(rig.cameras(), 3);
        let named: Vec<(u32, String)> =
            (0..6).map(|view| rig.view(ViewId(view)).map(|it| (it.pose, it.camera)).expect("a camera")).collect();
        let want = [(0, "left"), (0, "right"), (0, "top"), (1, "left"), (1, "right"), (1, "top")];
        assert_eq!(named, want.map(|(pose, name)| (pose, name.to_owned())));
        assert!(rig.is_first(ViewId(3)) && !rig.is_first(ViewId(4)));
        // −90° about y turns the optical axis z to −x.
        let right = rig.poses()[1];
        assert!((right * Vector3::z() + Vector3::x()).norm() < 1e-12, "{right}");
        assert_eq!(right.translation.vector, Vector3::new(0.1, 0.0, 0.0));
        let top = rig.poses()[2];
        assert!((top * Vector3::z() - Vector3::y()).norm() < 1e-9, "{top}");
        let single = Rig::default();
        assert_eq!((single.cameras(), single.pose(ViewId(5)), single.view(ViewId(5))), (1, ViewId(5), None));
    }

    #[test]
    fn contradictions_are_refused_by_their_keys() {
        for (text, key) in [
            ("rig = [{ name = \"a\" }, { name = \"a\" }]", "rig[1].name"),
            (
                "rig = [{ name = \"a\", position_m = [1, 0, 0], rig_from_camera = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]] }]",
                "rig[0].rig_from_camera",
            ),
            (
                "rig = [{ name = \"a\", rig_from_camera = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]] }]",
                "rig[0].rig_from_camera",
            ),
        ] {
            assert_eq!(cameras(text).expect_err("refused").key, key, "{text}");
        }
    }
}
