//! Settlers: rigid bodies come to rest on their supports (rapier3d, with its own convex decomposition).
//!
//! The kind `rapier` starts from the placers' scene, lets every dynamic body fall, and returns poses at rest:
//!
//! 1. `decompose`: every object becomes convex parts. If the object supplies parts, these are used. Otherwise, its mesh
//!    is cut into parts once, which are cached in memory and on disk (`hull_cache`).
//! 2. `static_body`: supports become convex parts too, with a thick slab under a flat tabletop; floor, walls and
//!    ceiling become half-spaces.
//! 3. `engine`: the simulation runs until all bodies sleep or the time is over.
//! 4. `acceptance`: bodies off their support are removed or respawned. Moving bodies get more time. Bodies that still
//!    move then, or that penetrate another deeper than a limit, are respawned above the pile or removed, and the rest
//!    settles again, until no body violates a limit.
//!
//! The kind `none` leaves every body where it was placed.
//!
//! The annotator `relations` determines contacts and support from the poses of a scene and the same shapes, and the annotator
//! `collision_shapes` states them for other engines.
//!
//! **Measurements.** The penetration depth of two bodies is the largest depth of any two of their convex parts, and the
//! depth of two convex parts is the length of their minimum translation vector. Speed is the speed of the center of
//! mass at the last step; a sleeping body has speed 0.
//!
//! **Invariants.** Poses depend only on the scene, the options and the stream: each scene is simulated on a single
//! thread with platform-independent arithmetic, bodies are inserted in the order of their addition, and cached parts
//! are identical bit by bit. The acceptance loop ends on any input: every round removes a body, or uses up one of its
//! respawns or the one extension after each of them.
//!
//! **Units.** Meters, kilograms, seconds, in f64; inside the engine eighths of meters, in f32 (see `units`).

mod acceptance;
mod collision_shape;
mod collision_shapes;
mod decompose;
mod engine;
mod hull_cache;
mod hull_codec;
mod none;
mod options;
mod rapier;
mod relations;
mod settle;
mod static_body;
mod units;

pub use collision_shapes::CollisionShapes;
pub use none::NoPhysics;
pub use options::{Collision, Mass, OnViolation, Rapier, Remove};
pub use relations::Relations;

#[cfg(test)]
extern crate self as syntable_physics;
#[cfg(test)]
#[path = "../tests/kit/mod.rs"]
mod kit;
