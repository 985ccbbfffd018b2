//! Meshes of a dataset that is read.

use super::finish::model_file;
use super::model::{Model, ModelInfo};
use super::record::MM;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::Log;
use syntable_model::prelude::*;
use syntable_model::scene::Mesh;

/// The mesh files of a folder of models. Each is read when somebody asks, once.
pub struct Meshes {
    folder: PathBuf,
    formats: MeshFormats,
    of: BTreeMap<u64, OnceLock<Result<Arc<Mesh>>>>,
}

/// What a mesh file says of textures and colors has no place in BOP's own files of this program.
struct Silent;

impl Log for Silent {
    fn warn(&self, _: &Error) {}
}

impl Meshes {
    /// Those models of a folder that have a file. There are none if no crate that is linked reads PLY files.
    pub fn of(folder: &Path, models: impl Iterator<Item = u64>) -> Self {
        let formats = MeshFormats::linked().unwrap_or_default();
        let is_there = |id: &u64| {
            let file = folder.join(model_file(*id));
            formats.of_file(&file).is_some() && file.is_file()
        };
        let of = models.filter(is_there).map(|id| (id, OnceLock::new())).collect();
        Self { folder: folder.to_owned(), formats, of }
    }

    /// Whether there is a mesh for each of these.
    pub fn have(&self, models: &BTreeSet<u64>) -> bool {
        models.iter().all(|id| self.of.contains_key(id))
    }

    /// Numbers of the models that have a mesh.
    pub fn numbers(&self) -> impl Iterator<Item = u64> {
        self.of.keys().copied()
    }

    /// The mesh of a model, m.
    pub fn mesh(&self, id: u64) -> Result<Arc<Mesh>> {
        let Some(mesh) = self.of.get(&id) else {
            return Err(Error::new("there is no such file").in_file(self.folder.join(model_file(id))).permanent());
        };
        mesh.get_or_init(|| self.read(id)).clone()
    }

    fn read(&self, id: u64) -> Result<Arc<Mesh>> {
        let file = PathBuf::from(model_file(id));
        // A root of its own: limits are those of one mesh.
        let model = self.formats.read(&AssetRoot::open(&self.folder)?, &file, &Silent)?;
        let mesh = Mesh::new(model.scaled(1.0 / MM).mesh).map_err(|error| error.in_file(self.folder.join(file)))?;
        Ok(Arc::new(mesh))
    }

    /// Sizes of a model, mm; none if it cannot be read, and the reason.
    pub fn info(&self, id: u64) -> Result<ModelInfo> {
        Ok(Model::of(&*self.mesh(id)?).info())
    }
}
