//! JSON Lines with any product.

use crate::encode::{json_shard, view};
use crate::include;
use serde_json::{Map, Value as Json};
use syntable_model::prelude::*;

/// Writes any products as JSON Lines.
///
/// # What it does
///
/// Each line is a record with the numbers `scene` and `view` and each included product under its name. Masks are COCO's
/// compressed run lengths with their size, arrays are nested lists, and values per instance are keyed by the id.
/// Numbers that are not finite are null. With `per = "scene"` a line has the products of the scene, and a list `views`
/// with the products of each view.
///
/// # Output
///
/// One file for the dataset, `{id}.jsonl` or `file`, with the scenes in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Jsonl {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Vec<ProductName>,
    /// What a line covers.
    pub per: LinePer,
    /// Path of the file, relative to the dataset; `{id}.jsonl` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

/// What a line covers.
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
        Self { include: include.map(ProductName::from).to_vec(), per: LinePer::View, file: None }
    }
}

impl Config for Jsonl {
    type Stage = dyn Writer;
    const KIND: &'static str = "jsonl";
    const EXAMPLE: &'static str = "include = [\"camera\", \"object_info\", \"occlusion_rate\"]\nper = \"view\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        include::check_unique(&self.include)?;
        include::check_free(&self.include, &["scene", "view", "views"])?;
        Ok(Box::new(self))
    }
}

impl Writer for Jsonl {
    fn reads(&self) -> Vec<String> {
        include::names(&self.include)
    }

    fn scene(&self, site: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        let scene = Map::from_iter([("scene".to_owned(), site.scene.id.0.into())]);
        let (lines, views) = (Vec::new(), Vec::new());
        Ok(Box::new(JsonlScene { include: self.reads(), per: self.per, output, lines, scene, views }))
    }

    fn finish(&self, _: &DatasetInfo, finish: &Finish) -> Result<()> {
        let path = self.file.clone().unwrap_or_else(|| format!("{}.jsonl", finish.id()));
        finish.write(&path, |out| {
            json_shard::for_each_line(finish, |_, line| {
                writeln!(out, "{line}").map_err(|error| Error::io(&path, &error))
            })
        })
    }
}

struct JsonlScene {
    include: Vec<String>,
    per: LinePer,
    output: Output,
    /// Finished lines of the shard.
    lines: Vec<u8>,
    /// The fields of the scene's own line.
    scene: Map<String, Json>,
    /// The views of the scene's own line.
    views: Vec<Json>,
}

impl SceneWriter for JsonlScene {
    fn view(&mut self, site: &Site, frame: &Products) -> Result<()> {
        let mut record = Map::new();
        if self.per == LinePer::View {
            record.insert("scene".into(), site.scene.id.0.into());
        }
        record.insert("view".into(), view(site)?.id.0.into());
        for name in &self.include {
            let value = json(frame, name)?;
            if self.per == LinePer::Scene && include::of_scene(frame, name) {
                self.scene.insert(name.clone(), value);
            } else {
                record.insert(name.clone(), value);
            }
        }
        match self.per {
            LinePer::View => json_shard::push_line(&mut self.lines, &record),
            LinePer::Scene => {
                self.views.push(record.into());
                Ok(())
            }
        }
    }

    fn close(mut self: Box<Self>) -> Result<()> {
        if self.per == LinePer::Scene {
            self.scene.insert("views".into(), self.views.into());
            json_shard::push_line(&mut self.lines, &self.scene)?;
        }
        self.output.write_shard(&self.lines)
    }
}

/// A product as JSON.
pub(crate) fn json(frame: &Products, name: &str) -> Result<Json> {
    serde_json::to_value(frame.value(name)?)
        .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")).context(format!("product `{name}`")))
}

register!(Jsonl);
