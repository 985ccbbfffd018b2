//! A file of a store, which is downloaded when it is opened or read.

use super::blocks::{BLOCK, Blocks};
use super::downloads::Downloads;
use super::outage::Outage;
use super::recent::Recent;
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::{StoreFolder, Stored, StoredFile};
use crate::unique::unique;
use parking_lot::Mutex;
use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::sync::{Arc, Weak};

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
        let version = stored.version.clone().unwrap_or_else(|| format!("{:016x}", unique()));
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

/// The name of a downloaded file: its content is of one version of one URL.
fn key_of(url: &str, path: &str, version: &str) -> Digest {
    Digest::of([url, path, version].join("\n").as_bytes())
}
