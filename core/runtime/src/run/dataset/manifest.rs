//! Lists of files with their sizes and digests.

use crate::run::dataset::foreign::{self, read_list};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::stage::unreadable;
use syntable_model::store::{Kind, StoreFolder, StoredFile};

/// Files by their path, relative to the dataset, with `/` between folders.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Size and digest of each file.
    pub files: Files,
    /// The files of each writer; the result of settling has none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub writers: Written,
}

/// Files with their sizes and digests.
pub type Files = BTreeMap<DatasetPath, Stamp>;

/// A function that hashes a file, such as [`Digest::of_reader`].
pub type HashFile = fn(StoredFile) -> std::io::Result<(Digest, u64)>;

/// Files of a scene by the id of their writer.
pub type Written = BTreeMap<String, BTreeSet<DatasetPath>>;

/// Size of a file in bytes, and the digest of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp(pub u64, pub Digest);

/// The state of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileState {
    /// Unchanged.
    Whole,
    /// Missing.
    Missing,
    /// Different size or content.
    Damaged,
    /// A link, or behind one, and therefore not compared.
    Linked,
}

impl Stamp {
    /// Reads a file of a dataset.
    pub fn of(dataset: &StoreFolder, path: &DatasetPath) -> Result<Self> {
        Self::by(Digest::of_reader, dataset, path)
    }

    /// Reads a file of a dataset, and hashes it by a function.
    fn by(hash: HashFile, dataset: &StoreFolder, path: &DatasetPath) -> Result<Self> {
        let fail = |error: std::io::Error| Error::io(dataset.name_of(path), &error);
        let opened = dataset.open(path)?.ok_or_else(|| fail(ErrorKind::NotFound.into()))?;
        hash(opened).map(|(digest, size)| Self(size, digest)).map_err(fail)
    }

    /// Reads a file of this machine.
    pub fn of_file(path: &Path) -> Result<Self> {
        let read = File::open(path).and_then(Digest::of_reader);
        read.map(|(digest, size)| Self(size, digest)).map_err(|error| Error::io(path, &error))
    }

    /// Whether a file of this machine has this stamp. Reads the content only if the size matches.
    pub fn is_of_file(&self, path: &Path) -> Result<bool> {
        let there = std::fs::symlink_metadata(path).map_err(|error| Error::io(path, &error))?;
        Ok(there.is_file() && there.len() == self.0 && Self::of_file(path)? == *self)
    }

    /// The stamp of a file with this text.
    pub fn of_text(text: &str) -> Self {
        Self::of_bytes(text.as_bytes())
    }

    /// The stamp of a file with this content.
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let (digest, size) = Digest::of_reader(bytes).expect("memory can be read");
        Self(size, digest)
    }

    /// Compares a file of a dataset with its stamp. Reads the content only if the size matches, and never through a
    /// link.
    pub fn check_in(&self, dataset: &StoreFolder, path: &DatasetPath) -> Result<FileState> {
        for folder in path.folders() {
            if dataset.has_link(folder)? {
                return Ok(FileState::Linked);
            }
        }
        self.check(dataset, path)
    }

    /// Compares a file with its stamp. Reads the content only if the size matches.
    pub fn check(&self, dataset: &StoreFolder, path: &DatasetPath) -> Result<FileState> {
        Ok(match dataset.look(path)? {
            None => FileState::Missing,
            Some(there) if there.kind == Kind::Link => FileState::Linked,
            Some(there) if there.kind != Kind::File || there.size != self.0 => FileState::Damaged,
            Some(_) if Self::of(dataset, path).map_err(unreadable)? == *self => FileState::Whole,
            Some(_) => FileState::Damaged,
        })
    }
}

impl Manifest {
    /// Lists the files of a folder, and syncs them to disk. Files that are `known` are neither read nor synced; `hash` hashes the
    /// others.
    pub fn of_tree(folder: &StoreFolder, known: &Files, hash: HashFile) -> Result<Self> {
        let mut manifest = Self::default();
        manifest.add_tree(folder, "", known, hash)?;
        Ok(manifest)
    }

    fn add_tree(&mut self, folder: &StoreFolder, inside: &str, known: &Files, hash: HashFile) -> Result<()> {
        for (name, kind) in folder.list(inside)? {
            let inside = if inside.is_empty() { name } else { format!("{inside}/{name}") };
            match kind {
                Kind::Folder => self.add_tree(folder, &inside, known, hash)?,
                Kind::File => {
                    let path = DatasetPath::new(inside).map_err(|error| Error::new(error.to_string()))?;
                    let stamp = match known.get(&path) {
                        Some(stamp) => *stamp,
                        None => {
                            let stamp = Stamp::by(hash, folder, &path)?;
                            folder.sync(&path)?;
                            stamp
                        }
                    };
                    self.files.insert(path, stamp);
                }
                Kind::Link | Kind::Other => {
                    let error = Error::new("a writer created an entry that is not a regular file");
                    return Err(error.in_file(folder.name_of(&inside)));
                }
            }
        }
        Ok(())
    }

    /// The text of the manifest, and its digest.
    pub fn text(&self) -> (String, Digest) {
        let text = serde_json::to_string(self).expect("a manifest is plain data");
        let Stamp(_, digest) = Stamp::of_text(&text);
        (text, digest)
    }

    /// Reads a manifest, with its digest. Returns `None` if the file is missing or not a manifest.
    ///
    /// # Errors
    /// If it cannot be read, or names files that are reserved for the program.
    pub fn read(dataset: &StoreFolder, path: &DatasetPath) -> Result<Option<(Self, Digest)>> {
        let Some((manifest, digest)) = Self::read_any(dataset, path)? else { return Ok(None) };
        let paths = manifest.files.keys().chain(manifest.writers.values().flatten());
        foreign::check_list(dataset, path, paths)?;
        Ok(Some((manifest, digest)))
    }

    /// As [`read`](Self::read), but the manifest may name any file. For code that changes nothing.
    pub fn read_any(dataset: &StoreFolder, path: &DatasetPath) -> Result<Option<(Self, Digest)>> {
        let Some(text) = read_list(dataset, path).map_err(unreadable)?.and_then(|bytes| String::from_utf8(bytes).ok())
        else {
            return Ok(None);
        };
        let manifest: Option<Self> = serde_json::from_str(&text).ok();
        let Stamp(_, digest) = Stamp::of_text(&text);
        Ok(manifest.map(|manifest| (manifest, digest)))
    }

    /// The manifest without the files of writers that do not stay.
    pub fn only(&self, stays: impl Fn(&str) -> bool) -> Self {
        let mut kept = self.clone();
        kept.writers.retain(|id, _| stays(id));
        for path in self.writers.iter().filter(|(id, _)| !stays(id)).flat_map(|(_, files)| files) {
            kept.files.remove(path);
        }
        kept
    }

    /// Whether the manifest lists a file.
    pub fn has(&self, path: &str) -> bool {
        self.files.contains_key(path)
    }
}
