//! Puts bodies into a scene.

use crate::context::Context;
use crate::error::Result;
use crate::scene::SceneBuilder;

/// Adds bodies, and what belongs to them such as the tabletop, with their initial poses. Placers run in recipe order.
pub trait Placer: Send + Sync {
    /// Places the bodies of one scene.
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()>;
}
