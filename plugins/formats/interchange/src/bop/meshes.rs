//! Meshes of a dataset that a reader opens.

use super::model::BopModel;
use super::record::{BopModelInfo, MM, model_file};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::Log;
use syntable_model::prelude::*;
use syntable_model::product::ObjectModel;
use syntable_model::scene::{Mesh, SourceModel, Symmetries};

/// The mesh files of a folder of models. Each is read once, at its first use.
pub struct Meshes {
    folder: PathBuf,
    formats: MeshFormats,
    of: BTreeMap<u64, OnceLock<Result<ObjectModel>>>,
}

/// Discards the warnings about a mesh file, which matter to renderers only.
struct Silent;

impl Log for Silent {
    fn warn(&self, _: &Error) {}
}

impl Meshes {
    /// The models of a folder that have a mesh file. Empty if no linked crate reads PLY files.
    pub fn of(folder: &Path, models: impl Iterator<Item = u64>) -> Self {
        let formats = MeshFormats::linked().unwrap_or_default();
        let is_there = |id: &u64| {
            let file = folder.join(model_file(*id));
            formats.of_file(&file).is_some() && file.is_file()
        };
        let of = models.filter(is_there).map(|id| (id, OnceLock::new())).collect();
        Self { folder: folder.to_owned(), formats, of }
    }

    /// Whether each of these models has a mesh.
    pub fn have(&self, models: &BTreeSet<u64>) -> bool {
        models.iter().all(|id| self.of.contains_key(id))
    }

    /// Numbers of the models that have a mesh.
    pub fn numbers(&self) -> impl Iterator<Item = u64> {
        self.of.keys().copied()
    }

    /// The shape and the surface of a model, m.
    pub fn model(&self, id: u64) -> Result<ObjectModel> {
        let Some(model) = self.of.get(&id) else {
            return Err(Error::new("no such file").in_file(self.folder.join(model_file(id))));
        };
        model.get_or_init(|| self.read(id)).clone()
    }

    fn read(&self, id: u64) -> Result<ObjectModel> {
        let file = PathBuf::from(model_file(id));
        // Each mesh has its own root, because the limits apply per mesh.
        let model = self.formats.read(&AssetRoot::open(&self.folder)?, &file, &Silent)?;
        let Model { mesh, materials } = model.scaled(1.0 / MM);
        // A file without colors leaves them unknown: the default gray of renderers is not a color of the model.
        let is_plain = mesh.colors.is_empty() && !materials.iter().any(|it| it.base_color.texture.is_some());
        let materials = if is_plain { Vec::new() } else { materials.into_iter().map(Arc::new).collect() };
        let mesh = Mesh::new(mesh).map_err(|error| error.in_file(self.folder.join(file)))?;
        Ok(ObjectModel { mesh: Arc::new(mesh), materials, source: SourceModel::default() })
    }

    /// Sizes of a model, mm; none with the reason if its mesh cannot be read.
    pub fn info(&self, id: u64) -> Result<BopModelInfo<f64, Symmetries>> {
        Ok(BopModel::of(&self.model(id)?)?.info())
    }
}
