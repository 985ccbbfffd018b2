//! Files that are uploaded when they are complete.

use crate::objects::Bucket;
use object_store::path::Path as Key;
use std::io::{self, Read, Seek, Write};
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use tempfile::SpooledTempFile;

/// Size up to which a file waits in memory, and is uploaded with one request, bytes.
pub const SMALL: usize = 16 << 20;

/// A file that is being written: in memory, or on the disk of this machine if it is large.
pub struct Spool(SpooledTempFile);

impl Spool {
    pub fn new() -> Self {
        Self(SpooledTempFile::new(SMALL))
    }

    /// The whole content, if it is small.
    pub fn small(&mut self) -> io::Result<Option<Vec<u8>>> {
        if self.0.is_rolled() {
            return Ok(None);
        }
        let mut bytes = Vec::new();
        self.0.rewind()?;
        self.0.read_to_end(&mut bytes)?;
        Ok(Some(bytes))
    }

    /// The next part from the beginning: full, or the last one.
    pub fn part(&mut self, is_first: bool) -> io::Result<Vec<u8>> {
        if is_first {
            self.0.rewind()?;
        }
        let mut bytes = Vec::with_capacity(SMALL);
        Read::by_ref(&mut self.0).take(SMALL as u64).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// A file that is uploaded at each flush, and when it is dropped.
pub struct NewObject {
    pub bucket: Arc<Bucket>,
    pub path: DatasetPath,
    pub key: Key,
    pub spool: Spool,
    pub is_changed: bool,
}

impl NewObject {
    fn upload(&mut self) -> Result<()> {
        if std::mem::take(&mut self.is_changed) {
            self.bucket.upload(&self.path, &self.key, &mut self.spool)?;
            // The next write goes on at the end.
            let _ = self.spool.0.seek(io::SeekFrom::End(0));
        }
        Ok(())
    }
}

impl Write for NewObject {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.is_changed = true;
        self.spool.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.upload().map_err(|error| io::Error::other(error.message().to_owned()))
    }
}

impl Drop for NewObject {
    fn drop(&mut self) {
        // A flush reports errors.
        let _ = self.upload();
    }
}
