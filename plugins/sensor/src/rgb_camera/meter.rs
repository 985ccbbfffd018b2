//! The exposure meter.

use syntable_model::photometry::luminance;

/// Luminance that saturates the picture at an exposure value for ISO 100, nits: `78 / (100 · 0.65) · 2^EV100`, from
/// the saturation-based speed of ISO 12232 and a lens that passes 65 % (Lagarde and de Rousiers, SIGGRAPH 2014).
pub fn white_nits(ev100: f64) -> f64 {
    1.2 * ev100.exp2()
}

/// Calibration constant of reflected-light meters, ISO 2720: `2^EV100 = L · 100 / K`.
const METER_K: f64 = 12.5;
/// The share of darkest and of brightest pixels that the average leaves out.
const TAIL: f64 = 0.1;
/// The share of pixels that may burn out before the meter stops down.
const BURNT: f64 = 0.01;
/// How far it stops down at most. What is brighter still is a lamp, which no exposure would save.
const GUARD_EV: f64 = 2.0;
/// The exposure of a picture without light.
const DARK_EV100: f64 = 0.0;

/// The exposure value for ISO 100 that an automatic camera chooses for a picture in nits.
///
/// The log-average luminance of the pixels between the 10th and the 90th percentile goes through the meter's equation.
/// Then white is raised so that 99 % of the pixels are not above it, by two stops at most; pixels that two stops would
/// not save, such as a lamp in the picture, do not count in this. Pixels without light, or that are not finite, never
/// count; a picture without light has EV 0.
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
    let rank = |share: f64| ((lit.len() - 1) as f64 * share).round() as usize;
    let (low, high) = (rank(TAIL), rank(1.0 - TAIL));
    // A selection leaves the smaller values in front of the selected one.
    let high_nits = *sorted.select_nth_unstable_by(high, f32::total_cmp).1;
    let low_nits = *sorted[..=high].select_nth_unstable_by(low, f32::total_cmp).1;
    // Summed in image order: the same on every machine.
    let (mut sum_ln, mut count) = (0.0, 0);
    for y in lit.iter().copied().filter(|y| (low_nits..=high_nits).contains(y)) {
        sum_ln += f64::from(y).ln();
        count += 1;
    }
    let mean_ln = sum_ln / f64::from(count);
    let metered = (mean_ln.exp() * 100.0 / METER_K).log2();
    let saved_nits = white_nits(metered + GUARD_EV) as f32;
    let mut saved: Vec<f32> = lit.into_iter().filter(|y| *y <= saved_nits).collect();
    // The middle pixels are far below what is saved, so that there is at least one.
    let bright = ((saved.len() - 1) as f64 * (1.0 - BURNT)).round() as usize;
    let bright_nits = *saved.select_nth_unstable_by(bright, f32::total_cmp).1;
    (f64::from(bright_nits) / white_nits(0.0)).log2().clamp(metered, metered + GUARD_EV)
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
    fn highlights_stop_the_exposure_down_but_not_for_ever() {
        // White of the metered exposure is 1.2 nits; 5 % of the pixels at twice that cost one stop.
        let with = |share: usize, nits: f32| -> Vec<[f32; 3]> {
            (0..1000).map(|i| if i < share { [nits; 3] } else { [0.125; 3] }).collect()
        };
        close(ev100_of(&with(50, 2.4)), 1.0);
        close(ev100_of(&with(50, 1.0)), 0.0);
        close(ev100_of(&with(50, 4.8)), 2.0);
        // A lamp cannot be saved, and does not make the rest dark.
        close(ev100_of(&with(50, 5.0)), 0.0);
        close(ev100_of(&with(50, 1e6)), 0.0);
        close(ev100_of(&with(5, 1e6)), 0.0);
    }
}
