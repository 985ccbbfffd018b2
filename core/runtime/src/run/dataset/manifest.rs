//! Lists of files with their sizes and digests.

use crate::run::dataset::foreign::read_list;
use crate::run::dataset::inside::link_before;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::Path;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;

/// Files by their path, relative to the dataset, with `/` between folders.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Size and digest of each file.
    pub files: BTreeMap<DatasetPath, Stamp>,
    /// Of a scene, whose they are, but for what settling did.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub writers: Written,
}

/// Files of a scene by the id of their writer.
pub type Written = BTreeMap<String, BTreeSet<DatasetPath>>;

/// Size of a file in bytes, and the digest of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp(pub u64, pub Digest);

/// The state of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// As it was written.
    Whole,
    /// Not there.
    Missing,
    /// Of another size or content.
    Damaged,
    /// A link, or behind one: not looked at.
    Linked,
}

impl Stamp {
    /// Reads a file.
    pub fn of(path: &Path) -> Result<Self> {
        let read = File::open(path).and_then(Digest::of_reader);
        read.map(|(digest, size)| Self(size, digest)).map_err(|error| Error::io(path, &error))
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

    /// Compares a file of a dataset with its stamp; the content only if the size is right, and nothing behind a link.
    pub fn check_in(&self, root: &Path, path: &DatasetPath) -> Result<State> {
        match link_before(root, path) {
            Some(_) => Ok(State::Linked),
            None => self.check(&path.below(root)),
        }
    }

    /// Compares a file with its stamp; the content only if the size is right.
    pub fn check(&self, path: &Path) -> Result<State> {
        match fs::symlink_metadata(path) {
            Ok(metadata) if metadata.is_symlink() => Ok(State::Linked),
            Ok(metadata) if metadata.is_file() && metadata.len() == self.0 => {
                Ok(if Self::of(path)? == *self { State::Whole } else { State::Damaged })
            }
            Ok(_) => Ok(State::Damaged),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(State::Missing),
            Err(error) => Err(Error::io(path, &error)),
        }
    }
}

impl Manifest {
    /// Lists the files of a folder, and brings them to disk.
    pub fn of_tree(root: &Path) -> Result<Self> {
        let mut manifest = Self::default();
        manifest.add_tree(root, "")?;
        Ok(manifest)
    }

    fn add_tree(&mut self, folder: &Path, inside: &str) -> Result<()> {
        for entry in fs::read_dir(folder).map_err(|error| Error::io(folder, &error))? {
            let entry = entry.map_err(|error| Error::io(folder, &error))?;
            let path = entry.path();
            let name = entry.file_name().into_string().map_err(|name| {
                Error::new(format!("the file name {} is not UTF-8", name.display())).in_file(folder).permanent()
            })?;
            let inside = if inside.is_empty() { name } else { format!("{inside}/{name}") };
            let kind = entry.file_type().map_err(|error| Error::io(&path, &error))?;
            if kind.is_dir() {
                self.add_tree(&path, &inside)?;
            } else if !kind.is_file() {
                return Err(Error::new("a writer made what is no regular file").in_file(&path).permanent());
            } else {
                let name = DatasetPath::new(inside).map_err(|error| Error::new(error.to_string()).permanent())?;
                let fail = |error: std::io::Error| Error::io(&path, &error);
                let file = File::open(&path).map_err(fail)?;
                let (digest, size) = Digest::of_reader(&file).map_err(fail)?;
                file.sync_data().map_err(fail)?;
                self.files.insert(name, Stamp(size, digest));
            }
        }
        Ok(())
    }

    /// The text of the manifest, and its digest.
    pub fn text(&self) -> (String, String) {
        let text = serde_json::to_string(self).expect("a manifest is plain data");
        let Stamp(_, digest) = Stamp::of_text(&text);
        (text, digest.to_string())
    }

    /// Reads a manifest, with its digest; none if there is no such file, or if its text is none of a manifest.
    pub fn read(path: &Path) -> Result<Option<(Self, String)>> {
        let Some(text) = read_list(path)?.and_then(|bytes| String::from_utf8(bytes).ok()) else { return Ok(None) };
        let manifest: Option<Self> = serde_json::from_str(&text).ok();
        let Stamp(_, digest) = Stamp::of_text(&text);
        Ok(manifest.map(|manifest| (manifest, digest.to_string())))
    }

    /// Without the files of writers that do not stay.
    pub fn only(&self, stays: impl Fn(&str) -> bool) -> Self {
        let mut kept = self.clone();
        kept.writers.retain(|id, _| stays(id));
        for path in self.writers.iter().filter(|(id, _)| !stays(id)).flat_map(|(_, files)| files) {
            kept.files.remove(path);
        }
        kept
    }

    /// Whether it lists a file.
    pub fn has(&self, path: &str) -> bool {
        self.files.contains_key(path)
    }
}
