//! A tone curve that lets bright colours fade to white.
//!
//! The published idea is that of AgX (T. Sobotka, 2022; Blender's standard view since 4.0): encode the light as a
//! logarithm, in a gamut that is drawn in towards white, put an S through it, and go back. A saturated light then
//! brightens along a path to white, where a curve for every channel alone turns it into a flat primary. The constants
//! here are our own choice, stated below; there is no table from elsewhere.

use super::tone::{Curve, GAIN, Tone, srgb_encode};

/// Share of a colour's luminance that is mixed into each of its channels: how far the gamut is drawn in.
const INSET: f32 = 0.2;
/// What a meter calls grey, after [`GAIN`].
const GREY: f64 = 0.18;
/// The range of the logarithm, stops below and above grey.
const STOPS: [f64; 2] = [-10.0, 6.5];
/// Steepness of the S at grey, share of the brightness over share of the range: as steep as the sRGB encoding is.
const SLOPE: f64 = 2.4;
/// How late the S leaves its straight middle.
const POWER: f64 = 3.0;

/// The encoded brightness in [0, 1] of a grey of `light`, where [`GREY`] is middle grey.
///
/// With `e` in [0, 1] the place of `log2(light / GREY)` in [`STOPS`] and `d` its distance from the place of grey, the
/// curve is `SLOPE d / (1 + (SLOPE d / L)^p)^(1/p)` up or down from the brightness of grey. `L` is what makes it reach
/// exactly 1 at the upper end and 0 at the lower: with `A = SLOPE · (distance to the end)` and `B` the brightness left,
/// `L = A / ((A / B)^p − 1)^(1/p)`.
pub fn sigmoid(light: f64) -> f64 {
    let range = STOPS[1] - STOPS[0];
    let grey = -STOPS[0] / range;
    let encoded = ((light / GREY).log2().clamp(STOPS[0], STOPS[1]) - STOPS[0]) / range;
    let middle = srgb_encode(GREY);
    let branch = |distance: f64, end: f64, left: f64| {
        let (at, all) = (SLOPE * distance, SLOPE * end);
        let limit = all / ((all / left).powf(POWER) - 1.0).powf(1.0 / POWER);
        at / (1.0 + (at / limit).powf(POWER)).powf(1.0 / POWER)
    };
    let brightness = if encoded >= grey {
        middle + branch(encoded - grey, 1.0 - grey, 1.0 - middle)
    } else {
        middle - branch(grey - encoded, grey, middle)
    };
    brightness.clamp(0.0, 1.0)
}

/// The linear value of an sRGB code in [0, 1] (IEC 61966-2-1).
fn srgb_decode(code: f64) -> f64 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Steps of the table in every doubling, as bits of the mantissa.
const BITS: u32 = 9;
/// Bits of a single below a step.
const BELOW: u32 = 23 - BITS;

/// The curve for a given white, as a table.
pub struct Agx {
    /// From nits to a scale on which a metered grey is [`GREY`].
    scale: f32,
    /// Bits of the least light of the table.
    first: u32,
    /// Linear brightness at every step.
    table: Vec<f32>,
    codes: Curve,
}

impl Agx {
    /// The curve whose middle grey is the metered grey of this white.
    pub fn new(white: f64) -> Self {
        let first = ((GREY * STOPS[0].exp2()) as f32).to_bits() >> BELOW;
        let last = ((GREY * STOPS[1].exp2()) as f32).to_bits() >> BELOW;
        let table =
            (first..=last + 1).map(|step| srgb_decode(sigmoid(f32::from_bits(step << BELOW).into())) as f32).collect();
        Self { scale: (GAIN / white) as f32, first, table, codes: Curve::new(Tone::Srgb, 1.0) }
    }

    /// Linear brightness of a channel.
    fn shown(&self, light: f32) -> f32 {
        // The larger of both: what is not a number is dark.
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

    /// The codes of a colour in nits.
    pub fn code(&self, nits: [f32; 3]) -> [u8; 3] {
        let light = nits.map(|nits| (nits.max(0.0) * self.scale).min(1e30));
        let grey = INSET * luminance(light);
        let shown = light.map(|light| self.shown((1.0 - INSET) * light + grey));
        let grey = INSET * luminance(shown);
        shown.map(|shown| self.codes.code((shown - grey) / (1.0 - INSET)))
    }
}

fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_its_ends_its_middle_and_its_slope() {
        assert!((sigmoid(GREY) - srgb_encode(0.18)).abs() < 1e-12);
        assert!((sigmoid(GREY * 6.5_f64.exp2()) - 1.0).abs() < 1e-12 && sigmoid(1e9) <= 1.0);
        assert!(sigmoid(GREY * (-10.0_f64).exp2()).abs() < 1e-12 && sigmoid(0.0) == 0.0);
        // One stop is 1 / 16.5 of the range.
        let stop = |by: f64| sigmoid(GREY * by.exp2());
        assert!(((stop(0.01) - stop(-0.01)) / 0.02 - SLOPE / 16.5).abs() < 1e-4);
        let mut last = -1.0;
        for i in 0..=1650 {
            let y = stop(-10.0 + f64::from(i) * 0.01);
            assert!(y > last, "it falls at {i}");
            last = y;
        }
    }

    #[test]
    fn the_table_agrees_with_the_curve_and_greys_stay_grey() {
        let agx = Agx::new(2.0);
        for i in 0..4000 {
            let nits = (-16.0 + f64::from(i) * 0.006).exp2() as f32;
            let [r, g, b] = agx.code([nits; 3]);
            let want = 255.0 * sigmoid(f64::from(nits) / 2.0 * GAIN);
            assert!(r == g && g == b && (f64::from(r) - want).abs() < 0.51, "{nits}: {r} {g} {b}, not {want}");
        }
        assert_eq!([f32::NAN, -1.0, f32::INFINITY].map(|nits| agx.code([nits; 3])[1]), [0, 0, 255]);
        // The metered grey, 12.5 / 120 of white, is 18 %.
        assert_eq!(agx.code([2.0 * 12.5 / 120.0; 3]), [118; 3]);
    }

    #[test]
    fn bright_colours_fade_to_white() {
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
