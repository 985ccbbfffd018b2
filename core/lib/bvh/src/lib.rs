//! Ray tracing: an 8-wide tree per mesh, a small tree of instances per scene.
//!
//! Input and output are plain `f32` arrays, in meters throughout. Build a [`MeshBvh`] once per mesh, place it any
//! number of times in a [`SceneBvh`], and query that for first hits, shadows, or the first hit in every instance. The
//! modules: `wide` is the tree, `build` builds it, `ray` holds values that a walk precomputes, `walk` is the traversal
//! and the triangle test, `query` holds the queries, `frustum` rejects boxes for a whole tile.

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
use syntable_prepare::SurfacePoint;
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

impl Hit {
    /// The point without its distance along the ray.
    #[inline(always)]
    pub fn point(&self) -> SurfacePoint {
        SurfacePoint { instance: self.instance, primitive: self.primitive, u: self.u, v: self.v }
    }
}
