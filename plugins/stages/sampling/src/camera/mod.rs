//! Camera models.

mod exposure;
mod fisheye;
mod intrinsics;
mod lens;
mod pinhole;
mod recorded;

pub use fisheye::Fisheye;
pub use pinhole::Pinhole;
pub use recorded::RecordedLenses;
