//! What a sensor costs at 640 × 480.

use divan::{Bencher, black_box};
use syntable_model::prelude::*;
use syntable_sensor::rgb::{Developer, Tone, ev100_of, white_nits};

const SIZE: [u32; 2] = [640, 480];

fn main() {
    divan::main();
}

/// Metering and developing a noisy picture.
#[divan::bench(args = [Tone::Filmic, Tone::Agx])]
fn develop(bencher: Bencher, tone: Tone) {
    let mut stream = Stream::root(1);
    let radiance = Plane::from_fn(SIZE[0], SIZE[1], |_, _| [0.0; 3].map(|_: f64| stream.unit() as f32 * 100.0));
    bencher.bench(|| {
        let developer = Developer::new(tone, white_nits(ev100_of(radiance.data())));
        black_box(&radiance).map(|pixel| developer.code(*pixel))
    });
}
