//! Puts bodies into a scene.

use crate::context::Context;
use crate::error::Result;
use crate::scene::SceneBuilder;

/// Adds bodies, and what belongs to them such as the tabletop, with their initial poses. Placers run in recipe order.
pub trait Placer: Send + Sync {
    /// Places the bodies of one scene.
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()>;
    /// What it has to do with the tabletop, so that `check` finds steps that are missing, twice there or in the wrong
    /// order.
    fn tabletop(&self) -> PartUse {
        PartUse::Unstated
    }
    /// The same of the floor.
    fn floor(&self) -> PartUse {
        PartUse::Unstated
    }
    /// Whether it may place bodies of [`Role::Object`](crate::scene::Role::Object): a scene needs one.
    fn places_objects(&self) -> bool {
        true
    }
}

/// What a placer has to do with a part that a scene has once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartUse {
    /// It does not say.
    Unstated,
    /// Nothing, or whatever is there.
    None,
    /// It sets the part. One placer of a recipe does.
    Sets,
    /// It needs the part, which an earlier step has set.
    Needs,
}
