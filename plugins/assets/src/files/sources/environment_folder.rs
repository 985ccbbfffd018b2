//! Any folder of environment maps.

use super::mesh_folder::category;
use super::nothing_found;
use crate::files::formats::environment;
use crate::files::root::AssetRoot;
use crate::files::scan::{extension, walk};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::OnceLock;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, CatalogEntry};

/// Environment maps anywhere below a folder: equirectangular pictures, Radiance HDR (`.hdr`) or OpenEXR (`.exr`), of
/// linear radiance with Rec. 709 primaries.
///
/// A map's name is its path without the extension; its category is the folder above. The middle column looks along the
/// world's +x, the first row up. Such files rarely say what one unit is in nits: the light that uses a map scales it.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentFolder {
    /// Folder that holds the maps, at most eight folders deep.
    root: AssetPath,
    /// Licence of the maps, as an SPDX expression or name.
    #[serde(default)]
    licence: String,
    #[serde(skip)]
    found: OnceLock<BTreeMap<String, PathBuf>>,
}

/// Deepest folder below the root that is looked into.
const DEPTH: usize = 8;
/// Extensions, the richer format first.
const EXTENSIONS: [&str; 2] = ["exr", "hdr"];

impl Config for EnvironmentFolder {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "environment_folder";
    const EXAMPLE: &'static str = "root = \"${ASSETS}/hdri\"\nlicence = \"CC0-1.0\"";
    fn build(self) -> Result<Box<dyn AssetSource>, Invalid> {
        Ok(Box::new(self))
    }
}

impl AssetSource for EnvironmentFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Environment
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        let found = find(&root, log)?;
        if found.is_empty() {
            return Err(nothing_found(&root, "`.hdr` or `.exr` file"));
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
        let file = file.ok_or_else(|| Error::new(format!("no environment map `{name}`")).in_file(root.folder()))?;
        let mut map = environment::read(&root.locate(&file)?)?;
        name.clone_into(&mut map.name);
        map.licence.clone_from(&self.licence);
        Ok(Asset::Environment(map))
    }
}

/// All maps by name, their paths relative to the root. Of one map in both formats OpenEXR is read.
fn find(root: &AssetRoot, log: &dyn Log) -> Result<BTreeMap<String, PathBuf>> {
    let files = walk(root, DEPTH, &|path| EXTENSIONS.contains(&extension(path).as_str()))?;
    let mut found: BTreeMap<String, PathBuf> = BTreeMap::new();
    // Sorted by path, so that `.exr` comes before `.hdr`.
    for file in files {
        let name = file.with_extension("").to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
        match found.get(&name) {
            Some(first) => {
                let message = format!("`{name}` is there twice; `{}` is read instead", first.display());
                log.warn(&Error::new(message).in_file(root.folder().join(&file)));
            }
            None => {
                found.insert(name, file);
            }
        }
    }
    Ok(found)
}

syntable_model::register!(EnvironmentFolder);
