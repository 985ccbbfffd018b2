//! The paper's lights: glowing balls in a hemispherical shell beyond the cameras.

use crate::brightness::{Brightness, check_temperature, complete};
use crate::per::Per;
use crate::radius::{LightRadius, check_bounds};
use crate::shell::{HEMISPHERE_DEG, centre, direction};
use std::f64::consts::PI;
use syntable_model::photometry::{blackbody, flux_luminance, sphere_luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, SphereLight};

/// Sphere lights in a hemispherical shell beyond the cameras (SynTable, "lighting").
///
/// A light's middle is drawn as the paper draws viewpoints: uniform in direction over the upper hemisphere around the
/// point `centre_offset_m` above the tabletop, and uniform in distance. Its brightness is the illuminance in lux that
/// it alone would give, with nothing in between, at the middle of the tabletop on a plane that faces it; by
/// E = π L (r/d)² that fixes the luminance L of its surface, whatever its distance d and radius r.
///
/// The released program uses `size_m = { uniform = [0.3, 0.7] }`, mostly `count = 1` and white light, here
/// `temperature_k = 6500`. Its intensity, uniform in 0 to 30,000, is no illuminance;
/// `recipes/syntable-sim/release.toml` has 0 to 20,000 lx. Such large spheres can reach in among the cameras; with the
/// default radii they never do.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SphereLights {
    /// Whether it is drawn anew for every `view`, or once for all views of a `scene`.
    per: Per,
    /// How many lights there are.
    count: IntDist,
    /// Distance from the shell's middle: `{ beyond_views_m = [0.1, 1.1] }`, metres beyond the farthest possible
    /// camera, or `{ metres = [1.5, 2.5] }`.
    radius: LightRadius,
    /// Height of the shell's middle above the tabletop, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    centre_offset_m: f64,
    /// Elevations above the horizon of the shell's middle, degrees: smallest and largest.
    #[schemars(inner(range(min = 0.0, max = 90.0)))]
    elevation_deg: [f64; 2],
    /// Radius of each sphere, metres; larger ones cast softer shadows.
    size_m: Dist,
    /// Colour temperature, kelvin.
    temperature_k: Dist,
    /// Illuminance that each light alone gives at the middle of the tabletop on a plane facing it, lux. A light of
    /// 0 lx is left out. Uniform in 100 to 20,000 lx unless brightness is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    illuminance_lx: Option<Dist>,
    /// Luminance of the spheres' surface, nits (cd/m²); takes the place of `illuminance_lx` if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_nits: Option<Dist>,
    /// Luminous flux of each light, lumens, as on a lamp's box; in place of the above.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminous_flux_lm: Option<Dist>,
}

impl Default for SphereLights {
    fn default() -> Self {
        Self {
            per: Per::default(),
            count: IntDist::Integers(0, 2),
            radius: LightRadius::BeyondViewsM([0.1, 1.1]),
            centre_offset_m: 0.2,
            elevation_deg: HEMISPHERE_DEG,
            size_m: Dist::Uniform(0.04, 0.1),
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            illuminance_lx: None,
            luminance_nits: None,
            luminous_flux_lm: None,
        }
    }
}

impl Config for SphereLights {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "sphere_lights";
    const EXAMPLE: &'static str = "count = { integers = [0, 2] }\nradius = { beyond_views_m = [0.1, 1.1] }\n\
        temperature_k = { uniform = [2000, 6500] }\nilluminance_lx = { uniform = [100, 20000] }";

    fn completed(mut self) -> Self {
        let usual = Dist::Uniform(100.0, 20_000.0);
        complete(&mut self.illuminance_lx, &self.luminance_nits, &self.luminous_flux_lm, usual);
        self
    }

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.count.within("count", 0, 1000)?;
        self.radius.check("radius")?;
        check_bounds("centre_offset_m", "centre_offset_m", [self.centre_offset_m; 2], 0.0)?;
        check_bounds("elevation_deg", "elevation_deg", self.elevation_deg, 0.0)?;
        if self.elevation_deg[1] > 90.0 {
            return Err(Invalid::new("elevation_deg", format!("`elevation_deg = {:?}` passes 90", self.elevation_deg)));
        }
        self.size_m.within("size_m", 1e-3, 100.0)?;
        check_temperature(&self.temperature_k)?;
        let light = self.completed();
        light.brightness().check()?;
        Ok(Box::new(light))
    }
}
register!(SphereLights);

impl SphereLights {
    fn brightness(&self) -> Brightness<'_> {
        Brightness {
            illuminance_lx: self.illuminance_lx.as_ref(),
            luminance_nits: self.luminance_nits.as_ref(),
            luminous_flux_lm: self.luminous_flux_lm.as_ref(),
        }
    }
}

impl LightSampler for SphereLights {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, scene: &Scene, _: &Camera, shell: &Shell, context: &Context) -> Result<Vec<Light>> {
        let tabletop = scene.tabletop.centre();
        let [low, high] = self.radius.metres(shell);
        let count = self.count.draw(&mut context.stream.child("count"));
        let mut lights = Vec::new();
        for i in 0..count.max(0) as u64 {
            let stream = context.stream.child("light").at(i);
            let r = stream.child("distance").uniform(low, high);
            let direction = direction(self.elevation_deg, &mut stream.child("direction"));
            let position = centre(&scene.tabletop, self.centre_offset_m) + r * direction;
            let radius = self.size_m.draw(&mut stream.child("radius"));
            let distance = (position - tabletop).norm();
            if radius >= 0.99 * distance {
                let message =
                    format!("a sphere light of radius {radius:.3} m reaches the tabletop's middle at {distance:.3} m");
                return Err(Error::new(message).help("make `radius` larger or `size_m` smaller"));
            }
            let luminance = self.brightness().draw(
                &mut stream.child("brightness"),
                |lux| sphere_luminance(lux, distance, radius),
                |lumens| flux_luminance(lumens, 4.0 * PI * radius * radius),
            );
            let color = blackbody(self.temperature_k.draw(&mut stream.child("temperature")));
            if luminance > 0.0 {
                lights.push(Light::Sphere(SphereLight {
                    centre: position,
                    radius,
                    radiance: color.map(|channel| channel * luminance),
                }));
            }
        }
        Ok(lights)
    }
}
