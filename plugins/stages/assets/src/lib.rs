//! Asset sources that read files: objects, materials and environment maps of many formats and collections.
//!
//! - [`sources`]: kinds for a recipe's `[assets.<pool>]`, one per module.
//! - [`formats`]: readers, one format per module. They register with [`syntable_mesh`], where other crates add theirs.
//! - `inspect`: folders and files, besides single meshes and images, that `syntable check --asset PATH` can inspect.
//!
//! **Choices.** A missing image or material library is a warning, and a constant color replaces it; a broken one is an
//! error. A name that leads out of the asset's folder is an error, and is never opened.

mod bop_files;
pub mod formats;
mod inspect;
pub mod sources;
