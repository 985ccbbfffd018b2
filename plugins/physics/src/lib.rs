//! Settler: rigid bodies come to rest on the table (rapier3d, convex parts by parry3d).
//!
//! The kind `rapier` takes a scene as the placers left it, lets every dynamic body fall, and hands back poses at rest:
//!
//! 1. [`decompose`]: every object becomes convex parts. Parts that the object brings are used; otherwise VHACD makes
//!    them, once per mesh, kept in memory and in the cache.
//! 2. [`fixed`]: supports become convex parts too, with a thick slab under a flat tabletop; floor, walls and ceiling
//!    become half-spaces.
//! 3. [`engine`]: the simulation runs until everything sleeps or the time is over.
//! 4. [`gate`]: bodies off the tabletop go; bodies that still move, or are deeper in another than a limit, are dropped
//!    again from above the pile or go too, and the rest settles anew, until the state is accepted.
//!
//! **What is measured.** The [`depth`] of two bodies is the largest depth of any two of their convex parts, and the
//! depth of two convex parts is the length of the shortest translation that parts them. Speed is that of the centre of
//! mass at the last step; a sleeping body has none.
//!
//! **Invariants.** Poses depend on the scene, the options and the stream alone: each scene is simulated on one thread
//! of its own with platform-independent arithmetic, bodies enter in the order in which they were added, and cached
//! parts are read back bit by bit. Whatever the input, the loop of the gate ends: every round uses up one of a body's
//! tries or takes a body out.
//!
//! **Units.** Metres, kilograms, seconds, in f64; inside the engine eighths of metres, in f32 (see [`units`]).

mod codec;
mod config;
mod decompose;
mod depth;
mod engine;
mod fixed;
mod gate;
mod hull;
mod library;
mod manifold;
mod settle;
mod shape;
mod solid;
mod units;

pub use config::{Collision, Mass, OnViolation, Rapier, Remove};

#[cfg(test)]
extern crate self as syntable_physics;
#[cfg(test)]
#[path = "../tests/kit/mod.rs"]
mod kit;
