//! CPU path tracer: images, depth and every mask from the same rays.
//!
//! The renderers are [`cpu_path`](CpuPath) and [`auto`](AutoPath), which selects `gpu_path` on machines with a graphics
//! card. `syntable-prepare` turns the scene into tables; `syntable-bvh` answers ray queries; `syntable-transport` has
//! surfaces, scattering, lights and images. The modules here, from the bottom up: `world`, a scene with its trees;
//! `path`, path tracing in batches (`batch`) of eight lanes; `labels`, the masks; `cpu_path`, the stage.
//!
//! **Invariants.** A pixel is a pure function of (seed, pixel, scene, view): threads and tiles only decide when it is
//! computed. Only IEEE basic operations are used, so that every machine computes the same bits. Labels are taken at
//! pixel centers and never filtered; lights are not bodies.

mod auto;
mod batch;
mod cpu_path;
mod labels;
mod path;
mod world;

pub use auto::AutoPath;
pub use cpu_path::{CpuPath, CpuPathRenderer, CpuPathSession};
pub use path::Strategy;
