//! Intrinsics of the pinhole camera, in one of three forms.

use crate::camera::lens::FocalLength;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::scene::Intrinsics;

/// Focal length and principal point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IntrinsicsOption {
    /// Horizontal field of view, degrees, from 0.1 to 179. Pixels are square, and the principal point is the center of
    /// the image.
    FovDeg(#[schemars(range(min = 0.1, max = 179.0))] f64),
    /// Focal length and sensor size of a physical camera. The principal point is the center of the image.
    Physical(PhysicalCamera),
    /// Elements of the camera matrix K, pixels, for an image whose top-left corner is (0, 0).
    Pixels(PixelIntrinsics),
}

/// Focal length and sensor size. In pixels, fx = width · f / sensor width and fy = height · f / sensor height: pixels
/// are square only if image and sensor have the same aspect ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhysicalCamera {
    /// Focal length, millimeters.
    #[schemars(range(min = 1e-3, max = 1e6))]
    focal_length_mm: f64,
    /// Width and height of the sensor area that the image covers, millimeters.
    #[schemars(inner(range(min = 1e-3, max = 1e6)))]
    sensor_size_mm: [f64; 2],
}

/// Elements of the camera matrix K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PixelIntrinsics {
    /// Horizontal focal length, pixels.
    #[schemars(range(min = 1e-3, max = 1e9))]
    fx: f64,
    /// Vertical focal length, pixels.
    #[schemars(range(min = 1e-3, max = 1e9))]
    fy: f64,
    /// Principal point, pixels from the left edge of the image; half the width is the center. Calibrations that put
    /// pixel centers at integers, such as OpenCV's, are half a pixel less.
    #[schemars(range(min = -1e9, max = 1e9))]
    cx: f64,
    /// Principal point, pixels from the top edge of the image; half the height is the center.
    #[schemars(range(min = -1e9, max = 1e9))]
    cy: f64,
}

/// The color camera of a RealSense L515 as the paper rounds it: 1.88 mm and 2.63 × 1.96 mm.
impl Default for IntrinsicsOption {
    fn default() -> Self {
        Self::Physical(PhysicalCamera { focal_length_mm: 1.88, sensor_size_mm: [2.63, 1.96] })
    }
}

impl PixelIntrinsics {
    /// The intrinsics of an image of this width and height.
    pub fn intrinsics(self, [width, height]: [u32; 2]) -> Intrinsics {
        let Self { fx, fy, cx, cy } = self;
        Intrinsics { width, height, fx, fy, cx, cy }
    }
}

impl IntrinsicsOption {
    /// The intrinsics of an image of this width and height.
    pub fn intrinsics(self, [width, height]: [u32; 2]) -> Intrinsics {
        let (w, h) = (f64::from(width), f64::from(height));
        let centered = |fx: f64, fy: f64| Intrinsics { width, height, fx, fy, cx: w / 2.0, cy: h / 2.0 };
        match self {
            Self::FovDeg(degrees) => {
                let f = 0.5 * w / libm::tan(degrees.to_radians() / 2.0);
                centered(f, f)
            }
            Self::Physical(PhysicalCamera { focal_length_mm: f, sensor_size_mm: [sensor_w, sensor_h] }) => {
                centered(w * f / sensor_w, h * f / sensor_h)
            }
            Self::Pixels(pixels) => pixels.intrinsics([width, height]),
        }
    }

    /// The focal length in millimeters, if the intrinsics state one.
    pub fn focal_length(self) -> FocalLength {
        match self {
            Self::Physical(camera) => FocalLength::Physical(camera.focal_length_mm),
            Self::FovDeg(_) => FocalLength::Unknown("fov_deg"),
            Self::Pixels(_) => FocalLength::Unknown("pixels"),
        }
    }
}
