//! The layout of SynTable datasets.

mod check;
mod debug;
mod merge;
mod read;
mod record;
mod write;

pub(crate) use debug::inverse_depth;

use syntable_formats::depth::DepthSource;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Path of the copy of the resolved recipe.
const RECIPE: &str = "parameters/recipe.toml";
/// Usual name of the annotation file.
const ANNOTATION_FILE: &str = "annotation_final.json";

/// Writes the dataset layout that the readers of SynTable and UOAIS-Net expect.
///
/// # Behavior
///
/// The annotation file has COCO's structure. `segmentation` is the amodal mask of an object; `visible_mask`,
/// `occluded_mask`, `occluded_rate` and boxes are additional fields. Image ids are `scene · views_per_scene + view +
/// 1`, so they do not depend on which scenes are complete; they change if the recipe of a growing dataset gets more
/// views per scene. Categories are `object` (id 1) and, from 2, the classes of the recipe's pools, sorted by name.
/// `scenes` has a record per scene, whose `bodies` explain each id in the product `instance`: role, asset, category,
/// materials and pose of objects, distractors, table and room. Row and column n of the occlusion order belong to the
/// n-th annotation of the image, which is `instance_ids[n]` of the image's record. Dates are constant.
///
/// In a conversion, the `coco` form omits everything that the dataset lacks: depth, order, camera and other fields.
/// Without amodal masks, `segmentation` and `area` describe the visible mask, and the fields on occlusion are omitted.
///
/// # Output
///
/// - `data/mono/rgb/{scene}_{view}.png`, or `.jpg`: 8-bit RGB.
/// - `data/mono/depth/{scene}_{view}.png`: 16-bit depth along the optical axis, whole millimeters, truncated; 0 without
///   a surface or measurement.
/// - `data/mono/occlusion_order/{scene}_{view}.npy`: float64 `[N, N]`, 1 where the row's object occludes the column's.
/// - `annotation_final.json`: the annotations of all images.
/// - `parameters/recipe.toml`: the resolved recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SynTable {
    /// Form of the annotation file: `coco` for COCO's readers, `syntable_1` for programs that rely on the files of
    /// SynTable's release.
    pub compat: Compat,
    /// Mask whose box is written as `bbox`: `visible` as in SynTable, or `amodal` to fit `segmentation`. The `coco`
    /// form also has both boxes under their own names.
    pub bbox: BoxSource,
    /// Whether to omit images without annotations from the annotation file, as some readers of test sets require. Their
    /// image files are written all the same. The `syntable_1` form never lists such images.
    pub skip_empty_images: bool,
    /// Also writes the files of SynTable's switch `--save-segmentation-data`, except the images of single objects:
    /// instance maps, visible, amodal and occlusion masks as PNG, depth as PFM in meters and as 8-bit inverse depth. If
    /// a converted dataset lacks instance maps, they are painted from the visible masks.
    pub debug_masks: bool,
    /// File name of the annotation file.
    pub annotation_file: String,
    /// Folder inside the dataset for all files; empty for the dataset's own.
    pub folder: String,
    /// Files of the color images. Readers find them by `file_name` in the annotation file.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
    /// Depth that is written.
    #[serde(skip_serializing_if = "DepthSource::is_default")]
    pub depth: DepthSource,
}

/// Form of the annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compat {
    /// One record per image, true areas, rates in full precision; camera, object poses and label policy.
    Coco,
    /// The image's record repeated for every annotation, area 0, ten times the area of the amodal masks in
    /// `segmentation`, rates of two decimals, one category, depth that is truncated in single precision, `_` for `/` in
    /// names of objects. Objects without a visible pixel or with a rate that rounds to 1.00 are left out, and so are
    /// images without annotations.
    #[serde(rename = "syntable_1")]
    Syntable1,
}

/// Mask whose box is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BoxSource {
    /// The visible mask; of an object without visible pixels, the amodal mask.
    Visible,
    /// The amodal mask.
    Amodal,
}

impl Default for SynTable {
    fn default() -> Self {
        Self {
            compat: Compat::Coco,
            bbox: BoxSource::Visible,
            skip_empty_images: false,
            debug_masks: false,
            annotation_file: ANNOTATION_FILE.into(),
            folder: String::new(),
            rgb: RgbFiles::default(),
            depth: DepthSource::default(),
        }
    }
}

impl Config for SynTable {
    type Stage = dyn Writer;
    const KIND: &'static str = "syntable";
    const EXAMPLE: &'static str = "compat = \"coco\"\nskip_empty_images = false";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        if self.annotation_file.is_empty() || self.annotation_file.contains(['/', '\\']) {
            let message = format!("`{}` is not a file name", self.annotation_file);
            return Err(ConfigError::new("annotation_file", message));
        }
        check_path("annotation_file", &self.annotation_file)?;
        self.rgb.check()?;
        if !self.folder.is_empty() {
            check_path("folder", &self.folder)?;
        }
        Ok(self.boxed())
    }
}

register!(SynTable);
