//! COCO panoptic segmentation.

mod check;
mod read;
mod record;
mod write;

pub(crate) use record::FILE;

use crate::family::write::{Family, check_split};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes COCO's layout for panoptic segmentation.
///
/// # Behavior
///
/// Every visible mask is a segment, and the id of the segment is the id of the object in its scene. If
/// visible masks overlap, as in COCO and LVIS, a pixel belongs to the object with the smallest mask. Areas and boxes
/// then describe the remaining pixels, an object without remaining pixels has no segment, and the number of objects
/// that lose pixels is reported. All other pixels (table, room, distractors and unlabeled objects) are one segment of
/// the stuff `background`, so that panopticapi counts predictions there as wrong. No pixel is void. A segment's id is
/// R + 256 · G + 256² · B of its pixels in the PNG file. Categories are `object` (1) and the classes of the recipe's
/// pools, with `isthing` 1, then `background` with `isthing` 0. Image ids are `scene · views_per_scene + view + 1`;
/// `bbox` is `[x, y, width, height]`, and `area` is in whole pixels.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/annotations/panoptic_{split}/{scene:06}_{view:04}.png`: the segments.
/// - `{id}/annotations/panoptic_{split}.json`: one annotation per image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CocoPanoptic {
    /// Name of the split in the names of the annotation file and of its folder.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

impl Default for CocoPanoptic {
    fn default() -> Self {
        Self { split: "train".into(), rgb: RgbFiles::default() }
    }
}

impl Config for CocoPanoptic {
    type Stage = dyn Writer;
    const KIND: &'static str = "coco_panoptic";
    const EXAMPLE: &'static str = "split = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.writer())
    }
}

register!(CocoPanoptic);
