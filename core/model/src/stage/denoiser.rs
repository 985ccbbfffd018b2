//! Removes sampling noise from rendered images.

use super::Replacement;
use crate::context::ViewContext;
use crate::error::Result;
use crate::product::standard::{DENOISER, RADIANCE, RADIANCE_NOISY};
use crate::product::{KeyId, Products};
use std::any::Any;

/// Makes an image of few samples look like one of many. Runs once per view, before sensors and annotators.
pub trait Denoiser: Send + Sync {
    /// The products that it reads: the noisy image and its guides.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides: the denoised image, and [`DENOISER`], which names it.
    fn provides(&self) -> Vec<KeyId> {
        vec![RADIANCE.id(), DENOISER.id()]
    }
    /// The rendered product that it replaces, and the key under which it reads the original.
    fn replaces(&self) -> Vec<Replacement> {
        vec![Replacement { product: RADIANCE.id(), original: RADIANCE_NOISY.id(), of_objects: true }]
    }
    /// Whether the files that it needs are there. Runs none of them: `check` asks, for any recipe.
    fn found(&self) -> Result<()> {
        Ok(())
    }
    /// Whether it can run here: an error if something that it needs from outside the program is missing. Asked before
    /// the first scene.
    fn ready(&self) -> Result<()> {
        Ok(())
    }
    /// The denoiser with its options, so that a renderer knows one that it runs itself; `None` if no renderer does.
    fn as_any(&self) -> Option<&dyn Any> {
        None
    }
    /// Denoises one view: puts what it provides into `products`, which holds what it reads. The result must not depend on
    /// the number of threads.
    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()>;
}
