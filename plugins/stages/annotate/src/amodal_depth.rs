//! Depth of hidden parts.

use syntable_model::prelude::*;
use syntable_model::product::ObjectImages;
use syntable_model::product::standard::{AMODAL_DEPTH, AMODAL_MASK, OBJECT_DEPTHS};

/// Depth of every annotated object's first surface, visible or hidden, as if the object were alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmodalDepth {}

config!(AmodalDepth => dyn ImageAnnotator, "amodal_depth");

impl ImageAnnotator for AmodalDepth {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![AMODAL_DEPTH]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let (masks, hits) = (products.get(AMODAL_MASK)?, products.get(OBJECT_DEPTHS)?);
        let images = ObjectImages::of_hits(masks, hits, f32::INFINITY, |_| |_, depth| depth);
        products.put(AMODAL_DEPTH, images)
    }
}

register!(AmodalDepth);
