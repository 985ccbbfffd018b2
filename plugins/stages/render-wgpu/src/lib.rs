//! GPU path tracer: the images and labels of the CPU path tracer, on any card with Vulkan, Metal or DirectX 12.
//!
//! One renderer, [`gpu_path`](GpuPath). It takes the scene from `syntable-prepare` and rays, films and the reference of all
//! functions from `syntable-transport`, as `cpu_path` does.
//!
//! - `trees`: what rays walk; `queries`: what cards trace themselves
//! - `layout`: what both sides of the bus agree on; `tables`, `arena`: how scenes lie in buffers; `constants`: what shaders know by name
//! - `adapters`: the cards of a machine, and those that render; `device`: kernels and errors
//! - `tiles`: what a request shows; `view`: the tables of a view
//! - `passes`: paths over the pixels of an image; `planes`: what becomes of them
//! - `session`: a scene on a device; `frame`, `rounds`: images in one go, and in rounds; `rendering`: the choice between them
//! - `gpu_path`: the stage
//! - `guided`: the denoiser of that name on the images that are rendered here
//! - `shaders`: the kernels; what of them depends on no buffer lies beside the Rust that it mirrors
//!
//! **Invariants.** The same device makes the same bytes: paths are numbered, each is computed by itself, and the samples of
//! a pixel are added in their order. The CPU's numbers are found up to rounding.

mod adapters;
mod arena;
mod constants;
mod device;
mod frame;
mod gpu_path;
mod guided;
mod layout;
mod passes;
mod planes;
mod queries;
mod rendering;
mod rounds;
mod session;
mod tables;
#[cfg(test)]
mod tests;
mod tiles;
mod trees;
mod view;

pub use adapters::{AdapterInfo, Adapters, RayQueries};
pub use device::Device;
pub use gpu_path::{GpuPath, GpuPathRenderer};
pub use guided::{GuidedFilter, Sections};
