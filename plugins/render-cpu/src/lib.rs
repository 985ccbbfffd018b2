//! CPU path tracer: pictures, depth and every mask from the same rays.

pub mod bvh;
