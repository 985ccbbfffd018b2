//! HDF5 files in the layout of BlenderProc.

use syntable_formats::depth::DepthSource;
use syntable_formats::include::Included;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes one HDF5 file per view, as BlenderProc does.
///
/// # Behavior
///
/// A file has the chosen datasets of BlenderProc, and each included product under its own name:
///
/// | dataset | type and shape | holds |
/// | --- | --- | --- |
/// | `colors` | uint8 `[H, W, 3]` | the image |
/// | `depth` | float32 `[H, W]` | meters along the optical axis; infinite without a surface, and with `depth = "sensed"` 0 without a measurement |
/// | `distance` | float32 `[H, W]` | meters from the camera's center; missing where `depth` is, with the same value |
/// | `normals` | float32 `[H, W, 3]` | normals `n` of the camera frame as `0.5 n + 0.5`: x right, y up, z toward the viewer |
/// | `instance_segmaps` | unsigned `[H, W]` | id of the body at the pixel, table and room included; 0 without a body |
/// | `category_id_segmaps` | unsigned `[H, W]` | category of that body: 1 is `object`, then the classes of pools by name; 0 for all bodies that are not objects |
/// | `instance_attribute_maps` | text | JSON: `idx`, `category_id`, `name` (pool and asset), `category` and `role` of each body in `instance_segmaps` |
///
/// Unsigned arrays have 8, 16 or 32 bits, depending on their largest value. Included numeric products are arrays as in
/// files of the writer `npy`, with the ids of a product per instance in `{product}_ids`; other products, such as
/// `camera`, are JSON text. Arrays are compressed with gzip. `h5py.File(path)[name][()]` reads a dataset.
///
/// # Output
///
/// `{id}/{scene:06}_{view:04}.hdf5`, and, if category ids are included, `{id}/categories.json` with ids and names of
/// all categories of the recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Hdf5 {
    /// Datasets of BlenderProc to write.
    #[schemars(extend("uniqueItems" = true))]
    pub datasets: Vec<BlenderProcDataset>,
    /// Products of the view to write in addition.
    pub include: Included,
    /// Depth of `depth` and `distance`.
    #[serde(skip_serializing_if = "DepthSource::is_default")]
    pub depth: DepthSource,
}

/// A dataset of BlenderProc.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlenderProcDataset {
    /// The image.
    Colors,
    /// Depth along the optical axis.
    Depth,
    /// Distance from the camera's center.
    Distance,
    /// Normals in the camera frame.
    Normals,
    /// Ids of bodies.
    InstanceSegmaps,
    /// Categories of bodies.
    CategoryIdSegmaps,
    /// Name, role and category of each body id.
    InstanceAttributeMaps,
}

impl Default for Hdf5 {
    fn default() -> Self {
        Self { datasets: BlenderProcDataset::ALL.to_vec(), include: Included::default(), depth: DepthSource::default() }
    }
}

impl Config for Hdf5 {
    type Stage = dyn Writer;
    const KIND: &'static str = "hdf5";
    const EXAMPLE: &'static str =
        "datasets = [\"colors\", \"depth\", \"instance_segmaps\"]\ninclude = [\"camera\", \"amodal_mask\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        if self.datasets.is_empty() && self.include.is_empty() {
            let help = "name datasets, or products in `include`";
            return Err(ConfigError::new("datasets", "nothing to write").help(help));
        }
        self.include.check_free(&BlenderProcDataset::ALL.map(BlenderProcDataset::name))?;
        Ok(self.boxed())
    }
}

register!(Hdf5);
