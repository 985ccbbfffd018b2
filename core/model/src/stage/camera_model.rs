//! How the camera makes images.

use crate::context::Context;
use crate::error::Result;
use crate::geometry::Pose;
use crate::scene::{Optics, Scene};
use crate::stage::Part;

/// Gives a view's optics.
pub trait CameraModel: Send + Sync {
    /// Intrinsics, distortion, lens and exposure of one view, whose camera is at `world_from_camera`.
    fn optics(&self, scene: &Scene, world_from_camera: &Pose, context: &Context) -> Result<Optics>;
    /// The part of the scene that the optics need, which a step of `[[place]]` must set.
    fn needs(&self) -> Option<Part> {
        None
    }
}
