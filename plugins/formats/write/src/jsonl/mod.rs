//! JSON Lines with any product.

mod read;

use serde_json::{Map, Value as Json};
use std::collections::BTreeSet;
use syntable_formats::encode::json_shard;
use syntable_formats::include::Included;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Writes any products as JSON Lines.
///
/// # What it does
///
/// Each line is a record with the numbers `scene` and `view` and each included product under its name. Masks are COCO's
/// compressed run lengths with their size, arrays are nested lists, and values per instance are keyed by the id.
/// Numbers that are not finite are null. A product of the scene that is known before the views is in the line of each
/// view; those that are made from all views have a line of their own after the views. With `per = "scene"` a line has
/// the products of the scene, and a list `views` with the products of each view. Products of the dataset are in the
/// last line.
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
        Self { include: include.into(), per: LinePer::View, file: None }
    }
}

impl Config for Jsonl {
    type Stage = dyn Writer;
    const KIND: &'static str = "jsonl";
    const EXAMPLE: &'static str = "include = [\"camera\", \"object_info\", \"occlusion_rate\"]\nper = \"view\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&["scene", "view", "views"])?;
        self.file.as_ref().map_or(Ok(()), |file| check_path("file", file))?;
        Ok(self.boxed())
    }
}

impl ImageWriter for Jsonl {
    type Scene = Lines;

    fn reads(&self) -> Vec<Input> {
        self.include.inputs(Accepts::Any)
    }

    fn view(&self, scene: &mut Lines, cx: &ImageContext, products: &Products, _: &Output) -> Result<()> {
        let include = &self.include;
        let mut record = Map::from_iter([("view".to_owned(), cx.view_id.0.into())]);
        match self.per {
            LinePer::View => {
                record = Map::from_iter([("scene".to_owned(), cx.scene_id.0.into())].into_iter().chain(record));
                // What is known before the views is in each line, in the order of `include`.
                for key in include.names().filter_map(|name| products.key(name)) {
                    let name = key.to_string();
                    scene.written.insert(name.clone());
                    let value = encoded(products, &name)?;
                    record.insert(name, value);
                }
                json_shard::push_line(&mut scene.lines, &record)
            }
            LinePer::Scene => {
                record.extend(json(include, products, Scope::View)?);
                scene.views.push(record.into());
                Ok(())
            }
        }
    }

    fn close(&self, mut scene: Lines, cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        let mut line = Map::from_iter([("scene".to_owned(), cx.scene_id.0.into())]);
        let mut of_scene = json(&self.include, products, Scope::Scene)?;
        match self.per {
            LinePer::Scene => {
                line.extend(of_scene);
                line.insert("views".into(), scene.views.into());
                json_shard::push_line(&mut scene.lines, &line)?;
            }
            LinePer::View => {
                of_scene.retain(|name, _| !scene.written.contains(name));
                if !of_scene.is_empty() {
                    line.extend(of_scene);
                    json_shard::push_line(&mut scene.lines, &line)?;
                }
            }
        }
        output.write_shard(&scene.lines)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        if of.scene.is_none() { vec![self.path(of.id)] } else { Vec::new() }
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["file"]
    }

    fn finish(&self, _: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        let path = self.path(finish.id());
        let of_dataset = json(&self.include, products, Scope::Dataset)?;
        finish.write(&path, |out| {
            let mut write =
                |line: &dyn std::fmt::Display| writeln!(out, "{line}").map_err(|error| Error::io(&path, &error));
            json_shard::for_each_line(finish, |_, line| write(&line))?;
            if of_dataset.is_empty() { Ok(()) } else { write(&Json::from(of_dataset)) }
        })
    }
}

impl Jsonl {
    fn path(&self, id: &str) -> String {
        self.file.clone().unwrap_or_else(|| format!("{id}.jsonl"))
    }
}

/// What a scene keeps between its views.
#[derive(Default)]
pub struct Lines {
    /// Finished lines of the shard.
    lines: Vec<u8>,
    /// The products of the scene that the lines of the views have.
    written: BTreeSet<String>,
    /// The views of the scene's own line.
    views: Vec<Json>,
}

/// The included products of a scope by name.
fn json(include: &Included, products: &Products, scope: Scope) -> Result<Map<String, Json>> {
    include.of_scope(products, scope).map(|(name, _)| Ok((name.to_owned(), encoded(products, name)?))).collect()
}

/// A product as JSON.
pub(crate) fn encoded(products: &Products, name: &str) -> Result<Json> {
    serde_json::to_value(products.value(name)?)
        .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")).context(format!("product `{name}`")))
}

register!(Jsonl);
