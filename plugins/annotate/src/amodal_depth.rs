//! Depth of hidden parts.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_DEPTH, AMODAL_MASK, OBJECT_DEPTHS};
use syntable_model::product::{ObjectImage, ObjectImages};

/// Depth of every annotated object's first surface, where it is seen and where it is hidden, as if it stood there alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmodalDepth {}

impl Config for AmodalDepth {
    type Stage = dyn Annotator;
    const KIND: &'static str = "amodal_depth";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for AmodalDepth {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![AMODAL_DEPTH]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let depths = products.get(OBJECT_DEPTHS)?;
        let mut images = ObjectImages::within(f32::INFINITY, depths.width(), depths.height());
        for (id, mask) in products.get(AMODAL_MASK)?.iter() {
            images.insert(id, ObjectImage::of_mask(mask, f32::INFINITY, |pixel| depths.of(id, pixel)));
        }
        products.put(AMODAL_DEPTH, images)
    }
}

register!(AmodalDepth);
