//! Lights of a view.

use super::Shell;
use crate::context::Context;
use crate::error::Result;
use crate::scene::{Camera, Light, Scene};

/// Gives lights, anew for every view.
pub trait LightSampler: Send + Sync {
    /// The lights of one view. `shell` is where the scene's cameras are.
    fn lights(&self, scene: &Scene, camera: &Camera, shell: &Shell, context: &Context) -> Result<Vec<Light>>;
}
