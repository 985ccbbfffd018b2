//! Views evenly spaced on a circle around the table.

use crate::hemisphere_shell::LookAt;
use crate::radius::{ViewDistance, ViewRadius, check_bounds};
use crate::shell::centre;
use nalgebra::Vector3;
use syntable_model::geometry::look_at;
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Views on a circle around the table: view `i` stands at azimuth `start_deg + i · step_deg`, at one elevation and
/// distance. Nothing is random, and views turn anticlockwise seen from above.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Orbit {
    /// Distance from the orbit's middle: `{ of_table = 1.35 }`, multiples of max(w/2, l/2), or `{ metres = 1.0 }`.
    distance: ViewDistance,
    /// Height of the orbit's middle above the tabletop, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    centre_offset_m: f64,
    /// Elevation above the horizon, degrees.
    #[schemars(range(min = 0.0, max = 90.0))]
    elevation_deg: f64,
    /// Azimuth of the first view, degrees from world x.
    start_deg: f64,
    /// Azimuth from one view to the next, degrees.
    step_deg: f64,
    /// What the camera looks at.
    look_at: LookAt,
}

impl Default for Orbit {
    fn default() -> Self {
        Self {
            distance: ViewDistance::OfTable(1.35),
            centre_offset_m: 0.2,
            elevation_deg: 40.0,
            start_deg: 0.0,
            step_deg: 30.0,
            look_at: LookAt::Tabletop,
        }
    }
}

impl Config for Orbit {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "orbit";
    const EXAMPLE: &'static str = "distance = { metres = 1.2 }\nelevation_deg = 35\nstep_deg = 30";

    fn build(self) -> Result<Box<dyn ViewSampler>, Invalid> {
        ViewRadius::from(self.distance).check("distance")?;
        check_bounds("centre_offset_m", "centre_offset_m", [self.centre_offset_m; 2], 0.0)?;
        for (key, degrees) in
            [("elevation_deg", self.elevation_deg), ("start_deg", self.start_deg), ("step_deg", self.step_deg)]
        {
            if !degrees.is_finite() {
                return Err(Invalid::new(key, format!("`{key} = {degrees}` is not finite")));
            }
        }
        if !(0.0..=90.0).contains(&self.elevation_deg) {
            let message = format!("`elevation_deg = {}` is outside 0 to 90", self.elevation_deg);
            return Err(Invalid::new("elevation_deg", message));
        }
        Ok(Box::new(self))
    }
}
register!(Orbit);

impl ViewSampler for Orbit {
    fn pose(&self, scene: &Scene, view: ViewId, _: &Context) -> Result<Pose> {
        let [r, _] = ViewRadius::from(self.distance).metres(&scene.tabletop);
        let azimuth = (self.start_deg + self.step_deg * f64::from(view.0)).to_radians();
        let (sin, cos) = self.elevation_deg.to_radians().sin_cos();
        let direction = Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
        let eye = centre(&scene.tabletop, self.centre_offset_m) + r * direction;
        Ok(look_at(eye, self.look_at.point(scene, self.centre_offset_m), Vector3::z()))
    }

    fn shell(&self, scene: &Scene) -> Shell {
        let radius = ViewRadius::from(self.distance).metres(&scene.tabletop);
        Shell { centre: centre(&scene.tabletop, self.centre_offset_m), radius }
    }
}
