//! Annotator `centroid`: the center of the visible part of each object.

use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;

products! {
    /// Mean position (u, v) of an object's visible pixel centers, from the image's top-left corner.
    pub const CENTROID: Key<PerInstance<Value>> = view("centroid").unit("px");
}

/// Computes the centroid of each object's visible mask. Objects without a visible pixel have none.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Centroid {}

impl Config for Centroid {
    type Stage = dyn ImageAnnotator;
    const KIND: &'static str = "centroid";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn ImageAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ImageAnnotator for Centroid {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CENTROID]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let visible = products.get(VISIBLE_MASK)?.iter().filter(|(_, mask)| !mask.is_empty());
        let centroids: PerInstance<Value> = visible.map(|(id, mask)| (id, Value::from(center(mask)))).collect();
        products.put(CENTROID, centroids)
    }
}
register!(Centroid);

fn center(mask: &Mask) -> [f64; 2] {
    let height = f64::from(mask.height());
    let mut sum = [0.0; 2];
    for position in mask.runs().flatten().map(f64::from) {
        let column = (position / height).floor();
        sum[0] += column + 0.5;
        sum[1] += position - column * height + 0.5;
    }
    sum.map(|total| total / f64::from(mask.area()))
}
