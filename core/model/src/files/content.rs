//! The content of small files, and of files that replace others.

use crate::error;
use crate::mirror::DatasetFile;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Largest file that [`read_small`] reads, bytes.
const LARGEST: u64 = crate::limits::SMALL_FILE_BYTES.most;

/// Reads a recipe, a list or a template. Refuses files above 64 MiB, and anything but a regular file: a device or a
/// FIFO may never end.
pub fn read_small(path: &Path) -> Result<Vec<u8>> {
    let refuse = |message: &str| Err(Error::new(ErrorKind::InvalidInput, message));
    // Checked before opening, because opening a FIFO waits for a writer.
    let kind = std::fs::metadata(path).map_err(|error| match path.to_string_lossy().contains("://") {
        true if error.kind() == ErrorKind::NotFound => {
            let message = "this file must be on this machine, and the name is a URL: copy the file here first";
            Error::new(ErrorKind::InvalidInput, message)
        }
        _ => error,
    })?;
    if kind.is_dir() {
        return refuse("it is a folder");
    }
    if !kind.is_file() {
        return refuse("it is not a regular file");
    }
    let mut bytes = Vec::new();
    DatasetFile::open(path)?.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return refuse("it has more than 64 MiB");
    }
    Ok(bytes)
}

/// First bytes of a file that Git LFS leaves where it has not fetched the content.
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";
/// Bytes at the start of a file that may precede the tag of an HTML page.
const HTML_START: usize = 512;

/// The error of a file that replaces the real one: a pointer of Git LFS, or a page that a server sent instead of a download.
/// None for other content.
pub fn replacement(bytes: &[u8]) -> Option<error::Error> {
    if bytes.starts_with(LFS_POINTER) {
        let error = error::Error::new("a pointer of Git LFS, not the file itself");
        return Some(error.help("fetch the files of the repository: run `git lfs pull` in its folder"));
    }
    let start = &bytes[..bytes.len().min(HTML_START)];
    let text = String::from_utf8_lossy(start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start)).to_ascii_lowercase();
    let text = text.trim_start();
    let is_html = text.starts_with("<!doctype html") || text.starts_with("<html");
    is_html.then(|| {
        let error = error::Error::new("an HTML page, not the file itself");
        error.help("download the file again: the server sent a page instead, such as a login or an error")
    })
}
