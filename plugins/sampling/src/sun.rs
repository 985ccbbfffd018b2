//! The sun.

use crate::brightness::check_temperature;
use crate::per::Per;
use nalgebra::Vector3;
use syntable_model::photometry::blackbody;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DirectionalLight, Light};

/// The sun, or the moon: light from a small round patch of the sky. It shines through
/// nothing: with a closed room it is outside.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sun {
    /// Whether it is drawn anew for every `view`, or once for all views of a `scene`.
    per: Per,
    /// Elevation above the horizon, degrees.
    elevation_deg: Dist,
    /// Direction that it stands in, degrees from world x, anticlockwise seen from above.
    azimuth_deg: Dist,
    /// Angle under which it is seen, degrees. A larger one makes softer shadows.
    angular_diameter_deg: Dist,
    /// Illuminance on a plane that faces it, lux: 100,000 for the sun high in a clear sky. With 0 lx there is no light.
    illuminance_lx: Dist,
    /// Colour temperature, kelvin: 2500 at sunset, 5500 at noon.
    temperature_k: Dist,
}

impl Default for Sun {
    fn default() -> Self {
        Self {
            per: Per::default(),
            elevation_deg: Dist::Uniform(15.0, 70.0),
            azimuth_deg: Dist::Uniform(0.0, 360.0),
            angular_diameter_deg: Dist::Constant(0.53),
            illuminance_lx: Dist::Uniform(20_000.0, 100_000.0),
            temperature_k: Dist::Uniform(4000.0, 5800.0),
        }
    }
}

impl Config for Sun {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "sun";
    const EXAMPLE: &'static str =
        "elevation_deg = { uniform = [20, 60] }\nilluminance_lx = { uniform = [20000, 90000] }";

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.elevation_deg.within("elevation_deg", -90.0, 90.0)?;
        self.azimuth_deg.within("azimuth_deg", -3600.0, 3600.0)?;
        self.angular_diameter_deg.within("angular_diameter_deg", 0.01, 90.0)?;
        self.illuminance_lx.within("illuminance_lx", 0.0, 1e7)?;
        check_temperature(&self.temperature_k)?;
        Ok(Box::new(self))
    }
}
register!(Sun);

impl LightSampler for Sun {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, _: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let draw = |name: &str, dist: &Dist| dist.draw(&mut context.stream.child(name));
        let illuminance = draw("brightness", &self.illuminance_lx);
        let (sin, cos) = draw("elevation", &self.elevation_deg).to_radians().sin_cos();
        let (across, along) = draw("azimuth", &self.azimuth_deg).to_radians().sin_cos();
        let color = blackbody(draw("temperature", &self.temperature_k));
        let light = DirectionalLight {
            towards: Vector3::new(cos * along, cos * across, sin),
            half_angle: draw("diameter", &self.angular_diameter_deg).to_radians() / 2.0,
            irradiance: color.map(|channel| channel * illuminance),
        };
        Ok(if illuminance > 0.0 { vec![Light::Directional(light)] } else { Vec::new() })
    }
}
