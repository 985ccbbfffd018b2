//! D2S amodal.

mod check;
mod read;
mod record;
mod write;

pub(crate) use check::{fault_of_name, faults_of_order, faults_of_region};
pub(crate) use record::{D2saRegion, FILE};

use crate::family::write::{Family, check_split};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes the layout of D2SA, MVTec's amodal annotations of D2S.
///
/// # Behavior
///
/// The annotation file has COCO's structure. `segmentation`, `area` and `bbox` describe the amodal mask. Annotations
/// also have `visible_mask`, and `invisible_mask` for occluded objects. Masks are compressed run lengths.
/// `occlude_rate` is the hidden fraction of the amodal mask, `occl_depth` the number of objects in the longest chain of
/// occluders in front of it, 0 without occluders. `amodal_region.order` counts the objects of an image from 1, from
/// front to back: each object comes after its occluders. Of objects that occlude each other, directly or in a cycle,
/// the object with the nearest visible pixel comes first. `amodal_base`, which repeats the image's record, is omitted.
/// Images without objects are listed.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/annotations/D2S_amodal_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct D2sa {
    /// Name of the split in the annotation file's name.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

impl Default for D2sa {
    fn default() -> Self {
        Self { split: "training".into(), rgb: RgbFiles::default() }
    }
}

impl Config for D2sa {
    type Stage = dyn Writer;
    const KIND: &'static str = "d2sa";
    const EXAMPLE: &'static str = "split = \"training\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.writer())
    }
}

register!(D2sa);
