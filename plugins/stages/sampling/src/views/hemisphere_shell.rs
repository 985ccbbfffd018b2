//! The paper's views: anywhere in a hemispherical shell around a support.

use crate::common::bounds::check_order;
use crate::common::shell::{ALL_AROUND, HEMISPHERE_DEG, center, direction};
use crate::views::look_at::{LookAt, rolled};
use crate::views::radius::ViewRadius;
use nalgebra::{Point3, Vector3};
use syntable_model::geometry::look_at;
use syntable_model::prelude::*;
use syntable_model::scene::{Support, ViewId};

/// Camera positions in a hemispherical shell above a support such as the table (SynTable, "viewpoints"): uniform in direction and in
/// distance, looking at the center of the tabletop.
///
/// With w and l the tabletop's extents and h its height: r is uniform in 1.0 to 1.7 times max(w/2, l/2), and the
/// camera is at (r sin θ cos φ, r sin θ sin φ, r cos θ + h + 0.2 m) with φ = 2πu and θ = acos(1 − v). The released
/// program uses `radius = { of_table = [0.8, 1.36] }`. Nothing keeps the camera out of walls and objects; with the
/// default room and tables up to 4 m it stays inside the room.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HemisphereShell {
    /// Name of the support that the cameras look at. If left out, it is the first that a step of `[[place]]` sets. If it is the name
    /// of several supports, such as the boards of a shelf, the views of a scene take them in turn, and the first view of each scene takes the next one.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Smallest and largest distance from the center of the shell: `{ of_table = [1.0, 1.7] }`, multiples of
    /// max(w/2, l/2), or `{ meters = [0.7, 1.4] }`.
    radius: ViewRadius,
    /// Height of the center of the shell above the support, meters.
    #[schemars(range(min = 0.0, max = 100.0))]
    center_offset_m: f64,
    /// Smallest and largest elevation above the horizon, seen from the center of the shell, degrees.
    #[schemars(inner(range(min = 0.0, max = 90.0)))]
    elevation_deg: [f64; 2],
    /// Smallest and largest azimuth, counterclockwise seen from above, against the first edge of the support, degrees. A shelf is open
    /// towards −90°. All around by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = -360.0, max = 360.0))))]
    azimuth_deg: Option<[f64; 2]>,
    /// The point that the camera looks at, such as `"objects_center"`, or `{ near_mean_of = 15 }` for an object that each view draws.
    look_at: LookAt,
    /// Rotation of the camera about its optical axis, degrees; positive is clockwise seen from behind the camera.
    roll_deg: Dist,
}

impl Default for HemisphereShell {
    fn default() -> Self {
        Self {
            support: None,
            radius: ViewRadius::OfTable([1.0, 1.7]),
            center_offset_m: 0.2,
            elevation_deg: HEMISPHERE_DEG,
            azimuth_deg: None,
            look_at: LookAt::TabletopCenter,
            roll_deg: Dist::Constant(0.0),
        }
    }
}

impl Config for HemisphereShell {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "hemisphere_shell";
    const EXAMPLE: &'static str =
        "radius = { of_table = [1.0, 1.7] }\ncenter_offset_m = 0.2\nlook_at = \"tabletop_center\"";
    const RENAMED: &[(&str, &str)] = &[("centre_offset_m", "center_offset_m"), ("radius.metres", "radius.meters")];

    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        self.radius.check("radius")?;
        check_order("elevation_deg", self.elevation_deg)?;
        self.azimuth_deg.map_or(Ok(()), |azimuth| check_order("azimuth_deg", azimuth))?;
        Ok(Box::new(self))
    }
}
register!(HemisphereShell);

impl HemisphereShell {
    /// The support that a view looks at.
    fn support_of<'s>(&self, scene: &'s Scene, view: ViewId) -> Result<&'s Support> {
        let group = scene.supports.group(self.support.as_ref())?;
        Ok(group[(scene.id.0 as usize + view.0 as usize) % group.len()])
    }
}

impl ViewSampler for HemisphereShell {
    fn needs(&self) -> Option<Part> {
        self.support.is_none().then_some(Part::MainSupport)
    }

    fn pose(&self, scene: &Scene, view: ViewId, context: &Context) -> Result<Pose> {
        let support = self.support_of(scene, view)?;
        let [low, high] = self.radius.in_meters(support);
        let r = context.stream.child("radius").uniform(low, high);
        let azimuth =
            self.azimuth_deg.map_or(ALL_AROUND, |azimuth| azimuth.map(|it| it.to_radians() + support.surface.yaw()));
        let direction = direction(self.elevation_deg, azimuth, &mut context.stream.child("direction"));
        let eye = center(support, self.center_offset_m) + r * direction;
        let target = self.look_at.point(scene, support, self.center_offset_m, &mut context.stream.child("look_at"));
        let roll = self.roll_deg.draw(&mut context.stream.child("roll"));
        Ok(rolled(look_at(eye, target, Vector3::z()), roll))
    }

    fn target(&self, scene: &Scene, view: ViewId) -> Option<Point3<f64>> {
        let support = self.support_of(scene, view).ok()?;
        self.look_at.fixed(scene, support, self.center_offset_m)
    }

    fn shell(&self, scene: &Scene) -> Result<Shell> {
        let group = scene.supports.group(self.support.as_ref())?;
        let shell = |support: &&Support| (center(support, self.center_offset_m), self.radius.in_meters(support));
        let shells: Vec<(Point3<f64>, [f64; 2])> = group.iter().map(shell).collect();
        if let [(center, radius)] = shells[..] {
            return Ok(Shell { center, radius });
        }
        // One shell around the shells of all supports.
        let sum: Vector3<f64> = shells.iter().map(|(center, _)| center.coords).sum();
        let middle = Point3::from(sum / shells.len() as f64);
        let low = shells.iter().map(|(center, [low, _])| low - (center - middle).norm()).fold(f64::INFINITY, f64::min);
        let high = shells.iter().map(|(center, [_, high])| high + (center - middle).norm()).fold(0.0, f64::max);
        Ok(Shell { center: middle, radius: [low.max(0.0), high] })
    }
}
