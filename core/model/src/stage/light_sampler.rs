//! Lights of a view.

use super::{Part, Shell};
use crate::context::Context;
use crate::error::Result;
use crate::scene::{Camera, Light, Scene};

/// Gives the lights of views, either new ones for each view or the same for all views of a scene.
pub trait LightSampler: Send + Sync {
    /// The lights of one view. `shell` is where the scene's cameras are.
    fn lights(&self, scene: &Scene, camera: &Camera, shell: &Shell, context: &Context) -> Result<Vec<Light>>;
    /// Whether all views of a scene have the same lights: the context's stream is then the same for all of them.
    fn once_per_scene(&self) -> bool {
        false
    }
    /// The part of the scene that the lights need, which a step of `[[place]]` must set. Supports are named by options of the type
    /// [`SupportName`](crate::names::SupportName), and need not be stated here.
    fn needs(&self) -> Option<Part> {
        None
    }
}
