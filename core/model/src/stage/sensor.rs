//! Simulates what a real camera makes of rendered images and depth.

use super::Replacement;
use crate::context::ViewContext;
use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::random::Stream;

/// Reads rendered products and provides what a sensor would give: noisy, blurred, quantized. Runs once per view, after
/// the denoiser. Unlike an annotator it is given random numbers; labels are made from what was rendered, never from
/// what was sensed.
pub trait Sensor: Send + Sync {
    /// The products that it reads.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides.
    fn provides(&self) -> Vec<KeyId>;
    /// The products of other stages that it replaces, each with the key under which it reads the original.
    fn replaces(&self) -> Vec<Replacement> {
        Vec::new()
    }
    /// Makes all that it provides and puts it into `products`, which holds what it reads. `stream` belongs to this sensor,
    /// scene, view and attempt.
    fn sense(&self, cx: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()>;
}
