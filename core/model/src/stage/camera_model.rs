//! How the camera makes pictures.

use crate::context::Context;
use crate::error::Result;
use crate::scene::{Exposure, Intrinsics};

/// Gives a view's intrinsics and exposure.
pub trait CameraModel: Send + Sync {
    /// Intrinsics and exposure of one view.
    fn camera(&self, context: &Context) -> Result<(Intrinsics, Exposure)>;
}
