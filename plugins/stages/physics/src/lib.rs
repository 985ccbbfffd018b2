//! Settler: rigid bodies come to rest on their supports (rapier3d, with a convex decomposition of its own).
//!
//! The kind `rapier` takes a scene as the placers left it, lets every dynamic body fall, and returns poses at rest:
//!
//! 1. `decompose`: every object becomes convex parts. Parts supplied by the object are used; otherwise its
//!    mesh is cut into them, once, and they are kept in memory and in the cache (`hull_cache`).
//! 2. `static_body`: supports become convex parts too, with a thick slab under a flat tabletop; floor, walls and
//!    ceiling become half-spaces.
//! 3. `engine`: the simulation runs until everything sleeps or the time is over.
//! 4. `acceptance`: bodies off their support are removed or respawned. Bodies that still move get more time; those that
//!    move even then, or penetrate another deeper than a limit, are respawned above the pile or removed, and the rest
//!    settles again, until no body violates a limit.
//!
//! The kind `none` leaves every body where it was placed.
//!
//! The annotator `relations` says who touches and carries whom, from the poses of a scene and the same shapes.
//!
//! **What is measured.** The penetration depth of two bodies is the largest depth of any two of their convex parts, and
//! the depth of two convex parts is the length of their minimum translation vector. Speed is that of the center of mass
//! at the last step; a sleeping body has none.
//!
//! **Invariants.** Poses depend on the scene, the options and the stream alone: each scene is simulated on one thread
//! of its own with platform-independent arithmetic, bodies are inserted in the order in which they were added, and
//! cached parts are read back bit by bit. The acceptance loop ends on any input: every round uses up one of a body's
//! respawns or the one time that it is waited for after each, or removes a body.
//!
//! **Units.** Meters, kilograms, seconds, in f64; inside the engine eighths of meters, in f32 (see `units`).

mod acceptance;
mod collision_shape;
mod decompose;
mod engine;
mod hull_cache;
mod hull_codec;
mod none;
mod rapier;
mod relations;
mod settle;
mod static_body;
mod units;

pub use none::NoPhysics;
pub use rapier::{Collision, Mass, OnViolation, Rapier, Remove};
pub use relations::Relations;

#[cfg(test)]
extern crate self as syntable_physics;
#[cfg(test)]
#[path = "../tests/kit/mod.rs"]
mod kit;
