//! CPU path tracer: images, depth and every mask from the same rays.
//!
//! One renderer, [`cpu_path`](CpuPath). `syntable-prepare` turns the scene into tables; here are, from the bottom up:
//! [`bvh`], where rays go; `layer` and `world`, the surface at a hit; `bsdf`, how surfaces scatter light; `light`, sampling
//! lights; `path`, path tracing in batches (`batch`) of eight lanes; `film`, rounds and images; `labels`, the masks;
//! `cpu_path`, the stage.
//!
//! **Invariants.** A pixel is a pure function of (seed, pixel, scene, view): threads and tiles only decide when it is
//! computed. Only IEEE basic operations take part, so that every machine finds the same bits. Labels are taken at
//! pixel centers and never filtered; lights are not bodies.

mod batch;
mod bsdf;
pub mod bvh;
mod camera;
mod cpu_path;
mod film;
mod labels;
mod layer;
mod light;
mod path;
#[cfg(test)]
mod tests;
mod world;

pub use cpu_path::{CpuPath, CpuPathRenderer, CpuPathSession};
pub use path::Statistics;
