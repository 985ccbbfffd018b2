//! The lens of a camera: distortion and depth of field.

use syntable_model::geometry::{Point3, Pose};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Distortion, Intrinsics, Polynomial, ThinLens};

/// Coefficients of lens distortion, with the names and meaning of OpenCV's `calibrateCamera`: 5 of Brown and Conrady, 8 of
/// the rational model, or 12 with a thin prism.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DistortionOptions {
    /// Radial coefficient of r²: negative is barrel distortion, positive is pincushion distortion. 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    k1: f64,
    /// Radial coefficient of r⁴; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    k2: f64,
    /// Tangential coefficient, vertical; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    p1: f64,
    /// Tangential coefficient, horizontal; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    p2: f64,
    /// Radial coefficient of r⁶; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    k3: f64,
    /// Radial coefficient of r² in the denominator (`CALIB_RATIONAL_MODEL`); 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    k4: f64,
    /// Radial coefficient of r⁴ in the denominator; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    k5: f64,
    /// Radial coefficient of r⁶ in the denominator; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    k6: f64,
    /// Thin-prism coefficient of r², horizontal (`CALIB_THIN_PRISM_MODEL`); 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    s1: f64,
    /// Thin-prism coefficient of r⁴, horizontal; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    s2: f64,
    /// Thin-prism coefficient of r², vertical; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    s3: f64,
    /// Thin-prism coefficient of r⁴, vertical; 0 by default.
    #[schemars(range(min = -1e6, max = 1e6))]
    #[serde(skip_serializing_if = "is_zero")]
    s4: f64,
}

/// Positions in an image, px: a fine grid along the border, a coarse one inside.
fn grid(intrinsics: Intrinsics) -> impl Iterator<Item = [f64; 2]> {
    const STEPS: u32 = 32;
    let part = |step: u32, pixels: u32| f64::from(pixels) * f64::from(step) / f64::from(STEPS);
    (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j))).filter_map(move |(i, j)| {
        let inner = (1..STEPS).contains(&i) && (1..STEPS).contains(&j);
        let skipped = inner && (i % 4 != 0 || j % 4 != 0);
        (!skipped).then(|| [part(i, intrinsics.width), part(j, intrinsics.height)])
    })
}

/// Whether an option of OpenCV's longer models is off, so that resolved recipes do not list it.
fn is_zero(coefficient: &f64) -> bool {
    *coefficient == 0.0
}

impl DistortionOptions {
    /// The distortion. Rejects coefficients that map two directions to one pixel, or leave pixels without a direction.
    pub fn distortion(&self, intrinsics: Intrinsics) -> Result<Distortion, ConfigError> {
        let Self { k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 } = *self;
        let distortion = Distortion::Polynomial(Polynomial {
            radial: [k1, k2, k3],
            tangential: [p1, p2],
            denominator: [k4, k5, k6],
            thin_prism: [s1, s2, s3, s4],
        });
        let camera = Camera { distortion: Some(distortion), ..Camera::pinhole(intrinsics, Pose::identity()) };
        if let Some([u, v]) = grid(intrinsics).find(|[u, v]| camera.unproject(*u, *v).is_none()) {
            let all = [
                ("k1", k1),
                ("k2", k2),
                ("k3", k3),
                ("k4", k4),
                ("k5", k5),
                ("k6", k6),
                ("p1", p1),
                ("p2", p2),
                ("s1", s1),
                ("s2", s2),
                ("s3", s3),
                ("s4", s4),
            ];
            let given: Vec<String> = all
                .into_iter()
                .filter(|(_, value)| *value != 0.0)
                .map(|(name, value)| format!("{name} = {value}"))
                .collect();
            let message = format!(
                "`distortion` with {} folds the image over before pixel ({u}, {v}): nothing can be seen there",
                given.join(", ")
            );
            return Err(ConfigError::new("distortion", message)
                .help("use coefficients that were calibrated at this field of view, or a smaller one"));
        }
        Ok(distortion)
    }
}

/// Depth of field: objects off the focal plane are blurred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LensOptions {
    /// F-number, the focal length over the diameter of the aperture, sampled per view, from 0.1 to 1000. Smaller values
    /// blur more.
    #[schemars(extend("minimum" = F_NUMBER[0], "maximum" = F_NUMBER[1]))]
    f_number: Dist,
    /// Distance in focus: `"tabletop"` (the default), the depth of the center of the support, such as the tabletop; `"nearest_object"`, the
    /// depth of the center of the object nearest to the camera in the image; or `{ distance_m = 0.8 }`.
    #[serde(default)]
    focus: Focus,
    /// Name of the support that is in focus. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Focal length of the lens, millimeters. Required unless `intrinsics.physical` has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6))]
    focal_length_mm: Option<f64>,
}

/// Limits of `f_number`.
const F_NUMBER: [f64; 2] = [0.1, 1000.0];
/// Limits of `distance_m`, meters.
const DISTANCE_M: [f64; 2] = [0.001, 1e6];

/// Distance in focus.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Focus {
    /// Center of the support.
    #[default]
    Tabletop,
    /// Center of the nearest object in the image, or of the support without an object.
    NearestObject,
    /// Distance along the optical axis, meters, sampled per view, from 0.001 to 1,000,000.
    DistanceM(#[schemars(extend("minimum" = DISTANCE_M[0], "maximum" = DISTANCE_M[1]))] Dist),
}

/// A lens with a known focal length.
#[derive(Debug)]
pub struct FocusedLens {
    options: LensOptions,
    focal_length_m: f64,
}

/// The focal length according to the intrinsics, millimeters.
#[derive(Debug, Clone, Copy)]
pub enum FocalLength {
    /// The focal length of `intrinsics.physical`.
    Physical(f64),
    /// Intrinsics of this form state angles only.
    Unknown(&'static str),
}

impl LensOptions {
    /// The lens for a camera.
    pub fn lens(self, camera: FocalLength) -> Result<FocusedLens, ConfigError> {
        self.f_number.within("lens.f_number", F_NUMBER[0], F_NUMBER[1])?;
        if let Focus::DistanceM(distance) = &self.focus {
            distance.within("lens.focus.distance_m", DISTANCE_M[0], DISTANCE_M[1])?;
        }
        let millimeters = match (self.focal_length_mm, camera) {
            (Some(_), FocalLength::Physical(own)) => {
                let message = format!("the focal length is {own} mm already, by `intrinsics.physical`");
                return Err(ConfigError::new("lens.focal_length_mm", message).help("leave it out of `lens`"));
            }
            (Some(length), FocalLength::Unknown(_)) | (None, FocalLength::Physical(length)) => length,
            (None, FocalLength::Unknown(form)) => {
                let message = format!("`lens` needs a focal length, which `intrinsics.{form}` does not determine");
                return Err(ConfigError::new("lens", message).help("add focal_length_mm to `lens`"));
            }
        };
        Ok(FocusedLens { options: self, focal_length_m: millimeters / 1e3 })
    }
}

impl FocusedLens {
    /// The lens in focus for a view. `camera` has everything but the lens.
    pub fn focused(&self, scene: &Scene, camera: &Camera, context: &Context) -> Result<ThinLens> {
        let support = || Ok(depth(camera, scene.support(self.options.support.as_ref())?.center()));
        let distance = match &self.options.focus {
            Focus::Tabletop => support()?,
            Focus::NearestObject => nearest_object(scene, camera).map_or_else(support, Ok)?,
            Focus::DistanceM(distance) => distance.draw(&mut context.stream.child("focus")),
        };
        if distance <= self.focal_length_m {
            let message = format!(
                "the distance in focus is {distance:.4} m, where a lens of {} mm cannot focus",
                self.focal_length_m * 1e3
            );
            return Err(Error::unlucky(message).help("set lens.focus to another distance, or change the views"));
        }
        let f_number = self.options.f_number.draw(&mut context.stream.child("f_number"));
        Ok(ThinLens { aperture_radius_m: self.focal_length_m / (2.0 * f_number), focus_distance_m: distance })
    }
}

/// Depth of a point along the optical axis, meters.
fn depth(camera: &Camera, point: Point3<f64>) -> f64 {
    camera.world_from_camera.inverse_transform_point(&point).z
}

/// Depth of the center of the object nearest to the camera, among objects whose center is in the image.
fn nearest_object(scene: &Scene, camera: &Camera) -> Option<f64> {
    let (width, height) = (f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height));
    scene
        .objects()
        .iter()
        .map(|body| body.world_from_body * body.object.mesh.bounds().center())
        .map(|center| camera.world_from_camera.inverse_transform_point(&center))
        .filter(|p| p.z > 0.0)
        .filter(|p| {
            let [u, v] = camera.project(p);
            (0.0..width).contains(&u) && (0.0..height).contains(&v)
        })
        .min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()))
        .map(|p| p.z)
}
