//! CPU path tracer: pictures, depth and every mask from the same rays.
//!
//! One renderer, [`cpu_path`](CpuPath). From the bottom up: [`bvh`] finds where rays go; `mesh`, `texture`, `material`
//! and `cache` hold what bodies are made of, `world` puts them together for a scene; `bsdf` says how surfaces scatter
//! light, `light` where it comes from, `sampler` which numbers are tried, all of them for one path or for eight at once
//! (`real`); `path` makes pictures of all that, `labels`
//! the masks; `cpu_path` is the stage.
//!
//! **Invariants.** A pixel is a pure function of (seed, pixel, scene, view): threads and tiles only decide when it is
//! computed. Only IEEE basic operations take part, so that every machine finds the same bits. Labels are taken at
//! pixel centres and never filtered; lights are not bodies.

mod approx;
mod batch;
mod bsdf;
pub mod bvh;
mod cache;
mod camera;
mod cpu_path;
mod labels;
mod light;
mod material;
mod mesh;
mod path;
mod picture;
mod real;
mod sampler;
#[cfg(test)]
mod tests;
mod texture;
mod vec3;
mod world;

pub use cpu_path::{CpuPath, CpuPathRenderer, CpuPathSession};
pub use path::Statistics;
