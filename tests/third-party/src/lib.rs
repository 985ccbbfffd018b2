//! Annotator `centroid`: the middle of what is seen of each object.

use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;

/// Mean position (u, v) of an object's visible pixel centres, px from the top-left corner.
pub const CENTROID: Key<PerInstance<Value>> = Key::view("centroid", "mean (u, v) of the visible pixels, px");

/// The middle of what is seen of each object; objects with no visible pixel have none.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Centroid {}

impl Config for Centroid {
    type Stage = dyn Annotator;
    const KIND: &'static str = "centroid";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for Centroid {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CENTROID]
    }

    fn annotate(&self, _: &Site, frame: &mut Frame) -> Result<()> {
        let seen = frame.get(VISIBLE_MASK)?.iter().filter(|(_, mask)| !mask.is_empty());
        let centroids = seen.map(|(id, mask)| (id, Value::from(middle(mask)))).collect();
        frame.put::<PerInstance<Value>>(CENTROID, centroids)
    }
}
register!(Centroid);

fn middle(mask: &Mask) -> [f64; 2] {
    let height = f64::from(mask.height());
    let mut sum = [0.0; 2];
    for position in mask.runs().flatten().map(f64::from) {
        let column = (position / height).floor();
        sum[0] += column + 0.5;
        sum[1] += position - column * height + 0.5;
    }
    sum.map(|total| total / f64::from(mask.area()))
}
