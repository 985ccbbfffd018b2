//! Any folder of meshes.

use super::{MESH_EXTENSIONS, nothing_found, read_mesh};
use crate::files::object::{Identity, finish};
use crate::files::root::AssetRoot;
use crate::files::scan::{extension, root_name, walk};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, CatalogEntry};

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
    found: OnceLock<BTreeMap<String, PathBuf>>,
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

/// Deepest folder below the root that is looked into.
const DEPTH: usize = 8;

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
        let found = find(&root, log)?;
        if found.is_empty() {
            return Err(nothing_found(&root, "OBJ, glTF, GLB, PLY or STL file"));
        }
        let entries = found
            .keys()
            .map(|name| CatalogEntry { name: name.clone(), category: category(name, root.folder()) })
            .collect();
        // A second call finds the same; the first stays.
        let _ = self.found.set(found);
        Ok(Catalog { entries })
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?;
        let file = match self.found.get() {
            Some(found) => found.get(name).cloned(),
            None => find(&root, log)?.remove(name),
        };
        let file = file.ok_or_else(|| Error::new(format!("no mesh `{name}`")).in_file(root.folder()))?;
        let model = read_mesh(&root, &file, log)?;
        let has_up = matches!(extension(&file).as_str(), "glb" | "gltf");
        let model = if self.up == Up::Y && !has_up { model.y_up_to_z_up() } else { model };
        let identity =
            Identity { name: name.to_owned(), category: category(name, root.folder()), licence: self.licence.clone() };
        finish(model, identity, &root.folder().join(&file), log).map(|(object, _)| Asset::Object(object))
    }
}

/// All meshes by name, their paths relative to the root.
fn find(root: &AssetRoot, log: &dyn Log) -> Result<BTreeMap<String, PathBuf>> {
    let files = walk(root, DEPTH, &|path| MESH_EXTENSIONS.contains(&extension(path).as_str()))?;
    // The same path in several formats is one mesh.
    let mut meshes: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for file in files {
        meshes.entry(file.with_extension("")).or_default().push(file);
    }
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
    let mut found = BTreeMap::new();
    for (stem, mut files) in meshes {
        let rank = |file: &PathBuf| MESH_EXTENSIONS.iter().position(|known| *known == extension(file));
        files.sort_by_key(|file| (rank(file), file.clone()));
        let name = short(&stem);
        let name = if uses.get(&name) == Some(&1) { name } else { stem };
        let name = name.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
        if let [best, others @ ..] = &files[..] {
            for other in others {
                let message = format!("`{name}` is there twice; `{}` is read instead", best.display());
                log.warn(&Error::new(message).in_file(root.folder().join(other)));
            }
            found.insert(name, best.clone());
        }
    }
    Ok(found)
}

/// The folder above a name, or the root.
pub(super) fn category(name: &str, root: &Path) -> String {
    match name.rsplit('/').nth(1) {
        Some(folder) => folder.to_owned(),
        None => root_name(root),
    }
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
        assert_eq!(category("cup/a", Path::new("/data/things")), "cup");
        assert_eq!(category("bowl", Path::new("/data/things")), "things");
    }
}
