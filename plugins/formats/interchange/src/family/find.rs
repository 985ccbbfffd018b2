//! Finds the annotation file of a dataset by the keys of its records, whatever the file's name.

use std::path::{Path, PathBuf};
use syntable_formats::read::{above, is_json, json_files};
use syntable_formats::structure::{AnnotationStart, RecordKeys};
use syntable_formats::syntable;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::reader::Source;
use syntable_model::shown::shown;

/// Folder of the annotation file.
pub const FOLDER: &str = "annotations";

/// The structures of annotation files, each with a reader of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Structure {
    /// COCO's instances, and relatives that add masks to them, such as COCOA-cls and UOAIS-Sim.
    Instances,
    /// COCOA: regions of an image.
    Regions,
    /// KINS: amodal and inmodal masks.
    Kins,
    /// D2SA: instances with their places in chains of occluders.
    D2sa,
    /// COCO's segments of panoptic images.
    Segments,
}

/// Keys of annotations that only one structure has. The first match counts; instances come last, because most structures
/// have their keys, too.
const KEYS: [(Structure, &[&str]); 5] = [
    (Structure::Segments, &["segments_info"]),
    (Structure::Regions, &["regions"]),
    (Structure::Kins, &["a_segm", "i_segm", "inmodal_seg"]),
    (Structure::D2sa, &["occl_depth", "amodal_region", "amodal_base"]),
    (Structure::Instances, &["segmentation", "bbox"]),
];

/// Keys of SA-1B's annotations, which have no `image_id`: each of its files is about one image.
const OF_ONE_IMAGE: &[&str] = &["predicted_iou", "stability_score"];

/// Starts and ends of the stems of file names, for files without annotations and for damaged files.
const NAMES: [(Structure, &str, &str); 5] = [
    (Structure::Segments, crate::coco_panoptic::FILE, ""),
    (Structure::Instances, crate::cocoa::FILE, "_with_classes"),
    (Structure::Regions, crate::cocoa::FILE, ""),
    (Structure::D2sa, crate::d2sa::FILE, ""),
    (Structure::Kins, "update_", "_2020"),
];

impl Structure {
    /// The structure of a file; none if it is not an annotation file.
    fn of(file: &Path) -> Option<Self> {
        match AnnotationStart::of(file) {
            AnnotationStart::Records(keys) if keys.is_empty() => Self::by_name(file).or(Some(Self::Instances)),
            AnnotationStart::Records(keys) => Self::by_keys(&keys),
            AnnotationStart::Unreadable => Self::by_name(file).or(is_in(file, FOLDER).then_some(Self::Instances)),
            AnnotationStart::Images | AnnotationStart::Other => None,
        }
    }

    fn by_keys(keys: &RecordKeys) -> Option<Self> {
        if keys.have_any(OF_ONE_IMAGE) && !keys.have_any(&["image_id"]) {
            return None;
        }
        KEYS.iter().find(|(_, of)| keys.have_any(of)).map(|(structure, _)| *structure)
    }

    fn by_name(file: &Path) -> Option<Self> {
        let stem = file.file_stem()?.to_string_lossy();
        let named = NAMES.iter().find(|(_, start, end)| stem.starts_with(start) && stem.ends_with(end));
        // COCO's files of this name are in `annotations`, KINS' files beside the images.
        let is_of_kins = || stem.starts_with("instances_") && !is_in(file, FOLDER);
        named.map(|(structure, ..)| *structure).or_else(|| is_of_kins().then_some(Self::Kins))
    }

    /// The annotation files of this structure that a path names: a file; those in the folder `annotations`, which the path may
    /// be; or those at the top of the folder.
    fn files(self, path: &Path) -> std::io::Result<Vec<PathBuf>> {
        let is_one = |file: &PathBuf| Self::of(file) == Some(self);
        // A folder of more files is not a dataset of this family: LabelMe writes a file per image.
        let few = |folder: &Path| {
            let files = json_files(folder)?;
            Ok::<_, std::io::Error>(if files.len() > FILES { Vec::new() } else { files })
        };
        if path.is_file() {
            return Ok(Some(path.to_owned()).filter(|file| is_json(file) && is_one(file)).into_iter().collect());
        }
        let inner = path.join(FOLDER);
        let mut files = if inner.is_dir() { few(&inner)? } else { Vec::new() };
        files.retain(is_one);
        // JSON files at the top of SynTable's layout have a reader of their own.
        if files.is_empty() && !syntable::is_root(path) {
            files = few(path)?;
            files.retain(is_one);
        }
        Ok(files)
    }

    /// Whether a path is a dataset of this structure.
    pub fn is_at(self, path: &Path) -> bool {
        self.files(path).is_ok_and(|files| !files.is_empty())
    }

    /// Whether a path is a dataset of any structure.
    pub fn any_is_at(path: &Path) -> bool {
        KEYS.iter().any(|(structure, _)| structure.is_at(path))
    }

    /// The folder of a dataset, and its annotation file: the file that the path names, or the only one of the dataset.
    pub fn find(self, source: &Source) -> Result<(DatasetFolder, PathBuf)> {
        let path = &source.path;
        let file = if path.is_file() { path.clone() } else { self.only_file(path)? };
        let folder = above(&file);
        let root = if is_named(&folder, FOLDER) { above(&folder) } else { folder };
        let root = source.folder(&root)?;
        if !path.is_file() {
            beside(root.clone(), &file).file(file.file_name().unwrap_or_default())?;
        }
        Ok((root, file))
    }

    fn only_file(self, folder: &Path) -> Result<PathBuf> {
        let fail = |error: std::io::Error| Error::io(folder, &error).of_request();
        let mut files = self.files(folder).map_err(fail)?;
        if files.is_empty() {
            // A single file of another structure is opened, so that an error names its fault.
            files = json_files(&folder.join(FOLDER)).or_else(|_| json_files(folder)).map_err(fail)?;
        }
        match <[PathBuf; 1]>::try_from(files) {
            Ok([file]) => Ok(file),
            Err(files) => {
                let help = files.first().map_or_else(
                    || "name the annotation file instead of the folder".to_owned(),
                    |first| format!("name one of them instead of the folder, such as {}", shown(first).display()),
                );
                let message = format!("expected one annotation file, found {}", files.len());
                Err(Error::new(message).in_file(folder).help(help))
            }
        }
    }
}

/// The folder inside a dataset in which its annotation file is.
pub fn beside(root: DatasetFolder, file: &Path) -> DatasetFolder {
    if is_in(file, FOLDER) { root.inner(FOLDER) } else { root }
}

/// Whether a file is in a folder of this name.
fn is_in(file: &Path, folder: &str) -> bool {
    is_named(&above(file), folder)
}

/// Whether a folder has this name, whatever folder the process is in.
fn is_named(path: &Path, folder: &str) -> bool {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    path.file_name().is_some_and(|name| name == folder)
}

/// Most JSON files in a folder of annotation files.
const FILES: usize = 64;

/// Depth of folders in which images are searched.
const DEPTH: usize = 3;
/// Number of folders in which images are searched.
const FOLDERS: usize = 4096;

/// The only folder inside a dataset that `has` images. None if several have them: a dataset may store masks and depth under
/// the names of its images. Links and hidden folders are not searched.
pub fn only_folder(root: &DatasetFolder, has: impl Fn(&DatasetFolder) -> bool) -> Option<DatasetFolder> {
    let mut found = None;
    let mut level = vec![PathBuf::new()];
    let mut left = FOLDERS;
    for _ in 0..DEPTH {
        let mut next = Vec::new();
        for folder in &level {
            let inner = std::fs::read_dir(root.inner(folder).path()).into_iter().flatten().flatten();
            let is_one = |entry: &std::fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
            let names = inner.filter(is_one).map(|entry| entry.file_name());
            next.extend(names.filter(|name| !name.to_string_lossy().starts_with('.')).map(|name| folder.join(name)));
        }
        next.sort();
        next.truncate(left);
        left -= next.len();
        for folder in next.iter().map(|name| root.inner(name)).filter(|folder| has(folder)) {
            if found.replace(folder).is_some() {
                return None;
            }
        }
        level = next;
    }
    found
}
