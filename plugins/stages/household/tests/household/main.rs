//! One program for all tests of the crate: each program takes seconds to compile.

mod household;
mod photographs;
mod procedural_environments;
mod procedural_materials;
