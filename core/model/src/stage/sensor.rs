//! Simulates the effects of real cameras on images and depth.

use super::{Part, Replacement};
use crate::context::ViewContext;
use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::random::Stream;

/// Makes noisy, blurred or quantized products from rendered ones, as a sensor would. Runs once per view, after the denoiser. A
/// sensor gets random numbers, and an annotator does not: labels depend on rendered products, never on sensed ones.
pub trait Sensor: Send + Sync {
    /// The products that it reads.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides.
    fn provides(&self) -> Vec<KeyId>;
    /// The products of other stages that it replaces, each with the key under which it reads the original.
    fn replaces(&self) -> Vec<Replacement> {
        Vec::new()
    }
    /// The part of the scene that a placer must set for it; none by default.
    fn needs(&self) -> Option<Part> {
        None
    }
    /// Checks that the files that it needs for scenes of some views exist. Loads none of them, because `check` calls it for any
    /// recipe.
    fn found(&self, views: u32) -> Result<()> {
        let _ = views;
        Ok(())
    }
    /// Puts all that it provides into `products`, which holds what it reads. `stream` is the random stream of this sensor, scene,
    /// view and attempt.
    fn sense(&self, cx: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()>;
}
