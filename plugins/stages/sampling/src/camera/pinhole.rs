//! The pinhole camera, with an optional lens.

use crate::camera::exposure::ExposureOption;
use crate::camera::intrinsics::IntrinsicsOption;
use crate::camera::lens::{DistortionOptions, FocusedLens, LensOptions};
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Distortion, Exposure, Intrinsics, Optics};

/// A pinhole camera with optional lens distortion and depth of field.
///
/// Without options it is the color camera of a RealSense L515, as in SynTable. The origin of the image is the top-left
/// corner of its top-left pixel: the center of a 640 × 480 image is (320, 240).
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pinhole {
    /// Width and height of the image, pixels.
    #[schemars(inner(range(min = 1, max = Intrinsics::MAX_EDGE)))]
    resolution: [u32; 2],
    /// Focal length and principal point: `{ fov_deg = 60 }`,
    /// `{ physical = { focal_length_mm = 1.88, sensor_size_mm = [2.63, 1.96] } }` (the default) or
    /// `{ pixels = { fx = 457.5, fy = 460.4, cx = 320, cy = 240 } }`.
    intrinsics: IntrinsicsOption,
    /// Lens distortion with OpenCV's coefficients, such as `{ k1 = -0.2, k2 = 0.05 }`. Images, labels and depth are all
    /// distorted; no distortion by default. The kind `fisheye` has the lenses of OpenCV's `fisheye` module.
    #[serde(skip_serializing_if = "Option::is_none")]
    distortion: Option<DistortionOptions>,
    /// Depth of field, such as `{ f_number = 2.8, focus = "tabletop" }`; everything is in focus by default. Labels are
    /// taken through the center of the lens and are never blurred.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<LensOptions>,
    /// Exposure: `"auto"`, `{ auto = { compensation_ev = 0.5 } }` or `{ ev100 = 9 }`.
    exposure: ExposureOption,
}

impl Default for Pinhole {
    fn default() -> Self {
        Self {
            resolution: [640, 480],
            intrinsics: IntrinsicsOption::default(),
            distortion: None,
            lens: None,
            exposure: ExposureOption::default(),
        }
    }
}

impl Config for Pinhole {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "pinhole";
    const EXAMPLE: &'static str = "resolution = [640, 480]\nintrinsics = { fov_deg = 60 }\nexposure = \"auto\"";
    const RENAMED: &'static [(&'static str, &'static str)] = &[
        ("focal_length_mm", "intrinsics.physical.focal_length_mm"),
        ("aperture_mm", "intrinsics.physical.sensor_size_mm"),
        ("k", "intrinsics.pixels"),
        ("fov_deg", "intrinsics.fov_deg"),
    ];

    fn build(self) -> Result<Box<dyn CameraModel>, ConfigError> {
        let intrinsics = self.intrinsics.intrinsics(self.resolution);
        let distortion = self.distortion.map(|options| options.distortion(intrinsics)).transpose()?;
        let lens = self.lens.map(|lens| lens.lens(self.intrinsics.focal_length())).transpose()?;
        Ok(Box::new(PinholeModel { intrinsics, distortion, lens, exposure: self.exposure.0 }))
    }
}
register!(Pinhole);

struct PinholeModel {
    intrinsics: Intrinsics,
    distortion: Option<Distortion>,
    lens: Option<FocusedLens>,
    exposure: Exposure,
}

impl CameraModel for PinholeModel {
    fn optics(&self, scene: &Scene, world_from_camera: &Pose, context: &Context) -> Result<Optics> {
        let Self { intrinsics, distortion, exposure, .. } = *self;
        let camera = Camera { intrinsics, distortion, lens: None, world_from_camera: *world_from_camera };
        let lens = self.lens.as_ref().map(|lens| lens.focused(scene, &camera, context)).transpose()?;
        Ok(Optics { intrinsics, distortion, lens, exposure })
    }
}
