//! One program for all tests of the crate: each program takes seconds to compile.

mod mixture;
mod recipe;
mod recipe_kit;
mod recipe_schema;
