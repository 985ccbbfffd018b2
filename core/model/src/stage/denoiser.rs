//! Removes sampling noise from rendered images.

use super::Replacement;
use crate::context::ViewContext;
use crate::error::Result;
use crate::product::standard::{DENOISER, RADIANCE, RADIANCE_NOISY};
use crate::product::{KeyId, Products};
use std::any::Any;

/// Removes the noise of an image with few samples. Runs once per view, before sensors and annotators.
pub trait Denoiser: Send + Sync {
    /// The products that it reads: the noisy image and its guides.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides: the denoised image, and [`DENOISER`], which names it.
    fn provides(&self) -> Vec<KeyId> {
        vec![RADIANCE.id(), DENOISER.id()]
    }
    /// The rendered product that it replaces, and the key under which it reads the original.
    fn replaces(&self) -> Vec<Replacement> {
        vec![Replacement { product: RADIANCE.id(), original: RADIANCE_NOISY.id(), of_parts: true }]
    }
    /// Checks that the files that it needs exist. Loads none of them, because `check` calls it for any recipe.
    fn found(&self) -> Result<()> {
        Ok(())
    }
    /// Checks that it can run on this machine. Called before the first scene.
    ///
    /// # Errors
    /// If it lacks something from outside the program.
    fn ready(&self) -> Result<()> {
        Ok(())
    }
    /// The denoiser with its options, for renderers that may run it themselves. `None` if no renderer can.
    fn as_any(&self) -> Option<&dyn Any> {
        None
    }
    /// Denoises one view: puts all that it provides into `products`, which holds what it reads. The result must not depend on the
    /// number of threads.
    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()>;
}
