//! Placers: room, ground, table, bins and shelves, furniture along the walls, meshes and objects at given poses, objects that are dropped
//! or put down on a support, recorded scenes, and clutter on the floor.
//!
//! - `drop_box` and `arrange` share `objects`, which draws objects and their variation. `drop_box` starts them in the air; `arrange`
//!   puts them down in the poses of `resting`, on the surface that `bearing` finds, where no `footprint` is in the way.
//! - `table` and `support` place the bodies that carry them.
//!
//! **Invariants.** Every random number comes from a named child of the stage's stream, one per surface or object, so
//! the draws for one object do not depend on the number of draws for another. `drop_box`, `table`,
//! `support`, `furnishings` and `distractors` place the center of a mesh's bounding box, whatever its own origin. `arrange` places the
//! lowest point and the center of the footprint; `mesh`, `listed` and `recorded` place the origin of the file.

mod areas;
mod arrange;
mod bearing;
mod bounds;
mod dist_list;
mod distractors;
mod drop_box;
mod floor_support;
mod footprint;
mod furnishings;
mod ground;
mod listed;
mod material;
mod mesh;
mod objects;
mod oriented_box;
mod recorded;
mod resting;
mod room;
mod rotation;
mod support;
mod table;
mod variation;

pub use arrange::Arrange;
pub use distractors::Distractors;
pub use drop_box::DropBox;
pub use furnishings::Furnishings;
pub use ground::Ground;
pub use listed::Listed;
pub use mesh::Mesh;
pub use recorded::Recorded;
pub use room::Room;
pub use support::Support;
pub use table::Table;
