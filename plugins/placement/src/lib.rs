//! Placers: room, table, objects dropped from a box, and clutter on the floor.
//!
//! **Invariants.** Every draw comes from a named child of the stage's stream, one per surface or object, so that what
//! is drawn for one thing does not depend on how many draws another took. Poses put the middle of a mesh's bounding
//! box where it should be, whatever the mesh's own origin.

mod distractors;
mod drop_box;
mod oriented_box;
mod room;
mod surface;
mod table;

pub use distractors::Distractors;
pub use drop_box::DropBox;
pub use room::Room;
pub use table::Table;
