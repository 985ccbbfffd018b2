//! Writes JSON Lines.

use super::record::{JsonlRecord, JsonlView};
use super::{Jsonl, LinePer};
use serde_json::{Map, Value as Json};
use std::collections::BTreeSet;
use syntable_formats::encode::json_shard;
use syntable_formats::json;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Products by name, in the order of the option `include`.
type JsonProducts = Map<String, Json>;

/// The state of a scene between its views.
#[derive(Default)]
pub struct JsonlScene {
    /// Finished lines of the shard.
    lines: Vec<u8>,
    /// The products of the scene that are already in the lines of the views.
    written: BTreeSet<String>,
    /// The views in the scene's own line.
    views: Vec<JsonlView<JsonProducts>>,
}

impl ImageWriter for Jsonl {
    type Scene = JsonlScene;

    fn reads(&self) -> Vec<Input> {
        self.include.inputs(Accepts::Any)
    }

    fn view(&self, scene: &mut JsonlScene, cx: &ImageContext, products: &Products, _: &Output) -> Result<()> {
        let view = cx.view_id.0;
        match self.per {
            LinePer::View => {
                // Products of the scene that exist before the views are in each line, in the order of `include`.
                let keys: Vec<KeyId> = self.include.names().filter_map(|name| products.key(name)).collect();
                let of_view = keys.iter().map(|key| named(products, &key.to_string()));
                let of_view: JsonProducts = of_view.collect::<Result<_>>()?;
                scene.written.extend(keys.iter().map(KeyId::to_string));
                let scene_id = Some(cx.scene_id.0);
                let line = JsonlRecord { scene: scene_id, view: Some(view), products: of_view, views: None };
                json_shard::push_line(&mut scene.lines, &line)
            }
            LinePer::Scene => {
                scene.views.push(JsonlView { view, products: self.of_scope(products, Scope::View)? });
                Ok(())
            }
        }
    }

    fn close(&self, mut scene: JsonlScene, cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        let mut of_scene = self.of_scope(products, Scope::Scene)?;
        let views = (self.per == LinePer::Scene).then_some(scene.views);
        of_scene.retain(|name, _| !scene.written.contains(name));
        if views.is_some() || !of_scene.is_empty() {
            let line = JsonlRecord { scene: Some(cx.scene_id.0), view: None, products: of_scene, views };
            json_shard::push_line(&mut scene.lines, &line)?;
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
        let of_dataset = self.of_scope(products, Scope::Dataset)?;
        finish.write(&path, |out| {
            let mut write = |line: &str| writeln!(out, "{line}").map_err(|error| Error::io(&path, &error));
            json_shard::for_each_line(finish, |_, line| write(line))?;
            if of_dataset.is_empty() { Ok(()) } else { write(&json::text(&of_dataset)?) }
        })
    }
}

impl Jsonl {
    fn path(&self, id: &str) -> String {
        self.file.clone().unwrap_or_else(|| format!("{id}.jsonl"))
    }

    /// The included products of a scope.
    fn of_scope(&self, products: &Products, scope: Scope) -> Result<JsonProducts> {
        self.include.of_scope(products, scope).map(|(name, _)| named(products, name)).collect()
    }
}

fn named(products: &Products, name: &str) -> Result<(String, Json)> {
    Ok((name.to_owned(), json::of_product(products, name)?))
}
