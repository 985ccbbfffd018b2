//! Renders images and per-pixel labels.

use crate::context::{Cache, NoCache, Workers};
use crate::error::{Error, Result};
use crate::product::{KeyId, Lighting, Products};
use crate::random::Stream;
use crate::scene::{InstanceId, Scene, View};
use crate::stage::Window;
use crate::stage::{Atlas, AtlasTile, Denoiser};
use std::sync::Arc;

/// A way of rendering. It offers products, and the plan requests the products that a stage reads.
pub trait Renderer: Send + Sync {
    /// The products that it can make.
    fn offers(&self) -> Vec<KeyId>;
    /// Maximum number of open sessions: the number of devices. `None` if it is not limited.
    fn max_sessions(&self) -> Option<usize> {
        None
    }
    /// The devices that it renders on.
    ///
    /// # Errors
    /// If it cannot render on this machine.
    fn devices(&self) -> Result<Vec<RenderDevice>> {
        Ok(vec![RenderDevice::new("the processor", DeviceClass::Processor)])
    }
    /// Devices of this machine that it does not use, each with the reason, for users.
    fn unused_devices(&self) -> Vec<String> {
        Vec::new()
    }
    /// Whether its sessions run this denoiser themselves, on the device that has the image. Requests then name the denoiser, and
    /// may want its outputs and inputs.
    fn denoises(&self, denoiser: &dyn Denoiser) -> bool {
        let _ = denoiser;
        false
    }
    /// Opens a session. `index` counts from 0 and chooses the device.
    fn open(&self, index: usize) -> Result<Box<dyn RenderSession>>;
    /// Which surface on a ray its labels describe, if some surfaces are transparent.
    fn label_surface(&self) -> LabelSurface {
        LabelSurface::First
    }
    /// Number of random paths per pixel, at most; `None` if its images have no noise.
    fn samples_per_pixel(&self) -> Option<u32> {
        None
    }
    /// One line about the cost of a view, for `syntable plan`.
    fn cost(&self) -> String;
}

/// Which surface on a ray depth, ids, masks and other labels describe, if some surfaces are transparent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LabelSurface {
    /// The first surface, glass included. The alpha of a texture decides where the surface is; the transparency of the whole
    /// material does not matter.
    #[default]
    First,
    /// The first surface whose alpha covers at least half of the background. Glass does.
    AlphaThreshold,
    /// The first opaque surface: its alpha covers at least half of the background, and it transmits less than half of the
    /// light.
    FirstOpaque,
}

impl LabelSurface {
    /// Its name in the policy of labels.
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::AlphaThreshold => "alpha_threshold",
            Self::FirstOpaque => "first_opaque",
        }
    }

    /// The same in words.
    pub fn statement(self) -> &'static str {
        match self {
            Self::First => "of surfaces that can be seen through the first one counts",
            Self::AlphaThreshold => "surfaces whose alpha is below one half are not there, glass is",
            Self::FirstOpaque => {
                "surfaces whose alpha is below one half, or that transmit one half or more, are not there"
            }
        }
    }
}

/// A device that renders.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RenderDevice {
    /// One line for users and for the dataset: the device, its driver with the version, and the interface.
    pub name: String,
    /// Its class.
    pub class: DeviceClass,
    /// Its limits, for users. Empty if it has none.
    pub limits: String,
}

impl RenderDevice {
    /// A device that renders, without limits.
    pub fn new(name: impl Into<String>, class: DeviceClass) -> Self {
        Self { name: name.into(), class, limits: String::new() }
    }
}

/// A class of devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceClass {
    /// The processor. Images have the same bytes on every machine.
    Processor,
    /// A graphics card. Images of different cards or drivers may differ by rounding.
    Card,
    /// A program that emulates a graphics card, for tests.
    Emulated,
}

impl DeviceClass {
    /// Whether images of different devices of the class may differ by rounding.
    pub fn rounds(self) -> bool {
        self != Self::Processor
    }
}

/// A renderer at work. One thread at a time uses it, for one scene after another.
pub trait RenderSession: Send {
    /// Prepares a scene.
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()>;
    /// Prepares the loaded scene at another [moment](Scene::at). Only poses of bodies differ. By default, this loads the scene
    /// again, which is enough for a session that caches the data of objects.
    fn pose(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        self.load(scene, workers)
    }
    /// Renders a view of the loaded scene, and puts exactly the wanted products into `products`.
    fn render(&mut self, request: &RenderRequest, products: &mut Products) -> Result<()>;
}

/// One view to render: the whole image of the whole scene ([`RenderRequest::new`]), a window of it or some bodies
/// ([`of`](RenderRequest::of)), or many windows with bodies of their own ([`of_objects`](RenderRequest::of_objects)).
#[derive(Clone)]
pub struct RenderRequest<'a> {
    /// Camera and lights.
    pub view: &'a View,
    /// The products to make, all offered by the renderer. Their framing is [`Framing::IMAGE`](crate::product::Framing::IMAGE),
    /// because the tiles state what to render.
    pub wants: &'a [KeyId],
    /// Width and height of the products, px.
    pub size: [u32; 2],
    /// The parts of the products. Tiles do not overlap. Pixels outside of all tiles are 0, and their depth is infinite. Requests
    /// with several tiles want only products with one value per pixel.
    pub tiles: Vec<Tile<'a>>,
    /// Whether camera rays hit lights and sky. If not, the radiance comes from bodies only, premultiplied by
    /// [`OPACITY`](crate::product::standard::OPACITY). Mirrors and glass still show lights.
    pub background: bool,
    /// Seed of the sampling.
    pub stream: Stream,
    /// Threads to spread the pixels over.
    pub workers: &'a dyn Workers,
    /// Compiled kernels, kept between runs. They do not change an image.
    pub cache: &'a dyn Cache,
    /// The denoiser, if the renderer runs it itself; see [`Renderer::denoises`].
    pub denoiser: Option<&'a dyn Denoiser>,
}

impl<'a> RenderRequest<'a> {
    /// The image of the whole scene.
    pub fn new(view: &'a View, wants: &'a [KeyId], stream: Stream, workers: &'a dyn Workers) -> Self {
        let image = Window::of(&view.camera.intrinsics);
        let (size, tiles) =
            ([image.width, image.height], vec![Tile { window: image, at: [0, 0], bodies: Bodies::All }]);
        Self { view, wants, size, tiles, background: true, stream, workers, cache: &NoCache, denoiser: None }
    }

    /// Replaces the image by a window and the bodies in it.
    pub fn of(self, window: Window, bodies: Bodies<'a>) -> Self {
        Self { size: [window.width, window.height], tiles: vec![Tile { window, at: [0, 0], bodies }], ..self }
    }

    /// Replaces the image by windows around the objects of an atlas. Each shows its object only, without background.
    pub fn of_objects(self, atlas: &'a Atlas, lighting: Lighting) -> Self {
        let tile = |tile: &'a AtlasTile| {
            let body = std::slice::from_ref(&tile.id);
            let bodies = match lighting {
                Lighting::Alone => Bodies::Only(body),
                Lighting::InScene => Bodies::Seen(body),
            };
            Tile { window: tile.window, at: tile.at, bodies }
        };
        Self { size: atlas.size, tiles: atlas.tiles.iter().map(tile).collect(), background: false, ..self }
    }

    /// The only tile, if it fills the products.
    pub fn only_tile(&self) -> Option<&Tile<'a>> {
        match &self.tiles[..] {
            [tile] if [tile.window.width, tile.window.height] == self.size => Some(tile),
            _ => None,
        }
    }

    /// Number of pixels of all tiles.
    pub fn pixels(&self) -> u64 {
        self.tiles.iter().map(|tile| tile.window.pixels()).sum()
    }
}

/// A part of a request: a window, and the bodies to render in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tile<'a> {
    /// Pixels to render.
    pub window: Window,
    /// Column and row of its first pixel in the products.
    pub at: [u32; 2],
    /// Bodies to render.
    pub bodies: Bodies<'a>,
}

impl Bodies<'_> {
    /// For each body of a scene with `count` bodies, whether it is one of these.
    ///
    /// # Errors
    /// If the scene has no body with one of the ids.
    pub fn chosen(&self, count: usize) -> Result<Vec<bool>> {
        let (Self::Only(ids) | Self::Seen(ids)) = *self else { return Ok(vec![true; count]) };
        let mut chosen = vec![false; count];
        for id in ids {
            let body = usize::from(id.0).checked_sub(1).and_then(|index| chosen.get_mut(index));
            let unknown = || Error::new(format!("unknown body {} to render", id.0));
            *body.ok_or_else(unknown)? = true;
        }
        Ok(chosen)
    }
}

/// Bodies to render.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bodies<'a> {
    /// The whole scene.
    All,
    /// Only these bodies, as if the scene had no others: the appearance of an object alone, under the lights of the
    /// view.
    Only(&'a [InstanceId]),
    /// Camera rays hit only these bodies. The others still cast shadows and reflect light, and mirrors show them: the appearance of
    /// an object in its place, without the bodies in front of it.
    Seen(&'a [InstanceId]),
    /// The whole scene, but camera rays end without light at bodies that are not in the [foreground](Scene::foreground): the
    /// appearance of objects and distractors where nothing hides them.
    Foreground,
}
