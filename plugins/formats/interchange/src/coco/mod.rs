//! COCO detection and instance segmentation.

mod check;
mod fields;
mod keypoints;
mod read;
mod record;
mod write;

pub(crate) use read::open_file;
pub(crate) use record::{AmodalAnnotation, AmodalFields};
pub(crate) use write::{StoredParts, file};

use crate::family::write::{Family, check_split};
use std::collections::BTreeMap;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::include::Included;
use syntable_model::prelude::*;

/// Writes COCO's layout for detection and instance segmentation.
///
/// # Behavior
///
/// `segmentation`, `area` and `bbox` describe one mask, visible or amodal, so COCO's own tools evaluate this mask.
/// Every annotation also has both masks, both boxes and the occlusion rate under SynTable's names. Boxes are `[x, y,
/// width, height]` with `width = last column - first column + 1`, areas are whole pixels, and masks are compressed run
/// lengths. Image ids are `scene · views_per_scene + view + 1`; images without objects are listed, too. Categories are
/// `object` (1) and the classes of the recipe's pools. In a conversion from a dataset with visible masks only,
/// `segmentation` is the visible mask, and SynTable's fields are omitted. From a dataset with amodal masks only,
/// `segmentation` is the amodal mask, which `amodal_mask` and `amodal_bbox` repeat.
///
/// With `keypoints`, annotations also have x, y and visibility of each keypoint: 0 for unlabeled ones (then x and y are
/// 0, too), 1 for hidden ones, 2 for visible ones. As in COCO's files, (0, 0) is the center of the first pixel. Every
/// category lists the names and the `skeleton`, which connects them.
///
/// `include` adds products as fields under their own names: products per object to annotations, and products of the view to
/// images. A mask is compressed run lengths, a record a JSON object. An annotation lacks the field if the product has no value
/// for its object.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB; `file_name` is relative to `{id}/images`.
/// - `{id}/annotations/instances_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coco {
    /// Mask of `segmentation`, `area` and `bbox`. Objects whose visible mask is empty have no annotation with
    /// `visible`.
    pub masks: MaskChoice,
    /// Name of the split in the annotation file's name.
    pub split: String,
    /// Names of keypoints, in the order in which every annotation lists them, as `keypoints` and `num_keypoints`. A
    /// keypoint that an object does not have, or that is outside of the image, counts as not labeled. Without names,
    /// annotations have no keypoints.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("uniqueItems" = true))]
    pub keypoints: Vec<String>,
    /// Pairs of names of keypoints that viewers connect by a line.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skeleton: Vec<[String; 2]>,
    /// Products that annotations or images have as fields.
    #[serde(skip_serializing_if = "Included::is_empty")]
    pub include: Included,
    /// Supercategories of categories, by the names of the categories.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub supercategories: BTreeMap<String, String>,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

/// A mask of each object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaskChoice {
    /// The visible part of the object.
    Visible,
    /// The object without occluders.
    Amodal,
}

impl Default for Coco {
    fn default() -> Self {
        Self {
            masks: MaskChoice::Amodal,
            split: "train".into(),
            keypoints: Vec::new(),
            skeleton: Vec::new(),
            include: Included::default(),
            supercategories: BTreeMap::new(),
            rgb: RgbFiles::default(),
        }
    }
}

impl Config for Coco {
    type Stage = dyn Writer;
    const KIND: &'static str = "coco";
    const EXAMPLE: &'static str = "masks = \"amodal\"\ninclude = [\"object_name\", \"camera\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        self.check_fields()?;
        keypoints::check_names(&self.keypoints)?;
        keypoints::check_skeleton(&self.keypoints, &self.skeleton)?;
        Ok(self.writer())
    }
}

register!(Coco);
