//! Assets in files: objects of many formats and collections, pictures, environment maps and material folders.
//!
//! - [`sources`]: what a recipe's `[assets.<pool>]` can name.
//! - [`inspectors`]: what `syntable check --asset PATH` can look at.
//! - [`formats`]: readers, one a format.
//! - [`hygiene`] cleans what the readers give, [`object`] weighs it.
//! - [`root`] keeps every name that a file contains inside the asset's folder.
//!
//! **Choices.** A picture or material library that is missing is a warning, and a plain colour takes its place; one that
//! is broken is an error. A name that leads out of the asset's folder is an error, and is never opened.

mod colour;
pub mod formats;
pub mod hygiene;
pub mod inspectors;
mod mesh_digest;
pub mod object;
mod plain;
pub mod root;
mod scan;
pub mod sources;
