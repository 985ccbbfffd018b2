//! Annotator `rival_boxes`: provides products that a stock plugin also provides. Only recipes with an
//! `[annotate.rival_boxes]` table use it.

use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_BOX, AMODAL_MASK, VISIBLE_BOX, VISIBLE_MASK};

/// Bounding boxes of the masks.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RivalBoxes {}

impl Config for RivalBoxes {
    type Stage = dyn ImageAnnotator;
    const KIND: &'static str = "rival_boxes";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn ImageAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ImageAnnotator for RivalBoxes {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_BOX, AMODAL_BOX]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let visible = products.get(VISIBLE_MASK)?.map(|_, mask| mask.bbox());
        products.put(VISIBLE_BOX, visible)?;
        let amodal = products.get(AMODAL_MASK)?.map(|_, mask| mask.bbox());
        products.put(AMODAL_BOX, amodal)
    }
}
register!(RivalBoxes);
