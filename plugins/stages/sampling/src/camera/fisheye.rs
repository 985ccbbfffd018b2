//! The fisheye camera.

use crate::camera::exposure::ExposureOption;
use crate::camera::intrinsics::PixelIntrinsics;
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::{Distortion, Exposure, Fisheye as Lens, Intrinsics, Optics};

/// A fisheye camera after Kannala and Brandt, with the parameters of OpenCV's `fisheye` module.
///
/// A direction at the angle θ from the optical axis is seen at the distance f · θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) from
/// the principal point. Without coefficients the lens is equidistant.
///
/// # Behavior
/// - Depth is measured along the optical axis, as with any camera. Directions of 89.5° and more from the axis have none:
///   their pixels are black and show no object. Use `distance` for the length of the ray.
/// - Images, labels and depth all have the lens's distortion. The product `camera` states it as `fisheye_k1_k2_k3_k4`.
/// - The origin of the image is the top-left corner of its top-left pixel. Calibrations that put pixel centers at integers,
///   such as OpenCV's, have a principal point half a pixel less.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Fisheye {
    /// Width and height of the image, pixels.
    #[schemars(inner(range(min = 1, max = Intrinsics::MAX_EDGE)))]
    resolution: [u32; 2],
    /// Focal length and principal point: `{ fov_deg = 150 }` (the default) or
    /// `{ pixels = { fx = 285.7, fy = 286.1, cx = 320, cy = 240 } }`.
    intrinsics: FisheyeIntrinsics,
    /// Coefficient of θ³; 0 by default.
    #[schemars(range(min = -1e3, max = 1e3))]
    k1: f64,
    /// Coefficient of θ⁵; 0 by default.
    #[schemars(range(min = -1e3, max = 1e3))]
    k2: f64,
    /// Coefficient of θ⁷; 0 by default.
    #[schemars(range(min = -1e3, max = 1e3))]
    k3: f64,
    /// Coefficient of θ⁹; 0 by default.
    #[schemars(range(min = -1e3, max = 1e3))]
    k4: f64,
    /// Exposure: `"auto"`, `{ auto = { compensation_ev = 0.5 } }` or `{ ev100 = 9 }`.
    exposure: ExposureOption,
}

/// Focal length and principal point of a fisheye camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum FisheyeIntrinsics {
    /// Angle between the left and the right edge of the image, degrees, from 1 to 179. Pixels are square, and the principal
    /// point is the center of the image.
    FovDeg(#[schemars(range(min = 1.0, max = 179.0))] f64),
    /// Elements of the camera matrix K, pixels.
    Pixels(PixelIntrinsics),
}

impl Default for Fisheye {
    fn default() -> Self {
        Self {
            resolution: [640, 480],
            intrinsics: FisheyeIntrinsics::FovDeg(150.0),
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
            exposure: ExposureOption::default(),
        }
    }
}

impl Config for Fisheye {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "fisheye";
    const EXAMPLE: &'static str =
        "resolution = [640, 480]\nintrinsics = { fov_deg = 170 }\nk1 = -0.02\nexposure = \"auto\"";

    fn build(self) -> Result<Box<dyn CameraModel>, ConfigError> {
        let lens = Lens { coefficients: [self.k1, self.k2, self.k3, self.k4] };
        let [width, height] = self.resolution;
        let intrinsics = match self.intrinsics {
            FisheyeIntrinsics::Pixels(pixels) => pixels.intrinsics(self.resolution),
            FisheyeIntrinsics::FovDeg(degrees) => {
                let (w, h) = (f64::from(width), f64::from(height));
                check_fold(&lens, |angle, _| angle >= degrees.to_radians() / 2.0)?;
                let (edge, _) = lens.radius(degrees.to_radians() / 2.0);
                let f = 0.5 * w / edge;
                Intrinsics { width, height, fx: f, fy: f, cx: w / 2.0, cy: h / 2.0 }
            }
        };
        let corner =
            |[u, v]: [f64; 2]| libm::hypot((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy);
        let [w, h] = self.resolution.map(f64::from);
        let end = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(corner).into_iter().fold(0.0, f64::max);
        check_fold(&lens, |_, radius| radius >= end)?;
        Ok(Box::new(FisheyeModel { intrinsics, lens, exposure: self.exposure.0 }))
    }
}
register!(Fisheye);

/// Rejects coefficients that show two directions at one place, from the axis until `is_outside` of an angle and its radius.
fn check_fold(lens: &Lens, is_outside: impl Fn(f64, f64) -> bool) -> Result<(), ConfigError> {
    const STEPS: u32 = 360;
    for step in 0..=STEPS {
        let angle = Lens::MAX_ANGLE * f64::from(step) / f64::from(STEPS);
        let (radius, slope) = lens.radius(angle);
        if slope <= 0.0 {
            let [k1, k2, k3, k4] = lens.coefficients;
            let message = format!(
                "the lens with k1 = {k1}, k2 = {k2}, k3 = {k3}, k4 = {k4} folds the image over {:.1}° from its axis",
                angle.to_degrees()
            );
            return Err(ConfigError::new("k1", message)
                .help("use coefficients of this field of view, or a smaller image or field of view"));
        }
        if is_outside(angle, radius) {
            break;
        }
    }
    Ok(())
}

struct FisheyeModel {
    intrinsics: Intrinsics,
    lens: Lens,
    exposure: Exposure,
}

impl CameraModel for FisheyeModel {
    fn optics(&self, _: &Scene, _: &Pose, _: &Context) -> Result<Optics> {
        let Self { intrinsics, lens, exposure } = *self;
        Ok(Optics { intrinsics, distortion: Some(Distortion::Fisheye(lens)), lens: None, exposure })
    }
}
