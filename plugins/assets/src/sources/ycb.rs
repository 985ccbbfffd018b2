//! `ycb`: folders `<name>/google_16k/textured.obj`, meters, z up.

use super::folder::catalog_of_folders;
use crate::formats::obj;
use std::path::{Path, PathBuf};
use syntable_mesh::ObjectInfo;
use syntable_mesh::root::{AssetRoot, exists, is_dir};
use syntable_mesh::scan::list;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};
use syntable_model::stage::AssetLimits;

/// Objects of the YCB Object and Model Set (Calli et al., 2015), as downloaded: one folder per object with
/// `google_16k/textured.obj` beside its texture; or as in YCB-Video, with `textured.obj` or `textured_simple*.obj` in the
/// object's folder itself. Meters, z up. The origins lie outside of the objects; let the pool center them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ycb {
    /// Folder that holds the objects' folders.
    root: AssetPath,
    /// Which reconstruction of each object is read.
    #[serde(default)]
    reconstruction: Reconstruction,
    #[serde(skip)]
    limits: AssetLimits,
}

/// The reconstructions that come with YCB.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Reconstruction {
    /// Google's scanner, 16 thousand triangles.
    #[default]
    #[serde(rename = "google_16k")]
    Google16k,
    /// Google's scanner, 64 thousand triangles.
    #[serde(rename = "google_64k")]
    Google64k,
    /// Google's scanner, 512 thousand triangles.
    #[serde(rename = "google_512k")]
    Google512k,
    /// Berkeley's scanner, Poisson reconstruction.
    #[serde(rename = "poisson")]
    Poisson,
    /// Berkeley's scanner, volumetric range image integration.
    #[serde(rename = "tsdf")]
    Tsdf,
}

impl Reconstruction {
    fn folder(self) -> &'static str {
        match self {
            Self::Google16k => "google_16k",
            Self::Google64k => "google_64k",
            Self::Google512k => "google_512k",
            Self::Poisson => "poisson",
            Self::Tsdf => "tsdf",
        }
    }
}

/// License of all objects of the collection.
const LICENSE: &str = "CC-BY-4.0";

impl Config for Ycb {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "ycb";
    const EXAMPLE: &'static str = "root = \"${ASSETS}/ycb\"";
    fn build(self) -> Result<Box<dyn AssetSource>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl AssetSource for Ycb {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let wanted = format!("`<name>/{}/textured.obj`", self.reconstruction.folder());
        let has_mesh = |folder: &Path| mesh_in(folder, self.reconstruction).map(|mesh| mesh.is_some());
        catalog_of_folders(&self.root, has_mesh, |_, name| Ok(category(name)), &wanted)
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let folder = AssetRoot::open(self.root.path())?.locate(Path::new(name))?;
        let mesh = mesh_in(&folder, self.reconstruction)?.ok_or_else(|| {
            Error::new(format!("no mesh of the reconstruction {:?}", self.reconstruction)).in_file(&folder)
        })?;
        let model = obj::read(&AssetRoot::open(&folder)?.within(self.limits), &mesh, log)?;
        let info = ObjectInfo { name: name.to_owned(), category: category(name), license: LICENSE.to_owned() };
        model.into_object(info, &folder.join(mesh), log).map(|(object, _)| Asset::from(object))
    }
}

/// The mesh of an object's folder, relative to it.
pub(crate) fn mesh_in(folder: &Path, reconstruction: Reconstruction) -> Result<Option<PathBuf>> {
    let own = Path::new(reconstruction.folder());
    for mesh in [own.join("textured.obj"), "textured.obj".into()] {
        if exists(&folder.join(&mesh))? {
            return Ok(Some(mesh));
        }
    }
    // Simplified and repackaged versions; `textured_simple.obj` is first in order.
    for inside in [Path::new(""), own] {
        if is_dir(&folder.join(inside))? {
            let simple = |name: &String| name.starts_with("textured_simple") && name.ends_with(".obj");
            if let Some(name) = list(&folder.join(inside))?.files.into_iter().find(simple) {
                return Ok(Some(inside.join(name)));
            }
        }
    }
    Ok(None)
}

/// `003_cracker_box` is a `cracker_box`, `065-a_cups` are `cups`.
fn category(name: &str) -> String {
    match name.split_once('_') {
        Some((number, rest)) if number.starts_with(|c: char| c.is_ascii_digit()) && !rest.is_empty() => rest.to_owned(),
        _ => name.to_owned(),
    }
}

syntable_model::register!(Ycb);
