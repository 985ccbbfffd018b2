//! Camera models.

mod exposure;
mod fisheye;
mod intrinsics;
mod lens;
mod pinhole;

pub use fisheye::Fisheye;
pub use pinhole::Pinhole;
