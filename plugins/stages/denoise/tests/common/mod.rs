//! The room of the renderer's bench, rendered with all inputs of denoisers.

#![allow(dead_code)]

use std::sync::Arc;
use syntable_guided::Guided;
use syntable_model::context::{Collected, DatasetContext, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{RADIANCE, RADIANCE_NOISY};
use syntable_render_cpu::CpuPathRenderer;
use syntable_testing::workers::Threads;
use syntable_testing::{room, scenes};
use syntable_transport::PathTracing;

/// Relative luminance of linear Rec. 709.
pub fn luminance(c: [f32; 3]) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// Runs a denoiser with the products that it declares to read. Returns its products, and checks that they are the
/// declared ones.
pub fn denoise(denoiser: &dyn Denoiser, products: &Products, workers: &dyn Workers) -> Result<Products> {
    let (dataset, scene) = (scenes::dataset(), scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]));
    let (view, log) = (scenes::view([0.0, -1.0, 1.0], [0.0; 3], [8, 8], 60.0), Collected::default());
    let cx = DatasetContext::new(&dataset, workers, &log).scene(&scene).view(&view);
    let names: Vec<_> = denoiser.reads().iter().map(|key| key.product_id()).collect();
    let lent = products.only(&names);
    let mut filled = lent.clone();
    denoiser.denoise(&cx, &mut filled)?;
    let made = filled.without(&lent);
    let mut provided = denoiser.provides();
    provided.sort_by_key(|key| key.product_id());
    assert_eq!(made.keys(), provided, "it makes other products than it declares");
    Ok(made)
}

/// The room, seen by a camera whose focal length is 600 px.
pub struct Room {
    scene: Arc<Scene>,
    view: View,
}

impl Room {
    /// An image of `width × height`, the center of the image of 640 × 480.
    pub fn new(width: u32, height: u32) -> Self {
        Self { scene: room::scene(), view: room::view(width, height) }
    }

    /// The noisy image with all guides.
    pub fn render(&self, samples_per_pixel: u32, seed: u64) -> Products {
        // Inputs of the filter, under the renderer's names.
        let of_renderer = |key: KeyId| if key == RADIANCE_NOISY.id() { RADIANCE.id() } else { key };
        let wants: Vec<KeyId> = Guided::default().reads().into_iter().map(of_renderer).collect();
        // As in recipes: caustics converge too slowly for a reference.
        let options = PathTracing { samples_per_pixel, regularize: 0.3, ..PathTracing::default() };
        let mut session = CpuPathRenderer::new(options).session();
        session.load(&self.scene, &Threads(2)).expect("loads");
        let stream = Stream::root(seed);
        let request = RenderRequest::new(&self.view, &wants, stream, &Threads(2));
        let mut products = Products::new();
        session.render(&request, &mut products).expect("renders");
        products.rename(RADIANCE.id(), RADIANCE_NOISY.id()).expect("not there yet");
        products
    }
}
