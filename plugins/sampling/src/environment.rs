//! Light from all around: a map, or the same from everywhere.

use crate::brightness::check_temperature;
use crate::per::Per;
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::geometry::{Rotation3, Vector3};
use syntable_model::names::EnvironmentPool;
use syntable_model::photometry::{blackbody, level_irradiance, luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DirectionalLight, EnvironmentLight, EnvironmentMap, Light};

/// Light from all around: an environment map, turned about the vertical at random, or an
/// even sky. It shines where no body is in the way, and is what the camera sees there: with a closed room it is
/// outside; without one it is the background.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Whether it is drawn anew for every `view`, or once for all views of a `scene`.
    per: Per,
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
    /// Nits of a texel of value 1, in place of `illuminance_lx`: 1 for maps in absolute units.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_scale: Option<Dist>,
    /// Colour temperature of even light, kelvin, without `from`; 5000 to 8000 K by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature_k: Option<Dist>,
    /// A sun where the map is brightest above the horizon, for maps without its disc, such as `{ ratio = 4 }`. It turns
    /// with the map. For skies that show where the sun is: not for overcast ones, nor for photographs of sunny days.
    #[serde(skip_serializing_if = "Option::is_none")]
    sun: Option<SunInSky>,
}

/// The sun of a map that does not show its disc.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SunInSky {
    /// Illuminance on a plane that faces the sun against that of the map on a level plane: 1 in haze, 6 in a clear sky.
    ratio: Dist,
    /// Angle under which it is seen, degrees.
    angular_diameter_deg: Dist,
    /// Colour temperature, kelvin.
    temperature_k: Dist,
}

impl Default for SunInSky {
    fn default() -> Self {
        Self {
            ratio: Dist::Uniform(1.0, 6.0),
            angular_diameter_deg: Dist::Constant(0.53),
            temperature_k: Dist::Uniform(4000.0, 5800.0),
        }
    }
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
        if let Some(sun) = &light.sun {
            if light.from.is_empty() {
                return Err(Invalid::new("sun", "even light from everywhere has no place for a sun")
                    .help("name a pool of maps in `from`, or add [[lights]] kind = \"sun\""));
            }
            sun.ratio.within("sun.ratio", 0.0, 1000.0)?;
            sun.angular_diameter_deg.within("sun.angular_diameter_deg", 0.01, 90.0)?;
            sun.temperature_k.within("sun.temperature_k", 1000.0, 40_000.0)?;
        }
        light.rotation_deg.as_ref().map_or(Ok(()), |turn| turn.within("rotation_deg", -3600.0, 3600.0))?;
        Ok(Box::new(light))
    }
}
register!(Environment);

impl LightSampler for Environment {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

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
        if nits <= 0.0 {
            return Ok(Vec::new());
        }
        let mut lights = Vec::new();
        if let Some(sun) = &self.sun {
            let stream = context.stream.child("sun");
            let facing = sun.ratio.draw(&mut stream.child("ratio")) * nits * luminance(level_irradiance(&map));
            let color = blackbody(sun.temperature_k.draw(&mut stream.child("temperature")));
            if facing > 0.0 {
                lights.push(Light::Directional(DirectionalLight {
                    towards: Rotation3::from_axis_angle(&Vector3::z_axis(), rotation) * brightest(&map),
                    half_angle: sun.angular_diameter_deg.draw(&mut stream.child("diameter")).to_radians() / 2.0,
                    irradiance: color.map(|channel| channel * facing),
                }));
            }
        }
        let scale = color.map(|channel| channel * nits);
        lights.push(Light::Environment(EnvironmentLight { map, scale, rotation }));
        Ok(lights)
    }
}

/// The direction above the horizon in which a map is brightest: the mean of all texels within 1 % of the brightest, so
/// that a wide bright patch has its sun in the middle.
fn brightest(map: &EnvironmentMap) -> Vector3<f64> {
    let (width, height) = (map.width() as usize, map.height() as usize);
    let above = || map.texels().iter().take(width * (height / 2).max(1)).enumerate();
    let value = |texel: &[f32; 3]| luminance(texel.map(f64::from));
    let most = above().map(|(_, texel)| value(texel)).fold(0.0, f64::max);
    let mut sum = Vector3::zeros();
    for (i, _) in above().filter(|(_, texel)| value(texel) >= 0.99 * most) {
        let middle = |at: usize, count: usize| (at as f64 + 0.5) / count as f64;
        let solid_angle = (PI * middle(i / width, height)).sin();
        sum += EnvironmentMap::direction([middle(i % width, width), middle(i / width, height)]) * solid_angle;
    }
    sum.try_normalize(1e-12).unwrap_or_else(Vector3::z)
}
