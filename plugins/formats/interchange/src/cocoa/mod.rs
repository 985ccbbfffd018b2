//! COCO-Amodal.

mod check;
mod read;
mod record;
mod write;

pub(crate) use record::FILE;

use crate::family::write::{Family, check_split};
use syntable_model::prelude::*;

/// Writes the layout of COCO-Amodal (COCOA), one annotation per image with its objects from front to back.
///
/// # What it does
///
/// `regions` has the objects from front to back, each after all that occlude it; `order` counts them from 1. Where
/// objects occlude each other, directly or in a circle, the one whose nearest visible pixel is nearest comes first.
/// `depth_constraint` lists the pairs `i-j` of which i occludes j and comes before it, by `order`.
///
/// `segmentation` is one polygon around the amodal mask: its parts are linked at their nearest corners, its holes
/// filled. The annotator `outlines` says how close it is. `area` and `occlude_rate` are those of the masks.
/// `visible_mask` and `invisible_mask`, compressed run lengths, are there if the object is occluded. `name` is the
/// object's category, `isStuff` 0, and `url` the image's file name. Images without objects are left out, so that the
/// n-th annotation is that of the n-th image.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/annotations/COCO_amodal_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cocoa {
    /// Name of the split in the annotation file's name.
    pub split: String,
}

impl Default for Cocoa {
    fn default() -> Self {
        Self { split: "train2014".into() }
    }
}

impl Config for Cocoa {
    type Stage = dyn Writer;
    const KIND: &'static str = "cocoa";
    const EXAMPLE: &'static str = "split = \"train2014\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(self.writer())
    }
}

register!(Cocoa);
