//! The blocks of a file of a store that were downloaded so far.

use super::downloads::{Downloads, random};
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::{StoreFolder, Stored, StoredFile};
use parking_lot::Mutex;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::Arc;

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
    /// Downloaded blocks of a large file.
    blocks: Mutex<Option<Arc<Mutex<Blocks>>>>,
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
        Self { path, size: stored.size, version: stored.version.clone(), key, blocks: Mutex::new(None) }
    }

    /// Whether it is on this machine, or is too large to be downloaded before it is read.
    pub fn is_ready(&self, downloads: &Downloads) -> bool {
        self.size > BLOCK || downloads.path(self.key).is_file()
    }

    /// Opens it. A small file is downloaded now, once: other threads wait.
    pub fn open(&self, store: &StoreFolder, downloads: &Arc<Downloads>) -> Result<Open> {
        let mut blocks = self.blocks.lock();
        if let Some(blocks) = &*blocks {
            return Ok(Open::Blocks(Arc::clone(blocks)));
        }
        if let Some(file) = self.kept(downloads) {
            return Ok(Open::Whole(file));
        }
        if self.size <= BLOCK {
            return self.download(store, downloads).map(Open::Whole);
        }
        let new = Blocks::new(self.size, self.open_stored(store)?, Arc::clone(downloads), self.key)?;
        let new = Arc::new(Mutex::new(new));
        *blocks = Some(Arc::clone(&new));
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
        let opened = store.open(&self.path)?.ok_or_else(|| Error::io(name(), &io::ErrorKind::NotFound.into()))?;
        let is_same = opened.size == self.size && (self.version.is_none() || opened.version == self.version);
        if !is_same {
            return Err(Error::new("the file changed after the dataset was opened")
                .in_file(name())
                .help("open the dataset again after its writer has ended")
                .of_request());
        }
        Ok(opened)
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
            let kept = file.rewind().and_then(|()| downloads.keep(&path, self.key, self.size));
            kept.map_err(|error| downloads.fail(&path, &error))
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
    size: u64,
    stored: StoredFile,
    file: File,
    /// Path of the file until it is complete.
    part: Option<PathBuf>,
    has: Vec<bool>,
    missing: usize,
    downloads: Arc<Downloads>,
    key: Digest,
}

impl Blocks {
    fn new(size: u64, stored: StoredFile, downloads: Arc<Downloads>, key: Digest) -> Result<Self> {
        let (part, file) = downloads.part(key).map_err(|error| downloads.fail(&downloads.path(key), &error))?;
        let count = size.div_ceil(BLOCK) as usize;
        Ok(Self { size, stored, file, part: Some(part), has: vec![false; count], missing: count, downloads, key })
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
            self.stored.seek(SeekFrom::Start(start))?;
            self.stored.read_exact(&mut bytes)?;
            let written = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.write_all(&bytes));
            written.map_err(|error| self.fail(&error))?;
            self.has[block] = true;
            self.missing -= 1;
            if let Some(part) = self.part.take_if(|_| self.missing == 0) {
                // Without the name, the file serves until it is closed.
                let _ = self.downloads.keep(&part, self.key, self.size);
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
