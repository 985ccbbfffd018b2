//! The sun.

use crate::lights::brightness::check_temperature;
use crate::lights::brightness::limits::{ILLUMINANCE_LX, TEMPERATURE_K};
use crate::lights::environment::DIAMETER_DEG;
use crate::lights::per::Per;
use nalgebra::Vector3;
use syntable_model::photometry::blackbody;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DirectionalLight, Light};

/// The sun or the moon: light from a small disk, infinitely far away. Walls block it: with a closed room it is outside.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sun {
    /// Whether the sun is sampled per `view` or once per `scene`.
    per: Per,
    /// Elevation above the horizon, degrees, from -90 to 90.
    #[schemars(extend("minimum" = ELEVATION_DEG[0], "maximum" = ELEVATION_DEG[1]))]
    elevation_deg: Dist,
    /// Azimuth, degrees from world x, counterclockwise seen from above, from -3600 to 3600.
    #[schemars(extend("minimum" = AZIMUTH_DEG[0], "maximum" = AZIMUTH_DEG[1]))]
    azimuth_deg: Dist,
    /// Angular diameter, degrees, from 0.01 to 90. A larger sun casts softer shadows.
    #[schemars(extend("minimum" = DIAMETER_DEG[0], "maximum" = DIAMETER_DEG[1]))]
    angular_diameter_deg: Dist,
    /// Unoccluded illuminance on a plane that faces the sun, lux, from 0 to 10⁷: 100,000 high in a clear sky. 0 leaves
    /// the sun out.
    #[schemars(extend("minimum" = ILLUMINANCE_LX[0], "maximum" = ILLUMINANCE_LX[1]))]
    illuminance_lx: Dist,
    /// Color temperature, kelvin, from 1000 to 40,000: 2500 at sunset, 5500 at noon.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
}

/// Limits of `elevation_deg`, degrees.
const ELEVATION_DEG: [f64; 2] = [-90.0, 90.0];
/// Limits of `azimuth_deg`, degrees.
const AZIMUTH_DEG: [f64; 2] = [-3600.0, 3600.0];

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

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.elevation_deg.within("elevation_deg", ELEVATION_DEG[0], ELEVATION_DEG[1])?;
        self.azimuth_deg.within("azimuth_deg", AZIMUTH_DEG[0], AZIMUTH_DEG[1])?;
        self.angular_diameter_deg.within("angular_diameter_deg", DIAMETER_DEG[0], DIAMETER_DEG[1])?;
        self.illuminance_lx.within("illuminance_lx", ILLUMINANCE_LX[0], ILLUMINANCE_LX[1])?;
        check_temperature("temperature_k", &self.temperature_k)?;
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
        let (sin, cos) = libm::sincos(draw("elevation", &self.elevation_deg).to_radians());
        let (across, along) = libm::sincos(draw("azimuth", &self.azimuth_deg).to_radians());
        let color = blackbody(draw("temperature", &self.temperature_k));
        let light = DirectionalLight {
            towards: Vector3::new(cos * along, cos * across, sin),
            half_angle: draw("diameter", &self.angular_diameter_deg).to_radians() / 2.0,
            irradiance: color.map(|channel| channel * illuminance),
        };
        Ok(if illuminance > 0.0 { vec![Light::Directional(light)] } else { Vec::new() })
    }
}
