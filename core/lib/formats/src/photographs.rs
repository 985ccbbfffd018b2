//! Photographs of a folder, upright.

use crate::decode::FileContent;
use crate::read::entries_with;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::natural::natural;
use syntable_model::product::Plane;

/// The JPEG and PNG files of a folder, in the order of their names, with numbers in them by value: `2.jpg` before `10.jpg`.
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
        let is_one = |(stem, path): &(String, PathBuf)| !stem.starts_with('.') && path.is_file();
        let entries = entries_with(folder, is_photograph)?.into_iter().filter(is_one);
        let mut files: Vec<PathBuf> = entries.map(|(_, path)| path).collect();
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.sort_by(|one, other| natural(&name(one), &name(other)));
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
fn is_photograph(extension: &str) -> bool {
    ["jpeg", "jpg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Reads a photograph, turned upright by its EXIF orientation.
///
/// # Errors
/// If the file is not readable as 8-bit JPEG or PNG, or is too large.
pub fn photograph(path: &Path) -> Result<Plane<[u8; 3]>> {
    FileContent::read(path)?.upright().map_err(|error| {
        if error.help_text().is_some() {
            error
        } else {
            error.help("save it as an 8-bit JPEG or PNG file, or remove it")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photographs_are_files_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().expect("a folder");
        let names = ["10.jpg", "2.JPG", "1.png", "a-1.jpg", "a.png", "a10b2.jpeg", "a9b11.jpg", "007.jpg", "7.jpg"];
        for name in names.iter().chain(&[".hidden.jpg", "notes.txt"]) {
            std::fs::write(folder.path().join(name), "").expect("written");
        }
        std::fs::create_dir(folder.path().join("raw.png")).expect("created");
        let found = Photographs::of(folder.path()).expect("some");
        let found: Vec<_> = found.files().iter().map(|path| path.file_name().expect("a name").to_str()).collect();
        let sorted = ["1.png", "2.JPG", "007.jpg", "7.jpg", "10.jpg", "a-1.jpg", "a.png", "a9b11.jpg", "a10b2.jpeg"];
        assert_eq!(found, sorted.map(Some));
    }
}
