//! Differences between objects of one asset: their size, their colors and their materials.

use crate::material::{MaterialReplacement, always};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use syntable_mesh::mass::within_estimates;
use syntable_mesh::size;
use syntable_model::context::Assets;
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Object, Recolor};

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

/// The options of a placer that make its objects differ from their assets.
#[derive(Debug, Clone, Copy)]
pub struct Variation<'o> {
    /// Factor of the size.
    pub scale: Option<&'o Dist>,
    /// Change of the colors.
    pub color: Option<&'o ColorChange>,
    /// Replacement of the material.
    pub material: Option<&'o MaterialReplacement>,
}

impl Variation<'_> {
    /// Refuses values outside of their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.scale.map_or(Ok(()), |scale| scale.within("scale", SCALE[0], SCALE[1]))?;
        self.color.map_or(Ok(()), ColorChange::check)?;
        self.material.map_or(Ok(()), MaterialReplacement::check)
    }

    /// Whether some object has another size than its asset.
    pub fn resizes(&self) -> bool {
        self.scale.is_some_and(|scale| scale.range() != (1.0, 1.0))
    }

    /// Draws the factor of an object's size.
    pub fn factor(&self, stream: &Stream) -> f64 {
        self.scale.map_or(1.0, |scale| scale.draw(&mut stream.child("scale")))
    }

    /// Draws the material and the colors of a body.
    pub fn painted(&self, body: BodyDraft, assets: &dyn Assets, stream: &Stream) -> Result<BodyDraft> {
        let material = match self.material {
            Some(other) => other.draw(assets, &stream.child("surface"))?,
            None => None,
        };
        let recolor = self.color.and_then(|color| color.draw(&stream.child("color")));
        Ok(body.with_material_override(material).with_recolor(recolor))
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
