//! Time of the denoiser `guided` on a graphics card and on the processor, for images of 640 × 480 and 1280 × 960.
//!
//! `cargo bench -p syntable-render-wgpu --bench guided [-- ADAPTER]` prints milliseconds per image, averaged over many
//! images that stay on the card.

#[path = "../tests/common/mod.rs"]
#[allow(dead_code)]
mod common;

use common::{Card, reference, render};
use std::time::Instant;
use syntable_guided::Guided;
use syntable_render_wgpu::Adapters;
use syntable_testing::figures::{Figures, Unit};
use syntable_testing::room;
use syntable_testing::workers::Threads;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let adapter = arguments.first().and_then(|a| a.parse().ok()).unwrap_or(0);
    let found = Adapters::find().used().unwrap_or_default();
    let Some(info) = found.get(adapter) else { return println!("no adapter is called {adapter}") };
    let workers = Threads(std::thread::available_parallelism().map_or(2, usize::from));
    let images = if info.is_hardware() { 100 } else { 2 };
    let mut card = Card::open(adapter);
    println!("{info}, and {} threads", workers.0);
    let options = Guided::default();
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for (width, height) in [(640, 480), (1280, 960)] {
        let products = render(&room::scene(), &room::view(width, height), 2);
        let started = Instant::now();
        reference(&options, &products, &workers);
        let on_processor = started.elapsed().as_secs_f64();

        let image = card.upload(&products);
        let output = card.device.storage("image", 12 * u64::from(width) * u64::from(height)).expect("room");
        let through = card.device.readable("word", 4).expect("room");
        let mut time = |images: u32| {
            let started = Instant::now();
            let mut encoder = card.device.encoder();
            for _ in 0..images {
                let record =
                    card.filter.record(&mut encoder, image.size, &image.input, image.sections, &options, (&output, 0));
                record.expect("records");
            }
            card.device.read(encoder, &through, 1, |_: &[f32]| ()).expect("runs");
            started.elapsed().as_secs_f64()
        };
        let first = time(1);
        let on_card = time(images) / f64::from(images);
        figures.keep(&format!("{width} × {height}, on the card"), on_card, Unit::Seconds);
        figures.keep(&format!("{width} × {height}, on the processor"), on_processor, Unit::Seconds);
        println!(
            "{width} × {height}: {:.2} ms, the first {:.1} ms; on the processor {:.0} ms",
            1e3 * on_card,
            1e3 * first,
            1e3 * on_processor
        );
    }
}
