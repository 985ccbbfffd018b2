//! Encoders of files, by kind of value.
//!
//! Each encoder has one function that decides from a product's [`ValueKind`](kind::ValueKind) how the product is
//! stored, or why it cannot be stored. No encoder depends on the names of products.

pub mod exr;
pub mod jpeg;
pub mod json_shard;
pub mod kind;
pub mod npy;
pub mod npz;
pub mod pfm;
pub mod png;
pub mod rgb;
pub mod tar;

use syntable_model::scene::{SceneId, ViewId};

/// `{scene:06}_{view:04}`: the name of a view in the files of generic writers.
pub fn view_name(scene: SceneId, view: ViewId) -> String {
    format!("{:06}_{:04}", scene.0, view.0)
}

/// `{scene:06}`: the name of a scene in the files of generic writers.
pub fn scene_name(scene: SceneId) -> String {
    format!("{:06}", scene.0)
}
