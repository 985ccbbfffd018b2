//! Camera `square_camera`: square images, by focal length.

use syntable_model::prelude::*;
use syntable_model::scene::{Exposure, Intrinsics, Optics};

/// A pinhole camera with square images. The exposure is automatic.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SquareCamera {
    /// Width and height of the image, pixels.
    #[schemars(range(min = 1, max = 4096))]
    side_px: u32,
    /// Focal length, pixels. A focal length of half the width shows 90 degrees from the left to the right edge.
    #[schemars(range(min = 1.0, max = 100_000.0))]
    focal_px: f64,
}

impl Default for SquareCamera {
    fn default() -> Self {
        Self { side_px: 512, focal_px: 500.0 }
    }
}

impl Config for SquareCamera {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "square_camera";
    const EXAMPLE: &'static str = "side_px = 512\nfocal_px = 500.0";
    fn build(self) -> Result<Box<dyn CameraModel>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl CameraModel for SquareCamera {
    fn optics(&self, _: &Scene, _: &Pose, _: &Context) -> Result<Optics> {
        let (side, center, focal) = (self.side_px, f64::from(self.side_px) / 2.0, self.focal_px);
        let intrinsics = Intrinsics { width: side, height: side, fx: focal, fy: focal, cx: center, cy: center };
        Ok(Optics { intrinsics, distortion: None, lens: None, exposure: Exposure::Auto { compensation_ev: 0.0 } })
    }
}
register!(SquareCamera);
