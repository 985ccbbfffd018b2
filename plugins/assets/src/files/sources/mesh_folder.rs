//! Any folder of meshes.

use super::folder::{Found, Kept, by_stem, category, enter};
use super::{MESH_EXTENSIONS, read_mesh};
use crate::files::object::{Identity, finish};
use crate::files::root::AssetRoot;
use crate::files::scan::extension;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};

/// Meshes anywhere below a folder: OBJ with MTL, glTF, GLB, PLY and STL, in metres. (The pool's `scale` brings other
/// units to metres.)
///
/// An asset's name is its path without the extension, or that of its folder where that holds no other mesh; its category
/// is the folder above. Of one mesh in several formats the richest is read: glTF, then OBJ, PLY, STL.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFolder {
    /// Folder that holds the meshes, at most eight folders deep. Meshes may use pictures from anywhere below it.
    root: AssetPath,
    /// Which axis points up in OBJ, PLY and STL files, which do not say. glTF is y up by its standard.
    #[serde(default)]
    up: Up,
    /// Licence of the objects, as an SPDX expression or name.
    #[serde(default)]
    licence: String,
    #[serde(skip)]
    found: Kept,
}

/// An axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Up {
    /// The third.
    #[default]
    Z,
    /// The second.
    Y,
}

impl Config for MeshFolder {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "mesh_folder";
    const EXAMPLE: &'static str = "root = \"${ASSETS}/gltf\"\nup = \"z\"\nlicence = \"CC0-1.0\"";
    fn build(self) -> Result<Box<dyn AssetSource>, Invalid> {
        Ok(Box::new(self))
    }
}

impl AssetSource for MeshFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        self.found.catalog(&root, find(&root, log)?, "OBJ, glTF, GLB, PLY or STL file")
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?;
        let file = self.found.file(name, || find(&root, log))?;
        let file = file.ok_or_else(|| Error::new(format!("no mesh `{name}`")).in_file(root.folder()))?;
        let model = read_mesh(&root, &file, log)?;
        let has_up = matches!(extension(&file).as_str(), "glb" | "gltf");
        let model = if self.up == Up::Y && !has_up { model.y_up_to_z_up() } else { model };
        let identity =
            Identity { name: name.to_owned(), category: category(name, root.folder()), licence: self.licence.clone() };
        finish(model, identity, &root.folder().join(&file), log).map(|(object, _)| Asset::Object(object))
    }
}

/// All meshes by name.
fn find(root: &AssetRoot, log: &dyn Log) -> Result<Found> {
    let meshes = by_stem(root, &MESH_EXTENSIONS)?;
    let mut in_folder: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for stem in meshes.keys() {
        *in_folder.entry(stem.parent().unwrap_or(Path::new("")).to_owned()).or_default() += 1;
    }
    let short = |stem: &Path| match stem.parent() {
        Some(folder) if folder != Path::new("") && in_folder.get(folder) == Some(&1) => folder.to_owned(),
        _ => stem.to_owned(),
    };
    // Where a short name is also another mesh's name, both keep their whole path.
    let mut uses: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for stem in meshes.keys() {
        *uses.entry(short(stem)).or_default() += 1;
    }
    let mut found = Found::new();
    for (stem, files) in &meshes {
        let name = short(stem);
        let name = if uses.get(&name) == Some(&1) { &name } else { stem };
        enter(&mut found, name, files, root, log);
    }
    Ok(found)
}

syntable_model::register!(MeshFolder);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    #[test]
    fn names_are_short_and_unique() {
        let folder = tempfile::tempdir().expect("temp folder");
        for path in [
            "mug.obj",
            "mug/model.obj",
            "cup/a.obj",
            "cup/b.glb",
            "cup/b.stl",
            "x/y/z.ply",
            "x/notes.txt",
            "bowl/bowl.gltf",
        ] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
            std::fs::write(path, "x").expect("file");
        }
        let (root, log) = (AssetRoot::open(folder.path()).expect("opens"), Collected::default());
        let found = find(&root, &log).expect("scans");
        let got: Vec<(&str, &str)> =
            found.iter().map(|(name, path)| (name.as_str(), path.to_str().expect("UTF-8"))).collect();
        let want = [
            ("bowl", "bowl/bowl.gltf"),
            ("cup/a", "cup/a.obj"),
            ("cup/b", "cup/b.glb"),
            ("mug", "mug.obj"),
            ("mug/model", "mug/model.obj"),
            ("x/y", "x/y/z.ply"),
        ];
        assert_eq!(got, want);
        assert_eq!(log.warnings().len(), 1, "{:?}", log.warnings());
    }
}
