//! Views evenly spaced on a circle around a support.

use crate::common::shell::center;
use crate::views::look_at::LookAt;
use crate::views::radius::ViewDistance;
use nalgebra::{Point3, Vector3};
use syntable_model::geometry::look_at;
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Camera positions on a circle around a support such as the table: view `i` is at azimuth `start_deg + i · step_deg`, at a constant
/// elevation and distance. Positions are not random. With a positive step, views go counterclockwise seen from above.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Orbit {
    /// Name of the support that the cameras look at. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Distance from the center of the orbit: `{ of_table = 1.35 }`, a multiple of max(w/2, l/2), or
    /// `{ meters = 1.0 }`.
    distance: ViewDistance,
    /// Height of the center of the orbit above the support, meters.
    #[schemars(range(min = 0.0, max = 100.0))]
    center_offset_m: f64,
    /// Elevation above the horizon, seen from the center of the orbit, degrees.
    #[schemars(range(min = 0.0, max = 90.0))]
    elevation_deg: f64,
    /// Azimuth of the first view, degrees from world x, counterclockwise seen from above.
    #[schemars(range(min = -3600.0, max = 3600.0))]
    start_deg: f64,
    /// Azimuth from one view to the next, degrees; 0 keeps the camera in place.
    #[schemars(range(min = -3600.0, max = 3600.0))]
    step_deg: f64,
    /// The point that the camera looks at.
    look_at: LookAt,
}

impl Default for Orbit {
    fn default() -> Self {
        Self {
            support: None,
            distance: ViewDistance::OfTable(1.35),
            center_offset_m: 0.2,
            elevation_deg: 40.0,
            start_deg: 0.0,
            step_deg: 30.0,
            look_at: LookAt::TabletopCenter,
        }
    }
}

impl Config for Orbit {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "orbit";
    const EXAMPLE: &'static str = "distance = { meters = 1.2 }\nelevation_deg = 35\nstep_deg = 30";
    const RENAMED: &[(&str, &str)] = &[("centre_offset_m", "center_offset_m"), ("distance.metres", "distance.meters")];

    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        Ok(Box::new(self))
    }
}
register!(Orbit);

impl ViewSampler for Orbit {
    fn needs(&self) -> Option<Part> {
        self.support.is_none().then_some(Part::MainSupport)
    }

    fn pose(&self, scene: &Scene, view: ViewId, context: &Context) -> Result<Pose> {
        let support = scene.support(self.support.as_ref())?;
        let r = self.distance.in_meters(support);
        let azimuth = (self.start_deg + self.step_deg * f64::from(view.0)).to_radians();
        let (sin, cos) = libm::sincos(self.elevation_deg.to_radians());
        let direction = Vector3::new(cos * libm::cos(azimuth), cos * libm::sin(azimuth), sin);
        let eye = center(support, self.center_offset_m) + r * direction;
        let mut stream = context.stream.child("look_at");
        Ok(look_at(eye, self.look_at.point(scene, support, self.center_offset_m, &mut stream), Vector3::z()))
    }

    fn target(&self, scene: &Scene, _: ViewId) -> Option<Point3<f64>> {
        let support = scene.support(self.support.as_ref()).ok()?;
        self.look_at.fixed(scene, support, self.center_offset_m)
    }

    fn shell(&self, scene: &Scene) -> Result<Shell> {
        let support = scene.support(self.support.as_ref())?;
        let radius = [self.distance.in_meters(support); 2];
        Ok(Shell { center: center(support, self.center_offset_m), radius })
    }
}
