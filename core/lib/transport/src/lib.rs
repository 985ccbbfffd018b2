//! Shared code of path tracers, on any device.
//!
//! [`PathTracing`] has the options of path tracers, [`RayCamera`] the rays of a camera, [`surface`] the surface at a
//! hit, [`bsdf`] its scattering, [`light`] the sampling of a view's lights, [`path`] constants of paths, [`film`] the
//! image of samples, and [`components`] the components of its light. The code computes in lanes of [`syntable_simd`],
//! one or eight at a time, and is the reference for shaders.
//!
//! **Units and frames.** Meters and nits, in the world frame; scattering is in a local frame with z along the shading
//! normal.

pub mod bsdf;
mod camera;
pub mod components;
pub mod film;
pub mod layer;
pub mod light;
mod options;
pub mod path;
mod sums;
pub mod surface;
pub mod wgsl;

pub use camera::{Lens, Ray, RayCamera};
pub use options::{Dielectrics, PathTracing, PixelFilter, Settings};
pub use sums::{PartSums, PixelSums};
