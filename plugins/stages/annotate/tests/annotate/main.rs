//! One program for all tests of the crate: each program takes seconds to compile.

mod common;
mod masks;
mod materials;
mod others;
mod views;
