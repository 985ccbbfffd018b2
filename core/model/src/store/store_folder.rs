//! A folder of a store.

use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::inside::linked;
use crate::store::{Access, Fill, Found, FsStore, Hold, Kind, Store, Stored, StoredFile};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A folder of a [`Store`]. Paths are relative to it. It may not exist yet.
///
/// A path of this machine is one: `StoreFolder::from(Path::new("data/train"))`; and so is a whole store:
/// `StoreFolder::from(Arc::new(MemStore::default()))`.
#[derive(Debug, Clone)]
pub struct StoreFolder {
    store: Arc<dyn Store>,
    /// None for the whole store.
    at: Option<DatasetPath>,
}

impl StoreFolder {
    /// A whole store.
    pub fn new(store: Arc<dyn Store>) -> Self {
        Self { store, at: None }
    }

    /// A folder within this one.
    pub fn inner(&self, folder: &DatasetPath) -> Self {
        Self { store: Arc::clone(&self.store), at: Some(self.whole(folder)) }
    }

    /// The whole name of the folder, for messages.
    pub fn name(&self) -> PathBuf {
        self.name_of("")
    }

    /// The whole name of a path, for messages.
    pub fn name_of(&self, path: &str) -> PathBuf {
        self.store.name_of(&self.text(path))
    }

    /// The folder on this machine, if the store has one.
    pub fn local(&self) -> Option<PathBuf> {
        let root = self.store.local()?;
        Some(self.at.as_ref().map_or_else(|| root.to_owned(), |at| at.below(root)))
    }

    /// Whether the store is on another machine; see [`Store::is_remote`].
    pub fn is_remote(&self) -> bool {
        self.store.is_remote()
    }

    /// Whether a folder of the same store is this one or is in it. Of folders on this machine, only the names are
    /// compared.
    pub fn contains(&self, other: &Self) -> bool {
        match (self.local(), other.local()) {
            (Some(own), Some(other)) => other.starts_with(own),
            (None, None) if Arc::ptr_eq(&self.store, &other.store) => match (&self.at, &other.at) {
                (None, _) => true,
                (Some(own), Some(at)) => own == at || at.folders().any(|folder| folder == own.as_str()),
                (Some(_), None) => false,
            },
            _ => false,
        }
    }

    /// Makes the store ready for writing; see [`Store::prepare`].
    pub fn prepare(&self) -> Result<()> {
        self.store.prepare()
    }

    /// The entry at a path; see [`Store::look`].
    pub fn look(&self, path: &str) -> Result<Option<Found>> {
        self.store.look(&self.text(path))
    }

    /// Whether a path exists.
    pub fn has(&self, path: &str) -> Result<bool> {
        self.look(path).map(|found| found.is_some())
    }

    /// Whether a link is at a path.
    pub fn has_link(&self, path: &str) -> Result<bool> {
        self.look(path).map(|found| found.is_some_and(|found| found.kind == Kind::Link))
    }

    /// Refuses a link where a folder must be.
    pub fn linked(&self, folder: &str) -> Error {
        linked(&self.name(), folder)
    }

    /// Names in a folder; see [`Store::list`].
    pub fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        self.store.list(&self.text(folder))
    }

    /// The files in the folder and in folders inside; see [`Store::files`].
    pub fn files(&self) -> Result<Vec<(DatasetPath, Stored)>> {
        self.store.files(&self.text(""))
    }

    /// Opens a file; see [`Store::open`].
    pub fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        self.store.open(&self.whole(path))
    }

    /// The content of a file; none if it does not exist.
    pub fn read(&self, path: &DatasetPath) -> Result<Option<Vec<u8>>> {
        let Some(mut opened) = self.open(path)? else { return Ok(None) };
        let mut bytes = Vec::new();
        opened.read_to_end(&mut bytes).map_err(|error| Error::io(self.name_of(path), &error))?;
        Ok(Some(bytes))
    }

    /// Creates a file; see [`Store::create`].
    pub fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        self.store.create(&self.whole(path))
    }

    /// Writes a file whole or not at all; see [`Store::put`].
    pub fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        self.store.put(&self.whole(path), fill)
    }

    /// Writes a file with this content, whole or not at all.
    pub fn write(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        self.put(path, &mut |file| file.write_all(bytes).map_err(|error| Error::io(self.name_of(path), &error)))
    }

    /// Writes a new file whole or not at all; see [`Store::put_new`].
    pub fn write_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        self.store.put_new(&self.whole(path), bytes)
    }

    /// Adds bytes to a file; see [`Store::append`].
    pub fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        self.store.append(&self.whole(path), bytes)
    }

    /// Waits until a file is stored for good; see [`Store::sync`].
    pub fn sync(&self, path: &DatasetPath) -> Result<()> {
        self.store.sync(&self.whole(path))
    }

    /// Gives a file the bytes of a file of `from` without storing them again; see [`Store::share`].
    pub fn share(&self, from: &Self, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        self.store.share(&*from.store, &from.whole(path), &self.whole(to))
    }

    /// Copies a new file from another folder, without storing its bytes again if the store can. Returns whether both files
    /// have the same bytes for that reason.
    ///
    /// # Errors
    /// If the file cannot be read or written, or `to` exists.
    pub fn copy(&self, from: &Self, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        if self.share(from, path, to)? {
            return Ok(true);
        }
        let gone = || Error::io(from.name_of(path), &io::ErrorKind::NotFound.into());
        let there = || Error::io(self.name_of(to), &io::ErrorKind::AlreadyExists.into());
        let mut opened = from.open(path)?.ok_or_else(gone)?;
        let mut file = self.create(to)?.ok_or_else(there)?;
        let copied = io::copy(&mut opened, &mut file).and_then(|_| file.flush());
        copied.map(|()| false).map_err(|error| Error::io(self.name_of(to), &error))
    }

    /// Moves a file or a folder; see [`Store::rename`].
    pub fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        self.store.rename(&self.whole(from), &self.whole(to))
    }

    /// Removes a file; see [`Store::remove`].
    pub fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.store.remove(&self.whole(path))
    }

    /// Removes a file, or a folder with all in it; see [`Store::remove_all`].
    pub fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        self.store.remove_all(&self.whole(path))
    }

    /// Locks a file; see [`Store::lock`].
    pub fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        self.store.lock(&self.whole(path), access)
    }

    fn whole(&self, path: &DatasetPath) -> DatasetPath {
        self.at.as_ref().map_or_else(|| path.clone(), |at| at.join(path))
    }

    fn text(&self, path: &str) -> String {
        match &self.at {
            None => path.to_owned(),
            Some(at) if path.is_empty() => at.to_string(),
            Some(at) => format!("{at}/{path}"),
        }
    }
}

impl<S: Store> From<Arc<S>> for StoreFolder {
    fn from(store: Arc<S>) -> Self {
        Self::new(store)
    }
}

impl From<Arc<dyn Store>> for StoreFolder {
    fn from(store: Arc<dyn Store>) -> Self {
        Self::new(store)
    }
}

impl From<PathBuf> for StoreFolder {
    fn from(path: PathBuf) -> Self {
        Self::new(Arc::new(FsStore::new(path)))
    }
}

impl From<&PathBuf> for StoreFolder {
    fn from(path: &PathBuf) -> Self {
        path.clone().into()
    }
}

impl From<&Path> for StoreFolder {
    fn from(path: &Path) -> Self {
        path.to_owned().into()
    }
}

impl From<&str> for StoreFolder {
    fn from(path: &str) -> Self {
        PathBuf::from(path).into()
    }
}

impl From<&StoreFolder> for StoreFolder {
    fn from(folder: &StoreFolder) -> Self {
        folder.clone()
    }
}
