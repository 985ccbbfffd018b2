//! Folder listings, in the same order on every system.

use std::fs;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::limits::FOLDER_ENTRIES;

/// Names in a folder.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct FolderNames {
    /// Folders, sorted by name.
    pub folders: Vec<String>,
    /// Everything else, sorted by name.
    pub files: Vec<String>,
    /// The folders that are symbolic links.
    pub linked: Vec<String>,
    /// Number of names that are not UTF-8, and therefore in no list.
    pub unnamed: usize,
}

/// Whether a folder exists. A failing file system is an error, a missing path is not.
pub fn is_dir(path: &Path) -> Result<bool> {
    metadata(path).map(|metadata| metadata.is_some_and(|metadata| metadata.is_dir()))
}

/// The metadata of a path, if it exists.
pub(crate) fn metadata(path: &Path) -> Result<Option<fs::Metadata>> {
    match fs::metadata(path).map_err(|error| Error::io(path, &error)) {
        Ok(metadata) => Ok(Some(metadata)),
        Err(error) if error.is_transient() => Err(error),
        Err(_) => Ok(None),
    }
}

/// Lists a folder. Hidden names and names that are not UTF-8 are skipped; links are followed.
pub fn list(folder: &Path) -> Result<FolderNames> {
    let io = |error: std::io::Error| Error::io(folder, &error);
    let mut listing = FolderNames::default();
    for (count, entry) in fs::read_dir(folder).map_err(io)?.enumerate() {
        FOLDER_ENTRIES.check(count as u64 + 1).map_err(|error| error.in_file(folder))?;
        let entry = entry.map_err(io)?;
        let Ok(name) = entry.file_name().into_string() else {
            listing.unnamed += 1;
            continue;
        };
        if name.starts_with('.') {
            continue;
        }
        let linked = entry.file_type().map_err(io)?.is_symlink();
        if is_dir(&entry.path())? {
            if linked {
                listing.linked.push(name.clone());
            }
            listing.folders.push(name);
        } else {
            listing.files.push(name);
        }
    }
    listing.folders.sort_unstable();
    listing.files.sort_unstable();
    Ok(listing)
}

/// Files below a root, and unsearched folders and names. Paths are relative to the root.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct WalkedFiles {
    /// The files, sorted.
    pub files: Vec<PathBuf>,
    /// Symbolic links to folders, which could form cycles.
    pub links: Vec<PathBuf>,
    /// Folders below the maximum depth.
    pub deep: Vec<PathBuf>,
    /// Number of names that are not UTF-8.
    pub unnamed: usize,
}

/// All files below a root, at most `depth` folders deep, that pass a test.
pub fn walk(root: &Path, depth: usize, wanted: &dyn Fn(&Path) -> bool) -> Result<WalkedFiles> {
    let mut found = WalkedFiles::default();
    let mut open = vec![(PathBuf::new(), 0)];
    let mut seen = 0;
    while let Some((folder, level)) = open.pop() {
        let FolderNames { folders, files, linked, unnamed } = list(&root.join(&folder))?;
        found.unnamed += unnamed;
        seen += folders.len() + files.len();
        FOLDER_ENTRIES.check(seen as u64).map_err(|error| error.in_file(root))?;
        found.files.extend(files.iter().map(|name| folder.join(name)).filter(|path| wanted(path)));
        for name in folders {
            let path = folder.join(&name);
            if linked.contains(&name) {
                found.links.push(path);
            } else if level < depth {
                open.push((path, level + 1));
            } else {
                found.deep.push(path);
            }
        }
    }
    for paths in [&mut found.files, &mut found.links, &mut found.deep] {
        paths.sort_unstable();
    }
    Ok(found)
}

/// The last part of a path, as text.
pub fn name_of(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Name of a root folder, even if the path is `.` or `..`.
pub fn root_name(folder: &Path) -> String {
    match name_of(folder) {
        name if name.is_empty() => folder.canonicalize().map(|path| name_of(&path)).unwrap_or_default(),
        name => name,
    }
}

/// Extension in lower case, without the dot; empty without an extension.
pub fn extension(path: &Path) -> String {
    path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}
