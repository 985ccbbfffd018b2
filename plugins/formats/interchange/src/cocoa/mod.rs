//! COCO-Amodal.

mod check;
mod read;
mod record;
mod write;

pub(crate) use record::FILE;

use crate::family::write::{Family, check_split};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes the layout of COCO-Amodal (COCOA), one annotation per image with its objects from front to back.
///
/// # Behavior
///
/// `regions` has the objects from front to back, each after its occluders; `order` counts them from 1. Of objects that
/// occlude each other, directly or in a cycle, the object with the nearest visible pixel comes first.
/// `depth_constraint` lists the pairs `i-j`, by `order`, in which i occludes j and comes before it.
///
/// `segmentation` is one polygon around the amodal mask: its parts are connected at their nearest corners, and its
/// holes are filled. The annotator `outlines` sets the polygon's tolerance. `area` and `occlude_rate` are computed from
/// the masks. Occluded objects have `visible_mask` and `invisible_mask` as compressed run lengths. `name` is the
/// object's category, `isStuff` is 0, and `url` is the image's file name. Images without objects are omitted, so the
/// n-th annotation belongs to the n-th image.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/annotations/COCO_amodal_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cocoa {
    /// Name of the split in the annotation file's name.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

impl Default for Cocoa {
    fn default() -> Self {
        Self { split: "train2014".into(), rgb: RgbFiles::default() }
    }
}

impl Config for Cocoa {
    type Stage = dyn Writer;
    const KIND: &'static str = "cocoa";
    const EXAMPLE: &'static str = "split = \"train2014\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.writer())
    }
}

register!(Cocoa);
