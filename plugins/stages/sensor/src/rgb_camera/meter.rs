//! The exposure meter.

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
    let lit: Vec<f32> = radiance
        .iter()
        .map(|pixel| luminance(pixel.map(f64::from)) as f32)
        .filter(|y| y.is_finite() && *y > 0.0)
        .collect();
    if lit.is_empty() {
        return DARK_EV100;
    }
    let mut sorted = lit.clone();
    let rank = |fraction: f64| ((lit.len() - 1) as f64 * fraction).round() as usize;
    let (low, high) = (rank(TAIL), rank(1.0 - TAIL));
    // A selection leaves the smaller values before the selected one.
    let high_nits = *sorted.select_nth_unstable_by(high, f32::total_cmp).1;
    let low_nits = *sorted[..=high].select_nth_unstable_by(low, f32::total_cmp).1;
    // In image order, so that the sum is reproducible.
    let (mut sum_ln, mut count) = (0.0, 0);
    for y in lit.iter().copied().filter(|y| (low_nits..=high_nits).contains(y)) {
        sum_ln += libm::log(f64::from(y));
        count += 1;
    }
    let mean_ln = sum_ln / f64::from(count);
    let metered = libm::log2(libm::exp(mean_ln) * 100.0 / METER_K);
    let recoverable_nits = white_nits(metered + GUARD_EV) as f32;
    let mut recoverable: Vec<f32> = lit.into_iter().filter(|y| *y <= recoverable_nits).collect();
    // The metered pixels are far below that limit, so the list is not empty.
    let bright = ((recoverable.len() - 1) as f64 * (1.0 - CLIPPED)).round() as usize;
    let bright_nits = *recoverable.select_nth_unstable_by(bright, f32::total_cmp).1;
    libm::log2(f64::from(bright_nits) / white_nits(0.0)).clamp(metered, metered + GUARD_EV)
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
