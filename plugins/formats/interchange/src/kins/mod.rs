//! KINS.

mod check;
mod labels;
mod read;
mod record;
mod write;

use crate::family::write::{Family, check_split};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes the layout of KINS, the amodal annotations of KITTI, in its form of 2019 or of 2020.
///
/// # Behavior
///
/// Both annotation files have COCO's structure and the categories of the dataset. Polygons are lists of lists `[x1, y1,
/// x2, y2, …]` with filled holes; the annotator `outlines` sets their tolerance. A visible mask has one polygon per
/// part. The parts of an amodal mask are connected at their nearest corners to one polygon, since the readers of
/// deocclusion and InstaOrder take only one. Areas and boxes `[x, y, width, height]` are computed from the masks.
/// Objects without a visible pixel have no annotation. Images without objects are listed.
///
/// - `2019`: `segmentation`, `bbox` and `area` are amodal; `inmodal_seg` is the visible mask as compressed run lengths,
///   `inmodal_bbox` its box.
/// - `2020`: `a_segm`, `a_bbox`, `a_area` are amodal, `i_segm`, `i_bbox`, `i_area` visible. `oco_id` is the number,
///   from 1, of the group of objects that overlap, directly or through others; `ico_id` is 1 for objects that nothing
///   in front of them occludes, and otherwise one more than the largest `ico_id` of an object's occluders. Both are 0
///   for an object that overlaps no other. Where objects occlude each other, directly or in a cycle, the object with
///   the nearest visible pixel is in front. `a_hole_area` and `i_hole_area`, which SynTable adds, are the pixels of the
///   holes that the polygons fill, so that readers can distinguish such an area from a wrong one.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/instances_{split}.json` (2019) or `{id}/update_{split}_2020.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Kins {
    /// Form of the annotation file.
    pub version: KinsVersion,
    /// Name of the split in the annotation file's name.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

/// Form of KINS' annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum KinsVersion {
    /// The first release.
    #[serde(rename = "2019")]
    V2019,
    /// The update with the order of occlusions.
    #[serde(rename = "2020")]
    V2020,
}

impl Default for Kins {
    fn default() -> Self {
        Self { version: KinsVersion::V2020, split: "train".into(), rgb: RgbFiles::default() }
    }
}

impl Config for Kins {
    type Stage = dyn Writer;
    const KIND: &'static str = "kins";
    const EXAMPLE: &'static str = "version = \"2020\"\nsplit = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.writer())
    }
}

register!(Kins);
