//! Puts bodies into a scene.

use crate::context::Context;
use crate::error::Result;
use crate::scene::SceneBuilder;

/// Adds bodies, and what belongs to them such as the tabletop, with their initial poses. Placers run in recipe order.
pub trait Placer: Send + Sync {
    /// Places the bodies of one scene.
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()>;
    /// What it has to do with the tabletop, so that `check` finds steps that are missing or in the wrong order.
    fn tabletop(&self) -> TabletopUse {
        TabletopUse::Unstated
    }
}

/// What a placer has to do with the tabletop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TabletopUse {
    /// It does not say.
    Unstated,
    /// Nothing.
    None,
    /// It sets the tabletop. One placer of a recipe does.
    Sets,
    /// It needs a tabletop that an earlier step has set.
    Needs,
}
