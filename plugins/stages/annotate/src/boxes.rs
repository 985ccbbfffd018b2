//! Boxes around the masks.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_BOX, AMODAL_MASK, VISIBLE_BOX, VISIBLE_MASK};

/// Tight bounding boxes of the visible and amodal masks: first column, first row, width and height in pixels, with
/// width = last − first + 1. The box of an empty mask is all zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Boxes {}

config!(Boxes => dyn ImageAnnotator, "boxes");

impl ImageAnnotator for Boxes {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_BOX, AMODAL_BOX]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let visible = products.get(VISIBLE_MASK)?.map(|_, mask| mask.bbox());
        let amodal = products.get(AMODAL_MASK)?.map(|_, mask| mask.bbox());
        products.put(VISIBLE_BOX, visible)?;
        products.put(AMODAL_BOX, amodal)
    }
}

register!(Boxes);
