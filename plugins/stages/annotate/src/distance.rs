//! Distance from the camera.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, DISTANCE};

/// Distance from the center of the camera to the first surface: the depth along the optical axis times the length of
/// the ray at depth one, with lens distortion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Distance {}

config!(Distance => dyn ViewAnnotator, "distance");

impl ViewAnnotator for Distance {
    fn reads(&self) -> Vec<KeyId> {
        keys![DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![DISTANCE]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let depth = products.get(DEPTH)?;
        let rays = cx.view.camera.rays();
        let of_ray = |((&depth, x), y): ((&f32, f64), f64)| {
            let distance = (f64::from(depth) * (x * x + y * y + 1.0).sqrt()) as f32;
            if x.is_nan() { f32::INFINITY } else { distance }
        };
        let mut distance = Vec::with_capacity(depth.data().len());
        for (y, depths) in (0..).zip(depth.data().chunks(depth.width().max(1) as usize)) {
            let (right, down) = rays.row(y);
            distance.extend(depths.iter().zip(right).zip(down).map(of_ray));
        }
        products.put(DISTANCE, Plane::from_vec(depth.width(), depth.height(), distance))
    }
}

register!(Distance);
