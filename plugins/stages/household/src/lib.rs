//! Procedural asset sources: household objects, containers, furniture, furnishings, tables, surface materials and environment maps. They need no
//! files; `household` can show photographs of a folder on its prints.
//!
//! Each kind has a module of its name: [`household`], [`procedural_containers`], [`procedural_furniture`], [`procedural_interior`], [`procedural_tables`],
//! [`procedural_materials`] and [`procedural_environments`]. Objects and furniture are modeled with [`shape`] and textured with [`material`];
//! [`family`] holds the object families.
//!
//! **Invariants.** A variant depends only on seed, family and number, not on earlier loads, on the selected families,
//! or on the number of selected variants. Meshes are unions of closed surfaces with outward normals.

pub mod family;
pub mod household;
mod joinery;
pub mod material;
mod photograph_folder;
pub mod procedural_containers;
pub mod procedural_environments;
pub mod procedural_furniture;
pub mod procedural_interior;
pub mod procedural_materials;
pub mod procedural_tables;
pub mod shape;
mod variants;
