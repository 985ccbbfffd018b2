//! Cameras.

use crate::geometry::{Point3, Pose, Vector3};
use serde::Serialize;

/// Pinhole intrinsics, pixels. The origin is the top-left corner of the image; pixel centres lie at half-integers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Intrinsics {
    /// Image width, px.
    pub width: u32,
    /// Image height, px.
    pub height: u32,
    /// Focal length along u, px.
    pub fx: f64,
    /// Focal length along v, px.
    pub fy: f64,
    /// Principal point, u, px from the left edge; `width / 2` is the middle.
    pub cx: f64,
    /// Principal point, v, px from the top edge.
    pub cy: f64,
}

impl Intrinsics {
    /// Projects a point of the camera frame to (u, v), px. The point must be in front: z > 0.
    pub fn project(&self, p_camera: &Point3<f64>) -> [f64; 2] {
        [self.fx * p_camera.x / p_camera.z + self.cx, self.fy * p_camera.y / p_camera.z + self.cy]
    }

    /// The direction of (u, v) in the camera frame with z = 1, so that depth is the ray parameter.
    pub fn unproject(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }

    /// The matrix K, row by row.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]]
    }
}

/// Intrinsics and pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// How directions become pixels.
    pub intrinsics: Intrinsics,
    /// Pose of the camera frame: x right, y down, z forward.
    pub world_from_camera: Pose,
}

/// How a picture in nits becomes an 8-bit one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exposure {
    /// Luminance `1.2 · 2^EV100` nits becomes white.
    Fixed {
        /// Exposure value at ISO 100.
        ev100: f64,
    },
    /// The picture's own brightness decides.
    Auto {
        /// Stops brighter (positive) or darker than the automatic choice.
        compensation_ev: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_and_ray_agree() {
        let k = Intrinsics { width: 640, height: 480, fx: 457.0, fy: 461.0, cx: 320.0, cy: 240.0 };
        let p = Point3::from(k.unproject(100.5, 400.25) * 1.7);
        let [u, v] = k.project(&p);
        assert!((u - 100.5).abs() < 1e-9 && (v - 400.25).abs() < 1e-9);
        assert_eq!(k.project(&Point3::new(0.0, 0.0, 2.0)), [320.0, 240.0]);
    }
}
