//! Time of the guided filter on an image of 640 × 480 with one and with four samples per pixel, on one and two threads.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Room, denoise};
use divan::Bencher;
use syntable_guided::Guided;
use syntable_model::prelude::*;
use syntable_testing::workers::Threads;

fn main() {
    divan::main();
}

#[divan::bench(args = [(1, 1), (1, 2), (4, 2)], sample_count = 10)]
fn guided(bencher: Bencher, (samples, threads): (u32, usize)) {
    let products = Room::new(640, 480).render(samples, 1);
    let denoiser = Guided::default().build().expect("sound defaults");
    bencher.bench(|| denoise(&*denoiser, &products, &Threads(threads)).expect("denoises"));
}
