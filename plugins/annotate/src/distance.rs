//! Distance from the camera.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, DISTANCE};

/// Distance from the center of the camera to the first surface: depth along the optical axis times the length of the ray
/// whose depth is one, the lens' distortion included.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Distance {}

impl Config for Distance {
    type Stage = dyn Annotator;
    const KIND: &'static str = "distance";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for Distance {
    fn reads(&self) -> Vec<KeyId> {
        keys![DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![DISTANCE]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let depth = products.get(DEPTH)?;
        let camera = &cx.view.camera;
        let distance = |x: u32, y: u32| {
            let ray = camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5);
            ray.map_or(f32::INFINITY, |ray| (f64::from(*depth.at(x, y)) * ray.norm()) as f32)
        };
        let distance = Plane::from_fn(depth.width(), depth.height(), distance);
        products.put(DISTANCE, distance)
    }
}

register!(Distance);
