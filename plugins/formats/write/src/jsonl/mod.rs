//! JSON Lines with any product.

mod read;
mod record;
mod write;

use syntable_formats::include::Included;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes any products as JSON Lines.
///
/// # Behavior
///
/// Each line is a record with the numbers `scene` and `view` and each included product under its name. Masks are COCO's
/// compressed run lengths with their size, arrays are nested lists, and values per instance are keyed by the id.
/// Numbers that are not finite are null. A product of the scene that is made before the views is in the line of each
/// view. Products that are made from all views have their own line after the views. With `per = "scene"`, a line has
/// the products of the scene and a list `views` with the products of each view. Products of the dataset are in the last
/// line.
///
/// # Output
///
/// One file for the dataset, `{id}.jsonl` or `file`, with the scenes in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Jsonl {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Scope of a line.
    pub per: LinePer,
    /// Path of the file, relative to the dataset. Default: `{id}.jsonl`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

/// Scope of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinePer {
    /// One view.
    View,
    /// One scene with all its views.
    Scene,
}

impl Default for Jsonl {
    fn default() -> Self {
        let include = ["camera", "object_info", "visible_box", "amodal_box", "occlusion_rate"];
        Self { include: include.into(), per: LinePer::View, file: None }
    }
}

impl Config for Jsonl {
    type Stage = dyn Writer;
    const KIND: &'static str = "jsonl";
    const EXAMPLE: &'static str = "include = [\"camera\", \"object_info\", \"occlusion_rate\"]\nper = \"view\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&record::KEYS)?;
        self.file.as_ref().map_or(Ok(()), |file| check_path("file", file))?;
        Ok(self.boxed())
    }
}

register!(Jsonl);
