//! Light from all directions: an environment map, or constant radiance.

use crate::lights::brightness::check_temperature;
use crate::lights::brightness::limits::{ILLUMINANCE_LX, TEMPERATURE_K};
use crate::lights::per::Per;
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::geometry::{Rotation3, Vector3};
use syntable_model::photometry::{blackbody, level_irradiance, luminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DirectionalLight, EnvironmentLight, EnvironmentMap, Light};

/// Light from infinitely far away in every direction: an environment map, rotated about the vertical at random, or a
/// constant radiance. It lights the scene and is the background. Walls block it: with a closed room it is outside.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Whether the light is sampled per `view` or once per `scene`.
    per: Per,
    /// Source of the light: `{ map = { from = ["skies"] } }`, or `{ constant = {} }` for the same radiance from all
    /// directions.
    source: LightSource,
    /// Brightness: `{ illuminance_lx = 5000 }`, or `{ luminance_scale = 1 }` for maps in absolute units.
    brightness: EnvironmentBrightness,
}

/// Source of the light of an environment.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum LightSource {
    /// An environment map from a pool.
    Map(MapSource),
    /// The same radiance from every direction.
    Constant(ConstantSource),
}

impl Default for LightSource {
    fn default() -> Self {
        Self::Constant(ConstantSource::default())
    }
}

/// A randomly rotated environment map.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MapSource {
    /// Pools of environment maps.
    from: EnvironmentPools,
    /// Rotation of the map about the vertical, degrees, counterclockwise seen from above, from -3600 to 3600. Uniform
    /// over the full circle by default.
    #[serde(default = "full_circle")]
    #[schemars(extend("minimum" = ROTATION_DEG[0], "maximum" = ROTATION_DEG[1]))]
    rotation_deg: Dist,
    /// Adds a sun in the brightest direction above the horizon, for maps that do not show the solar disk, such as
    /// `{ ratio = 4 }`. It rotates with the map. Not for overcast skies or photographs of sunny days.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sun: Option<SunInMap>,
}

/// Limits of `rotation_deg`, degrees.
const ROTATION_DEG: [f64; 2] = [-3600.0, 3600.0];

fn full_circle() -> Dist {
    Dist::Uniform(0.0, 360.0)
}

/// The same radiance from every direction.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct ConstantSource {
    /// Color temperature, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
}

impl Default for ConstantSource {
    fn default() -> Self {
        Self { temperature_k: Dist::Uniform(5000.0, 8000.0) }
    }
}

/// The sun in a map that does not show its disk.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SunInMap {
    /// Ratio of the illuminance on a plane that faces the sun to the illuminance of the map on a horizontal plane, from
    /// 0 to 1000: 1 in haze, 6 in a clear sky.
    #[schemars(extend("minimum" = RATIO[0], "maximum" = RATIO[1]))]
    ratio: Dist,
    /// Angular diameter, degrees, from 0.01 to 90. A larger sun casts softer shadows.
    #[schemars(extend("minimum" = DIAMETER_DEG[0], "maximum" = DIAMETER_DEG[1]))]
    angular_diameter_deg: Dist,
    /// Color temperature, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
}

/// Limits of `ratio`.
const RATIO: [f64; 2] = [0.0, 1000.0];
/// Limits of `angular_diameter_deg`, degrees.
pub(super) const DIAMETER_DEG: [f64; 2] = [0.01, 90.0];

impl Default for SunInMap {
    fn default() -> Self {
        Self {
            ratio: Dist::Uniform(1.0, 6.0),
            angular_diameter_deg: Dist::Constant(0.53),
            temperature_k: Dist::Uniform(4000.0, 5800.0),
        }
    }
}

/// Brightness of an environment, as an illuminance or as a scale.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum EnvironmentBrightness {
    /// Unoccluded illuminance on a horizontal plane, lux, from 0 to 10⁷. A map is scaled to it; its hues and contrast
    /// stay.
    IlluminanceLx(#[schemars(extend("minimum" = ILLUMINANCE_LX[0], "maximum" = ILLUMINANCE_LX[1]))] Dist),
    /// Luminance of a texel of value 1, nits (cd/m²), from 0 to 10⁹: 1 for maps in absolute units.
    LuminanceScale(#[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))] Dist),
}

/// Limits of `luminance_scale`, nits.
const SCALE: [f64; 2] = [0.0, 1e9];

impl Default for EnvironmentBrightness {
    fn default() -> Self {
        Self::IlluminanceLx(Dist::LogUniform(300.0, 10_000.0))
    }
}

impl Config for Environment {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "environment";
    const EXAMPLE: &'static str =
        "source = { map = { from = [\"skies\"] } }\nbrightness = { illuminance_lx = { log_uniform = [300, 10000] } }";
    const RENAMED: &'static [(&'static str, &'static str)] = &[
        ("from", "source.map.from"),
        ("rotation_deg", "source.map.rotation_deg"),
        ("sun", "source.map.sun"),
        ("temperature_k", "source.constant.temperature_k"),
        ("illuminance_lx", "brightness.illuminance_lx"),
        ("luminance_scale", "brightness.luminance_scale"),
    ];

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        match &self.source {
            LightSource::Map(map) => map.check()?,
            LightSource::Constant(constant) => {
                check_temperature("source.constant.temperature_k", &constant.temperature_k)?;
            }
        }
        match &self.brightness {
            EnvironmentBrightness::IlluminanceLx(lux) => {
                lux.within("brightness.illuminance_lx", ILLUMINANCE_LX[0], ILLUMINANCE_LX[1])?;
            }
            EnvironmentBrightness::LuminanceScale(scale) => {
                scale.within("brightness.luminance_scale", SCALE[0], SCALE[1])?;
            }
        }
        Ok(Box::new(self))
    }
}
register!(Environment);

impl MapSource {
    fn check(&self) -> Result<(), ConfigError> {
        self.rotation_deg.within("source.map.rotation_deg", ROTATION_DEG[0], ROTATION_DEG[1])?;
        let Some(sun) = &self.sun else { return Ok(()) };
        sun.ratio.within("source.map.sun.ratio", RATIO[0], RATIO[1])?;
        let key = "source.map.sun.angular_diameter_deg";
        sun.angular_diameter_deg.within(key, DIAMETER_DEG[0], DIAMETER_DEG[1])?;
        check_temperature("source.map.sun.temperature_k", &sun.temperature_k)
    }
}

impl LightSampler for Environment {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, _: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let draw = |name: &str, dist: &Dist| dist.draw(&mut context.stream.child(name));
        let (map, color, rotation, sun) = match &self.source {
            LightSource::Constant(constant) => {
                let color = blackbody(draw("temperature", &constant.temperature_k));
                (Arc::new(EnvironmentMap::constant([1.0; 3])), color, 0.0, None)
            }
            LightSource::Map(source) => {
                let (_, map) = context.assets.draw_environment(&source.from, &mut context.stream.child("asset"))?;
                (map, [1.0; 3], draw("rotation", &source.rotation_deg).to_radians(), source.sun.as_ref())
            }
        };
        let nits = match &self.brightness {
            EnvironmentBrightness::IlluminanceLx(lux) => scale_to(draw("brightness", lux), &map)?,
            EnvironmentBrightness::LuminanceScale(scale) => draw("brightness", scale),
        };
        if nits <= 0.0 {
            return Ok(Vec::new());
        }
        let mut lights = Vec::new();
        if let Some(sun) = sun {
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

/// Radiance, nits, of a texel of value 1 for which a map has this illuminance on a horizontal plane.
fn scale_to(lux: f64, map: &EnvironmentMap) -> Result<f64> {
    if lux <= 0.0 {
        return Ok(0.0);
    }
    let per_unit = luminance(level_irradiance(map));
    if per_unit <= 0.0 {
        let message = format!("the environment map `{}` has no light above the horizon", map.name);
        return Err(Error::unlucky(message).help("remove it from its pool, or set brightness.luminance_scale"));
    }
    Ok(lux / per_unit)
}

/// The brightest direction of a map above the horizon: the mean over all texels within 1 % of the maximum, so that the
/// sun is at the center of a wide bright patch.
fn brightest(map: &EnvironmentMap) -> Vector3<f64> {
    let (width, height) = (map.width() as usize, map.height() as usize);
    let above = || map.texels().iter().take(width * (height / 2).max(1)).enumerate();
    let value = |texel: &[f32; 3]| luminance(texel.map(f64::from));
    let most = above().map(|(_, texel)| value(texel)).fold(0.0, f64::max);
    let mut sum = Vector3::zeros();
    for (i, _) in above().filter(|(_, texel)| value(texel) >= 0.99 * most) {
        let center = |at: usize, count: usize| (at as f64 + 0.5) / count as f64;
        let solid_angle = libm::sin(PI * center(i / width, height));
        sum += EnvironmentMap::direction([center(i % width, width), center(i / width, height)]) * solid_angle;
    }
    sum.try_normalize(1e-12).unwrap_or_else(Vector3::z)
}
