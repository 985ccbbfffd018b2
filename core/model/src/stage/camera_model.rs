//! How the camera makes images.

use crate::context::Context;
use crate::error::Result;
use crate::geometry::Pose;
use crate::scene::{Optics, Scene};

/// Gives a view's optics.
pub trait CameraModel: Send + Sync {
    /// Intrinsics, distortion, lens and exposure of one view, whose camera is at `world_from_camera`.
    fn optics(&self, scene: &Scene, world_from_camera: &Pose, context: &Context) -> Result<Optics>;
}
