//! One program for all tests of the crate: each program takes seconds to compile.

mod appearance;
mod common;
mod depth_camera;
mod plate;
mod rgb_camera;
