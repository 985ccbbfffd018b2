//! Photographs of a folder, upright.

use crate::decode::FileContent;
use crate::read::entries_with;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;

/// The JPEG and PNG files of a folder, in the order of their names.
#[derive(Debug, Clone)]
pub struct Photographs {
    files: Vec<PathBuf>,
}

impl Photographs {
    /// The photographs of a folder. Folders in it and hidden files are left out.
    ///
    /// # Errors
    /// If the folder cannot be read, or has no photograph.
    pub fn of(folder: &Path) -> Result<Self> {
        let files = entries_with(folder, is_photograph)?;
        let files: Vec<PathBuf> =
            files.into_iter().filter(|(stem, _)| !stem.starts_with('.')).map(|(_, path)| path).collect();
        if files.is_empty() {
            return Err(Error::new("the folder has no photograph")
                .in_file(folder)
                .help("put JPEG or PNG files directly into it")
                .of_request());
        }
        Ok(Self { files })
    }

    /// Their files.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

/// Whether files with an extension are photographs.
pub fn is_photograph(extension: &str) -> bool {
    ["jpeg", "jpg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Reads a photograph, turned upright by its EXIF orientation.
///
/// # Errors
/// If the file is not readable as 8-bit JPEG or PNG, or is too large.
pub fn photograph(path: &Path) -> Result<Plane<[u8; 3]>> {
    FileContent::read(path)?.upright()
}
