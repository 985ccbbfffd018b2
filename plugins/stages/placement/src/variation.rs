//! Differences between objects of one asset: their size, their colors and their materials.

use crate::material::{MaterialReplacement, always};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use syntable_mesh::mass::within_estimates;
use syntable_mesh::size;
use syntable_model::context::Assets;
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Finish, Object, Recolor};

/// Limits of the factor of an object's size.
pub const SCALE: [f64; 2] = [0.01, 100.0];

/// Limits of turns of the hue, degrees.
const HUE_DEG: [f64; 2] = [-360.0, 360.0];

/// Limits of the factors of saturation and brightness.
const COLOR_FACTOR: [f64; 2] = [0.0, 10.0];

/// Changes the base colors of an object. Textures, vertex colors and constant colors change alike; shininess, light that is emitted
/// and the tint inside of glass stay.
///
/// The hue turns a linear Rec. 709 color `c` about the gray axis, and then adds gray so that its luminance `Y` stays: `h = R c + Y(c)
/// − Y(R c)`. The saturation scales the distance from gray: `s = Y(h) + saturation · (h − Y(h))`. The brightness multiplies:
/// `brightness · s`. The result is clamped to [0, 1]. Gray has no hue, and changes in brightness alone.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColorChange {
    /// Turn of the hue, degrees, −360 to 360: 120 makes red green.
    #[schemars(extend("minimum" = HUE_DEG[0], "maximum" = HUE_DEG[1]))]
    hue_deg: Dist,
    /// Factor of the distance from gray, 0 to 10: 0 gives gray, 1 changes nothing.
    #[schemars(extend("minimum" = COLOR_FACTOR[0], "maximum" = COLOR_FACTOR[1]))]
    saturation: Dist,
    /// Factor of the linear color, 0 to 10.
    #[schemars(extend("minimum" = COLOR_FACTOR[0], "maximum" = COLOR_FACTOR[1]))]
    brightness: Dist,
    /// Probability that the colors of an object change.
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
}

impl Default for ColorChange {
    fn default() -> Self {
        let [hue_deg, factor] = [0.0, 1.0].map(Dist::Constant);
        Self { hue_deg, saturation: factor.clone(), brightness: factor, probability: always() }
    }
}

impl ColorChange {
    /// Refuses distributions that leave their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.hue_deg.within("color.hue_deg", HUE_DEG[0], HUE_DEG[1])?;
        self.saturation.within("color.saturation", COLOR_FACTOR[0], COLOR_FACTOR[1])?;
        self.brightness.within("color.brightness", COLOR_FACTOR[0], COLOR_FACTOR[1])
    }

    /// Draws the change of an object; `None` if it keeps its colors.
    pub fn draw(&self, stream: &Stream) -> Option<Recolor> {
        let draw = |dist: &Dist, name: &str| dist.draw(&mut stream.child(name));
        stream.child("change").chance(self.probability).then(|| Recolor {
            hue_deg: draw(&self.hue_deg, "hue"),
            saturation: draw(&self.saturation, "saturation"),
            brightness: draw(&self.brightness, "brightness"),
        })
    }
}

/// Limits of the parts of a finish.
const FINISH: [f64; 2] = [0.0, 1.0];

/// Changes how the materials of an object reflect light. Each part replaces the values and textures of all its materials; parts that
/// are left out stay. Colors, normal maps and the roughness of a clearcoat stay.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FinishChange {
    /// Perceptual roughness, 0 to 1: 0 is a mirror.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FINISH[0], "maximum" = FINISH[1]))]
    roughness: Option<Dist>,
    /// Reflectance at normal incidence, 0 to 1, as a fraction of 8 %: 0.5 reflects 4 %, as most plastics do. This is `Specular` of
    /// Blender's Principled BSDF. Glass keeps its index of refraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FINISH[0], "maximum" = FINISH[1]))]
    specular: Option<Dist>,
    /// 0 for plastic and the like, 1 for metal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FINISH[0], "maximum" = FINISH[1]))]
    metallic: Option<Dist>,
    /// Probability that the finish of an object changes.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
}

impl FinishChange {
    /// Refuses distributions that leave their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        let parts = [("roughness", &self.roughness), ("specular", &self.specular), ("metallic", &self.metallic)];
        if parts.iter().all(|(_, dist)| dist.is_none()) {
            let message = "the finish states none of its parts";
            return Err(ConfigError::new("finish", message).help("set `roughness`, `specular` or `metallic`"));
        }
        let within = |(name, dist): (&str, &Option<Dist>)| {
            dist.as_ref().map_or(Ok(()), |dist| dist.within(&format!("finish.{name}"), FINISH[0], FINISH[1]))
        };
        parts.into_iter().try_for_each(within)
    }

    /// Draws the finish of an object; `None` if it keeps its own.
    pub fn draw(&self, stream: &Stream) -> Option<Finish> {
        let draw = |dist: &Option<Dist>, name: &str| Some(dist.as_ref()?.draw(&mut stream.child(name)));
        stream.child("change").chance(self.probability).then(|| Finish {
            roughness: draw(&self.roughness, "roughness"),
            specular: draw(&self.specular, "specular"),
            metallic: draw(&self.metallic, "metallic"),
        })
    }
}

/// The options of a placer that make its objects differ from their assets.
#[derive(Debug, Clone, Copy)]
pub struct Variation<'o> {
    /// Factor of the size.
    pub scale: Option<&'o Dist>,
    /// Change of the colors.
    pub color: Option<&'o ColorChange>,
    /// Replacement of the material.
    pub material: Option<&'o MaterialReplacement>,
    /// Change of the finish.
    pub finish: Option<&'o FinishChange>,
}

impl Variation<'_> {
    /// Refuses values outside of their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.scale.map_or(Ok(()), |scale| scale.within("scale", SCALE[0], SCALE[1]))?;
        self.color.map_or(Ok(()), ColorChange::check)?;
        self.material.map_or(Ok(()), MaterialReplacement::check)?;
        self.finish.map_or(Ok(()), FinishChange::check)
    }

    /// Whether some object has another size than its asset.
    pub fn resizes(&self) -> bool {
        self.scale.is_some_and(|scale| scale.range() != (1.0, 1.0))
    }

    /// Draws the factor of an object's size.
    pub fn factor(&self, stream: &Stream) -> f64 {
        self.scale.map_or(1.0, |scale| scale.draw(&mut stream.child("scale")))
    }

    /// Draws the material, the colors and the finish of a body.
    pub fn painted(&self, body: BodyDraft, assets: &dyn Assets, stream: &Stream) -> Result<BodyDraft> {
        let material = match self.material {
            Some(other) => other.draw(assets, &stream.child("surface"))?,
            None => None,
        };
        let recolor = self.color.and_then(|color| color.draw(&stream.child("color")));
        let finish = self.finish.and_then(|finish| finish.draw(&stream.child("finish")));
        Ok(body.with_material_override(material).with_recolor(recolor).with_finish(finish))
    }
}

/// An object at a factor of its size. Its density stays, so its mass has the cube of the factor, and an estimated mass stays within
/// the limits of estimates. A scene with an object of a size that no object has is drawn again.
pub fn resized(object: Arc<Object>, factor: f64) -> Result<Arc<Object>> {
    if factor == 1.0 {
        return Ok(object);
    }
    size::check_resized(object.mesh.bounds().size().max(), factor)?;
    let object = object.resized(factor)?;
    Ok(Arc::new(Object { mass: within_estimates(object.mass), ..object }))
}
