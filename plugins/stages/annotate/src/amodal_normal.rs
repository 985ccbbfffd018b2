//! Normals of hidden parts.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_NORMAL, COVERAGE, NORMAL};
use syntable_model::product::{Lighting, ObjectImage, ObjectImages};

/// Shading normal of every annotated object's first surface in the camera frame, visible or hidden, as if the object
/// were alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmodalNormal {}

/// Normals need no light.
const NORMAL_OF_OBJECTS: Key<Plane<[f32; 3]>> = NORMAL.of_objects(Lighting::Alone);

config!(AmodalNormal => dyn ViewAnnotator, "amodal_normal");

impl ViewAnnotator for AmodalNormal {
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
                None => ObjectImage::of_mask(mask, [0.0; 3], |_| None),
            };
            images.insert(id, image);
        }
        products.put(AMODAL_NORMAL, images)
    }
}

/// Normals of an object at the pixels of its mask, zero elsewhere.
fn normals_of(tile: &AtlasTile, mask: &Mask, normal: &Plane<[f32; 3]>) -> ObjectImage<[f32; 3]> {
    let window = tile.window;
    let (columns, rows) = (window.x..window.x + window.width as i32, window.y..window.y + window.height as i32);
    ObjectImage::of_mask(mask, [0.0; 3], |pixel| {
        let [x, y] = [pixel as u32 % mask.width(), pixel as u32 / mask.width()].map(|edge| edge as i32);
        // The mask only contains pixels of the image, so they are within the window.
        let is_there = columns.contains(&x) && rows.contains(&y);
        is_there.then(|| *normal.at(tile.at[0] + (x - window.x) as u32, tile.at[1] + (y - window.y) as u32))
    })
}

register!(AmodalNormal);
