//! GPU path tracer: the images and labels of the CPU path tracer, on any card with Vulkan, Metal or DirectX 12.
//!
//! One renderer, [`gpu_path`](GpuPath). As `cpu_path` does, it takes the scene from `syntable-prepare`, and rays, films
//! and the reference of all functions from `syntable-transport`.
//!
//! - `trees`: bounding volume hierarchies that rays walk; `queries`: acceleration structures of ray queries
//! - `layout`: sizes and indices that the program and the shaders share; `tables`, `arena`: how scenes lie in buffers;
//!   `constants`: constants of shaders
//! - `adapters`: the cards of a machine, and those that render; `device`: kernels and errors
//! - `tiles`: the parts of the image that a request renders; `view`: the tables of a view
//! - `passes`: paths over the pixels of an image; `planes`: layout and reading of the resulting planes
//! - `session`: a scene on a device; `frame`, `rounds`: images in one go, and in rounds; `rendering`: the choice
//!   between them
//! - `gpu_path`: the stage
//! - `guided`: the denoiser of that name, for images that are rendered here
//! - `shaders`: the kernels; parts that depend on no buffer are next to the Rust code that they mirror
//!
//! **Invariants.** The same device makes the same bytes: paths are numbered and independent of each other, and the
//! samples of a pixel are added in their order. The numbers equal the CPU's up to rounding.

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
