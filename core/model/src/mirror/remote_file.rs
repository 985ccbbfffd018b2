//! The blocks of a file of a store that were downloaded so far.

use super::downloads::{Downloads, random};
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::{StoreFolder, Stored, StoredFile};
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Arc, Weak};

/// Bytes that are downloaded at once. A smaller file is downloaded whole.
pub const BLOCK: u64 = 4 << 20;

/// A file of a store, as the store listed it.
pub struct RemoteFile {
    /// Its path below the URL of the mirror.
    pub path: DatasetPath,
    /// Bytes.
    pub size: u64,
    /// The version that the store listed, if it tells versions apart.
    version: Option<String>,
    key: Digest,
    /// Downloaded blocks of a large file, as long as a reader or [`Recent`] has it open.
    blocks: Mutex<Weak<Mutex<Blocks>>>,
}

/// The large files that were opened last. Each has an open file, and often a connection.
#[derive(Default)]
pub struct Recent(Mutex<VecDeque<Arc<Mutex<Blocks>>>>);

/// Number of them.
pub const RECENT: usize = if cfg!(test) { 3 } else { 64 };

impl Recent {
    fn add(&self, blocks: &Arc<Mutex<Blocks>>) {
        let dropped = {
            let mut recent = self.0.lock();
            recent.retain(|other| !Arc::ptr_eq(other, blocks));
            recent.push_back(Arc::clone(blocks));
            if recent.len() > RECENT { recent.pop_front() } else { None }
        };
        // Outside the lock: it deletes a file.
        drop(dropped);
    }
}

/// Why a file could not be downloaded, until it is reported. A reader may take the failure for damage of the file.
#[derive(Default)]
pub struct Outage(Mutex<Option<Error>>);

impl Outage {
    /// Remembers a failure that says nothing about the file.
    pub fn note(&self, error: &Error) {
        if error.is_transient() {
            self.0.lock().get_or_insert_with(|| error.clone());
        }
    }

    pub fn take(&self) -> Option<Error> {
        self.0.lock().take()
    }
}

/// An open file.
pub enum Open {
    /// It was downloaded completely.
    Whole(File),
    /// Blocks are downloaded when they are read.
    Blocks(Arc<Mutex<Blocks>>),
}

impl RemoteFile {
    pub fn new(path: DatasetPath, stored: &Stored, url: &str) -> Self {
        // Without a version, a file of this name may have been of other content before.
        let version = stored.version.clone().unwrap_or_else(|| format!("{:016x}", random()));
        let key = key_of(url, &path, &format!("{} {version}", stored.size));
        Self { path, size: stored.size, version: stored.version.clone(), key, blocks: Mutex::default() }
    }

    /// Whether it is on this machine, or is too large to be downloaded before it is read.
    pub fn is_ready(&self, downloads: &Downloads) -> bool {
        self.size > BLOCK || downloads.path(self.key).is_file()
    }

    /// Opens it. A small file is downloaded now, once: other threads wait.
    pub fn open(
        &self,
        store: &StoreFolder,
        downloads: &Arc<Downloads>,
        (recent, outage): (&Recent, &Arc<Outage>),
    ) -> Result<Open> {
        let mut known = self.blocks.lock();
        if let Some(blocks) = known.upgrade() {
            recent.add(&blocks);
            return Ok(Open::Blocks(blocks));
        }
        if let Some(file) = self.kept(downloads) {
            return Ok(Open::Whole(file));
        }
        if self.size <= BLOCK {
            return self.download(store, downloads).map(Open::Whole);
        }
        let stored = self.open_stored(store)?;
        let name = store.name_of(&self.path);
        let new = Blocks::new(name, stored, (Arc::clone(downloads), Arc::clone(outage)), self.key)?;
        let new = Arc::new(Mutex::new(new));
        *known = Arc::downgrade(&new);
        recent.add(&new);
        Ok(Open::Blocks(new))
    }

    /// Opens it without the locks of other threads, in a process that was forked from theirs.
    pub fn open_alone(&self, store: &StoreFolder, downloads: &Arc<Downloads>) -> Result<Open> {
        match self.kept(downloads) {
            Some(file) => Ok(Open::Whole(file)),
            None => self.download(store, downloads).map(Open::Whole),
        }
    }

    /// The complete file, if this machine has it.
    fn kept(&self, downloads: &Downloads) -> Option<File> {
        downloads.open(self.key, self.size)
    }

    /// Opens the file of the store, in the version that was listed.
    fn open_stored(&self, store: &StoreFolder) -> Result<StoredFile> {
        let name = || store.name_of(&self.path);
        let is_same = |opened: &StoredFile| {
            opened.size == self.size && (self.version.is_none() || opened.version == self.version)
        };
        store.open(&self.path)?.filter(is_same).ok_or_else(|| {
            // Transient: another list of the store has other versions.
            let changed =
                io::Error::new(io::ErrorKind::StaleNetworkFileHandle, "the file changed after the store listed it");
            Error::io(name(), &changed).help("run the same command again after the writer of the files has ended")
        })
    }

    fn download(&self, store: &StoreFolder, downloads: &Downloads) -> Result<File> {
        let mut stored = self.open_stored(store)?;
        let (path, mut file) =
            downloads.part(self.key).map_err(|error| downloads.fail(&downloads.path(self.key), &error))?;
        let mut copy = || -> Result<()> {
            let mut buffer = vec![0; self.size.min(1 << 20) as usize];
            let mut left = self.size;
            while left > 0 {
                let part = &mut buffer[..left.min(1 << 20) as usize];
                stored.read_exact(part).map_err(|error| Error::io(store.name_of(&self.path), &error))?;
                file.write_all(part).map_err(|error| downloads.fail(&path, &error))?;
                left -= part.len() as u64;
            }
            // After a power failure, a file with a name is complete.
            let synced = file.rewind().and_then(|()| file.sync_data());
            synced.map_err(|error| downloads.fail(&path, &error))?;
            // Without the name, the open file serves.
            let _ = downloads.keep(&path, self.key);
            downloads.count(self.size);
            Ok(())
        };
        let copied = copy();
        if copied.is_err() {
            let _ = fs::remove_file(&path);
        }
        copied.map(|()| file)
    }
}

/// A file with gaps: the blocks of a large file that were read.
pub struct Blocks {
    /// The URL, for messages.
    name: PathBuf,
    /// Bytes.
    size: u64,
    /// None if the file is complete.
    stored: Option<StoredFile>,
    file: File,
    /// Path of the file until it is complete.
    part: Option<PathBuf>,
    has: Vec<bool>,
    missing: usize,
    downloads: Arc<Downloads>,
    outage: Arc<Outage>,
    key: Digest,
}

impl Blocks {
    fn new(
        name: PathBuf,
        stored: StoredFile,
        (downloads, outage): (Arc<Downloads>, Arc<Outage>),
        key: Digest,
    ) -> Result<Self> {
        let (part, file) = downloads.part(key).map_err(|error| downloads.fail(&downloads.path(key), &error))?;
        let size = stored.size;
        let count = size.div_ceil(BLOCK) as usize;
        let (stored, part, has) = (Some(stored), Some(part), vec![false; count]);
        Ok(Self { name, size, stored, file, part, has, missing: count, downloads, outage, key })
    }

    /// Bytes of the file.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Reads bytes of one block.
    pub fn read(&mut self, at: u64, buffer: &mut [u8]) -> io::Result<usize> {
        if at >= self.size || buffer.is_empty() {
            return Ok(0);
        }
        let block = (at / BLOCK) as usize;
        let (start, end) = (block as u64 * BLOCK, self.size.min((block as u64 + 1) * BLOCK));
        if !self.has[block] {
            let mut bytes = vec![0; (end - start) as usize];
            if let Some(stored) = &mut self.stored {
                let read = stored.seek(SeekFrom::Start(start)).and_then(|_| stored.read_exact(&mut bytes));
                read.inspect_err(|error| self.outage.note(&Error::io(&self.name, error)))?;
            }
            let written = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.write_all(&bytes));
            written.map_err(|error| self.fail(&error))?;
            self.has[block] = true;
            self.missing -= 1;
            self.downloads.count(end - start);
            if self.missing == 0 {
                self.stored = None;
                // Without the name, the file serves until it is closed.
                if let Some(part) = self.part.take_if(|_| self.file.sync_data().is_ok()) {
                    let _ = self.downloads.keep(&part, self.key);
                }
            }
        }
        let length = buffer.len().min((end - at) as usize);
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut buffer[..length]));
        read.map_err(|error| self.fail(&error))?;
        Ok(length)
    }

    fn fail(&self, error: &io::Error) -> io::Error {
        let path = self.downloads.path(self.key);
        io::Error::new(error.kind(), self.downloads.fail(&path, error))
    }
}

impl Drop for Blocks {
    fn drop(&mut self) {
        if let Some(part) = &self.part {
            let _ = fs::remove_file(part);
        }
    }
}

/// The name of a downloaded file: its content is of one version of one URL.
fn key_of(url: &str, path: &str, version: &str) -> Digest {
    Digest::of([url, path, version].join("\n").as_bytes())
}
