//! Data of a scene for the end of a run: a tar file with a record per view, the samples for the tar files of the
//! dataset, and a list of the scene's assets. The models are separate files in the same folder, which scenes with the
//! same asset share.

use super::model::{BopModel, TEXTURE};
use super::record::ViewRecord;
use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use syntable_formats::encode::json_shard::{push_line, unread};
use syntable_formats::encode::tar::{TarWriter, for_each_member};
use syntable_model::digest::Digest;
use syntable_model::prelude::*;
use syntable_model::product::{ObjectModel, ObjectModels};
use syntable_model::scene::{SceneId, Symmetries};

/// A record per view, as lines.
const VIEWS: &str = "views.jsonl";
/// The assets of the scene that have a model.
const ASSETS: &str = "assets.json";
/// Folder of the members of samples.
const SAMPLES: &str = "samples/";

/// An asset and its model.
#[derive(Serialize, Deserialize)]
struct AssetOfModel {
    asset: String,
    /// Digest of the shared file of the mesh: a tar file of its arrays.
    mesh: Digest,
    /// Digest of the shared file of the texture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    texture: Option<Digest>,
    #[serde(flatten)]
    symmetries: Symmetries,
}

/// A shard that is being written.
pub struct Shard {
    archive: TarWriter<FileWriter>,
    views: Vec<u8>,
}

impl Shard {
    pub fn new(output: &Output) -> Result<Self> {
        Ok(Self { archive: TarWriter::new(output.create_shard()?, "the shard"), views: Vec::new() })
    }

    pub fn view(&mut self, view: &ViewRecord) -> Result<()> {
        push_line(&mut self.views, view)
    }

    /// Adds a member of an image's sample, such as `rgb.png`.
    pub fn sample(&mut self, key: &str, field: &str, bytes: &[u8]) -> Result<()> {
        self.archive.add(&format!("{SAMPLES}{key}.{field}"), bytes)
    }

    /// Adds the models of the scene's assets. `output` is the output of the scene.
    pub fn models(&mut self, models: &ObjectModels, output: &Output) -> Result<()> {
        let of_model = |(asset, model): (&String, &ObjectModel)| {
            let model = BopModel::of(model)?;
            let (mut mesh, mut texture) = (Vec::new(), None);
            let mut archive = TarWriter::new(&mut mesh, "the mesh");
            for (part, bytes) in model.parts() {
                if part == TEXTURE {
                    texture = Some(output.write_shared(&bytes)?);
                } else {
                    archive.add(part, &bytes)?;
                }
            }
            archive.finish()?;
            let mesh = output.write_shared(&mesh)?;
            Ok(AssetOfModel { asset: asset.clone(), mesh, texture, symmetries: model.symmetries })
        };
        let mut line = Vec::new();
        push_line(&mut line, &models.0.iter().map(of_model).collect::<Result<Vec<_>>>()?)?;
        self.archive.add(ASSETS, &line)
    }

    pub fn finish(mut self) -> Result<()> {
        self.archive.add(VIEWS, &self.views)?;
        self.archive.finish()
    }
}

fn damaged(finish: &Finish, scene: SceneId) -> Error {
    Error::new(format!("the shard of scene {} is not one of BOP", scene.0))
        .context(format!("write.{}", finish.id()))
        .help("the dataset is damaged, or of another version; a run with `options.repair` makes the scene again")
}

fn members(finish: &Finish, scene: SceneId, each: impl FnMut(&str, &mut dyn Read) -> Result<()>) -> Result<()> {
    for_each_member(finish.shard(scene)?, &format!("the shard of scene {}", scene.0), each)
}

fn content(finish: &Finish, scene: SceneId, member: &mut dyn Read) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    member.read_to_end(&mut bytes).map_err(|error| unread(finish, scene, &error))?;
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

/// The models of the assets of a scene that `wanted` selects.
pub fn models(finish: &Finish, scene: SceneId, wanted: impl Fn(&str) -> bool) -> Result<Vec<(String, BopModel)>> {
    let mut assets: Vec<AssetOfModel> = Vec::new();
    members(finish, scene, |name, member| {
        if name == ASSETS {
            assets = serde_json::from_slice(&content(finish, scene, member)?).map_err(|_| damaged(finish, scene))?;
        }
        Ok(())
    })?;
    let model = |AssetOfModel { asset, mesh, texture, symmetries }: AssetOfModel| {
        let mut parts = BTreeMap::new();
        let mesh = Cursor::new(finish.shared(scene, mesh)?);
        for_each_member(mesh, &format!("the mesh of {asset}"), |part, member| {
            parts.insert(part.to_owned(), content(finish, scene, member)?);
            Ok(())
        })?;
        if let Some(texture) = texture {
            parts.insert(TEXTURE.to_owned(), finish.shared(scene, texture)?);
        }
        let model = BopModel::from_parts(&mut parts, symmetries).ok_or_else(|| damaged(finish, scene))?;
        Ok((asset, model))
    };
    assets.into_iter().filter(|of_model| wanted(&of_model.asset)).map(model).collect()
}
