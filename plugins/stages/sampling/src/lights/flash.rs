//! A flash on the camera.

use crate::lights::brightness::limits::TEMPERATURE_K;
use crate::lights::brightness::{Brightness, LightColor};
use std::f64::consts::PI;
use syntable_model::geometry::Point3;
use syntable_model::photometry::{flux_luminance, sphere_luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, SphereLight};

/// A flash on the camera: a small bright sphere beside the lens. It makes hard shadows beside near objects, bright reflections, and a
/// dark background.
///
/// All cameras of a rig share the flash of its first one. `brightness.illuminance_lx` is the illuminance at the center of the support,
/// such as the tabletop, on a plane that faces the flash.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Flash {
    /// Probability that a view is taken with the flash.
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
    /// Name of the support that the brightness refers to. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Position beside the lens, to the right and up in the image, meters, −1 to 1.
    #[schemars(inner(range(min = -1.0, max = 1.0)))]
    offset_m: [f64; 2],
    /// Radius of the sphere, meters, from 0.001 to 0.1.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    size_m: Dist,
    /// Color temperature, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
    /// Brightness: `{ illuminance_lx = 500 }`, `{ luminance_nits = 1000000 }` or `{ luminous_flux_lm = 100 }`.
    brightness: Brightness,
}

/// Limits of `size_m`, meters.
const SIZE_M: [f64; 2] = [1e-3, 0.1];

impl Default for Flash {
    fn default() -> Self {
        Self {
            probability: 1.0,
            support: None,
            offset_m: [-0.02, 0.01],
            size_m: Dist::Constant(0.004),
            temperature_k: Dist::Uniform(5000.0, 6500.0),
            brightness: Brightness::IlluminanceLx(Dist::LogUniform(200.0, 3000.0)),
        }
    }
}

impl Config for Flash {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "flash";
    const EXAMPLE: &'static str =
        "probability = 0.2\noffset_m = [-0.02, 0.01]\nbrightness = { illuminance_lx = { log_uniform = [200, 3000] } }";

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.size_m.within("size_m", SIZE_M[0], SIZE_M[1])?;
        LightColor { temperature_k: &self.temperature_k, tint: None }.check()?;
        self.brightness.check()?;
        Ok(Box::new(self))
    }
}
register!(Flash);

impl LightSampler for Flash {
    fn needs(&self) -> Option<Part> {
        self.support.is_none().then_some(Part::MainSupport)
    }

    fn lights(&self, scene: &Scene, camera: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let stream = &context.stream;
        if !stream.child("fires").chance(self.probability) {
            return Ok(Vec::new());
        }
        let [right, up] = self.offset_m;
        let center = camera.world_from_camera * Point3::new(right, -up, 0.0);
        let radius = self.size_m.draw(&mut stream.child("radius"));
        let distance = (scene.support(self.support.as_ref())?.center() - center).norm();
        if radius >= 0.99 * distance {
            let message =
                format!("the flash of radius {radius:.3} m is {distance:.3} m from the center of the support");
            return Err(Error::unlucky(message).help("make `size_m` smaller or the distances of [views] larger"));
        }
        let luminance = self.brightness.draw(
            &mut stream.child("brightness"),
            |lux| sphere_luminance(lux, distance, radius),
            |lumens| flux_luminance(lumens, 4.0 * PI * radius * radius),
        );
        let color = LightColor { temperature_k: &self.temperature_k, tint: None }.draw(stream);
        let radiance = color.map(|channel| channel * luminance);
        Ok(if luminance > 0.0 { vec![Light::Sphere(SphereLight { center, radius, radiance })] } else { Vec::new() })
    }
}
