//! CPU path tracer: images, depth and every mask from the same rays.
//!
//! One renderer, [`cpu_path`](CpuPath), and [`auto`](AutoPath), which is `gpu_path` instead where there is a card. `syntable-prepare` turns the scene into tables, `syntable-transport` has surfaces,
//! scattering, lights and images; here are, from the bottom up: [`bvh`], where rays go; `world`, a scene with its trees;
//! `path`, path tracing in batches (`batch`) of eight lanes; `labels`, the masks; `cpu_path`, the stage.
//!
//! **Invariants.** A pixel is a pure function of (seed, pixel, scene, view): threads and tiles only decide when it is
//! computed. Only IEEE basic operations take part, so that every machine finds the same bits. Labels are taken at
//! pixel centers and never filtered; lights are not bodies.

mod auto;
mod batch;
pub mod bvh;
mod cpu_path;
mod labels;
mod path;
#[cfg(test)]
mod tests;
mod world;

pub use auto::AutoPath;
pub use cpu_path::{CpuPath, CpuPathRenderer, CpuPathSession};
