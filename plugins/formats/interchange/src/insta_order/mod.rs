//! InstaOrder.

mod record;
mod write;

use crate::family::write::{Family, check_split};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes InstaOrder's orders of occlusion and depth, and COCO's instances.
///
/// # Behavior
///
/// `instances_{split}.json` is the file of the writer `coco` with visible masks. Each record of
/// `InstaOrder_{split}.json` is an image with at least two visible objects: `instance_ids` are ids of annotations in
/// the former file, and numbers in an `order` are positions in this list, from 0. `occlusion` has the pairs of the
/// occlusion order: `a<b` if a occludes b, `a<b & b<a` if each occludes the other. `depth` has all pairs: `a<b` if a is
/// nearer by the mean depth of its visible pixels, or `a=b`; `overlap` is true if the ranges of these depths overlap.
/// `count` is always 2, as if two annotators of InstaOrder agreed at once. InstaOrder's reader requires a split named
/// `train2017` or `val2017`.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/annotations/instances_{split}.json` and `{id}/annotations/InstaOrder_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InstaOrder {
    /// Name of the split in the annotation files' names.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

impl Default for InstaOrder {
    fn default() -> Self {
        Self { split: "train2017".into(), rgb: RgbFiles::default() }
    }
}

impl Config for InstaOrder {
    type Stage = dyn Writer;
    const KIND: &'static str = "insta_order";
    const EXAMPLE: &'static str = "split = \"train2017\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.writer())
    }
}

register!(InstaOrder);
