//! WebDataset: tar files of samples.

mod read;
mod record;
mod write;

use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::include::Included;
use syntable_model::prelude::*;

/// Writes WebDataset shards: tar files of samples, for training from disks and object stores with fast sequential
/// reads.
///
/// # Behavior
///
/// Each scene is a shard, and each view is a sample with the key `{scene:06}_{view:04}`. A sample has a field per
/// included product, in the order of `include`. The kind of value determines the field's format:
///
/// | product | field |
/// | --- | --- |
/// | 8- or 16-bit image, such as `rgb` and `visible_ids` | `{product}.png`; `rgb.jpg` with `rgb = { format = "jpeg" }` |
/// | float image, such as `depth` | `{product}.npy`, or `{product}.exr` with `floats = "exr"` |
/// | other numbers, such as `amodal_bits` | `{product}.npy` |
/// | a number, a box or a mask per instance | `{product}.npy`, instances along the first axis, and `{product}.ids.npy` |
/// | record, list or text, such as `camera` | `{product}.json` |
///
/// Fields are the same as the files of the writers `png`, `exr`, `npy` and `jsonl`. The tar files are not compressed,
/// since their members are. They contain neither times nor owners, so equal samples give equal files. The URL of the
/// first hundred scenes for WebDataset's readers is `{id}-{000000..000099}.tar`; a shard has as many samples as a scene
/// has views.
///
/// # Output
///
/// `{id}/{id}-{scene:06}.tar`, and, if category ids are included, `{id}/categories.json` with their names in COCO's
/// form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Webdataset {
    /// Products of the view to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Format of float images.
    pub floats: Floats,
    /// Files of the product `rgb`.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

/// Format of float images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Floats {
    /// NumPy arrays, which WebDataset decodes without a plugin.
    Npy,
    /// OpenEXR, with lossless compression.
    Exr,
}

impl Default for Webdataset {
    fn default() -> Self {
        let include = [
            "rgb",
            "depth",
            "visible_ids",
            "amodal_bits",
            "visible_box",
            "amodal_box",
            "category_id",
            "occlusion_order",
            "camera",
        ];
        Self { include: include.into(), floats: Floats::Npy, rgb: RgbFiles::default() }
    }
}

impl Config for Webdataset {
    type Stage = dyn Writer;
    const KIND: &'static str = "webdataset";
    const EXAMPLE: &'static str =
        "include = [\"rgb\", \"depth\", \"visible_ids\", \"amodal_bits\", \"category_id\", \"camera\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.rgb.check()?;
        Ok(Box::new(self))
    }
}

register!(Webdataset);
