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

/// Turns an image upright, given its EXIF orientation from 1 to 8 (CIPA DC-008, 4.6.4): the number states where the first row and
/// the first column of the file belong.
pub(crate) fn turned(image: Plane<[u8; 3]>, orientation: u16) -> Plane<[u8; 3]> {
    let (width, height) = (image.width(), image.height());
    let (right, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
    match orientation {
        2 => Plane::from_fn(width, height, |x, y| *image.at(right - x, y)),
        3 => Plane::from_fn(width, height, |x, y| *image.at(right - x, bottom - y)),
        4 => Plane::from_fn(width, height, |x, y| *image.at(x, bottom - y)),
        5 => Plane::from_fn(height, width, |x, y| *image.at(y, x)),
        6 => Plane::from_fn(height, width, |x, y| *image.at(y, bottom - x)),
        7 => Plane::from_fn(height, width, |x, y| *image.at(right - y, bottom - x)),
        8 => Plane::from_fn(height, width, |x, y| *image.at(right - y, x)),
        _ => image,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The letters `ab` over `cd` over `ef`, as the file has them in each orientation.
    #[test]
    fn every_orientation_is_turned_upright() {
        let files: [(u16, &[&str]); 8] = [
            (1, &["ab", "cd", "ef"]),
            (2, &["ba", "dc", "fe"]),
            (3, &["fe", "dc", "ba"]),
            (4, &["ef", "cd", "ab"]),
            (5, &["ace", "bdf"]),
            (6, &["bdf", "ace"]),
            (7, &["fdb", "eca"]),
            (8, &["eca", "fdb"]),
        ];
        for (orientation, rows) in files {
            let letter = |x: u32, y: u32| [rows[y as usize].as_bytes()[x as usize]; 3];
            let file = Plane::from_fn(rows[0].len() as u32, rows.len() as u32, letter);
            let shown: Vec<u8> = turned(file, orientation).data().iter().map(|pixel| pixel[0]).collect();
            assert_eq!(shown, b"abcdef", "orientation {orientation}");
        }
    }
}
