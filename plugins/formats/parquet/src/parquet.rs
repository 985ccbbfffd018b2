//! Parquet tables.

use crate::record;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::include::Included;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes Parquet tables, which pandas, Polars, DuckDB and Hugging Face `datasets` read.
///
/// # Behavior
///
/// A table has a row per instance of a view, or with `rows = "views"` a row per view whose columns of instances are
/// lists. The columns `scene`, `view`, `instance`, `width` and `height` identify the row; the other columns hold the
/// included products:
///
/// | product | columns |
/// | --- | --- |
/// | number or text, such as `occlusion_rate` | `{product}` |
/// | box, such as `visible_box` | `{product}`: list `[x, y, width, height]` |
/// | mask, such as `amodal_mask` | `{product}`: struct of `size` and `counts`, COCO's compressed run lengths as pycocotools takes them, and `{product}_area`, px |
/// | `category_id` | `category_id`, and its name, `category` |
/// | `object_info` | `asset`, `obj_id`, `mass_kg`, `world_from_object`, `camera_from_object`, `model_origin_m` |
/// | `camera` | `K`, `world_from_camera`, `distortion_k1_k2_p1_p2_k3` (of OpenCV; null without distortion) |
/// | `visibility` | `px_count_all`, `px_count_in_frame`, `px_count_valid`, `px_count_visib`, `visib_fract` |
/// | other records and lists | `{product}`: JSON text |
///
/// An instance has a row, or an entry in the lists of its view, if any of the included products of the view has a value
/// for it. If `object_info` or `visibility` has `objects = "all"`, this includes objects that are not annotated: their
/// masks, boxes and `category_id` are null.
///
/// Matrices are lists of their entries, row by row. Cells without a value are null. Products of a view or a scene
/// repeat in the rows of its instances. Tables have no arrays per instance or per view; `npz` stores them.
///
/// `image_file` is the path of the image, relative to the table's folder. With `images = "embedded"`, the row of a view
/// has the image itself, `image`, a struct of `bytes` (a PNG or JPEG file) and `path`, which `datasets` decodes. Tables of instances
/// do not embed images, since each image would repeat in the rows of its instances.
///
/// If category ids are included, the metadata of each table has the key `categories`: COCO's list of all categories of
/// the recipe, as JSON.
///
/// Each scene has its own table with the same columns: an interrupted run leaves whole tables, and a growing dataset
/// leaves its tables unchanged. Readers accept a folder or `*.parquet` as one table.
///
/// ```python
/// table = pandas.read_parquet("data/parquet/instances")
/// hidden = table[table.occlusion_rate > 0.5]
/// annotated = table[table.amodal_mask_area.notna()]
/// data = datasets.load_dataset("parquet", data_files="data/parquet/views/*.parquet")
/// ```
///
/// # Output
///
/// In `{id}`: `{rows}/{scene:06}.parquet`, and with `images = "files"` `images/{scene:06}_{view:04}.png` or `.jpg`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parquet {
    /// Scope of a row.
    pub rows: ParquetRows,
    /// Products to write, of the view, its instances or the scene.
    pub include: Included,
    /// Storage of the images.
    pub images: ParquetImages,
    /// Format of the images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

/// Scope of a row of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParquetRows {
    /// An instance in a view. A view without instances has no row.
    Instances,
    /// A view with lists of its instances.
    Views,
}

/// Storage of the images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParquetImages {
    /// No images.
    None,
    /// Files next to the tables, with their paths in the column `image_file`.
    Files,
    /// In the column `image`, in tables of views only.
    Embedded,
}

impl ParquetRows {
    /// Name of the tables' folder.
    pub(crate) fn folder(self) -> &'static str {
        match self {
            Self::Instances => record::INSTANCES,
            Self::Views => record::VIEWS,
        }
    }
}

impl Default for Parquet {
    fn default() -> Self {
        let include = [
            "object_info",
            "category_id",
            "visible_box",
            "amodal_box",
            "occlusion_rate",
            "visible_mask",
            "amodal_mask",
            "camera",
        ];
        Self {
            rows: ParquetRows::Instances,
            include: include.into(),
            images: ParquetImages::Files,
            rgb: RgbFiles::default(),
        }
    }
}

impl Config for Parquet {
    type Stage = dyn Writer;
    const KIND: &'static str = "parquet";
    const EXAMPLE: &'static str =
        "rows = \"instances\"\ninclude = [\"object_info\", \"category_id\", \"visible_box\", \"occlusion_rate\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&record::reserved())?;
        self.rgb.check()?;
        if (self.rows, self.images) == (ParquetRows::Instances, ParquetImages::Embedded) {
            return Err(ConfigError::new("images", "a table of instances would have each image many times")
                .help("write `rows = \"views\"`, or `images = \"files\"`"));
        }
        Ok(self.boxed())
    }
}

register!(Parquet);
