//! A file of a dataset that is read.

use super::blocks::Blocks;
use super::names::mirrored;
use super::remote_file::Open;
use crate::error::Error;
use parking_lot::Mutex;
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

/// A file of a dataset, which is open for reading. Readers use it as a [`File`]: it also opens files of datasets at URLs,
/// whose content it downloads, by blocks if the file is large.
pub struct DatasetFile(Content);

enum Content {
    File(File),
    Blocks { blocks: Arc<Mutex<Blocks>>, at: u64 },
}

impl DatasetFile {
    /// Opens a file from its beginning.
    ///
    /// # Errors
    /// If it cannot be opened, or downloaded. [`Error::io`] names the URL then.
    pub fn open(path: impl AsRef<Path>) -> io::Result<Self> {
        let path = path.as_ref();
        let Some((mirror, number)) = mirrored(path) else {
            return File::open(path).map(|file| Self(Content::File(file)));
        };
        Ok(Self(match mirror.open_file(number).map_err(into_io)? {
            Open::Whole(file) => Content::File(file),
            Open::Blocks(blocks) => Content::Blocks { blocks, at: 0 },
        }))
    }

    /// The whole content of a file.
    ///
    /// # Errors
    /// As of [`open`](Self::open), or if it cannot be read.
    pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Self::open(path)?.read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// The same open file. As of [`File::try_clone`], a file of this machine shares its place with the clone: seek before
    /// you read.
    ///
    /// # Errors
    /// If the system opens no further file.
    pub fn try_clone(&self) -> io::Result<Self> {
        Ok(Self(match &self.0 {
            Content::File(file) => Content::File(file.try_clone()?),
            Content::Blocks { blocks, at } => Content::Blocks { blocks: Arc::clone(blocks), at: *at },
        }))
    }

    /// Its size, bytes.
    ///
    /// # Errors
    /// If the file system fails.
    pub fn size(&self) -> io::Result<u64> {
        match &self.0 {
            Content::File(file) => Ok(file.metadata()?.len()),
            Content::Blocks { blocks, .. } => Ok(blocks.lock().size()),
        }
    }
}

impl Read for DatasetFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.0 {
            Content::File(file) => file.read(buffer),
            Content::Blocks { blocks, at } => {
                let length = blocks.lock().read(*at, buffer)?;
                *at += length as u64;
                Ok(length)
            }
        }
    }
}

impl Seek for DatasetFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.0 {
            Content::File(file) => file.seek(to),
            Content::Blocks { blocks, at } => {
                let place = match to {
                    SeekFrom::Start(place) => Some(place),
                    SeekFrom::Current(by) => at.checked_add_signed(by),
                    SeekFrom::End(by) => blocks.lock().size().checked_add_signed(by),
                };
                *at = place.ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "a seek before the first byte"))?;
                Ok(*at)
            }
        }
    }
}

impl fmt::Debug for DatasetFile {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("DatasetFile")
    }
}

fn into_io(error: Error) -> io::Error {
    io::Error::new(error.io_kind().unwrap_or(ErrorKind::Other), error)
}
