//! NumPy archives: a ZIP file of `.npy` files.

use super::npy::Array;
use std::io::{Cursor, Write};
use syntable_model::error::{Error, Result};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// The bytes of an archive of named arrays, in their order. All entries have the earliest date of ZIP files, so that
/// the same arrays always give the same bytes.
pub fn encode<'a>(arrays: impl IntoIterator<Item = (&'a str, &'a Array)>, compress: bool) -> Result<Vec<u8>> {
    let method = if compress { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    let options = SimpleFileOptions::default()
        .compression_method(method)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let write = || {
        for (name, array) in arrays {
            archive.start_file(format!("{name}.npy"), options)?;
            archive.write_all(&array.encode())?;
        }
        Ok(())
    };
    write()
        .and_then(|()| archive.finish())
        .map(Cursor::into_inner)
        .map_err(|error: zip::result::ZipError| Error::new(format!("the archive cannot be made: {error}")))
}
