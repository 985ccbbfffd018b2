//! Any folder of assets: files of some formats anywhere below a root, each named by its path.

use super::collision::{self, Rule};
use super::layouts::kind_of;
use super::nothing_found;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syntable_mesh::foreign;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::scan::{WalkedFiles, extension, list, root_name, walk};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::limits::FOLDER_DEPTH;
use syntable_model::names::AssetPath;
use syntable_model::scene::{Catalog, CatalogEntry};

/// Maximum number of skipped meshes that a message names.
const SHOWN: usize = 8;

/// The files of assets by name, relative to the root; at least one per asset.
pub type AssetFiles = BTreeMap<String, Vec<PathBuf>>;

/// The files that the catalog found, for the assets that are loaded later.
#[derive(Debug, Default)]
pub struct FileIndex(OnceLock<AssetFiles>);

impl FileIndex {
    /// Makes the catalog of files, which must not be empty, and stores them.
    pub fn catalog(&self, root: &AssetRoot, files: AssetFiles, looked_for: &str) -> Result<Catalog> {
        if files.is_empty() {
            return Err(nothing_found(root, looked_for));
        }
        let entries = files.keys().map(|name| CatalogEntry::new(name, category(name, root.folder()))).collect();
        // A second call finds the same files; the first result stays.
        let _ = self.0.set(files);
        Ok(Catalog { entries })
    }

    /// The files of an asset. Scans the folder if the catalog does not exist yet.
    pub fn files(&self, name: &str, find: impl FnOnce() -> Result<AssetFiles>) -> Result<Option<Vec<PathBuf>>> {
        match self.0.get() {
            Some(files) => Ok(files.get(name).cloned()),
            None => Ok(find()?.remove(name)),
        }
    }
}

/// The catalog of a root with one folder per object: folders that hold a mesh, with a category by path and name. The
/// error for a folder without any names the kind of source that it is laid out for.
pub fn catalog_of_folders(
    root: &AssetPath,
    has_mesh: impl Fn(&Path) -> Result<bool>,
    category: impl Fn(&Path, &str) -> Result<String>,
    looked_for: &str,
) -> Result<Catalog> {
    let root = AssetRoot::open(root.path())?;
    let mut entries = Vec::new();
    for name in list(root.folder())?.folders {
        let folder = root.folder().join(&name);
        if has_mesh(&folder)? {
            entries.push(CatalogEntry::new(&name, category(&folder, &name)?));
        }
    }
    if !entries.is_empty() {
        return Ok(Catalog { entries });
    }
    let error = nothing_found(&root, looked_for);
    Err(match kind_of(root.folder())? {
        Some(kind) => error.help(format!("the folder is laid out for `kind = \"{kind}\"`")),
        None => error,
    })
}

/// All files below a root with one of the extensions, by path without extension. The same path in several formats is
/// one asset; its files are in the order of the extensions.
///
/// The log gets the folders and names that were not searched.
pub fn by_stem(root: &AssetRoot, extensions: &[&str], log: &dyn Log) -> Result<BTreeMap<PathBuf, Vec<PathBuf>>> {
    let mut stems: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    let found =
        walk(root.folder(), FOLDER_DEPTH.most as usize, &|path| extensions.contains(&extension(path).as_str()))?;
    warn_of_unsearched(root, &found, log);
    for file in found.files {
        stems.entry(file.with_extension("")).or_default().push(file);
    }
    let rank = |file: &PathBuf| extensions.iter().position(|known| *known == extension(file));
    for files in stems.values_mut() {
        // Stable: files that differ only in the case of the extension stay sorted by path.
        files.sort_by_key(rank);
    }
    Ok(stems)
}

/// Warns about folders and names of a root that were not searched, once for each reason.
fn warn_of_unsearched(root: &AssetRoot, found: &WalkedFiles, log: &dyn Log) {
    let folders = |what: &str, paths: &[PathBuf], help: &str| {
        if let Some(first) = paths.first() {
            let message = format!("folders are not searched, because they are {what}: {}", paths.len());
            log.warn(&Error::new(message).in_file(root.folder().join(first)).help(help.to_owned()));
        }
    };
    folders("symbolic links", &found.links, "name the linked folder as the `root` of a pool, or copy it into this one");
    let deep = format!("more than {} levels deep", FOLDER_DEPTH.most);
    folders(&deep, &found.deep, "name a folder further down as the `root` of a pool");
    if found.unnamed > 0 {
        let message = format!("names that are not UTF-8 are left out: {}", found.unnamed);
        log.warn(&Error::new(message).in_file(root.folder()).help("rename these files and folders"));
    }
}

/// Removes collision meshes from the meshes of a root. One warning counts them by rule, another names those that may be
/// objects. An error if no other mesh remains.
/// `others` are meshes of formats that are not read: they are siblings, too.
pub fn leave_out_collision_meshes(
    meshes: &mut BTreeMap<PathBuf, Vec<PathBuf>>,
    others: &BTreeMap<PathBuf, Vec<PathBuf>>,
    root: &AssetRoot,
    log: &dyn Log,
) -> Result<()> {
    let rules = collision::rules(meshes.keys().map(PathBuf::as_path), others.keys().map(PathBuf::as_path));
    let mut found = rules.into_iter();
    let mut left_out: Vec<(PathBuf, Rule)> = Vec::new();
    meshes.retain(|_, files| {
        let rule = found.next().flatten();
        let is_object = rule.is_none();
        left_out.extend(files.first().cloned().zip(rule));
        is_object
    });
    let Some((first, _)) = left_out.first() else { return Ok(()) };
    let rules: Vec<Rule> = left_out.iter().map(|(_, rule)| rule.clone()).collect();
    let by_rule = format!("{} ({})", collision::describe(&rules), shown(left_out.iter()));
    let message = match rules.len() {
        1 => format!("skipped 1 collision mesh: {by_rule}"),
        count => format!("skipped {count} collision meshes: {by_rule}"),
    };
    let note = Error::new(message).in_file(root.folder().join(first));
    let help = "set `collision_meshes = \"include\"` in the pool to use them as objects";
    if meshes.is_empty() {
        return Err(Error::new(format!("the folder has only collision meshes: {by_rule}"))
            .in_file(root.folder())
            .help(help));
    }
    log.warn(&note.help(help));
    let alone: Vec<&(PathBuf, Rule)> = left_out.iter().filter(|(_, rule)| rule.is_alone()).collect();
    if let Some((first, _)) = alone.first() {
        let what = if alone.len() == 1 { "1 mesh".to_owned() } else { format!("{} meshes", alone.len()) };
        let names = shown(alone.into_iter());
        let message = format!(
            "skipped {what} because of a word in the name, without a rendered mesh next to it; objects may be missing: {names}"
        );
        let help = "`collision_meshes = \"include\"` in the pool uses all meshes as objects; its `include` and `exclude` then \
                    choose among them";
        log.warn(&Error::new(message).in_file(root.folder().join(first)).help(help));
    }
    Ok(())
}

/// The first of the skipped meshes, each with its rule.
fn shown<'a>(left_out: impl ExactSizeIterator<Item = &'a (PathBuf, Rule)>) -> String {
    let more = if left_out.len() > SHOWN { ", …" } else { "" };
    let names = left_out.take(SHOWN).map(|(file, rule)| format!("`{}`: {rule}", file.display()));
    names.collect::<Vec<_>>().join(", ") + more
}

/// Adds an asset named `path`. Each of its parts has one or several files, and the first is read. Warns about the others,
/// and about an asset whose name already exists.
pub fn add_asset(assets: &mut AssetFiles, path: &Path, parts: &[&[PathBuf]], root: &AssetRoot, log: &dyn Log) {
    let name = path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    let Some(first) = parts.iter().find_map(|files| files.first()) else { return };
    if let Some(other) = assets.get(&name).and_then(|files| files.first()) {
        let message = format!("skipped: `{}` also has the name `{name}`", other.display());
        return log.warn(&Error::new(message).in_file(root.folder().join(first)).help("rename one of them"));
    }
    for files in parts {
        let [used, others @ ..] = files else { continue };
        for other in others {
            let message = format!("`{name}` has several files; using `{}`", used.display());
            log.warn(&Error::new(message).in_file(root.folder().join(other)));
        }
    }
    assets.insert(name, parts.iter().filter_map(|files| files.first().cloned()).collect());
}

/// Warns about meshes of formats that are not read, unless a mesh of the same name is read instead.
pub fn warn_of_foreign(
    meshes: &BTreeMap<PathBuf, Vec<PathBuf>>,
    others: &BTreeMap<PathBuf, Vec<PathBuf>>,
    formats: &MeshFormats,
    root: &AssetRoot,
    log: &dyn Log,
) {
    let missing = others.iter().filter(|(stem, _)| !meshes.contains_key(*stem));
    let files: Vec<&PathBuf> = missing.flat_map(|(_, files)| files).collect();
    if let Some(refusal) =
        files.first().and_then(|file| foreign::refusal(&root.folder().join(file), &formats.extensions()))
    {
        let more = match files.len() {
            1 => "the file is no object of the pool".to_owned(),
            count => format!("{count} files in such formats are no objects of the pool"),
        };
        log.warn(&refusal.with_consequence(&more));
    }
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
