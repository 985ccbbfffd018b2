//! What several writers need: encoders, names and shards.

pub mod array;
pub mod image;
pub mod products;
pub mod shard;

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
