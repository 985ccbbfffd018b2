//! Colors of furnishings: quieter than the colors of goods.

use crate::material::{SrgbColor, hsv};
use syntable_model::random::Stream;

/// Hue, saturation and value of a cloth or paint.
const QUIET: [[f64; 3]; 16] = [
    [0.10, 0.08, 0.85],
    [0.09, 0.18, 0.72],
    [0.08, 0.28, 0.55],
    [0.00, 0.00, 0.62],
    [0.60, 0.10, 0.40],
    [0.62, 0.12, 0.22],
    [0.61, 0.55, 0.32],
    [0.55, 0.35, 0.52],
    [0.47, 0.55, 0.38],
    [0.30, 0.30, 0.42],
    [0.22, 0.28, 0.60],
    [0.13, 0.70, 0.75],
    [0.05, 0.65, 0.62],
    [0.99, 0.55, 0.42],
    [0.96, 0.25, 0.70],
    [0.76, 0.25, 0.45],
];

fn near(stream: &mut Stream, [hue, saturation, value]: [f64; 3]) -> SrgbColor {
    let (dh, ds, dv) = (stream.uniform(-0.02, 0.02), stream.uniform(0.75, 1.2), stream.uniform(0.85, 1.12));
    hsv(hue + dh, (saturation * ds).min(0.9), (value * dv).min(0.92))
}

/// The color of a cloth.
pub fn cloth(stream: &mut Stream) -> SrgbColor {
    let tone = stream.pick(&QUIET).copied().unwrap_or(QUIET[0]);
    near(stream, tone)
}

/// The color of paint on furniture: white in half of all cases.
pub fn paint(stream: &mut Stream) -> SrgbColor {
    match stream.below(8) {
        0..=3 => hsv(stream.uniform(0.08, 0.16), stream.uniform(0.0, 0.06), stream.uniform(0.8, 0.92)),
        4 => hsv(0.6, stream.uniform(0.0, 0.1), stream.uniform(0.06, 0.25)),
        5 => hsv(0.1, stream.uniform(0.02, 0.15), stream.uniform(0.5, 0.75)),
        _ => cloth(stream),
    }
}

/// The color of a plastic case: dark, white, or gray.
pub fn case(stream: &mut Stream) -> SrgbColor {
    match stream.below(5) {
        0..=2 => hsv(0.6, 0.05, stream.uniform(0.03, 0.12)),
        3 => hsv(0.12, 0.02, stream.uniform(0.8, 0.9)),
        _ => hsv(0.6, 0.03, stream.uniform(0.35, 0.6)),
    }
}

/// Color and metallic part of steel, brass, and painted metal.
pub fn metal(stream: &mut Stream) -> (SrgbColor, f32) {
    match stream.below(8) {
        0..=2 => (hsv(0.6, 0.02, stream.uniform(0.65, 0.88)), 1.0),
        3 => (hsv(0.11, stream.uniform(0.3, 0.5), stream.uniform(0.6, 0.8)), 1.0),
        4 | 5 => (hsv(0.6, 0.05, stream.uniform(0.03, 0.1)), 0.0),
        6 => (hsv(0.1, 0.02, stream.uniform(0.8, 0.92)), 0.0),
        _ => (hsv(0.08, 0.15, stream.uniform(0.2, 0.35)), 1.0),
    }
}

/// The linear color of lamplight, in proportion: warm white.
pub fn lamplight(stream: &mut Stream, nits: f64) -> [f32; 3] {
    let warm = stream.uniform(0.0, 1.0) as f32;
    let nits = nits as f32;
    [nits, nits * (0.82 - 0.22 * warm), nits * (0.6 - 0.35 * warm)]
}
