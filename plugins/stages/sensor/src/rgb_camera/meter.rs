//! The exposure meter.

use super::ranks::Ranks;
use syntable_model::photometry::luminance;

/// Luminance that saturates the image at an exposure value for ISO 100, nits: `78 / (100 · 0.65) · 2^EV100`, from
/// the saturation-based speed of ISO 12232 and a lens that passes 65 % (Lagarde and de Rousiers, SIGGRAPH 2014).
pub fn white_nits(ev100: f64) -> f64 {
    1.2 * libm::exp2(ev100)
}

/// Calibration constant of reflected-light meters, ISO 2720: `2^EV100 = L · 100 / K`.
const METER_K: f64 = 12.5;
/// Fraction of the darkest and of the brightest pixels that the average leaves out.
const TAIL: f64 = 0.1;
/// Fraction of pixels that may clip before the meter lowers the exposure.
const CLIPPED: f64 = 0.01;
/// Maximum reduction of the exposure, stops. Brighter pixels are lights, which no exposure recovers.
const GUARD_EV: f64 = 2.0;
/// Exposure value of an image without light.
const DARK_EV100: f64 = 0.0;

/// The exposure value for ISO 100 that an automatic camera chooses for an image in nits.
///
/// The meter equation is applied to the log-average luminance of the pixels between the 10th and the 90th percentile.
/// Then white is raised by up to two stops until 99 % of the pixels are below it; pixels that two stops would not
/// recover, such as a light in the image, do not count here. Pixels that are zero or not finite never count; an image
/// without light has EV 0.
pub fn ev100_of(radiance: &[[f32; 3]]) -> f64 {
    let (lit, count) = lit(radiance.iter().copied());
    let Some(last) = count.checked_sub(1) else { return DARK_EV100 };
    let ranks = Ranks::new(&lit);
    let at = |count: usize, fraction: f64| ranks.at((count as f64 * fraction).round() as usize);
    let (low, high) = (at(last, TAIL), at(last, 1.0 - TAIL));
    let metered = libm::log2(libm::exp(mean_ln(&lit, low, high)) * 100.0 / METER_K);
    let recoverable_nits = white_nits(metered + GUARD_EV) as f32;
    // The metered pixels are far below that limit, so some are recoverable. They are the first in the order.
    let recoverable = lit.iter().filter(|y| **y <= recoverable_nits).count();
    let bright_nits = at(recoverable - 1, 1.0 - CLIPPED);
    libm::log2(f64::from(bright_nits) / white_nits(0.0)).clamp(metered, metered + GUARD_EV)
}

/// Luminance of each pixel, and the number of lit pixels. Pixels that are zero or not finite have
/// NaN, the last in the order of [`Ranks`].
pub(super) fn lit(radiance: impl Iterator<Item = [f32; 3]>) -> (Vec<f32>, usize) {
    let luminance = |pixel: [f32; 3]| luminance(pixel.map(f64::from)) as f32;
    let lit = |y: f32| if y > 0.0 && y < f32::INFINITY { y } else { f32::NAN };
    let lit: Vec<f32> = radiance.map(|pixel| lit(luminance(pixel))).collect();
    let count = lit.iter().filter(|y| !y.is_nan()).count();
    (lit, count)
}

/// Mean of the natural logarithms of the numbers from `low` to `high`, both positive. One of them is in the list.
fn mean_ln(values: &[f32], low: f32, high: f32) -> f64 {
    /// Numbers that are multiplied before a logarithm. The product of so many of the smallest or largest numbers is a normal one.
    const TOGETHER: usize = 6;
    let (mut sum, mut count) = (0.0, 0);
    // In image order, so that the sum is reproducible.
    for values in values.chunks(TOGETHER) {
        let mut product = 1.0;
        for y in values {
            let is_in = (low..=high).contains(y);
            product *= if is_in { f64::from(*y) } else { 1.0 };
            count += u32::from(is_in);
        }
        sum += libm::log(product);
    }
    sum / f64::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: f64, want: f64) {
        assert!((got - want).abs() < 1e-6, "{got} instead of {want}");
    }

    #[test]
    fn an_even_wall_is_metered_by_the_equation() {
        // 12.5 / 100 · 2^EV nits.
        close(ev100_of(&[[0.125; 3]; 50]), 0.0);
        close(ev100_of(&[[128.0; 3]; 50]), 10.0);
        // Luminance, not the mean of the channels.
        close(ev100_of(&[[0.0, 0.125 / 0.7152, 0.0]; 50]), 0.0);
        close(white_nits(3.0), 9.6);
    }

    #[test]
    fn the_mean_is_of_the_logarithms() {
        for values in [[f32::MAX; 20], [1e-45; 20], std::array::from_fn(|i| 0.3 * 1.7_f32.powi(i as i32 - 10))] {
            let want = values.iter().map(|y| f64::from(*y).ln()).sum::<f64>() / 20.0;
            close(mean_ln(&values, 0.0, f32::MAX), want);
        }
        close(mean_ln(&[0.1, 2.0, 8.0, 100.0], 1.0, 10.0), 4.0_f64.ln());
    }

    #[test]
    fn tails_and_dead_pixels_do_not_count() {
        let mut wall = vec![[0.125; 3]; 1000];
        for i in 0..90 {
            wall[i] = [1e-6; 3];
            wall[999 - i] = [0.9; 3];
        }
        wall[500] = [f32::NAN; 3];
        wall[501] = [f32::INFINITY; 3];
        wall[502] = [0.0; 3];
        close(ev100_of(&wall), 0.0);
        close(ev100_of(&[[0.0; 3]; 4]), DARK_EV100);
        close(ev100_of(&[]), DARK_EV100);
        close(ev100_of(&[[0.125; 3]]), 0.0);
    }

    #[test]
    fn highlights_lower_the_exposure_by_two_stops_at_most() {
        // White of the metered exposure is 1.2 nits; 5 % of the pixels at twice this luminance cost one stop.
        let with = |count: usize, nits: f32| -> Vec<[f32; 3]> {
            (0..1000).map(|i| if i < count { [nits; 3] } else { [0.125; 3] }).collect()
        };
        close(ev100_of(&with(50, 2.4)), 1.0);
        close(ev100_of(&with(50, 1.0)), 0.0);
        close(ev100_of(&with(50, 4.8)), 2.0);
        // A light cannot be recovered, and does not darken the rest.
        close(ev100_of(&with(50, 5.0)), 0.0);
        close(ev100_of(&with(50, 1e6)), 0.0);
        close(ev100_of(&with(5, 1e6)), 0.0);
    }
}
