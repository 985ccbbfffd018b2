//! UOAIS-Sim. The reader of `coco` also reads this layout.

mod record;
mod write;

pub(crate) use record::FILE;

use crate::family::find::FOLDER;
use crate::family::write::{Family, check_split};
use syntable_formats::depth::DepthSource;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes the layout of UOAIS-Sim, from which UOAIS-Net is trained.
///
/// # Behavior
///
/// The folder `{id}` replaces `datasets/UOAIS-Sim`. The annotation file has what UOAIS-Net's loader reads, and nothing
/// else: `segmentation` (amodal), `visible_mask` and `occluded_mask` are compressed run lengths, `bbox` and `area`
/// describe the amodal mask, `occluded_rate` is the hidden fraction of it. The one category is `object` (1). Image ids
/// are `scene · views_per_scene + view + 1`.
///
/// **Images must have 640 × 480 pixels** for UOAIS-Net's default recipe: it distorts depth as an image of this size,
/// and loading fails with any other. Its range of depth, `DEPTH_RANGE`, must be set to the range of the dataset, such
/// as 250 to 2500 mm.
///
/// # Output
///
/// - `{id}/{split}/rgb/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/{split}/depth/{scene:06}_{view:04}.png`: 16-bit depth along the optical axis, whole millimeters; 0 without a
///   surface.
/// - `{id}/annotations/coco_anns_uoais_sim_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Uoais {
    /// `train` or `val`: folder of the images, and part of the annotation file's name.
    pub split: String,
    /// Depth that is written.
    pub depth: DepthSource,
    /// Whether to omit images without annotations from the annotation file, since UOAIS-Net's evaluation fails on them.
    /// Their image files are written all the same.
    pub skip_empty_images: bool,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

impl Default for Uoais {
    fn default() -> Self {
        Self { split: "train".into(), depth: DepthSource::default(), skip_empty_images: true, rgb: RgbFiles::default() }
    }
}

impl Config for Uoais {
    type Stage = dyn Writer;
    const KIND: &'static str = "uoais";
    const EXAMPLE: &'static str = "split = \"train\"\nskip_empty_images = true";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        if self.split == FOLDER {
            let message = format!("`{FOLDER}` is the folder of the annotation file");
            return Err(ConfigError::new("split", message).help("write `train` or `val`"));
        }
        Ok(self.writer())
    }
}

register!(Uoais);
