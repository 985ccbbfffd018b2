//! Recorded products of finished scenes, which dataset annotators read in this run or a later one.

use crate::run::dataset::scene_files::SceneFiles;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use syntable_model::error::{Error, Result};
use syntable_model::limits::SCENE_RECORD_BYTES;
use syntable_model::product::{KeyId, Products};
use syntable_model::scene::SceneId;
use syntable_model::stage::{DAMAGED, Output, RecordedScene, unreadable};
use syntable_recipe::plan::Plan;

/// Owner of the records' shards, instead of a writer's id.
pub const OWNER: &str = "@records";

type Values = BTreeMap<String, serde_json::Value>;

/// Recorded products of a scene.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Records {
    scene: Values,
    views: Vec<Values>,
}

impl Records {
    /// Records a view.
    pub fn view(&mut self, plan: &Plan, products: &Products) -> Result<()> {
        if !plan.per_dataset.is_empty() {
            self.views.push(values(&plan.recorded_of_views(), products)?);
        }
        Ok(())
    }

    /// Writes the records of a finished scene, if any stage reads them.
    pub fn write(mut self, plan: &Plan, products: &Products, output: &Output) -> Result<()> {
        if plan.per_dataset.is_empty() {
            return Ok(());
        }
        self.scene = values(&plan.recorded_of_scene(), products)?;
        let text = serde_json::to_vec(&self).expect("values are plain data");
        // Text that is written can be read.
        SCENE_RECORD_BYTES.check(text.len() as u64)?;
        output.write_shard(&text)
    }

    /// Reads the record of a scene.
    pub fn read(files: &SceneFiles, scene: SceneId) -> Result<RecordedScene> {
        let path = syntable_model::stage::shard_path(OWNER, scene)?;
        let name = files.dataset().name_of(&path);
        let wrong = |message: String| Error::new(message).in_file(&name).help(DAMAGED);
        SCENE_RECORD_BYTES.check(files.size(scene, &path)?).map_err(|error| error.in_file(&name))?;
        let mut opened = files.open(scene, &path).map_err(unreadable)?;
        let mut text = Vec::new();
        opened.read_to_end(&mut text).map_err(|error| unreadable(Error::io(&name, &error)))?;
        let Self { scene: scene_values, views: view_values } =
            serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))?;
        Ok(RecordedScene { scene, scene_values, view_values })
    }
}

/// Names of the products that a plan records of a scene, sorted.
pub fn names(plan: &Plan) -> Vec<String> {
    let keys = plan.recorded_of_scene().into_iter().chain(plan.recorded_of_views());
    let mut names: Vec<String> = keys.map(|key| key.to_string()).collect();
    names.sort_unstable();
    names
}

fn values(keys: &[KeyId], products: &Products) -> Result<Values> {
    let value = |key: &KeyId| {
        let encoded = serde_json::to_value(products.value(key)?).expect("values are plain data");
        Ok((key.to_string(), encoded))
    };
    keys.iter().map(value).collect()
}
