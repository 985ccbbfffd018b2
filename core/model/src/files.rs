//! Reading files that a recipe names.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Largest file that [`read_small`] reads, bytes.
const LARGEST: u64 = crate::limits::SMALL_FILE_BYTES.most;

/// Reads a recipe, a list or a template. Refuses what is no regular file, such as a device or a FIFO, which may never
/// end, and files above 64 MiB.
pub fn read_small(path: &Path) -> Result<Vec<u8>> {
    let refuse = |message: &str| Err(Error::new(ErrorKind::InvalidInput, message));
    // Asked before it is opened: opening a FIFO waits for a writer.
    let kind = std::fs::metadata(path)?;
    if kind.is_dir() {
        return refuse("it is a folder");
    }
    if !kind.is_file() {
        return refuse("it is not a regular file");
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return refuse("it has more than 64 MiB");
    }
    Ok(bytes)
}
