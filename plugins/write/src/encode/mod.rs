//! Encoders of files, by kind of value.
//!
//! Each encoder has one function that decides from a product's [`Kind`](kind::Kind) how it is stored, or why it cannot
//! be: no encoder knows products by name.

pub mod exr;
pub mod json_shard;
pub mod kind;
pub mod npy;
pub mod pfm;
pub mod png;

use syntable_model::error::{Error, Result};
use syntable_model::scene::{SceneId, View, ViewId};
use syntable_model::stage::Site;

/// `{scene:06}_{view:04}`: the name of a view in the files of generic writers.
pub fn view_name(scene: SceneId, view: ViewId) -> String {
    format!("{:06}_{:04}", scene.0, view.0)
}

/// The view that is being written.
pub fn view<'a>(site: &Site<'a>) -> Result<&'a View> {
    site.view.ok_or_else(|| Error::new("a view is written without a view"))
}
