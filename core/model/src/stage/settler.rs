//! Lets bodies come to rest.

use crate::context::Context;
use crate::error::Result;
use crate::scene::{SceneBuilder, SettleReport};

/// Moves dynamic bodies to where they come to rest, and removes bodies that do not count. The result must not depend on
/// the number of threads.
///
/// It changes only poses, masses, trajectories, removals and the report. They are [stored](crate::scene::Settled) with
/// the dataset, so that a writer that is added later gets the same scene without a new simulation.
pub trait Settler: Send + Sync {
    /// Settles one scene.
    fn settle(&self, scene: &mut SceneBuilder, context: &Context) -> Result<SettleReport>;
}
