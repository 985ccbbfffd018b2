//! Annotator `visible_area`: the number of visible pixels of each object.

use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;

products! {
    /// Visible pixels of each object, counted at pixel centers.
    pub const VISIBLE_AREA: Key<PerInstance<u32>> = view("visible_area").unit("px");
}

/// Counts the visible pixels of every object.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VisibleArea {
    /// Objects with fewer visible pixels are left out.
    min_pixels: u32,
}

impl Config for VisibleArea {
    type Stage = dyn ImageAnnotator;
    const KIND: &'static str = "visible_area";
    const EXAMPLE: &'static str = "min_pixels = 16";
    fn build(self) -> Result<Box<dyn ImageAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ImageAnnotator for VisibleArea {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK]
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_AREA]
    }
    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let mut pixels = products.get(VISIBLE_MASK)?.map(|_, mask| mask.area());
        pixels.0.retain(|_, pixels| *pixels >= self.min_pixels);
        products.put(VISIBLE_AREA, pixels)
    }
}
register!(VisibleArea);
