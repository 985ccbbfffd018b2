//! The pinhole camera, with a lens if one is wanted.

use crate::exposure::ExposureOption;
use crate::lens::{DistortionOptions, FocalLength, Lens, LensOptions};
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Distortion, Exposure, Intrinsics, Optics};

/// Focal length of a RealSense L515's colour camera as SynTable uses it, millimetres.
const L515_FOCAL_MM: f64 = 1.88;
/// Its apertures, horizontal and vertical, millimetres.
const L515_APERTURE_MM: [f64; 2] = [2.63, 1.96];

/// A pinhole camera; on request with the distortion and the depth of field of a real lens. Intrinsics are given in one way: by `focal_length_mm` and `aperture_mm`, by
/// the matrix `k`, or by the field of view `fov_deg`; without any, they are those of a RealSense L515.
///
/// Focal lengths in pixels are fx = width · f / aperture[0] and fy = height · f / aperture[1]: with both apertures
/// given, pixels need not be square, and the field of view is what the apertures say. `fov_deg` makes square pixels.
/// The principal point is the middle of the image, except with `k`. The image's origin is the corner of its top-left
/// pixel, so that the middle of a 640 × 480 image is (320, 240).
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pinhole {
    /// Width and height of the image, pixels.
    #[schemars(inner(range(min = 1, max = 16384)))]
    resolution: [u32; 2],
    /// Focal length, millimetres; needs `aperture_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6))]
    focal_length_mm: Option<f64>,
    /// Width and height of the sensor, millimetres; needs `focal_length_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 1e-3, max = 1e6)))]
    aperture_mm: Option<[f64; 2]>,
    /// The matrix K, row by row, pixels: `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    k: Option<[[f64; 3]; 3]>,
    /// Horizontal field of view, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.1, max = 179.0))]
    fov_deg: Option<f64>,
    /// Lens distortion after Brown and Conrady, with OpenCV's coefficients, such as `{ k1 = -0.2, k2 = 0.05 }`. Pictures,
    /// labels and depth are all seen through it.
    #[serde(skip_serializing_if = "Option::is_none")]
    distortion: Option<DistortionOptions>,
    /// Depth of field, such as `{ f_number = 2.8, focus = "tabletop" }`; a pinhole without. Labels are those of the
    /// lens's centre and never blurred.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<LensOptions>,
    /// How scene light becomes a picture.
    exposure: ExposureOption,
}

impl Default for Pinhole {
    fn default() -> Self {
        Self {
            resolution: [640, 480],
            focal_length_mm: None,
            aperture_mm: None,
            k: None,
            fov_deg: None,
            distortion: None,
            lens: None,
            exposure: ExposureOption::default(),
        }
    }
}

impl Config for Pinhole {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "pinhole";
    const EXAMPLE: &'static str =
        "resolution = [640, 480]\nfocal_length_mm = 1.88\naperture_mm = [2.63, 1.96]\nexposure = \"auto\"";

    fn build(self) -> Result<Box<dyn CameraModel>, Invalid> {
        let intrinsics = self.intrinsics()?;
        let distortion = self.distortion.map(|options| options.distortion(intrinsics)).transpose()?;
        let focal_length = match (self.focal_length_mm, self.k.is_some() || self.fov_deg.is_some()) {
            (Some(length), _) => FocalLength::Given(length),
            (None, true) => FocalLength::Unknown,
            (None, false) => FocalLength::Usual(L515_FOCAL_MM),
        };
        let lens = self.lens.map(|lens| lens.lens(focal_length)).transpose()?;
        Ok(Box::new(Model { intrinsics, distortion, lens, exposure: self.exposure.0 }))
    }
}
register!(Pinhole);

impl Pinhole {
    fn intrinsics(&self) -> Result<Intrinsics, Invalid> {
        let [width, height] = self.resolution;
        for (i, edge) in self.resolution.into_iter().enumerate() {
            if !(1..=16384).contains(&edge) {
                let message = format!("`resolution` has {edge} pixels, outside 1 to 16384");
                return Err(Invalid::new(format!("resolution.{i}"), message));
            }
        }
        let (w, h) = (f64::from(width), f64::from(height));
        let centred = |fx: f64, fy: f64| Intrinsics { width, height, fx, fy, cx: w / 2.0, cy: h / 2.0 };
        let from_lens = |f: f64, [across, down]: [f64; 2]| centred(w * f / across, h * f / down);
        let intrinsics = match (self.focal_length_mm, self.aperture_mm, self.k, self.fov_deg) {
            (None, None, None, None) => from_lens(L515_FOCAL_MM, L515_APERTURE_MM),
            (Some(f), Some(aperture), None, None) => {
                positive("focal_length_mm", f)?;
                positive("aperture_mm", aperture[0])?;
                positive("aperture_mm", aperture[1])?;
                from_lens(f, aperture)
            }
            (Some(_), None, None, None) => {
                return Err(Invalid::new("focal_length_mm", "`focal_length_mm` needs `aperture_mm`")
                    .help("add aperture_mm = [width, height]"));
            }
            (None, Some(_), None, None) => {
                return Err(Invalid::new("aperture_mm", "`aperture_mm` needs `focal_length_mm`"));
            }
            (None, None, Some(k), None) => from_matrix(k, width, height)?,
            (None, None, None, Some(degrees)) => {
                if !(0.1..=179.0).contains(&degrees) {
                    let message = format!("`fov_deg = {degrees}` is outside 0.1 to 179");
                    return Err(Invalid::new("fov_deg", message));
                }
                let f = 0.5 * w / (degrees.to_radians() / 2.0).tan();
                centred(f, f)
            }
            (f, aperture, k, _) => {
                let first = match (f.is_some() || aperture.is_some(), k.is_some()) {
                    (true, true) => "k",
                    _ => "fov_deg",
                };
                return Err(Invalid::new(first, "intrinsics are given in more than one way")
                    .help("keep one of: focal_length_mm with aperture_mm, k, fov_deg"));
            }
        };
        Ok(intrinsics)
    }
}

fn positive(key: &str, value: f64) -> Result<(), Invalid> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Invalid::new(key, format!("`{key}` is {value}, and must be above zero")))
}

fn from_matrix(k: [[f64; 3]; 3], width: u32, height: u32) -> Result<Intrinsics, Invalid> {
    let [[fx, skew, cx], [zero, fy, cy], last] = k;
    let wrong =
        |what: String| Err(Invalid::new("k", what).help("write [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], in pixels"));
    if !k.iter().flatten().all(|x| x.is_finite()) {
        return wrong("`k` has an element that is not finite".into());
    }
    if last != [0.0, 0.0, 1.0] || zero != 0.0 {
        return wrong(format!("`k = {k:?}` is no matrix of intrinsics"));
    }
    if skew != 0.0 {
        return wrong(format!("`k` has skew {skew}; pixels with skew are not supported"));
    }
    if fx <= 0.0 || fy <= 0.0 {
        return wrong(format!("`k` has the focal lengths {fx} and {fy}, which must be above zero"));
    }
    Ok(Intrinsics { width, height, fx, fy, cx, cy })
}

struct Model {
    intrinsics: Intrinsics,
    distortion: Option<Distortion>,
    lens: Option<Lens>,
    exposure: Exposure,
}

impl CameraModel for Model {
    fn optics(&self, scene: &Scene, world_from_camera: &Pose, context: &Context) -> Result<Optics> {
        let Self { intrinsics, distortion, exposure, .. } = *self;
        let camera = Camera { intrinsics, distortion, lens: None, world_from_camera: *world_from_camera };
        let lens = self.lens.as_ref().map(|lens| lens.focused(scene, &camera, context)).transpose()?;
        Ok(Optics { intrinsics, distortion, lens, exposure })
    }
}
