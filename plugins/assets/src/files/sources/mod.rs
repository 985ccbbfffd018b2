//! Sources of assets in files, one kind a module.
//!
//! All of them find their assets by a cheap scan, sorted by name, and read one only when it is drawn.

pub mod bop_models;
pub mod environment_folder;
mod folder;
pub mod google_scanned_objects;
pub mod mesh_folder;
pub mod pbr_folder;
pub mod ycb;

use crate::files::formats::{Model, gltf, obj, ply, stl};
use crate::files::root::AssetRoot;
use crate::files::scan::extension;
use std::path::Path;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};

/// Extensions of mesh files, the richest format first.
pub const MESH_EXTENSIONS: [&str; 5] = ["glb", "gltf", "obj", "ply", "stl"];

/// Reads a mesh file of any format, named relative to its root, as it is: in its own unit, and z up only if its format
/// says which axis is up.
pub fn read_mesh(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    match extension(file).as_str() {
        "obj" => obj::read(root, file, log),
        "glb" | "gltf" => gltf::read(root, file, log),
        "ply" => ply::read(root, file, log),
        "stl" => stl::read(root, file, log),
        other => Err(Error::new(format!("`.{other}` is not a mesh format"))
            .in_file(root.folder().join(file))
            .help("OBJ, glTF, GLB, PLY and STL are read")),
    }
}

/// The error for a root without a single asset.
fn nothing_found(root: &AssetRoot, looked_for: &str) -> Error {
    Error::new(format!("no {looked_for} in this folder")).in_file(root.folder()).help("check `root`")
}
