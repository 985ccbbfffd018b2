//! The blocks of a large file of a store that were downloaded so far.

use super::downloads::Downloads;
use super::outage::Outage;
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::store::StoredFile;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Bytes that are downloaded at once. A smaller file is downloaded whole.
pub const BLOCK: u64 = 4 << 20;

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
    pub fn new(
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
