//! One program for all tests of the crate: each program takes seconds to compile.

mod hdf5;
mod read;
