//! Placers: room, ground, table, meshes at given poses, objects that start in a box above a support, and clutter on
//! the floor.
//!
//! **Invariants.** Every random number comes from a named child of the stage's stream, one per surface or object, so
//! the draws for one object do not depend on the number of draws for another. Poses place the center of a mesh's
//! bounding box, whatever the mesh's own origin, except for the kind `mesh`.

mod bounds;
mod distractors;
mod drop_box;
mod floor_support;
mod ground;
mod material;
mod mesh;
mod oriented_box;
mod room;
mod table;
mod variation;

pub use distractors::Distractors;
pub use drop_box::DropBox;
pub use ground::Ground;
pub use mesh::Mesh;
pub use room::Room;
pub use table::Table;
