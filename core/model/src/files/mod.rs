//! Reading files that a recipe names, and the paths of files in datasets.

mod content;
mod folder;
mod path;

pub use content::{read_small, replacement};
pub use folder::{DatasetFolder, Reach};
pub use path::{DatasetPath, NotInside, RESERVED};
