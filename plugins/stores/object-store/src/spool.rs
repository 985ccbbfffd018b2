//! Files that are uploaded when they are complete.

use std::io::{self, Read, Seek, Write};
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

impl Spool {
    /// Makes the next write go on at the end.
    pub fn go_on(&mut self) {
        let _ = self.0.seek(io::SeekFrom::End(0));
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
