//! The camera of an image, read back from the product `camera`.

use crate::error::{Error, Result};
use crate::geometry::{Pose, rigid};
use crate::product::Value;
use crate::product::standard::CAMERA;
use crate::scene::{Camera, Distortion, Fisheye, Intrinsics, Polynomial};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The known parameters of the camera of an image: intrinsics and distortion, and in most datasets the pose.
#[derive(Debug, Clone)]
pub struct StatedCamera {
    camera: Camera,
    has_pose: bool,
}

/// Skews up to this fraction of the focal length are rounding errors.
const MAX_SKEW: f64 = 1e-6;

/// The entries of the product `camera` that are read.
#[derive(Deserialize)]
struct CameraRecord {
    width: u32,
    height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(default)]
    world_from_camera: Option<[[f64; 4]; 4]>,
    #[serde(flatten)]
    distortion: DistortionRecord,
}

/// Lens distortion as entries of the product `camera`: at most one, whose name lists its coefficients in the order of
/// OpenCV's `distCoeffs`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct DistortionRecord {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion_k1_k2_p1_p2_k3: Option<[f64; 5]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion_k1_k2_p1_p2_k3_k4_k5_k6: Option<[f64; 8]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion_k1_k2_p1_p2_k3_k4_k5_k6_s1_s2_s3_s4: Option<[f64; 12]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fisheye_k1_k2_k3_k4: Option<[f64; 4]>,
}

impl DistortionRecord {
    /// The names of the entries.
    pub const NAMES: [&str; 4] = [
        "distortion_k1_k2_p1_p2_k3",
        "distortion_k1_k2_p1_p2_k3_k4_k5_k6",
        "distortion_k1_k2_p1_p2_k3_k4_k5_k6_s1_s2_s3_s4",
        "fisheye_k1_k2_k3_k4",
    ];

    /// The record of a lens, in the shortest form that states it; no entry for none.
    pub fn of(distortion: Option<&Distortion>) -> Self {
        let mut record = Self::default();
        match distortion {
            None => {}
            Some(Distortion::Fisheye(lens)) => record.fisheye_k1_k2_k3_k4 = Some(lens.coefficients),
            Some(Distortion::Polynomial(lens)) => {
                let ([k1, k2, k3], [p1, p2], [k4, k5, k6]) = (lens.radial, lens.tangential, lens.denominator);
                let [s1, s2, s3, s4] = lens.thin_prism;
                if lens.thin_prism != [0.0; 4] {
                    record.distortion_k1_k2_p1_p2_k3_k4_k5_k6_s1_s2_s3_s4 =
                        Some([k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4]);
                } else if lens.denominator != [0.0; 3] {
                    record.distortion_k1_k2_p1_p2_k3_k4_k5_k6 = Some([k1, k2, p1, p2, k3, k4, k5, k6]);
                } else {
                    record.distortion_k1_k2_p1_p2_k3 = Some([k1, k2, p1, p2, k3]);
                }
            }
        }
        record
    }

    /// Whether the lens has no distortion.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The lens.
    pub fn distortion(&self) -> Option<Distortion> {
        if let Some(coefficients) = self.fisheye_k1_k2_k3_k4 {
            return Some(Distortion::Fisheye(Fisheye { coefficients }));
        }
        let mut all = [0.0; 12];
        let forms = [
            self.distortion_k1_k2_p1_p2_k3.as_ref().map(|short| short.as_slice()),
            self.distortion_k1_k2_p1_p2_k3_k4_k5_k6.as_ref().map(|middle| middle.as_slice()),
            self.distortion_k1_k2_p1_p2_k3_k4_k5_k6_s1_s2_s3_s4.as_ref().map(|long| long.as_slice()),
        ];
        let given = forms.into_iter().flatten().next()?;
        all[..given.len()].copy_from_slice(given);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = all;
        Some(Distortion::Polynomial(Polynomial {
            radial: [k1, k2, k3],
            tangential: [p1, p2],
            denominator: [k4, k5, k6],
            thin_prism: [s1, s2, s3, s4],
        }))
    }
}

impl StatedCamera {
    /// The camera that a value of the product `camera` states.
    ///
    /// # Errors
    /// If the value has no size or no matrix `K`, if `K` has a skew, if the pose is no rigid motion, or if an entry has another form.
    pub fn of(value: &Value) -> Result<Self> {
        let unlike = |error: serde_json::Error| {
            Error::new(format!("product `{}` is not a camera: {error}", CAMERA.name()))
                .help("it has `width`, `height` and `K`, and may have `world_from_camera`")
        };
        let json = serde_json::to_value(value).map_err(unlike)?;
        let CameraRecord { width, height, k, world_from_camera, distortion } =
            serde_json::from_value(json).map_err(unlike)?;
        let [[fx, skew, cx], [_, fy, cy], _] = k;
        if skew.abs() > MAX_SKEW * fx.abs() {
            let message = format!("product `{}` has the skew {skew} px in `K`", CAMERA.name());
            return Err(Error::new(message).help("cameras here have square corners: `K[0][1]` is 0"));
        }
        let distortion = distortion.distortion();
        let pose = world_from_camera.map(|rows| rigid(rows, "world_from_camera")).transpose();
        let pose = pose.map_err(|error| Error::new(format!("product `{}`: {}", CAMERA.name(), error.message)))?;
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let camera = Camera { distortion, ..Camera::pinhole(intrinsics, pose.unwrap_or_else(Pose::identity)) };
        Ok(Self { camera, has_pose: pose.is_some() })
    }

    /// The point at depth 1 in the camera's frame (x right, y down, z forward) that a position in the image shows, px; none
    /// where distortion cannot be undone.
    pub fn unproject(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        self.camera.unproject(u, v)
    }

    /// The camera. Its pose is the identity if the dataset does not state it.
    pub fn camera(&self) -> &Camera {
        &self.camera
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lens_has_one_entry_and_returns() {
        let radial = Polynomial { radial: [0.1, 0.2, 0.3], tangential: [0.4, 0.5], ..Polynomial::default() };
        let rational = Polynomial { denominator: [0.6, 0.7, 0.8], ..radial };
        let prism = Polynomial { thin_prism: [0.9, 1.0, 1.1, 1.2], ..rational };
        let fisheye = Distortion::Fisheye(Fisheye { coefficients: [0.1, 0.2, 0.3, 0.4] });
        let [radial, rational, prism] = [radial, rational, prism].map(Distortion::Polynomial);
        let lenses = [radial, rational, prism, fisheye];
        for (name, lens) in DistortionRecord::NAMES.into_iter().zip(lenses) {
            let record = DistortionRecord::of(Some(&lens));
            let json = serde_json::to_value(record).expect("JSON");
            let entries: Vec<&String> = json.as_object().expect("a table").keys().collect();
            assert_eq!(entries, [name]);
            assert_eq!(json[name].as_array().expect("a list").len(), name.matches('_').count());
            let back: DistortionRecord = serde_json::from_value(json).expect("a record");
            assert_eq!(back.distortion(), Some(lens));
        }
        assert!(DistortionRecord::of(None).is_none() && DistortionRecord::default().distortion().is_none());
    }
}
