//! Comparison of paths that users enter, and the dataset that a path belongs to.

use crate::run::dataset::layout::journal_path;
use std::path::{Path, PathBuf};
use syntable_model::registry::Registry;

/// A path without links, `.` and `..` in its existing part.
pub fn whole(path: &Path) -> PathBuf {
    let of = |folder: &Path| {
        let inside = path.strip_prefix(folder).ok()?;
        Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }.canonicalize().ok()?.join(inside))
    };
    path.ancestors().find_map(of).unwrap_or_else(|| path.to_owned())
}

/// Folder of the annotation files in COCO's layout, beside the images.
const ANNOTATIONS: &str = "annotations";

/// The dataset's folder for a folder of annotation files, which users may name instead of the dataset.
fn above_annotations(folder: &Path) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    folder.file_name().filter(|name| *name == ANNOTATIONS).and_then(|_| folder.parent()).map(Path::to_owned)
}

/// The folder of the dataset for its own path, the path of a file in it, or the path of its folder of annotation files.
/// Does not check that it has a dataset.
/// Looks only at names.
pub(crate) fn root_of(source: &Path) -> Option<PathBuf> {
    let source = source.canonicalize().ok()?;
    let folder = if source.is_dir() { source } else { source.parent()?.to_owned() };
    Some(above_annotations(&folder).unwrap_or(folder))
}

/// The folder of the dataset for a path. For an annotation file, the nearest folder that looks like a dataset, of the
/// two above the file; the file itself if neither does. For a folder of annotation files, the folder above it.
pub fn dataset_folder(registry: &Registry, path: &Path) -> PathBuf {
    if !path.is_file() {
        return above_annotations(path).unwrap_or_else(|| path.to_owned());
    }
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let is_dataset = |folder: &&Path| registry.formats().iter().any(|format| format.detects(folder));
    let found = absolute.ancestors().skip(1).take(2).find(is_dataset);
    found.map_or_else(|| path.to_owned(), Path::to_owned)
}

/// Whether a path is a folder or file, or lies inside it. Resolves links and `..`. Either path may be missing.
pub fn lies_in(path: &Path, folder: &Path) -> bool {
    whole(path).starts_with(whole(folder))
}

/// The nearest folder of a run that contains this path or is this path. The path must be [`whole`].
pub fn run_above(path: &Path) -> Option<PathBuf> {
    path.ancestors().find(|above| journal_path(above).is_file()).map(Path::to_owned)
}
