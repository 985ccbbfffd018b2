//! Time of the guided filter on an image of 640 × 480 with one and with four samples per pixel, on one and two threads:
//! `cargo bench -p syntable-denoise --bench time`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Room, denoise};
use syntable_guided::Guided;
use syntable_model::prelude::*;
use syntable_testing::figures::Figures;
use syntable_testing::workers::Threads;

fn main() {
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for (samples, threads) in [(1, 1), (1, 2), (4, 2)] {
        let products = Room::new(640, 480).render(samples, 1);
        let denoiser = Guided::default().build().expect("sound defaults");
        let name = format!("guided, samples {samples}, threads {threads}");
        figures.time(&name, || denoise(&*denoiser, &products, &Threads(threads)).expect("denoises"));
    }
}
