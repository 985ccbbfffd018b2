//! `google_scanned_objects`: folders `<name>/meshes/model.obj` or `<name>/model.obj`, meters, z up.

use super::folder::catalog_of_folders;
use super::keypoints::with_keypoints;
use super::layouts::scanned_mesh;
use crate::formats::obj;
use std::path::Path;
use syntable_mesh::ObjectInfo;
use syntable_mesh::root::{AssetRoot, read_file};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};
use syntable_model::stage::AssetLimits;

/// Objects of Google Scanned Objects (Downs et al., ICRA 2022), as downloaded: one folder per object with
/// `meshes/model.obj`, `meshes/model.mtl` and `materials/textures/texture.png`; or as repackaged for simulators, with
/// `model.obj` and `texture.png` in the object's folder itself. Meters, z up. The category is the first category of
/// `metadata.pbtxt`, if the file exists.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoogleScannedObjects {
    /// Folder that holds the objects' folders.
    root: AssetPath,
    #[serde(skip)]
    limits: AssetLimits,
}

/// License of all objects of the collection.
const LICENSE: &str = "CC-BY-4.0";

/// Default category.
const CATEGORY: &str = "google_scanned_objects";

config!(GoogleScannedObjects => dyn AssetSource, "google_scanned_objects", "root = \"${ASSETS}/gso\"");

impl AssetSource for GoogleScannedObjects {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let has_mesh = |folder: &Path| scanned_mesh(folder).map(|mesh| mesh.is_some());
        let wanted = "`<name>/meshes/model.obj` or `<name>/model.obj`";
        catalog_of_folders(&self.root, has_mesh, |folder, _| category(folder), wanted)
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let folder = AssetRoot::open(self.root.path())?.locate(Path::new(name))?;
        let root = AssetRoot::open(&folder)?.within(self.limits);
        let mesh = scanned_mesh(&folder)?.ok_or_else(|| Error::new("no mesh `model.obj`").in_file(&folder))?;
        let model = obj::read(&root, mesh, log)?;
        let info = ObjectInfo { name: name.to_owned(), category: category(&folder)?, license: LICENSE.to_owned() };
        let (object, _) = model.into_object(info, &folder.join(mesh), log)?;
        with_keypoints(object, &root, mesh).map(Asset::from)
    }
}

/// The first category of `metadata.pbtxt`: the text after `first:` within `categories`.
fn category(folder: &Path) -> Result<String> {
    let path = folder.join("metadata.pbtxt");
    let bytes = match read_file(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.is_transient() => return Err(error),
        Err(_) => return Ok(CATEGORY.to_owned()),
    };
    let text = String::from_utf8_lossy(&bytes);
    let known = || {
        let (_, categories) = text.split_once("categories")?;
        let (_, first) = categories.split_once("first:")?;
        let name = first.split('"').nth(1)?.trim();
        (!name.is_empty()).then(|| name.to_owned())
    };
    Ok(known().unwrap_or_else(|| CATEGORY.to_owned()))
}

syntable_model::register!(GoogleScannedObjects);
