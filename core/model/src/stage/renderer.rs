//! Renders images and per-pixel labels.

use crate::context::Workers;
use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::random::Stream;
use crate::scene::{Scene, View};
use std::sync::Arc;

/// A way of rendering. It offers products; the plan asks for those that somebody wants.
pub trait Renderer: Send + Sync {
    /// The products it can make.
    fn offers(&self) -> Vec<KeyId>;
    /// How many sessions may be open at once: the number of devices, or none if there is no limit.
    fn max_sessions(&self) -> Option<usize> {
        None
    }
    /// Opens a session. `index` counts from 0 and chooses the device.
    fn open(&self, index: usize) -> Result<Box<dyn RenderSession>>;
    /// One line on what a view costs, for `syntable plan`.
    fn cost(&self) -> String;
}

/// A renderer at work; used by one thread at a time, for one scene after another.
pub trait RenderSession: Send {
    /// Makes a scene ready.
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()>;
    /// Renders a view of the scene that was loaded last, and puts exactly the wanted products into `products`.
    fn render(&mut self, request: &RenderRequest, products: &mut Products) -> Result<()>;
}

/// One view to render.
#[derive(Clone)]
pub struct RenderRequest<'a> {
    /// Camera and lights.
    pub view: &'a View,
    /// The products to make, all among those offered.
    pub wants: &'a [KeyId],
    /// Seed of the sampling.
    pub stream: Stream,
    /// Threads to spread the pixels over.
    pub workers: &'a dyn Workers,
}
