//! Layouts of well-known collections: where the mesh of an object is, and the kind of source that reads a folder.

use super::bop_models;
use std::path::{Path, PathBuf};
use syntable_mesh::root::exists;
use syntable_mesh::scan::{is_dir, list};
use syntable_model::error::Result;

/// Paths of the mesh in an object's folder of Google Scanned Objects: as downloaded, and repackaged.
const SCANNED: [&str; 2] = ["meshes/model.obj", "model.obj"];
/// Folders of the reconstructions of YCB, in the order of the option.
pub(crate) const RECONSTRUCTIONS: [&str; 5] = ["google_16k", "google_64k", "google_512k", "poisson", "tsdf"];
/// Maximum number of folders that are looked at to recognize a layout.
const LOOKED_AT: usize = 20;

/// The mesh in an object's folder of Google Scanned Objects, relative to it.
pub(crate) fn scanned_mesh(folder: &Path) -> Result<Option<&'static Path>> {
    for mesh in SCANNED {
        if exists(&folder.join(mesh))? {
            return Ok(Some(Path::new(mesh)));
        }
    }
    Ok(None)
}

/// The mesh in an object's folder of YCB, relative to it, in the reconstruction of this folder.
pub(crate) fn ycb_mesh(folder: &Path, reconstruction: &str) -> Result<Option<PathBuf>> {
    let own = Path::new(reconstruction);
    for mesh in [own.join("textured.obj"), "textured.obj".into()] {
        if exists(&folder.join(&mesh))? {
            return Ok(Some(mesh));
        }
    }
    // Simplified and repackaged versions; `textured_simple.obj` is first in order.
    for inside in [Path::new(""), own] {
        if is_dir(&folder.join(inside))? {
            let simple = |name: &String| name.starts_with("textured_simple") && name.ends_with(".obj");
            if let Some(name) = list(&folder.join(inside))?.files.into_iter().find(simple) {
                return Ok(Some(inside.join(name)));
            }
        }
    }
    Ok(None)
}

/// The kind of source that a folder is laid out for; `None` if no folder in it has the layout of a collection.
pub(crate) fn kind_of(root: &Path) -> Result<Option<&'static str>> {
    for name in list(root)?.folders.into_iter().take(LOOKED_AT) {
        let folder = root.join(name);
        if scanned_mesh(&folder)?.is_some() {
            return Ok(Some("google_scanned_objects"));
        }
        for reconstruction in RECONSTRUCTIONS {
            if ycb_mesh(&folder, reconstruction)?.is_some() {
                return Ok(Some("ycb"));
            }
        }
        if bop_models::is_models(&folder)? || bop_models::is_models(&folder.join("models"))? {
            return Ok(Some("bop_models"));
        }
    }
    Ok(None)
}
