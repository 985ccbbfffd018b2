//! Light from all around: a map, or the same from everywhere.

use crate::brightness::check_temperature;
use std::sync::Arc;
use syntable_model::names::EnvironmentPool;
use syntable_model::photometry::{blackbody, level_irradiance, luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, EnvironmentLight, EnvironmentMap, Light};

/// Light from all around, drawn anew for every view: an environment map, turned about the vertical at random, or an
/// even sky. It shines where no body is in the way, and is what the camera sees there: with a closed room it is
/// outside; without one it is the background.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Pools that the map is drawn from, uniformly over all their entries. Without any, the same light comes from
    /// everywhere.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    from: Vec<EnvironmentPool>,
    /// Turn of the map about the vertical, degrees, anticlockwise seen from above; any angle by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    rotation_deg: Option<Dist>,
    /// Illuminance that it alone gives on a level plane without obstacles, lux. The map is scaled to it; its colours
    /// and contrasts stay. Log-uniform in 300 to 10,000 lx unless brightness is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    illuminance_lx: Option<Dist>,
    /// Nits of a texel of one, in place of `illuminance_lx`: 1 for maps in absolute units.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_scale: Option<Dist>,
    /// Colour temperature of even light, kelvin, without `from`; 5000 to 8000 K by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature_k: Option<Dist>,
}

impl Config for Environment {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "environment";
    const EXAMPLE: &'static str = "from = [\"skies\"]\nilluminance_lx = { log_uniform = [300, 10000] }";

    fn completed(mut self) -> Self {
        if self.luminance_scale.is_none() {
            self.illuminance_lx.get_or_insert(Dist::LogUniform(300.0, 10_000.0));
        }
        if self.from.is_empty() {
            self.temperature_k.get_or_insert(Dist::Uniform(5000.0, 8000.0));
        } else {
            self.rotation_deg.get_or_insert(Dist::Uniform(0.0, 360.0));
        }
        self
    }

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        let light = self.completed();
        if let Some(temperature) = &light.temperature_k {
            if !light.from.is_empty() {
                return Err(Invalid::new("temperature_k", "maps have their own colours")
                    .help("leave out `from` for even light, or `temperature_k`"));
            }
            check_temperature(temperature)?;
        }
        if light.illuminance_lx.is_some() && light.luminance_scale.is_some() {
            let message = "brightness is given by `illuminance_lx` and by `luminance_scale`";
            return Err(Invalid::new("luminance_scale", message).help("keep one of them"));
        }
        light.illuminance_lx.as_ref().map_or(Ok(()), |lux| lux.within("illuminance_lx", 0.0, 1e7))?;
        light.luminance_scale.as_ref().map_or(Ok(()), |scale| scale.within("luminance_scale", 0.0, 1e9))?;
        light.rotation_deg.as_ref().map_or(Ok(()), |turn| turn.within("rotation_deg", -3600.0, 3600.0))?;
        Ok(Box::new(light))
    }
}
register!(Environment);

impl LightSampler for Environment {
    fn lights(&self, _: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let draw =
            |name: &str, dist: &Option<Dist>| dist.as_ref().map(|dist| dist.draw(&mut context.stream.child(name)));
        let (map, color) = match draw("temperature", &self.temperature_k) {
            Some(kelvin) => (Arc::new(EnvironmentMap::constant([1.0; 3])), blackbody(kelvin)),
            None => {
                let (_, map) = context.assets.draw_environment(&self.from, &mut context.stream.child("asset"))?;
                (map, [1.0; 3])
            }
        };
        let nits = match draw("brightness", &self.illuminance_lx) {
            Some(lux) => {
                let per_unit = luminance(level_irradiance(&map));
                if lux > 0.0 && per_unit <= 0.0 {
                    let message = format!("the environment map `{}` gives no light from above", map.name);
                    return Err(Error::new(message).help("leave it out, or set luminance_scale for illuminance_lx"));
                }
                if lux > 0.0 { lux / per_unit } else { 0.0 }
            }
            None => draw("brightness", &self.luminance_scale).unwrap_or(0.0),
        };
        let rotation = draw("rotation", &self.rotation_deg).unwrap_or(0.0).to_radians();
        let light = EnvironmentLight { map, scale: color.map(|channel| channel * nits), rotation };
        Ok(if nits > 0.0 { vec![Light::Environment(light)] } else { Vec::new() })
    }
}
