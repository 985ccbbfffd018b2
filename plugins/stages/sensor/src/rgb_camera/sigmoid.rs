//! The sigmoid of the tone curve in which bright colors fade to white.

use syntable_model::color::linear_to_srgb;

/// A metered gray, after [`GAIN`](super::tone::GAIN).
pub(super) const GRAY: f64 = 0.18;
/// Range of the logarithm, stops below and above gray.
pub(super) const STOPS: [f64; 2] = [-10.0, 6.5];
/// Slope of the sigmoid at gray, brightness over encoded light, both in [0, 1]: as steep as the sRGB encoding.
const SLOPE: f64 = 2.4;
/// Exponent of the sigmoid: larger values extend its linear part.
const POWER: f64 = 3.0;

/// The encoded brightness in [0, 1] of a gray of `light`, where [`GRAY`] is middle gray.
///
/// With `e` in [0, 1] the position of `log2(light / GRAY)` in [`STOPS`] and `d` its distance from the position of gray,
/// the curve is `SLOPE d / (1 + (SLOPE d / L)^p)^(1/p)` above or below the brightness of gray. `L` makes it reach
/// exactly 1 at the upper end and 0 at the lower: with `A = SLOPE · (distance to the end)` and `B` the remaining
/// brightness, `L = A / ((A / B)^p − 1)^(1/p)`.
pub fn sigmoid(light: f64) -> f64 {
    let range = STOPS[1] - STOPS[0];
    let gray = -STOPS[0] / range;
    let encoded = (libm::log2(light / GRAY).clamp(STOPS[0], STOPS[1]) - STOPS[0]) / range;
    let middle = linear_to_srgb(GRAY);
    let branch = |distance: f64, end: f64, left: f64| {
        let (at, all) = (SLOPE * distance, SLOPE * end);
        let limit = all / libm::pow(libm::pow(all / left, POWER) - 1.0, 1.0 / POWER);
        at / libm::pow(1.0 + libm::pow(at / limit, POWER), 1.0 / POWER)
    };
    let brightness = if encoded >= gray {
        middle + branch(encoded - gray, 1.0 - gray, 1.0 - middle)
    } else {
        middle - branch(gray - encoded, gray, middle)
    };
    brightness.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_the_stated_ends_gray_and_slope() {
        assert!((sigmoid(GRAY) - linear_to_srgb(0.18)).abs() < 1e-12);
        assert!((sigmoid(GRAY * 6.5_f64.exp2()) - 1.0).abs() < 1e-12 && sigmoid(1e9) <= 1.0);
        assert!(sigmoid(GRAY * (-10.0_f64).exp2()).abs() < 1e-12 && sigmoid(0.0) == 0.0);
        // One stop is 1 / 16.5 of the range.
        let stop = |by: f64| sigmoid(GRAY * by.exp2());
        assert!(((stop(0.01) - stop(-0.01)) / 0.02 - SLOPE / 16.5).abs() < 1e-4);
        let mut last = -1.0;
        for i in 0..=1650 {
            let y = stop(-10.0 + f64::from(i) * 0.01);
            assert!(y > last, "it falls at {i}");
            last = y;
        }
    }
}
