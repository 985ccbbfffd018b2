//! The paper's lights: spheres in a hemispherical shell beyond the cameras.

use crate::common::bounds::check_order;
use crate::common::shell::{ALL_AROUND, HEMISPHERE_DEG, center, direction};
use crate::lights::brightness::limits::{TEMPERATURE_K, TINT};
use crate::lights::brightness::{Brightness, LightColor};
use crate::lights::per::Per;
use std::f64::consts::PI;
use syntable_model::photometry::{flux_luminance, sphere_luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, SphereLight};

/// Spherical lights in a hemispherical shell beyond the cameras (SynTable, "lighting").
///
/// The center of a light is sampled as the paper samples viewpoints: uniform in direction over the upper hemisphere
/// around the point `center_offset_m` above the support, such as the tabletop, and uniform in distance. An illuminance E fixes the luminance
/// L of the sphere whatever its distance d and radius r: E = π L (r/d)².
///
/// The released program uses `size_m = { uniform = [0.3, 0.7] }`, mostly `count = 1` and white light, here
/// `temperature_k = 6500`. Its intensity, uniform in 0 to 30,000, is not an illuminance;
/// `recipes/syntable-sim/release.toml` has 0 to 20,000 lx. Spheres that large can be between the cameras; with the
/// default radii they never are.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SphereLights {
    /// Whether lights are sampled per `view` or once per `scene`.
    per: Per,
    /// Name of the support that the lights are around. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Number of lights, from 0 to 1000.
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Smallest and largest distance from the center of the shell: `{ beyond_views_m = [0.1, 1.1] }`, meters beyond the
    /// farthest possible camera, or `{ meters = [1.5, 2.5] }`.
    radius: LightRadius,
    /// Height of the center of the shell above the support, meters.
    #[schemars(range(min = 0.0, max = 100.0))]
    center_offset_m: f64,
    /// Smallest and largest elevation above the horizon, seen from the center of the shell, degrees.
    #[schemars(inner(range(min = 0.0, max = 90.0)))]
    elevation_deg: [f64; 2],
    /// Radius of each sphere, meters, from 0.001 to 100. Larger spheres cast softer shadows.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    size_m: Dist,
    /// Color temperature, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
    /// Factor of the light's red, green and blue, drawn for each of the three, 0 to 1: `{ uniform = [0.5, 1] }` gives pale colors. A
    /// filter darkens: `brightness` is the brightness without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = TINT[0], "maximum" = TINT[1]))]
    tint: Option<Dist>,
    /// Brightness of each light: `{ illuminance_lx = 500 }`, `{ luminance_nits = 10000 }` or
    /// `{ luminous_flux_lm = 800 }`. A light of zero brightness is left out.
    brightness: Brightness,
}

/// Limits of `count`.
const COUNT: [i64; 2] = [0, 1000];
/// Limits of `size_m`, meters.
const SIZE_M: [f64; 2] = [1e-3, 100.0];

/// Smallest and largest distance of lights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum LightRadius {
    /// Meters beyond the largest possible distance of a camera, from 0 to 1000.
    BeyondViewsM(#[schemars(inner(range(min = 0.0, max = 1000.0)))] [f64; 2]),
    /// Meters, from 0.001 to 1000.
    Meters(#[schemars(inner(range(min = 0.001, max = 1000.0)))] [f64; 2]),
}

impl LightRadius {
    /// The bounds for the shell of the cameras, meters.
    fn in_meters(self, views: &Shell) -> [f64; 2] {
        match self {
            Self::BeyondViewsM(beyond) => beyond.map(|meters| views.radius[1] + meters),
            Self::Meters(meters) => meters,
        }
    }

    /// Rejects bounds in the wrong order.
    fn check(self) -> Result<(), ConfigError> {
        match self {
            Self::BeyondViewsM(bounds) => check_order("radius.beyond_views_m", bounds),
            Self::Meters(bounds) => check_order("radius.meters", bounds),
        }
    }
}

impl Default for SphereLights {
    fn default() -> Self {
        Self {
            per: Per::default(),
            support: None,
            count: IntDist::Integers(0, 2),
            radius: LightRadius::BeyondViewsM([0.1, 1.1]),
            center_offset_m: 0.2,
            elevation_deg: HEMISPHERE_DEG,
            size_m: Dist::Uniform(0.04, 0.1),
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            tint: None,
            brightness: Brightness::IlluminanceLx(Dist::Uniform(100.0, 20_000.0)),
        }
    }
}

impl Config for SphereLights {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "sphere_lights";
    const EXAMPLE: &'static str = "count = { integers = [0, 2] }\nradius = { beyond_views_m = [0.1, 1.1] }\n\
        temperature_k = { uniform = [2000, 6500] }\nbrightness = { illuminance_lx = { uniform = [100, 20000] } }";
    const RENAMED: &[(&str, &str)] = &[
        ("centre_offset_m", "center_offset_m"),
        ("radius.metres", "radius.meters"),
        ("illuminance_lx", "brightness.illuminance_lx"),
        ("luminance_nits", "brightness.luminance_nits"),
        ("luminous_flux_lm", "brightness.luminous_flux_lm"),
    ];

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.count.within("count", COUNT[0], COUNT[1])?;
        self.radius.check()?;
        check_order("elevation_deg", self.elevation_deg)?;
        self.size_m.within("size_m", SIZE_M[0], SIZE_M[1])?;
        self.color().check()?;
        self.brightness.check()?;
        Ok(Box::new(self))
    }
}
register!(SphereLights);

impl SphereLights {
    fn color(&self) -> LightColor<'_> {
        LightColor { temperature_k: &self.temperature_k, tint: self.tint.as_ref() }
    }
}

impl LightSampler for SphereLights {
    fn needs(&self) -> Option<Part> {
        self.support.is_none().then_some(Part::MainSupport)
    }

    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, scene: &Scene, _: &Camera, shell: &Shell, context: &Context) -> Result<Vec<Light>> {
        let support = scene.support(self.support.as_ref())?;
        let lit = support.center();
        let [low, high] = self.radius.in_meters(shell);
        let count = self.count.draw(&mut context.stream.child("count"));
        let mut lights = Vec::new();
        for i in 0..count.max(0) as u64 {
            let stream = context.stream.child("light").at(i);
            let r = stream.child("distance").uniform(low, high);
            let direction = direction(self.elevation_deg, ALL_AROUND, &mut stream.child("direction"));
            let position = center(support, self.center_offset_m) + r * direction;
            let radius = self.size_m.draw(&mut stream.child("radius"));
            let distance = (position - lit).norm();
            if radius >= 0.99 * distance {
                let message = format!(
                    "a sphere light of radius {radius:.3} m reaches the center of the {}, {distance:.3} m away",
                    support.name
                );
                return Err(Error::unlucky(message).help("make `radius` larger or `size_m` smaller"));
            }
            let luminance = self.brightness.draw(
                &mut stream.child("brightness"),
                |lux| sphere_luminance(lux, distance, radius),
                |lumens| flux_luminance(lumens, 4.0 * PI * radius * radius),
            );
            let color = self.color().draw(&stream);
            if luminance > 0.0 {
                lights.push(Light::Sphere(SphereLight {
                    center: position,
                    radius,
                    radiance: color.map(|channel| channel * luminance),
                }));
            }
        }
        Ok(lights)
    }
}
