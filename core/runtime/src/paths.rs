//! Paths of people, as they may be compared.

use crate::run::dataset::layout::journal_path;
use std::path::{Path, PathBuf};
use syntable_model::registry::Registry;

/// A path without links and detours, as far as it exists.
pub fn whole(path: &Path) -> PathBuf {
    let of = |folder: &Path| {
        let inside = path.strip_prefix(folder).ok()?;
        Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }.canonicalize().ok()?.join(inside))
    };
    path.ancestors().find_map(of).unwrap_or_else(|| path.to_owned())
}

/// Folder of the annotation files in COCO's layout, beside the images.
const ANNOTATIONS: &str = "annotations";

/// The folder above one of annotation files, which may be named in place of its dataset.
fn above_annotations(folder: &Path) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    folder.file_name().filter(|name| *name == ANNOTATIONS).and_then(|_| folder.parent()).map(Path::to_owned)
}

/// The folder of a dataset that is named by it, by a file in it or by the folder of its annotation files, as far as names tell.
pub(crate) fn root_of(source: &Path) -> Option<PathBuf> {
    let source = source.canonicalize().ok()?;
    let folder = if source.is_dir() { source } else { source.parent()?.to_owned() };
    Some(above_annotations(&folder).unwrap_or(folder))
}

/// The folder of a dataset, which may be named by its annotation file: the nearest one that looks like a dataset by itself, of the
/// two in which the file may be. A file that lies among others stands for itself. The folder of annotation files stands for the
/// folder above it.
pub fn dataset_folder(registry: &Registry, path: &Path) -> PathBuf {
    if !path.is_file() {
        return above_annotations(path).unwrap_or_else(|| path.to_owned());
    }
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let is_dataset = |folder: &&Path| registry.formats().iter().any(|format| format.detects(folder));
    let found = absolute.ancestors().skip(1).take(2).find(is_dataset);
    found.map_or_else(|| path.to_owned(), Path::to_owned)
}

/// Whether a path is a folder or file, or lies in it, links and detours aside; either may not be there yet.
pub fn lies_in(path: &Path, folder: &Path) -> bool {
    whole(path).starts_with(whole(folder))
}

/// The folder of a run that a path is or lies in, the nearest one. The path must be [`whole`].
pub fn run_above(path: &Path) -> Option<PathBuf> {
    path.ancestors().find(|above| journal_path(above).is_file()).map(Path::to_owned)
}
