//! Any folder of assets: files of some formats anywhere below a root, each named by its path.

use super::nothing_found;
use crate::files::root::AssetRoot;
use crate::files::scan::{extension, root_name, walk};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Catalog, CatalogEntry};

/// Deepest folder below the root that is looked into.
const DEPTH: usize = 8;

/// Assets by name, their paths relative to the root.
pub type Found = BTreeMap<String, PathBuf>;

/// What the catalog found, kept for the assets that are drawn.
#[derive(Debug, Default)]
pub struct Kept(OnceLock<Found>);

impl Kept {
    /// The catalog of what was found; an error if that is nothing.
    pub fn catalog(&self, root: &AssetRoot, found: Found, looked_for: &str) -> Result<Catalog> {
        if found.is_empty() {
            return Err(nothing_found(root, looked_for));
        }
        let entries = found
            .keys()
            .map(|name| CatalogEntry { name: name.clone(), category: category(name, root.folder()) })
            .collect();
        // A second call finds the same; the first stays.
        let _ = self.0.set(found);
        Ok(Catalog { entries })
    }

    /// The file of an asset; without a catalog before, it is found now.
    pub fn file(&self, name: &str, find: impl FnOnce() -> Result<Found>) -> Result<Option<PathBuf>> {
        match self.0.get() {
            Some(found) => Ok(found.get(name).cloned()),
            None => Ok(find()?.remove(name)),
        }
    }
}

/// All files below a root with one of the extensions, by path without extension: the same path in several formats is
/// one asset. Its files come in the order of the extensions.
pub fn by_stem(root: &AssetRoot, extensions: &[&str]) -> Result<BTreeMap<PathBuf, Vec<PathBuf>>> {
    let mut stems: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for file in walk(root, DEPTH, &|path| extensions.contains(&extension(path).as_str()))? {
        stems.entry(file.with_extension("")).or_default().push(file);
    }
    let rank = |file: &PathBuf| extensions.iter().position(|known| *known == extension(file));
    for files in stems.values_mut() {
        // Stable: files that differ only in the case of the extension stay sorted by path.
        files.sort_by_key(rank);
    }
    Ok(stems)
}

/// Enters an asset under the path that is its name, with the first of its files; warns of the others.
pub fn enter(found: &mut Found, path: &Path, files: &[PathBuf], root: &AssetRoot, log: &dyn Log) {
    let name = path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    let [first, others @ ..] = files else { return };
    for other in others {
        let message = format!("`{name}` is there twice; `{}` is read instead", first.display());
        log.warn(&Error::new(message).in_file(root.folder().join(other)));
    }
    found.insert(name, first.clone());
}

/// The folder above a name, or the root.
pub fn category(name: &str, root: &Path) -> String {
    match name.rsplit('/').nth(1) {
        Some(folder) => folder.to_owned(),
        None => root_name(root),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_category_is_the_folder_above() {
        assert_eq!(category("cup/a", Path::new("/data/things")), "cup");
        assert_eq!(category("bowl", Path::new("/data/things")), "things");
    }
}
