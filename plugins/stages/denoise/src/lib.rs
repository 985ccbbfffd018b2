//! Denoisers: stages that remove sampling noise from images.
//!
//! | kind | method |
//! | --- | --- |
//! | [`none`] | leaves images as rendered; the default |
//! | [`guided`] | edge-avoiding filter, guided by albedo, normals, depth and ids |
//! | [`oidn`] | Open Image Denoise, loaded at run time if the user has it |
//! | [`auto`] | `oidn` where it is found, else `guided` |
//!
//! **Invariants.** The image does not depend on the number of threads. The program is not linked to optional libraries;
//! a library is opened when the first image is denoised, never by `check` or `plan`.

pub mod auto;
pub mod guided;
pub mod none;
pub mod oidn;
