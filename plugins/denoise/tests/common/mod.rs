//! Rendered frames of the room of the renderer's bench, with everything that denoisers read.

#![allow(dead_code)]

use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    DENOISE_ALBEDO, DENOISE_NORMAL, DEPTH, INSTANCE, RADIANCE, RADIANCE_DEMODULATED, RADIANCE_DEMODULATED_VARIANCE,
    RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE,
};
use syntable_render_cpu::{CpuPath, CpuPathRenderer};
use syntable_testing::room;
use syntable_testing::workers::Threads;

/// Relative luminance of linear Rec. 709.
pub fn luminance(c: [f32; 3]) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// The room, seen by a camera whose focal length is 600 px.
pub struct Room {
    scene: Arc<Scene>,
    view: View,
}

impl Room {
    /// An image of `width × height`, the center of that of 640 × 480.
    pub fn new(width: u32, height: u32) -> Self {
        Self { scene: room::scene(), view: room::view(width, height) }
    }

    /// A rendered frame with all guides.
    pub fn frame(&self, samples_per_pixel: u32, seed: u64) -> Frame {
        let wants: [KeyId; 9] = [
            RADIANCE.id(),
            DENOISE_ALBEDO.id(),
            DENOISE_NORMAL.id(),
            DEPTH.id(),
            INSTANCE.id(),
            RADIANCE_SPECULAR.id(),
            RADIANCE_SPECULAR_VARIANCE.id(),
            RADIANCE_DEMODULATED.id(),
            RADIANCE_DEMODULATED_VARIANCE.id(),
        ];
        // As recipes have it: caustics converge too slowly for a reference.
        let options = CpuPath { samples_per_pixel, regularize: 0.3, ..CpuPath::default() };
        let mut session = CpuPathRenderer::new(options).expect("sound options").session();
        session.load(&self.scene, &Threads(2)).expect("loads");
        let stream = Stream::root(seed);
        let request = RenderRequest { view: &self.view, wants: &wants, stream, workers: &Threads(2) };
        let mut frame = Products::new();
        session.render(&request, &mut frame).expect("renders");
        frame
    }
}
