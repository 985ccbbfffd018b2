//! A store in memory that fails or is killed at chosen calls.

use std::fmt;
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::Duration;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, Fill, Found, Hold, Kind, MemStore, Store, StoredFile};

/// Fault at a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The call fails and changes nothing, and the next calls work.
    Once,
    /// The call works but fails, because its answer is lost, and the next calls work.
    Unheard,
    /// The call takes this long.
    Slow(Duration),
    /// The program is killed during the call: the call does a part of its work, and no later call reaches the store.
    Kill,
}

/// The fault of a call by its number, from 0.
type Plan = Box<dyn Fn(u32) -> Option<Fault> + Send + Sync>;

/// A store in memory with faults at some calls.
pub struct FaultStore {
    inner: Arc<MemStore>,
    plan: Plan,
    calls: AtomicU32,
    killed: Arc<AtomicBool>,
}

impl fmt::Debug for FaultStore {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "FaultStore({:?})", self.inner)
    }
}

/// Outcome of a call.
enum Turn {
    Works,
    /// The call works, and fails.
    Unheard(Error),
    /// The call does a part of its work, and fails.
    Torn(Error),
}

impl FaultStore {
    /// A store with the files of `inner`. `plan` is asked before each call, and may change these files: another program
    /// does so between two calls.
    pub fn new(inner: Arc<MemStore>, plan: impl Fn(u32) -> Option<Fault> + Send + Sync + 'static) -> Self {
        Self { inner, plan: Box::new(plan), calls: AtomicU32::new(0), killed: Arc::default() }
    }

    /// Number of calls so far.
    pub fn calls(&self) -> u32 {
        self.calls.load(Ordering::SeqCst)
    }

    /// Whether the program was killed.
    pub fn is_killed(&self) -> bool {
        self.killed.load(Ordering::SeqCst)
    }

    fn error() -> io::Error {
        ErrorKind::StorageFull.into()
    }

    fn turn(&self, path: &str) -> Result<Turn> {
        let error = || Error::io(self.inner.name_of(path), &Self::error());
        if self.killed.load(Ordering::SeqCst) {
            return Err(error());
        }
        match (self.plan)(self.calls.fetch_add(1, Ordering::SeqCst)) {
            None => Ok(Turn::Works),
            Some(Fault::Slow(time)) => {
                thread::sleep(time);
                Ok(Turn::Works)
            }
            Some(Fault::Once) => Err(error()),
            Some(Fault::Unheard) => Ok(Turn::Unheard(error())),
            Some(Fault::Kill) => {
                self.killed.store(true, Ordering::SeqCst);
                Ok(Turn::Torn(error()))
            }
        }
    }

    /// A call that may be killed before or after its work, but not during it.
    fn whole<T>(&self, path: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        match self.turn(path)? {
            Turn::Works => work(),
            Turn::Unheard(error) => work().and(Err(error)),
            Turn::Torn(error) => Err(error),
        }
    }

    /// The first half of the files in a folder.
    fn half(&self, folder: &DatasetPath) -> Vec<DatasetPath> {
        let prefix = format!("{folder}/");
        let all: Vec<DatasetPath> = self.inner.files().into_keys().filter(|path| path.starts_with(&prefix)).collect();
        all[..all.len().div_ceil(2)].to_vec()
    }
}

impl Store for FaultStore {
    fn name_of(&self, path: &str) -> PathBuf {
        self.inner.name_of(path)
    }

    fn is_remote(&self) -> bool {
        self.inner.is_remote()
    }

    fn prepare(&self) -> Result<()> {
        self.whole("", || self.inner.prepare())
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        self.whole(path, || self.inner.look(path))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        self.whole(folder, || self.inner.list(folder))
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        self.whole(path, || self.inner.open(path))
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        self.whole(path, || {
            let created = self.inner.create(path)?;
            Ok(created.map(|file| Box::new(Killable { file, killed: Arc::clone(&self.killed) }) as _))
        })
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        self.whole(path, || self.inner.put(path, fill))
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        self.whole(path, || self.inner.put_new(path, bytes))
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        match self.turn(path)? {
            Turn::Works => self.inner.append(path, bytes),
            // The contract allows no other.
            Turn::Unheard(error) => Err(error),
            Turn::Torn(error) => self.inner.append(path, &bytes[..bytes.len() / 2]).and(Err(error)),
        }
    }

    fn sync(&self, path: &DatasetPath) -> Result<()> {
        self.whole(path, || self.inner.sync(path))
    }

    fn share(&self, _: &dyn Store, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        self.whole(to, || self.inner.share(&*self.inner, path, to))
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        match self.turn(to)? {
            Turn::Works => self.inner.rename(from, to),
            Turn::Unheard(error) => self.inner.rename(from, to).and(Err(error)),
            Turn::Torn(error) => {
                for path in self.half(from) {
                    let inside = DatasetPath::new(&path[from.len() + 1..]).expect("a part of a path");
                    self.inner.rename(&path, &to.join(&inside))?;
                }
                Err(error)
            }
        }
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.whole(path, || self.inner.remove(path))
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        match self.turn(path)? {
            Turn::Works => self.inner.remove_all(path),
            Turn::Unheard(error) => self.inner.remove_all(path).and(Err(error)),
            Turn::Torn(error) => {
                self.half(path).iter().try_for_each(|path| self.inner.remove(path))?;
                Err(error)
            }
        }
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        self.whole(path, || self.inner.lock(path, access))
    }
}

/// A file that a killed program no longer writes.
struct Killable {
    file: Box<dyn Write + Send>,
    killed: Arc<AtomicBool>,
}

impl Write for Killable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.killed.load(Ordering::SeqCst) { Err(FaultStore::error()) } else { self.file.write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
