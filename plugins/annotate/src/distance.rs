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
        let rays = cx.view.camera.rays();
        let distance = |x: u32, y: u32, depth: f32| {
            let of_ray = |(x, y): (f64, f64)| (f64::from(depth) * (x * x + y * y + 1.0).sqrt()) as f32;
            rays.at(x, y).map_or(f32::INFINITY, of_ray)
        };
        let distance = Plane::from_fn(depth.width(), depth.height(), |x, y| distance(x, y, *depth.at(x, y)));
        products.put(DISTANCE, distance)
    }
}

register!(Distance);
