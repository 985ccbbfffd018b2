//! What the end of a run needs of a scene: a tar file with a record per view, with the samples of tar files, and with the
//! meshes of the scene's assets.

use super::model::Model;
use super::record::ViewRecord;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read};
use syntable_formats::encode::json_shard::push_line;
use syntable_formats::encode::tar::{Archive, for_each_member};
use syntable_model::prelude::*;
use syntable_model::product::ObjectModels;
use syntable_model::scene::{SceneId, ViewId};

/// A record per view, as lines.
const VIEWS: &str = "views.jsonl";
/// Names of the assets whose meshes follow.
const ASSETS: &str = "assets.json";
/// Folder of the members of samples.
const SAMPLES: &str = "samples/";

/// Names of the members that have the mesh of an asset.
fn model_members(index: usize) -> [String; 2] {
    ["vertices", "faces"].map(|part| format!("models/{index}.{part}"))
}

/// Key of an image in tar files.
pub fn key(scene: SceneId, view: ViewId) -> String {
    format!("{:06}_{:06}", scene.0, view.0)
}

/// A shard that is being written.
pub struct Shard {
    archive: Archive<BufWriter<File>>,
    views: Vec<u8>,
}

impl Shard {
    pub fn new(output: &Output) -> Result<Self> {
        Ok(Self { archive: Archive::new(output.create_shard()?, "the shard"), views: Vec::new() })
    }

    pub fn view(&mut self, view: &ViewRecord) -> Result<()> {
        push_line(&mut self.views, view)
    }

    /// Adds a member of an image's sample, such as `rgb.png`.
    pub fn sample(&mut self, key: &str, field: &str, bytes: &[u8]) -> Result<()> {
        self.archive.add(&format!("{SAMPLES}{key}.{field}"), bytes)
    }

    pub fn models(&mut self, models: &ObjectModels) -> Result<()> {
        let assets: Vec<&String> = models.0.keys().collect();
        let mut line = Vec::new();
        push_line(&mut line, &assets)?;
        self.archive.add(ASSETS, &line)?;
        for (index, mesh) in models.0.values().enumerate() {
            for (name, bytes) in model_members(index).iter().zip(Model::of(mesh).to_bytes()) {
                self.archive.add(name, &bytes)?;
            }
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<()> {
        self.archive.add(VIEWS, &self.views)?;
        self.archive.finish()
    }
}

fn damaged(finish: &Finish, scene: SceneId) -> Error {
    Error::new(format!("the shard of scene {} is not one of BOP", scene.0))
        .context(format!("write.{}", finish.id()))
        .help("the dataset is damaged, or of another version; `syntable run --repair` makes the scene again")
}

fn members(finish: &Finish, scene: SceneId, each: impl FnMut(&str, &mut dyn Read) -> Result<()>) -> Result<()> {
    for_each_member(finish.shard(scene)?, &format!("the shard of scene {}", scene.0), each)
}

fn content(finish: &Finish, scene: SceneId, member: &mut dyn Read) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    member.read_to_end(&mut bytes).map_err(|_| damaged(finish, scene))?;
    Ok(bytes)
}

/// The views of a scene, in order.
pub fn views(finish: &Finish, scene: SceneId) -> Result<Vec<ViewRecord>> {
    let mut lines = None;
    members(finish, scene, |name, member| {
        if name == VIEWS {
            lines = Some(content(finish, scene, member)?);
        }
        Ok(())
    })?;
    let lines = lines.ok_or_else(|| damaged(finish, scene))?;
    let views: std::result::Result<_, _> = serde_json::Deserializer::from_slice(&lines).into_iter().collect();
    views.map_err(|_| damaged(finish, scene))
}

/// Calls `each` with the key of the image, the field and the bytes of every member of the samples of a scene, in order.
pub fn for_each_sample(
    finish: &Finish,
    scene: SceneId,
    mut each: impl FnMut(&str, &str, &[u8]) -> Result<()>,
) -> Result<()> {
    members(finish, scene, |name, member| match name.strip_prefix(SAMPLES).and_then(|name| name.split_once('.')) {
        Some((key, field)) => each(key, field, &content(finish, scene, member)?),
        None => Ok(()),
    })
}

/// Calls `each` with the meshes of those assets of a scene that are wanted.
pub fn for_each_model(
    finish: &Finish,
    scene: SceneId,
    wanted: impl Fn(&str) -> bool,
    mut each: impl FnMut(&str, &Model) -> Result<()>,
) -> Result<()> {
    // Names of the members of wanted meshes, and what was read of the next one.
    let mut names: BTreeMap<String, (String, usize)> = BTreeMap::new();
    let mut vertices = Vec::new();
    members(finish, scene, |name, member| {
        if name == ASSETS {
            let assets: Vec<String> =
                serde_json::from_slice(&content(finish, scene, member)?).map_err(|_| damaged(finish, scene))?;
            for (index, asset) in assets.into_iter().enumerate().filter(|(_, asset)| wanted(asset)) {
                names.extend(model_members(index).into_iter().zip([(asset.clone(), 0), (asset, 1)]));
            }
            return Ok(());
        }
        match names.get(name) {
            None => Ok(()),
            Some((_, 0)) => {
                vertices = content(finish, scene, member)?;
                Ok(())
            }
            Some((asset, _)) => {
                let model = Model::from_bytes([&vertices, &content(finish, scene, member)?]);
                each(asset, &model.ok_or_else(|| damaged(finish, scene))?)
            }
        }
    })
}
