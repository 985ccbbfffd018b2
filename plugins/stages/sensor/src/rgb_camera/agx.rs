//! A tone curve in which bright colors fade to white.
//!
//! The published idea is AgX (T. Sobotka, 2022; Blender's default view since 4.0): encode radiance logarithmically in a
//! gamut that is contracted towards white, apply a sigmoid, and expand again. A saturated light then brightens along a
//! path to white, where a curve per channel would turn it into a flat primary. The constants are our own, stated below;
//! no published table is used.

use super::tone::{Curve, GAIN, Tone};
use syntable_model::color::{linear_to_srgb, srgb_to_linear};

/// Contraction of the gamut: weight of a color's luminance in each of its channels.
const INSET: f32 = 0.2;
/// A metered gray, after [`GAIN`].
const GRAY: f64 = 0.18;
/// Range of the logarithm, stops below and above gray.
const STOPS: [f64; 2] = [-10.0, 6.5];
/// Slope of the sigmoid at gray, brightness over encoded light, both in [0, 1]: as steep as the sRGB encoding.
const SLOPE: f64 = 2.4;
/// Exponent of the sigmoid: larger values extend its linear part.
const POWER: f64 = 3.0;

/// The encoded brightness in [0, 1] of a gray of `light`, where [`GRAY`] is middle gray.
///
/// With `e` in [0, 1] the position of `log2(light / GRAY)` in [`STOPS`] and `d` its distance from the position of gray,
/// the curve is `SLOPE d / (1 + (SLOPE d / L)^p)^(1/p)` above or below the brightness of gray. `L` makes it reach exactly
/// 1 at the upper end and 0 at the lower: with `A = SLOPE · (distance to the end)` and `B` the remaining brightness,
/// `L = A / ((A / B)^p − 1)^(1/p)`.
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

/// Entries of the table per doubling, as bits of the mantissa.
const BITS: u32 = 9;
/// Remaining bits of the mantissa.
const BELOW: u32 = 23 - BITS;

/// The curve for a given white, as a lookup table.
pub struct Agx {
    /// From nits to a scale on which a metered gray is [`GRAY`].
    scale: f32,
    /// Leading bits of the smallest light in the table.
    first: u32,
    /// Linear brightness at every entry.
    table: Vec<f32>,
    codes: Curve,
}

impl Agx {
    /// The curve whose middle gray is the metered gray of this white.
    pub fn new(white: f64) -> Self {
        let first = ((GRAY * libm::exp2(STOPS[0])) as f32).to_bits() >> BELOW;
        let last = ((GRAY * libm::exp2(STOPS[1])) as f32).to_bits() >> BELOW;
        let table = (first..=last + 1)
            .map(|step| srgb_to_linear(sigmoid(f32::from_bits(step << BELOW).into())) as f32)
            .collect();
        Self { scale: (GAIN / white) as f32, first, table, codes: Curve::new(Tone::Srgb, 1.0) }
    }

    /// Linear brightness of a channel.
    fn shown(&self, light: f32) -> f32 {
        // `max` turns NaN into the smallest light.
        let bits = light.max(f32::from_bits(self.first << BELOW)).to_bits();
        let step = ((bits >> BELOW) - self.first) as usize;
        match (self.table.get(step), self.table.get(step + 1)) {
            (Some(low), Some(high)) => {
                let part = (bits & ((1 << BELOW) - 1)) as f32 / (1 << BELOW) as f32;
                low + (high - low) * part
            }
            _ => 1.0,
        }
    }

    /// The codes of a color in nits.
    pub fn code(&self, nits: [f32; 3]) -> [u8; 3] {
        let light = nits.map(|nits| (nits.max(0.0) * self.scale).min(1e30));
        let gray = INSET * luminance(light);
        let shown = light.map(|light| self.shown((1.0 - INSET) * light + gray));
        let gray = INSET * luminance(shown);
        shown.map(|shown| self.codes.code((shown - gray) / (1.0 - INSET)))
    }
}

fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
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

    #[test]
    fn the_table_agrees_with_the_curve_and_grays_stay_gray() {
        let agx = Agx::new(2.0);
        for i in 0..4000 {
            let nits = (-16.0 + f64::from(i) * 0.006).exp2() as f32;
            let [r, g, b] = agx.code([nits; 3]);
            let want = 255.0 * sigmoid(f64::from(nits) / 2.0 * GAIN);
            assert!(r == g && g == b && (f64::from(r) - want).abs() < 0.51, "{nits}: {r} {g} {b}, not {want}");
        }
        assert_eq!([f32::NAN, -1.0, f32::INFINITY].map(|nits| agx.code([nits; 3])[1]), [0, 0, 255]);
        // The metered gray, 12.5 / 120 of white, is 18 %.
        assert_eq!(agx.code([2.0 * 12.5 / 120.0; 3]), [118; 3]);
    }

    #[test]
    fn bright_colors_fade_to_white() {
        let agx = Agx::new(1.0);
        let mut last = -1.0;
        for stops in [-3, -1, 1, 3, 5, 7] {
            let [r, g, b] = agx.code([1.0, 0.05, 0.02].map(|x: f32| x * (stops as f32).exp2())).map(f64::from);
            let paleness = g.min(b) / r;
            assert!(paleness > last, "{stops}: {r} {g} {b}");
            last = paleness;
        }
        assert_eq!(agx.code([1e6, 1e6, 0.0])[0], 255);
    }
}
