//! What path tracers share, whatever they run on.
//!
//! [`PathTracing`] are their options, [`RayCamera`] gives the rays of a camera, [`surface`] the surface at a hit, [`bsdf`]
//! how it scatters light, [`light`] samples the lights of a view, [`path`] has numbers of paths, [`film`] makes an image of samples, and [`components`] parts its
//! light. All of it computes
//! in lanes of [`syntable_simd`], one or eight at a time, and is the reference of what a shader does.
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
