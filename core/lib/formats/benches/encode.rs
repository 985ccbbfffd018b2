//! Time to encode the files of a 640 × 480 view: `cargo bench -p syntable-formats --bench encode`.

use std::hint::black_box;
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::png::PngImage;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_testing::figures::Figures;

const SIZE: [u32; 2] = [640, 480];

/// A shaded image with noise, as from a path tracer with few samples per pixel.
fn rgb() -> Plane<[u8; 3]> {
    let mut stream = Stream::root(1);
    Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
        let shade = 120.0 + 60.0 * (f64::from(x) / 90.0).sin() * (f64::from(y) / 70.0).cos();
        [1.0, 0.9, 0.8].map(|tint| (shade * tint + 6.0 * stream.normal()).clamp(0.0, 255.0) as u8)
    })
}

fn main() {
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let image = PngImage::rgb(&rgb());
    figures.time("PNG of RGB", || black_box(&image).encode());
    let image = PngImage::gray16(&Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
        (900.0 + 0.7 * f64::from(y) + 40.0 * (f64::from(x) / 50.0).sin().abs()) as u16
    }));
    figures.time("PNG of depth", || black_box(&image).encode());
    let mask = Mask::from_fn(SIZE[0], SIZE[1], |x, y| x.abs_diff(300).pow(2) + y.abs_diff(200).pow(2) < 6400);
    figures.time("PNG of a mask", || PngImage::mask(black_box(&mask), 255).encode());
    let plane = Plane::from_fn(SIZE[0], SIZE[1], |x, y| (x + y) as f32);
    figures.time("NPY of depth", || {
        let value = syntable_model::product::Product::encode(black_box(&plane));
        Array::of(&value).map(|array| array.encode())
    });
}
