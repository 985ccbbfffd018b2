//! Lets bodies come to rest.

use crate::context::Context;
use crate::error::Result;
use crate::scene::{SceneBuilder, SettleReport};

/// Moves dynamic bodies to where they come to rest, and removes those that do not count. The result must not depend
/// on the number of threads.
///
/// Poses, masses, trajectories, removals and the report are all that it changes: they are [stored](crate::scene::Settled) with the dataset, so
/// that a writer that is added later gets the same scene without simulating it again.
pub trait Settler: Send + Sync {
    /// Settles one scene.
    fn settle(&self, scene: &mut SceneBuilder, context: &Context) -> Result<SettleReport>;
}
