//! The camera of an image, read back from the product `camera`.

use crate::error::{Error, Result};
use crate::geometry::{Pose, pose_of_matrix};
use crate::product::Value;
use crate::product::standard::CAMERA;
use crate::scene::{Camera, Distortion, Intrinsics};
use nalgebra::Vector3;
use serde::Deserialize;

/// The known parameters of the camera of an image: intrinsics and distortion, and in most datasets the pose.
#[derive(Debug, Clone)]
pub struct StatedCamera {
    camera: Camera,
    has_pose: bool,
}

/// The entries of the product `camera` that are read.
#[derive(Deserialize)]
struct CameraRecord {
    width: u32,
    height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(default)]
    world_from_camera: Option<[[f64; 4]; 4]>,
    #[serde(default)]
    distortion_k1_k2_p1_p2_k3: Option<[f64; 5]>,
}

impl StatedCamera {
    /// The camera that a value of the product `camera` states.
    ///
    /// # Errors
    /// If the value has no size or no matrix `K`, or entries of another form.
    pub fn of(value: &Value) -> Result<Self> {
        let unlike = |error: serde_json::Error| {
            Error::new(format!("product `{}` is not a camera: {error}", CAMERA.name()))
                .help("it has `width`, `height` and `K`, and may have `world_from_camera`")
        };
        let json = serde_json::to_value(value).map_err(unlike)?;
        let CameraRecord { width, height, k, world_from_camera, distortion_k1_k2_p1_p2_k3 } =
            serde_json::from_value(json).map_err(unlike)?;
        let [[fx, _, cx], [_, fy, cy], _] = k;
        let distortion = distortion_k1_k2_p1_p2_k3
            .map(|[k1, k2, p1, p2, k3]| Distortion { radial: [k1, k2, k3], tangential: [p1, p2] });
        let pose = world_from_camera.as_ref().map(pose_of_matrix);
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let camera = Camera { distortion, ..Camera::pinhole(intrinsics, pose.unwrap_or_else(Pose::identity)) };
        Ok(Self { camera, has_pose: pose.is_some() })
    }

    /// The point at depth 1 in the camera's frame (x right, y down, z forward) that a position in the image shows, px; none
    /// where distortion cannot be undone.
    pub fn unproject(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        self.camera.unproject(u, v)
    }

    /// Pose of the camera in the world, meters.
    ///
    /// # Errors
    /// If the dataset does not state it.
    pub fn world_from_camera(&self) -> Result<Pose> {
        self.has_pose.then_some(self.camera.world_from_camera).ok_or_else(|| {
            Error::new(format!(
                "product `{}` has no `world_from_camera`: the dataset does not state the camera's pose",
                CAMERA.name()
            ))
        })
    }
}
