//! View sampler `hemisphere_shell`: cameras all around and above the table, looking at its middle.

use crate::dome;
use syntable_model::geometry::{Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Cameras uniformly on a hemisphere shell above the table, all looking at the middle of the tabletop (the paper's
/// views).
///
/// Distances are uniform between the shell's radii, directions uniform on the hemisphere, whose centre is raised above
/// the tabletop.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HemisphereShell {
    /// Smallest and largest distance from the centre: { of_table = [1.0, 1.7] } in multiples of the tabletop's larger
    /// half extent, max(w/2, l/2), or { metres = [0.7, 1.4] }. The released code uses { of_table = [0.8, 1.36] }.
    radius: Radius,
    /// How far the centre lies above the tabletop, m.
    centre_offset_m: f64,
    /// Limits of the elevation above the horizon, degrees; [0, 90] is the whole hemisphere.
    #[schemars(inner(range(min = 0, max = 90)))]
    elevation_deg: [f64; 2],
    /// What the cameras look at.
    look_at: Target,
}

/// The radii of a shell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Radius {
    /// In multiples of the tabletop's larger half extent, max(w/2, l/2).
    OfTable([f64; 2]),
    /// In metres.
    Metres([f64; 2]),
}

/// What cameras look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// The middle of the tabletop.
    TabletopCentre,
    /// The middle of the bounding box of all objects.
    ObjectsCentre,
}

impl Default for HemisphereShell {
    fn default() -> Self {
        Self {
            radius: Radius::OfTable([1.0, 1.7]),
            centre_offset_m: 0.2,
            elevation_deg: [0.0, 90.0],
            look_at: Target::TabletopCentre,
        }
    }
}

impl Config for HemisphereShell {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "hemisphere_shell";
    const EXAMPLE: &'static str =
        "radius = { of_table = [1.0, 1.7] }\ncentre_offset_m = 0.2\nlook_at = \"tabletop_centre\"";
    fn build(self) -> Result<Box<dyn ViewSampler>, Invalid> {
        let (Radius::OfTable([low, high]) | Radius::Metres([low, high])) = self.radius;
        if !(low > 0.0 && low <= high && high.is_finite()) {
            return Err(Invalid::new("radius", format!("`radius` from {low} to {high} is no shell"))
                .help("write two numbers above zero, the smaller first"));
        }
        let [low, high] = self.elevation_deg;
        if low > high {
            return Err(Invalid::new("elevation_deg", format!("`elevation_deg = [{low}, {high}]` is empty"))
                .help("write the smaller bound first"));
        }
        Ok(Box::new(self))
    }
}
register!(HemisphereShell);

impl ViewSampler for HemisphereShell {
    fn pose(&self, scene: &Scene, _: ViewId, context: &Context) -> Result<Pose> {
        let shell = self.shell(scene);
        let height = self.elevation_deg.map(|deg| deg.to_radians().sin());
        let eye = dome::point(shell.centre, shell.radius, height, &mut context.stream.clone());
        let target = match self.look_at {
            Target::TabletopCentre => scene.tabletop.centre(),
            Target::ObjectsCentre => {
                let boxes = scene.objects().iter().map(|body| {
                    let corners = body.object.mesh.bounds().corners();
                    syntable_model::geometry::Aabb::of(corners.map(|p| body.world_from_body * p))
                });
                boxes.reduce(|a, b| a.union(b)).map_or(scene.tabletop.centre(), |all| all.centre())
            }
        };
        Ok(look_at(eye, target, Vector3::z()))
    }

    fn shell(&self, scene: &Scene) -> Shell {
        let radius = match self.radius {
            Radius::OfTable(factors) => factors.map(|factor| factor * scene.tabletop.half_extent()),
            Radius::Metres(metres) => metres,
        };
        Shell { centre: dome::centre(&scene.tabletop, self.centre_offset_m), radius }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::{Collected, NoCache, Serial};
    use syntable_model::geometry::Point3;
    use syntable_testing::{assets::NoAssets, scenes};

    #[test]
    fn views_lie_on_the_shell_and_look_at_the_middle() {
        let scene = scenes::boxes(&[([0.0, 0.0, 0.05], [0.1; 3])]);
        let sampler = HemisphereShell { elevation_deg: [30.0, 60.0], ..Default::default() }.build().expect("sound");
        let shell = sampler.shell(&scene);
        // The test table is 2 m × 2 m, so max(w/2, l/2) is 1 m.
        assert_eq!(shell, Shell { centre: Point3::new(0.0, 0.0, 0.2), radius: [1.0, 1.7] });
        let intrinsics = scenes::view([1.0; 3], [0.0; 3], [640, 480], 70.0).camera.intrinsics;
        let log = Collected::default();
        for seed in 0..200 {
            let stream = Stream::root(seed);
            let context = Context { stream, assets: &NoAssets, cache: &NoCache, workers: &Serial, log: &log };
            let pose = sampler.pose(&scene, ViewId(0), &context).expect("posed");
            let from_centre = pose.translation.vector - shell.centre.coords;
            assert!((1.0..1.7).contains(&from_centre.norm()));
            let elevation = (from_centre.z / from_centre.norm()).asin().to_degrees();
            assert!((29.999..60.001).contains(&elevation), "{elevation}");
            let [u, v] = intrinsics.project(&(pose.inverse() * scene.tabletop.centre()));
            assert!((u - 320.0).abs() < 1e-6 && (v - 240.0).abs() < 1e-6, "{u} {v}");
        }
    }

    #[test]
    fn empty_shells_are_refused() {
        for (text, key) in [
            ("radius = { metres = [2.0, 1.0] }", "radius"),
            ("radius = { of_table = [0.0, 1.0] }", "radius"),
            ("elevation_deg = [50.0, 40.0]", "elevation_deg"),
        ] {
            let config: HemisphereShell = toml::from_str(text).expect("well-formed");
            assert_eq!(config.build().err().expect("empty").key, key);
        }
    }
}
