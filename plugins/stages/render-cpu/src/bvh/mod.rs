//! Ray tracing: an 8-wide tree per mesh, a small tree of instances per scene.
//!
//! Plain `f32` arrays in and out; meters throughout. Build a [`MeshBvh`] once per mesh, place it
//! any number of times in a [`SceneBvh`], and ask that for first hits, shadows, or the first hit in
//! every instance. Module by module: `wide` is the tree, `build` makes it, `ray` is what a walk
//! precomputes, `walk` the traversal and triangle test, `query` the questions, `frustum` what rules out
//! boxes for a whole tile.

mod axes;
mod build;
mod frustum;
mod mesh;
mod query;
mod ray;
mod scene;
#[cfg(test)]
mod tests;
mod walk;
mod wide;

pub use mesh::MeshBvh;
pub use ray::{Affine, IDENTITY};
pub use scene::{Instance, SceneBvh};
pub use syntable_transport::Ray;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second corner.
    pub u: f32,
    /// Weight of the triangle's third corner; the first one's is `1 - u - v`.
    pub v: f32,
    /// Position of the triangle in its mesh.
    pub primitive: u32,
    /// Position of the instance in its scene.
    pub instance: u32,
}
