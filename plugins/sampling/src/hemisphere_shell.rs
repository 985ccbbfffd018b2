//! The paper's views: anywhere in a hemispherical shell around the table.

use crate::radius::{ViewRadius, check_bounds};
use crate::shell::{HEMISPHERE_DEG, centre, direction};
use nalgebra::{Point3, Vector3};
use syntable_model::geometry::{Aabb, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Views from a hemispherical shell above the table (SynTable, "viewpoints"): uniform in direction and in distance,
/// looking at the middle of the tabletop.
///
/// With w and l the tabletop's extents and h its height: r is uniform in 1.0 to 1.7 times max(w/2, l/2), and the
/// camera stands at (r sin θ cos φ, r sin θ sin φ, r cos θ + h + 0.2 m) with φ = 2πu and θ = acos(1 − v). The released
/// program uses `radius = { of_table = [0.8, 1.36] }`. Nothing keeps the camera out of walls or objects; with the
/// default room and tables up to 4 m it stays inside the room.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HemisphereShell {
    /// Distance from the shell's middle: `{ of_table = [1.0, 1.7] }`, multiples of max(w/2, l/2), or
    /// `{ metres = [0.7, 1.4] }`.
    radius: ViewRadius,
    /// Height of the shell's middle above the tabletop, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    centre_offset_m: f64,
    /// Elevations above the horizon of the shell's middle, degrees: smallest and largest.
    #[schemars(inner(range(min = 0.0, max = 90.0)))]
    elevation_deg: [f64; 2],
    /// What the camera looks at.
    look_at: LookAt,
    /// Rotation of the picture about the optical axis, degrees; positive turns the camera clockwise.
    roll_deg: Dist,
}

/// What a camera looks at.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum LookAt {
    /// The middle of the tabletop, (0, 0, h).
    #[default]
    #[serde(rename = "tabletop_centre")]
    Tabletop,
    /// The middle of the shell, `centre_offset_m` above the tabletop.
    #[serde(rename = "shell_centre")]
    Shell,
    /// The middle of the box around all objects.
    #[serde(rename = "objects_centre")]
    Objects,
}

impl LookAt {
    /// The point.
    pub fn point(self, scene: &Scene, centre_offset_m: f64) -> Point3<f64> {
        match self {
            Self::Tabletop => scene.tabletop.centre(),
            Self::Shell => centre(&scene.tabletop, centre_offset_m),
            Self::Objects => {
                let corners = scene
                    .objects()
                    .iter()
                    .flat_map(|body| body.object.mesh.bounds().corners().map(|p| body.world_from_body * p));
                Aabb::of(corners).centre()
            }
        }
    }
}

impl Default for HemisphereShell {
    fn default() -> Self {
        Self {
            radius: ViewRadius::OfTable([1.0, 1.7]),
            centre_offset_m: 0.2,
            elevation_deg: HEMISPHERE_DEG,
            look_at: LookAt::Tabletop,
            roll_deg: Dist::Constant(0.0),
        }
    }
}

impl Config for HemisphereShell {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "hemisphere_shell";
    const EXAMPLE: &'static str =
        "radius = { of_table = [1.0, 1.7] }\ncentre_offset_m = 0.2\nlook_at = \"tabletop_centre\"";

    fn build(self) -> Result<Box<dyn ViewSampler>, Invalid> {
        self.radius.check("radius")?;
        check_bounds("elevation_deg", "elevation_deg", self.elevation_deg, 0.0)?;
        if self.elevation_deg[1] > 90.0 {
            return Err(Invalid::new("elevation_deg", format!("`elevation_deg = {:?}` passes 90", self.elevation_deg)));
        }
        check_bounds("centre_offset_m", "centre_offset_m", [self.centre_offset_m; 2], 0.0)?;
        Ok(Box::new(self))
    }
}
register!(HemisphereShell);

impl ViewSampler for HemisphereShell {
    fn pose(&self, scene: &Scene, _: ViewId, context: &Context) -> Result<Pose> {
        let [low, high] = self.radius.metres(&scene.tabletop);
        let r = context.stream.child("radius").uniform(low, high);
        let direction = direction(self.elevation_deg, &mut context.stream.child("direction"));
        let eye = centre(&scene.tabletop, self.centre_offset_m) + r * direction;
        let target = self.look_at.point(scene, self.centre_offset_m);
        let roll = self.roll_deg.draw(&mut context.stream.child("roll"));
        Ok(rolled(look_at(eye, target, Vector3::z()), roll))
    }

    fn shell(&self, scene: &Scene) -> Shell {
        Shell { centre: centre(&scene.tabletop, self.centre_offset_m), radius: self.radius.metres(&scene.tabletop) }
    }
}

/// A camera turned about its optical axis, clockwise seen from behind it; the picture turns the other way.
pub fn rolled(world_from_camera: Pose, degrees: f64) -> Pose {
    world_from_camera * Pose::rotation(Vector3::new(0.0, 0.0, degrees.to_radians()))
}
