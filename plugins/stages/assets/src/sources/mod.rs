//! Sources of assets in files, one kind per module.
//!
//! All kinds scan folders for assets, sort them by name, and read an asset only when it is drawn.

pub mod bop_models;
pub mod collision;
pub mod environment_folder;
pub mod folder;
pub mod google_scanned_objects;
mod keypoints;
pub(crate) mod layouts;
pub mod mesh_folder;
pub mod pbr_folder;
pub mod ycb;

use syntable_mesh::root::AssetRoot;
use syntable_model::error::Error;

/// The error for a root without a single asset.
fn nothing_found(root: &AssetRoot, looked_for: &str) -> Error {
    Error::new(format!("no {looked_for} in this folder")).in_file(root.folder()).help("check `root`")
}
