//! What a real camera makes of a perfect picture.

use super::Site;
use crate::context::Context;
use crate::error::Result;
use crate::product::{Frame, KeyId};

/// Reads rendered products and provides what a sensor would give: noisy, blurred, quantised. Runs once a view, after
/// the renderer and the denoiser and before the annotators. Unlike an annotator it is given random numbers; labels are
/// made from what was rendered, never from what was sensed.
pub trait Sensor: Send + Sync {
    /// The products that it reads.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them in the frame.
    fn sense(&self, site: &Site, context: &Context, frame: &mut Frame) -> Result<()>;
}
