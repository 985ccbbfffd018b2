//! Assets in files: bad and unusual input, real collections, and formats compared with each other.

#[path = "files/bombs.rs"]
mod bombs;
#[path = "files/broken.rs"]
mod broken;
#[path = "files/collections.rs"]
mod collections;
#[path = "files/colors.rs"]
mod colors;
#[path = "files/common.rs"]
mod common;
#[path = "files/damage.rs"]
mod damage;
#[path = "files/details.rs"]
mod details;
#[path = "files/exports.rs"]
mod exports;
#[path = "files/inputs.rs"]
mod inputs;
#[path = "files/meshes.rs"]
mod meshes;
#[path = "files/objects.rs"]
mod objects;
#[path = "files/real.rs"]
mod real;
#[path = "files/scenes.rs"]
mod scenes;
#[path = "files/uncommon.rs"]
mod uncommon;

// The crate registers its sources and inspectors only where it is linked.
use syntable_assets as _;
