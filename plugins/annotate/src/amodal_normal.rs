//! Normals of hidden parts.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_NORMAL, COVERAGE, NORMAL};
use syntable_model::product::{Lighting, ObjectImage, ObjectImages};

/// Shading normal of every annotated object's first surface in the camera frame, where it is seen and where it is hidden, as
/// if it stood there alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmodalNormal {}

/// Normals need no light.
const NORMAL_OF_OBJECTS: Key<Plane<[f32; 3]>> = NORMAL.of_objects(Lighting::Alone);

impl Config for AmodalNormal {
    type Stage = dyn Annotator;
    const KIND: &'static str = "amodal_normal";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for AmodalNormal {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, COVERAGE, NORMAL_OF_OBJECTS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![AMODAL_NORMAL]
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (coverage, normal) = (products.get(COVERAGE)?, products.get(NORMAL_OF_OBJECTS)?);
        let atlas = Atlas::of(coverage);
        let mut images = ObjectImages::new(coverage.width(), coverage.height());
        for (id, mask) in products.get(AMODAL_MASK)?.iter() {
            let image = match atlas.tile(id) {
                Some(tile) => normals_of(tile, mask, normal),
                None => ObjectImage { x: 0, y: 0, pixels: Plane::from_vec(0, 0, Vec::new()) },
            };
            images.insert(id, image);
        }
        products.put(AMODAL_NORMAL, images)
    }
}

/// Normals of an object at the pixels of its mask, zero elsewhere.
fn normals_of(tile: &AtlasTile, mask: &Mask, normal: &Plane<[f32; 3]>) -> ObjectImage<[f32; 3]> {
    let [left, top] = [tile.window.x, tile.window.y].map(|edge| edge as u32);
    let mut pixels = Plane::from_fn(tile.window.width, tile.window.height, |_, _| [0.0; 3]);
    for pixel in mask.pixels() {
        let (x, y) = (pixel as u32 % mask.width(), pixel as u32 / mask.width());
        // The mask is of what covers the image, and so within the window.
        let (Some(x), Some(y)) = (x.checked_sub(left), y.checked_sub(top)) else { continue };
        if x < tile.window.width && y < tile.window.height {
            let at = (y * tile.window.width + x) as usize;
            pixels.data_mut()[at] = *normal.at(tile.at[0] + x, tile.at[1] + y);
        }
    }
    ObjectImage { x: left, y: top, pixels }
}

register!(AmodalNormal);
