//! Annotator `mean_area`: a number for the whole dataset.

use crate::visible_area::VISIBLE_AREA;
use syntable_model::prelude::*;

products! {
    /// Mean number of visible pixels of an object, over all views of the dataset.
    pub const MEAN_AREA: Key<Value> = dataset("mean_area").unit("px");
}

/// Averages the visible areas of all objects in all views.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeanArea {}

impl Config for MeanArea {
    type Stage = dyn DatasetAnnotator;
    const KIND: &'static str = "mean_area";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn DatasetAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl DatasetAnnotator for MeanArea {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_AREA]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![MEAN_AREA]
    }

    fn annotate(
        &self,
        _: &DatasetContext,
        scenes: &mut dyn Iterator<Item = Result<RecordedScene>>,
        products: &mut Products,
    ) -> Result<()> {
        let (mut pixels, mut objects) = (0.0, 0.0);
        for scene in scenes {
            // The records are JSON: an object with a number for each id.
            for view in scene?.view_values {
                let areas = view.get(VISIBLE_AREA.name()).and_then(|value| value.as_object());
                for area in areas.into_iter().flat_map(|areas| areas.values()).filter_map(|area| area.as_f64()) {
                    pixels += area;
                    objects += 1.0;
                }
            }
        }
        products.put(MEAN_AREA, Value::from(if objects > 0.0 { pixels / objects } else { 0.0 }))
    }
}
register!(MeanArea);
