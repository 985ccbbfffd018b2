//! One program for all tests of the crate: each program takes seconds to compile.

mod exr;
mod formats;
mod gltf;
mod ply;
mod readers;
mod samples;
mod webdataset;
