//! Takes sampling noise out of a rendered picture.

use crate::context::Workers;
use crate::error::Result;
use crate::product::{Frame, KeyId, Plane, Value};

/// Makes a picture of few samples look like one of many. Runs after the renderer, once a view.
pub trait Denoiser: Send + Sync {
    /// The rendered products that guide it, beside the picture itself.
    fn guides(&self) -> Vec<KeyId>;
    /// Whether it can run here: an error if something that it needs from outside the program is missing. Asked by `check`
    /// and before the first scene, so that nobody waits for a scene to learn of it.
    fn ready(&self) -> Result<()> {
        Ok(())
    }
    /// Denoises [`RADIANCE`](crate::product::standard::RADIANCE) of a frame that also has the guides. The result must
    /// not depend on the number of threads.
    fn denoise(&self, rendered: &Frame, workers: &dyn Workers) -> Result<Denoised>;
}

/// A denoised picture.
#[derive(Debug, Clone)]
pub struct Denoised {
    /// Radiance, linear Rec. 709, nits.
    pub radiance: Plane<[f32; 3]>,
    /// Which denoiser ran and how, for the output: `name`, and whatever else tells runs apart.
    pub report: Value,
}
