//! Colours of light by their temperature, fast enough for every texel.

use std::sync::LazyLock;
use syntable_model::photometry::{blackbody, luminance};

/// Steps of the table are even in reciprocal temperature, in which colours differ about evenly to the eye (CIE mired).
const STEPS: usize = 128;
const MIRED: [f64; 2] = [33.0, 650.0];

/// Colour of a black body, linear Rec. 709 with luminance one; from 1540 K to 30,000 K, clamped beyond.
pub fn of_kelvin(kelvin: f64) -> [f64; 3] {
    static TABLE: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
        let mired = |i: usize| MIRED[0] + (MIRED[1] - MIRED[0]) * i as f64 / (STEPS - 1) as f64;
        (0..STEPS).map(|i| blackbody(1e6 / mired(i))).collect()
    });
    let at = (1e6 / kelvin - MIRED[0]) / (MIRED[1] - MIRED[0]) * (STEPS - 1) as f64;
    let at = if at > 0.0 { at.min((STEPS - 1) as f64) } else { 0.0 };
    let left = (at as usize).min(STEPS - 2);
    let t = at - left as f64;
    let (a, b) = (TABLE[left], TABLE[left + 1]);
    let color: [f64; 3] = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t);
    let scale = 1.0 / luminance(color);
    color.map(|c| c * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_agrees_with_planck() {
        for kelvin in [1800.0, 2700.0, 4100.0, 6500.0, 12_000.0, 25_000.0] {
            let (got, want) = (of_kelvin(kelvin), blackbody(kelvin));
            for i in 0..3 {
                assert!((got[i] - want[i]).abs() < 2e-3, "{kelvin} K: {got:?} {want:?}");
            }
            assert!((luminance(got) - 1.0).abs() < 1e-12);
        }
        assert_eq!(of_kelvin(1e9), of_kelvin(40_000.0));
    }
}
