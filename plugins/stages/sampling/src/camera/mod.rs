//! Camera models.

mod exposure;
mod intrinsics;
mod lens;
mod pinhole;

pub use pinhole::Pinhole;
