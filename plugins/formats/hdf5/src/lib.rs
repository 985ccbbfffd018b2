//! HDF5 files.
//!
//! | kind | writes, and reads |
//! | --- | --- |
//! | [`hdf5`] | one file per view in the layout of BlenderProc |
//!
//! The only crate that knows the format's library.

mod file;
pub mod hdf5;
mod read;
mod record;
mod write;
