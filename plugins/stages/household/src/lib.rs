//! Procedural asset sources: household objects, tables, surface materials and environment maps. They need no files.
//!
//! Each kind has a module of its name: [`household`], [`procedural_tables`], [`procedural_materials`] and
//! [`procedural_environments`]. Objects and tables are modeled with [`shape`] and textured with [`material`];
//! [`family`] holds the object families.
//!
//! **Invariants.** A variant is a function of seed, family and number: not of what was loaded before, nor of the
//! families or the number of variants selected. Meshes are unions of closed surfaces with outward normals.

pub mod family;
pub mod household;
pub mod material;
pub mod procedural_environments;
pub mod procedural_materials;
pub mod procedural_tables;
pub mod shape;
mod variants;
