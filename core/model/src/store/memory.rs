//! A store in memory.

use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::{Access, Fill, Found, Hold, Kind, Store, Stored, StoredFile};
use parking_lot::Mutex;
use std::any::Any;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Cursor, ErrorKind, Write};
use std::ops::Bound;
use std::path::PathBuf;
use std::sync::Arc;

/// Files in memory.
///
/// A run into memory keeps the whole dataset there, in addition to the memory for rendering.
#[derive(Default)]
pub struct MemStore {
    is_remote: bool,
    files: Arc<Mutex<Files>>,
    locks: Arc<Mutex<BTreeMap<DatasetPath, Lock>>>,
}

type Bytes = Arc<Vec<u8>>;
type Files = BTreeMap<DatasetPath, Bytes>;

/// The owners of a lock.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lock {
    Writer,
    Readers(usize),
}

impl MemStore {
    /// A store that callers treat as a store on another machine, for tests.
    pub fn remote() -> Self {
        Self { is_remote: true, ..Self::default() }
    }

    /// All files, by path.
    pub fn files(&self) -> BTreeMap<DatasetPath, Arc<Vec<u8>>> {
        self.files.lock().clone()
    }

    /// The content of a file; none if it does not exist.
    pub fn get(&self, path: &str) -> Option<Arc<Vec<u8>>> {
        self.files.lock().get(path).cloned()
    }

    /// Adds a file, or replaces the existing one.
    pub fn insert(&self, path: DatasetPath, bytes: Vec<u8>) {
        self.files.lock().insert(path, Arc::new(bytes));
    }

    /// A digest, as stores on other machines give it.
    fn version_of(&self, bytes: &[u8]) -> Option<String> {
        self.is_remote.then(|| Digest::of(bytes).to_string())
    }

    fn fail(&self, path: &str, kind: ErrorKind) -> Error {
        Error::io(self.name_of(path), &kind.into())
    }

    /// Refuses a path below a file, and the path of a folder.
    fn check_place(&self, files: &Files, path: &DatasetPath) -> Result<()> {
        if let Some(folder) = path.folders().find(|folder| files.contains_key(*folder)) {
            return Err(self.fail(folder, ErrorKind::NotADirectory));
        }
        if is_folder(files, path) { Err(self.fail(path, ErrorKind::IsADirectory)) } else { Ok(()) }
    }
}

/// The files in a folder, with their paths in the store.
fn below<'f>(files: &'f Files, folder: &str) -> impl Iterator<Item = (&'f DatasetPath, &'f Bytes)> {
    let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
    let all = files.range::<str, _>((Bound::Included(prefix.as_str()), Bound::Unbounded));
    all.take_while(move |(path, _)| path.starts_with(&prefix))
}

fn is_folder(files: &Files, path: &str) -> bool {
    below(files, path).next().is_some()
}

impl Store for MemStore {
    fn name_of(&self, path: &str) -> PathBuf {
        PathBuf::from(format!("memory:/{path}"))
    }

    fn is_remote(&self) -> bool {
        self.is_remote
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        let files = self.files.lock();
        let found = |kind, size| Some(Found { kind, size, leads_to: None, modified: None });
        Ok(match files.get(path) {
            Some(bytes) => found(Kind::File, bytes.len() as u64),
            None if path.is_empty() || is_folder(&files, path) => found(Kind::Folder, 0),
            None => None,
        })
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        let files = self.files.lock();
        let start = if folder.is_empty() { 0 } else { folder.len() + 1 };
        let mut names: BTreeMap<&str, Kind> = BTreeMap::new();
        for (path, _) in below(&files, folder) {
            match path[start..].split_once('/') {
                Some((name, _)) => names.insert(name, Kind::Folder),
                None => names.insert(&path[start..], Kind::File),
            };
        }
        Ok(names.into_iter().map(|(name, kind)| (name.to_owned(), kind)).collect())
    }

    fn files(&self, folder: &str) -> Result<Vec<(DatasetPath, Stored)>> {
        let files = self.files.lock();
        let start = if folder.is_empty() { 0 } else { folder.len() + 1 };
        let file = |(path, bytes): (&DatasetPath, &Bytes)| {
            let inside = DatasetPath::new(&path[start..]).ok()?;
            Some((inside, Stored { size: bytes.len() as u64, version: self.version_of(bytes) }))
        };
        Ok(below(&files, folder).filter_map(file).collect())
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        let bytes = self.files.lock().get(path).map(Arc::clone);
        Ok(bytes.map(|bytes| {
            let (size, version) = (bytes.len() as u64, self.version_of(&bytes));
            StoredFile { size, version, bytes: Box::new(Cursor::new(Shared(bytes))) }
        }))
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        let mut files = self.files.lock();
        if files.contains_key(path) || is_folder(&files, path) {
            return Ok(None);
        }
        self.check_place(&files, path)?;
        files.insert(path.clone(), Bytes::default());
        Ok(Some(Box::new(Growing { files: Arc::clone(&self.files), path: path.clone(), bytes: Vec::new() })))
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        let mut bytes = Vec::new();
        fill(&mut bytes)?;
        let mut files = self.files.lock();
        self.check_place(&files, path)?;
        files.insert(path.clone(), Arc::new(bytes));
        Ok(())
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        let mut files = self.files.lock();
        if files.contains_key(path) || is_folder(&files, path) {
            return Ok(false);
        }
        self.check_place(&files, path)?;
        files.insert(path.clone(), Arc::new(bytes.to_vec()));
        Ok(true)
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        let mut files = self.files.lock();
        self.check_place(&files, path)?;
        Arc::make_mut(files.entry(path.clone()).or_default()).extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&self, path: &DatasetPath) -> Result<()> {
        if self.files.lock().contains_key(path) { Ok(()) } else { Err(self.fail(path, ErrorKind::NotFound)) }
    }

    fn share(&self, from: &dyn Store, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        let from: &dyn Any = from;
        let Some(bytes) = from.downcast_ref::<Self>().and_then(|from| from.get(path)) else { return Ok(false) };
        let mut files = self.files.lock();
        self.check_place(&files, to)?;
        files.insert(to.clone(), bytes);
        Ok(true)
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        let mut files = self.files.lock();
        self.check_place(&files, to)?;
        if let Some(bytes) = files.remove(from) {
            files.insert(to.clone(), bytes);
            return Ok(());
        }
        let moved: Vec<DatasetPath> = below(&files, from).map(|(path, _)| path.clone()).collect();
        if moved.is_empty() {
            return Err(self.fail(from, ErrorKind::NotFound));
        }
        if files.contains_key(to) {
            return Err(self.fail(to, ErrorKind::NotADirectory));
        }
        for path in moved {
            let bytes = files.remove(&path).expect("it was listed");
            let inside = DatasetPath::new(&path[from.len() + 1..]).expect("a part of a path");
            files.insert(to.join(&inside), bytes);
        }
        Ok(())
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.files.lock().remove(path);
        Ok(())
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        let mut files = self.files.lock();
        files.remove(path);
        let all: Vec<DatasetPath> = below(&files, path).map(|(path, _)| path.clone()).collect();
        all.iter().for_each(|path| drop(files.remove(path)));
        Ok(())
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        match access {
            Access::Write | Access::Share => drop(self.files.lock().entry(path.clone()).or_default()),
            Access::Read if self.files.lock().contains_key(path) => {}
            Access::Read => return Ok(Some(Hold::new(()))),
        }
        let mut locks = self.locks.lock();
        let next = match (access, locks.get(path)) {
            (Access::Write, None) => Lock::Writer,
            (Access::Read | Access::Share, None) => Lock::Readers(1),
            (Access::Read | Access::Share, Some(Lock::Readers(others))) => Lock::Readers(others + 1),
            _ => return Ok(None),
        };
        locks.insert(path.clone(), next);
        Ok(Some(Hold::new(Held { locks: Arc::clone(&self.locks), path: path.clone() })))
    }
}

impl fmt::Debug for MemStore {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "MemStore({} files)", self.files.lock().len())
    }
}

/// The content of a file that is read.
struct Shared(Bytes);

impl AsRef<[u8]> for Shared {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

/// A file that is written. Its content appears when it is dropped.
struct Growing {
    files: Arc<Mutex<Files>>,
    path: DatasetPath,
    bytes: Vec<u8>,
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Growing {
    fn drop(&mut self) {
        // An attempt that was given up may have removed it.
        if let Some(file) = self.files.lock().get_mut(&self.path) {
            *file = Arc::new(std::mem::take(&mut self.bytes));
        }
    }
}

/// A lock that is held.
struct Held {
    locks: Arc<Mutex<BTreeMap<DatasetPath, Lock>>>,
    path: DatasetPath,
}

impl Drop for Held {
    fn drop(&mut self) {
        let mut locks = self.locks.lock();
        match locks.get_mut(&self.path) {
            Some(Lock::Readers(others)) if *others > 1 => *others -= 1,
            _ => drop(locks.remove(&self.path)),
        }
    }
}
