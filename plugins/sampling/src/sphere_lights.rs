//! Light sampler `sphere_lights`: glowing balls around the table, beyond the cameras.

use crate::{colour, dome};
use syntable_model::photometry::sphere_luminance;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, SphereLight};

/// Glowing balls on a hemisphere shell around the table, beyond the cameras (the paper's sphere lights).
///
/// The released code uses `count = 1`, `size_m = { uniform = [0.3, 0.7] }` and 6500 K.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SphereLights {
    /// How many.
    count: IntDist,
    /// Distance from the shell's centre: { beyond_views_m = [0.1, 1.1] } beyond the farthest camera, or
    /// { metres = [1.5, 2.5] }.
    radius: Radius,
    /// Radius of each ball, m.
    size_m: Dist,
    /// Colour temperature, K.
    temperature_k: Dist,
    /// Illuminance that each light alone gives, unoccluded, at the middle of the tabletop on a plane facing it, lx.
    illuminance_lx: Dist,
}

/// The distances of lights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Radius {
    /// Beyond the largest distance of the scene's cameras, m.
    BeyondViewsM([f64; 2]),
    /// From the centre of the cameras' shell, m.
    Metres([f64; 2]),
}

impl Default for SphereLights {
    fn default() -> Self {
        Self {
            count: IntDist::Integers(0, 2),
            radius: Radius::BeyondViewsM([0.1, 1.1]),
            size_m: Dist::Uniform(0.05, 0.3),
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            illuminance_lx: Dist::Uniform(100.0, 20000.0),
        }
    }
}

impl Config for SphereLights {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "sphere_lights";
    const EXAMPLE: &'static str = "count = { integers = [0, 2] }\nradius = { beyond_views_m = [0.1, 1.1] }\n\
        temperature_k = { uniform = [2000, 6500] }\nilluminance_lx = { uniform = [100, 20000] }";
    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.count.within("count", 0, 64)?;
        self.size_m.within("size_m", 1e-3, 100.0)?;
        self.temperature_k.within("temperature_k", 1000.0, 40000.0)?;
        self.illuminance_lx.within("illuminance_lx", 0.0, 1e6)?;
        let (Radius::BeyondViewsM([low, high]) | Radius::Metres([low, high])) = self.radius;
        if !(low >= 0.0 && low <= high && high.is_finite()) {
            return Err(Invalid::new("radius", format!("`radius` from {low} to {high} is no shell"))
                .help("write two numbers, the smaller first"));
        }
        Ok(Box::new(self))
    }
}
register!(SphereLights);

impl LightSampler for SphereLights {
    fn lights(&self, scene: &Scene, _: &Camera, shell: &Shell, context: &Context) -> Result<Vec<Light>> {
        let count = self.count.draw(&mut context.stream.child("count"));
        let target = scene.tabletop.centre();
        let range = match self.radius {
            Radius::BeyondViewsM(beyond) => beyond.map(|metres| shell.radius[1] + metres),
            Radius::Metres(metres) => metres,
        };
        Ok((0..count)
            .map(|i| {
                let mut stream = context.stream.at(i as u64);
                let centre = dome::point(shell.centre, range, [0.0, 1.0], &mut stream);
                let distance = (centre - target).norm();
                // A ball that would swallow the table's middle is made smaller.
                let radius = self.size_m.draw(&mut stream).min(0.5 * distance);
                let kelvin = self.temperature_k.draw(&mut stream);
                let luminance = sphere_luminance(self.illuminance_lx.draw(&mut stream), distance, radius);
                Light::Sphere(SphereLight { centre, radius, radiance: colour::radiance(luminance, kelvin) })
            })
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::{Collected, NoCache, Serial};
    use syntable_model::geometry::Point3;
    use syntable_model::photometry::luminance;
    use syntable_testing::{assets::NoAssets, scenes};

    #[test]
    fn balls_lie_beyond_the_cameras_and_give_their_lux() {
        let scene = scenes::boxes(&[([0.0, 0.0, 0.05], [0.1; 3])]);
        let view = scenes::view([1.0, 0.0, 1.0], [0.0; 3], [64, 48], 60.0);
        let shell = Shell { centre: Point3::new(0.0, 0.0, 0.2), radius: [1.0, 1.7] };
        let config: SphereLights =
            toml::from_str("count = 3\nilluminance_lx = 900.0\ntemperature_k = 4000.0").expect("well-formed");
        let sampler = config.build().expect("sound");
        let log = Collected::default();
        for seed in 0..50 {
            let stream = Stream::root(seed);
            let context = Context { stream, assets: &NoAssets, cache: &NoCache, workers: &Serial, log: &log };
            let lights = sampler.lights(&scene, &view.camera, &shell, &context).expect("lit");
            assert_eq!(lights.len(), 3);
            for light in lights {
                let Light::Sphere(ball) = light else { panic!("a ball, not {light:?}") };
                let beyond = (ball.centre - shell.centre).norm() - 1.7;
                assert!((0.1..1.1).contains(&beyond) && ball.centre.z >= 0.2, "{ball:?}");
                // E = ∫ L cos θ dω over the cone that the ball fills, summed in rings.
                let sine = ball.radius / (ball.centre - scene.tabletop.centre()).norm();
                let n = 10_000;
                let lux: f64 = (0..n)
                    .map(|i| {
                        let (a, b) =
                            (sine.asin() * f64::from(i) / f64::from(n), sine.asin() * f64::from(i + 1) / f64::from(n));
                        let middle = (a + b) / 2.0;
                        luminance(ball.radiance) * middle.cos() * middle.sin() * (b - a) * std::f64::consts::TAU
                    })
                    .sum();
                assert!((lux / 900.0 - 1.0).abs() < 1e-5, "{lux} lx");
            }
        }
    }
}
