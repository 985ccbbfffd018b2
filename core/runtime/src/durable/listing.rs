//! The list of files that a command created in a folder.

use super::disk;
use crate::run::dataset::manifest::Stamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use syntable_model::error::{Error, Result};

/// Name of the list in the folder.
pub const LISTING: &str = ".syntable-files";
/// Maximum number of files that an error names.
const NAMED: usize = 5;

/// The files that a command created in a folder. Commands delete no other file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileListing {
    /// The command, such as `syntable report`.
    pub made_by: String,
    /// Size and digest of each file, by its path with `/` between folders.
    pub(crate) files: BTreeMap<String, Stamp>,
}

impl FileListing {
    /// Reads the list of a folder. Returns `None` if the folder has no list of this program.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(LISTING);
        match fs::symlink_metadata(&path) {
            Ok(there) if there.is_file() => {}
            Ok(_) => return Ok(None),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            Err(error) => return Err(Error::io(&path, &error)),
        }
        let bytes = fs::read(&path).map_err(|error| Error::io(&path, &error))?;
        let listing: Option<Self> = serde_json::from_slice(&bytes).ok();
        let is_inside = |path: &String| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        Ok(listing.filter(|listing| listing.files.keys().all(is_inside)))
    }

    /// The text of the list.
    pub(super) fn text(&self) -> String {
        serde_json::to_string_pretty(self).expect("a list is plain data") + "\n"
    }

    /// Names, in order, of all entries of a folder except unchanged listed files: new files, changed files, and empty
    /// folders.
    pub fn others(&self, folder: &Path) -> Result<Vec<String>> {
        let mut others = Vec::new();
        walk(folder, &mut |entry| {
            match (self.files.get(&entry.inside), entry.kind) {
                (_, EntryKind::File) if entry.inside == LISTING => {}
                (Some(stamp), EntryKind::File) => {
                    if !stamp.is_of_file(&entry.path)? {
                        others.push(format!("{} (changed)", entry.inside));
                    }
                }
                (_, EntryKind::Empty) => {
                    let below = format!("{}/", entry.inside);
                    if !self.files.keys().any(|path| path.starts_with(&below)) {
                        others.push(below);
                    }
                }
                (_, EntryKind::Left) => {}
                (..) => others.push(entry.inside),
            }
            Ok(())
        })?;
        others.sort();
        Ok(others)
    }

    /// Refuses a folder with files that the command did not create.
    pub fn check(&self, folder: &Path) -> Result<()> {
        let others = self.others(folder)?;
        if others.is_empty() {
            return Ok(());
        }
        let command = &self.made_by;
        Err(Error::new(format!("the folder has files that `{command}` did not create: {}", named(&others)))
            .in_file(folder)
            .help("move them away, or choose another folder; no file was changed"))
    }

    /// Deletes the listed files, then empty folders. Other files stay, and are an error.
    pub(super) fn delete(&self, folder: &Path) -> Result<()> {
        let mut kept = Vec::new();
        walk(folder, &mut |entry| {
            let FolderEntry { path, inside, kind } = entry;
            let is_listed = match self.files.get(&inside) {
                Some(stamp) if kind == EntryKind::File => {
                    fs::symlink_metadata(&path).map_err(|error| Error::io(&path, &error))?.len() == stamp.0
                }
                _ => false,
            };
            let removed = match kind {
                // The list goes last: until then, it identifies the folder as ours.
                EntryKind::File if inside == LISTING => Ok(()),
                _ if is_listed => disk::remove_file(&path),
                // Fails for a folder with files that stay.
                EntryKind::Empty | EntryKind::Left => disk::remove_dir(&path).or_else(|error| match error.kind() {
                    ErrorKind::DirectoryNotEmpty => Ok(()),
                    _ => Err(error),
                }),
                _ => {
                    kept.push(inside);
                    Ok(())
                }
            };
            removed.map_err(|error| Error::io(&path, &error))
        })?;
        if !kept.is_empty() {
            return Err(Error::new(format!(
                "the folder has files that `{}` did not create: {}",
                self.made_by,
                named(&kept)
            ))
            .in_file(folder)
            .help("they appeared while the command worked, and were kept: move them away, and run the command again"));
        }
        let listing = folder.join(LISTING);
        disk::remove_file(&listing).map_err(|error| Error::io(&listing, &error))?;
        disk::remove_dir(folder).map_err(|error| Error::io(folder, &error))
    }
}

/// The first few names, and the number of the others.
fn named(names: &[String]) -> String {
    let some = names.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => some,
        more => format!("{some} and {more} more"),
    }
}

/// An entry of a folder.
struct FolderEntry {
    path: PathBuf,
    /// Path relative to the folder, with `/` between names.
    inside: String,
    kind: EntryKind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EntryKind {
    File,
    /// An empty folder.
    Empty,
    /// A folder, visited after its entries.
    Left,
    /// A link, a pipe or a device.
    Odd,
}

/// Visits all entries below a folder in the order of their names, each folder after its entries. Does not follow links.
fn walk(folder: &Path, visit: &mut dyn FnMut(FolderEntry) -> Result<()>) -> Result<()> {
    fn inner(folder: &Path, above: &str, visit: &mut dyn FnMut(FolderEntry) -> Result<()>) -> Result<bool> {
        let failed = |error: std::io::Error| Error::io(folder, &error);
        let mut entries = fs::read_dir(folder).map_err(failed)?.collect::<std::io::Result<Vec<_>>>().map_err(failed)?;
        entries.sort_by_key(fs::DirEntry::file_name);
        let is_empty = entries.is_empty();
        for entry in entries {
            let (path, name) = (entry.path(), entry.file_name());
            let name = name.to_string_lossy();
            let inside = if above.is_empty() { name.into_owned() } else { format!("{above}/{name}") };
            let kind = entry.file_type().map_err(|error| Error::io(&path, &error))?;
            let kind = match (kind.is_dir(), kind.is_file()) {
                (true, _) => {
                    if inner(&path, &inside, visit)? {
                        EntryKind::Empty
                    } else {
                        EntryKind::Left
                    }
                }
                (_, true) => EntryKind::File,
                _ => EntryKind::Odd,
            };
            visit(FolderEntry { path, inside, kind })?;
        }
        Ok(is_empty)
    }
    inner(folder, "", visit).map(drop)
}
