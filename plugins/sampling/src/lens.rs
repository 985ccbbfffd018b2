//! The lens of a camera: distortion and depth of field.

use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Distortion, Intrinsics, ThinLens};

/// Coefficients of Brown and Conrady's lens distortion, with OpenCV's names and meaning.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DistortionOptions {
    /// Radial, of r²: below zero is a barrel, above a pincushion.
    k1: f64,
    /// Radial, of r⁴.
    k2: f64,
    /// Tangential, vertical.
    p1: f64,
    /// Tangential, horizontal.
    p2: f64,
    /// Radial, of r⁶.
    k3: f64,
}

impl DistortionOptions {
    /// The distortion; refused if some of the picture would see nothing, or two places see the same.
    pub fn distortion(&self, intrinsics: Intrinsics) -> Result<Distortion, Invalid> {
        const STEPS: u32 = 32;
        let Self { k1, k2, p1, p2, k3 } = *self;
        if !self.all().iter().all(|coefficient| coefficient.is_finite()) {
            return Err(Invalid::new("distortion", "a coefficient of `distortion` is not finite"));
        }
        let distortion = Distortion { radial: [k1, k2, k3], tangential: [p1, p2] };
        let camera = Camera { distortion: Some(distortion), ..Camera::pinhole(intrinsics, Pose::identity()) };
        for i in 0..=STEPS {
            for j in 0..=STEPS {
                let inner = (1..STEPS).contains(&i) && (1..STEPS).contains(&j);
                // The border finely, the inside coarsely.
                if inner && (i % 4 != 0 || j % 4 != 0) {
                    continue;
                }
                let part = |step: u32, pixels: u32| f64::from(pixels) * f64::from(step) / f64::from(STEPS);
                let (u, v) = (part(i, intrinsics.width), part(j, intrinsics.height));
                if camera.unproject(u, v).is_none() {
                    let message = format!(
                        "`distortion` with k1 = {k1}, k2 = {k2}, k3 = {k3}, p1 = {p1}, p2 = {p2} folds the picture \
                         over before pixel ({u}, {v}): nothing can be seen there"
                    );
                    return Err(Invalid::new("distortion", message)
                        .help("use coefficients that were calibrated at this field of view, or a smaller one"));
                }
            }
        }
        Ok(distortion)
    }

    fn all(&self) -> [f64; 5] {
        [self.k1, self.k2, self.p1, self.p2, self.k3]
    }
}

/// Depth of field: what is off the plane of focus is blurred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LensOptions {
    /// The f-number, focal length over diameter of the aperture, drawn for each view. Smaller ones blur more.
    f_number: Dist,
    /// What is sharp: `"tabletop"`, the depth of the tabletop's middle; `"nearest_object"`, that of the middle of the
    /// object nearest to the camera in the picture; or `{ distance_m = 0.8 }`, metres along the optical axis.
    #[serde(default)]
    focus: Focus,
    /// Focal length of the lens, millimetres: needed with `k` and `fov_deg`, which do not tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6))]
    focal_length_mm: Option<f64>,
}

/// What is sharp.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Focus {
    /// The middle of the tabletop.
    #[default]
    Tabletop,
    /// The middle of the nearest object in the picture; the tabletop's if there is none.
    NearestObject,
    /// A distance along the optical axis, metres, drawn for each view.
    DistanceM(Dist),
}

/// A lens with all that is known of it.
#[derive(Debug)]
pub struct Lens {
    options: LensOptions,
    focal_length_m: f64,
}

/// The focal length that a camera's own options tell, millimetres.
#[derive(Debug, Clone, Copy)]
pub enum FocalLength {
    /// The camera says so.
    Given(f64),
    /// The default camera's; the lens may have another.
    Usual(f64),
    /// Angles alone are known.
    Unknown,
}

impl LensOptions {
    /// The lens for a camera.
    pub fn lens(self, camera: FocalLength) -> Result<Lens, Invalid> {
        self.f_number.within("lens.f_number", 0.1, 1000.0)?;
        if let Focus::DistanceM(distance) = &self.focus {
            distance.within("lens.focus.distance_m", 0.001, 1e6)?;
        }
        let key = "lens.focal_length_mm";
        let millimetres = match (self.focal_length_mm, camera) {
            (Some(_), FocalLength::Given(own)) => {
                let message = format!("the camera has `focal_length_mm = {own}` already");
                return Err(Invalid::new(key, message).help("leave it out of `lens`"));
            }
            (Some(length), _) | (None, FocalLength::Given(length) | FocalLength::Usual(length)) => length,
            (None, FocalLength::Unknown) => {
                return Err(Invalid::new("lens", "`k` and `fov_deg` do not tell how long the lens is")
                    .help("add focal_length_mm to `lens`"));
            }
        };
        if !(millimetres.is_finite() && millimetres > 0.0) {
            return Err(Invalid::new(key, format!("`{key}` is {millimetres}, and must be above zero")));
        }
        Ok(Lens { options: self, focal_length_m: millimetres / 1e3 })
    }
}

impl Lens {
    /// The lens in focus for a view. `camera` has everything but the lens.
    pub fn focused(&self, scene: &Scene, camera: &Camera, context: &Context) -> Result<ThinLens> {
        let tabletop = depth(camera, scene.tabletop.centre());
        let distance = match &self.options.focus {
            Focus::Tabletop => tabletop,
            Focus::NearestObject => nearest_object(scene, camera).unwrap_or(tabletop),
            Focus::DistanceM(distance) => distance.draw(&mut context.stream.child("focus")),
        };
        if distance <= self.focal_length_m {
            let message = format!(
                "the middle of the tabletop is {distance:.4} m before the camera, where a lens of {} mm cannot focus",
                self.focal_length_m * 1e3
            );
            return Err(Error::new(message).help("set lens.focus to another, or change the views"));
        }
        let f_number = self.options.f_number.draw(&mut context.stream.child("f_number"));
        Ok(ThinLens { aperture_radius_m: self.focal_length_m / (2.0 * f_number), focus_distance_m: distance })
    }
}

/// Depth of a point along the optical axis, metres.
fn depth(camera: &Camera, point: syntable_model::geometry::Point3<f64>) -> f64 {
    camera.world_from_camera.inverse_transform_point(&point).z
}

/// Depth of the middle of the object nearest to the camera, of those whose middle is in the picture.
fn nearest_object(scene: &Scene, camera: &Camera) -> Option<f64> {
    let (width, height) = (f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height));
    scene
        .objects()
        .iter()
        .map(|body| body.world_from_body * body.object.mesh.bounds().centre())
        .map(|middle| camera.world_from_camera.inverse_transform_point(&middle))
        .filter(|p| p.z > 0.0)
        .filter(|p| {
            let [u, v] = camera.project(p);
            (0.0..width).contains(&u) && (0.0..height).contains(&v)
        })
        .min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()))
        .map(|p| p.z)
}
