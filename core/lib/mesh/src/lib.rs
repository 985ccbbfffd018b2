//! Shared code of asset sources that read files, from the path in a recipe to the finished object.
//!
//! - [`root`] resolves the file names that assets contain and keeps them inside the asset's folder; [`scan`] lists
//!   folders in a fixed order; [`text`] and [`polygon`] help readers of text formats and of polygons.
//! - A reader produces a [`Model`]: triangles and materials as the file states them; [`paint`] helps with colors by
//!   vertex and by face, and [`placement`] moves a model. [`repair`] makes the mesh valid, and [`Model::into_object`] turns it into an object for pools.
//!   [`mass`] estimates its mass, and [`resting`] computes its stable poses.
//! - [`format`](mod@format) holds the registries of mesh and image formats. A crate adds a format with
//!   [`register_mesh_format!`] or [`register_image_format!`]; `mesh_folder`, textures, environment maps and
//!   `syntable check --asset` then read it.
//!
//! ```
//! use std::path::Path;
//! use syntable_mesh::format::MeshFormat;
//! use syntable_mesh::material::default_material;
//! use syntable_mesh::root::AssetRoot;
//! use syntable_mesh::{Model, register_mesh_format};
//! use syntable_model::context::Log;
//! use syntable_model::error::{Error, Result};
//! use syntable_model::scene::MeshData;
//!
//! /// Object File Format (OFF) with triangles.
//! fn read(root: &AssetRoot, file: &Path, _log: &dyn Log) -> Result<Model> {
//!     let path = root.locate(file)?;
//!     let text = String::from_utf8_lossy(&root.read(&path)?).into_owned();
//!     let mut numbers = text.split_ascii_whitespace().skip(1).map_while(|word| word.parse::<f32>().ok());
//!     let mut next = || numbers.next().ok_or_else(|| Error::new("the file ends early").in_file(&path));
//!     let [vertices, faces, _edges] = [next()?, next()?, next()?];
//!     let mut mesh = MeshData::default();
//!     for _ in 0..vertices as usize {
//!         mesh.positions.push([next()?, next()?, next()?]);
//!     }
//!     for _ in 0..faces as usize {
//!         let [_corners, a, b, c] = [next()?, next()?, next()?, next()?];
//!         mesh.triangles.push([a as u32, b as u32, c as u32]);
//!     }
//!     Ok(Model { mesh, materials: vec![default_material(false)] })
//! }
//!
//! register_mesh_format!(MeshFormat::new("OFF", &["off"], read));
//! # fn main() {}
//! ```

mod digest;
pub mod environment;
pub mod foreign;
pub mod format;
pub mod image;
pub mod inspect;
pub mod limits;
pub mod mass;
pub mod material;
mod model;
mod object;
pub mod paint;
pub mod placement;
pub mod polygon;
pub mod repair;
pub mod resting;
pub mod root;
pub mod scan;
pub mod size;
pub mod text;
mod up;

pub use digest::mesh_digest;
pub use model::Model;
pub use object::{FRICTION, ObjectInfo};
pub use syntable_model;
pub use up::Up;
