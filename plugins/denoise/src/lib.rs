//! Denoisers: stages that make a picture of few samples look like one of many.
//!
//! | kind | what it is |
//! | --- | --- |
//! | [`guided`] | a filter of its own, guided by colour, normals, depth and ids |
//! | [`oidn`] | Open Image Denoise, loaded while the program runs, if the user has it |
//!
//! **Invariants.** A picture does not depend on the number of threads. Nothing is linked that the user may not have; a
//! library is opened when the first picture comes, never by `check` or `plan`.

pub mod guided;
pub mod oidn;
