//! Light sampler `headlight`: light from behind the camera.

use syntable_model::photometry::blackbody;
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DirectionalLight, Light};

/// Parallel light from the camera towards the scene's main support, such as the tabletop.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Headlight {
    /// Illuminance on a plane that faces the camera, lux, from 0 to 100,000.
    #[schemars(extend("minimum" = 0.0, "maximum" = 1e5))]
    illuminance_lx: Dist,
}

impl Default for Headlight {
    fn default() -> Self {
        Self { illuminance_lx: Dist::Uniform(100.0, 500.0) }
    }
}

impl Config for Headlight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "headlight";
    const EXAMPLE: &'static str = "illuminance_lx = { uniform = [100, 500] }";
    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.illuminance_lx.within("illuminance_lx", 0.0, 1e5)?;
        Ok(Box::new(self))
    }
}

impl LightSampler for Headlight {
    fn lights(&self, scene: &Scene, camera: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let illuminance = self.illuminance_lx.draw(&mut context.stream.child("illuminance"));
        let position = camera.world_from_camera.translation.vector;
        let light = DirectionalLight {
            towards: (position - scene.support(None)?.center().coords).normalize(),
            half_angle: 1.0_f64.to_radians(),
            irradiance: blackbody(5500.0).map(|channel| channel * illuminance),
        };
        Ok(vec![Light::Directional(light)])
    }
}
register!(Headlight);
