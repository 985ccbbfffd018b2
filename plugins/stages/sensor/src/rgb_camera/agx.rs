//! A tone curve in which bright colors fade to white.
//!
//! The published idea is AgX (T. Sobotka, 2022; Blender's default view since 4.0): encode radiance logarithmically in a
//! gamut that is contracted towards white, apply a sigmoid, and expand again. A saturated light then brightens along a
//! path to white, where a curve per channel would turn it into a flat primary. The constants are our own, stated below;
//! no published table is used.

use super::curve::Curve;
use super::sigmoid::{GRAY, STOPS, sigmoid};
use super::tone::{GAIN, Tone};
use syntable_model::color::srgb_to_linear;

/// Contraction of the gamut: weight of a color's luminance in each of its channels.
const INSET: f32 = 0.2;
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

    /// The light whose linear brightness is this: the inverse of [`shown`](Self::shown).
    fn light(&self, shown: f32) -> f32 {
        let after = self.table.partition_point(|&entry| entry < shown).clamp(1, self.table.len() - 1);
        let [low, high] = [self.table[after - 1], self.table[after]];
        let part = if high > low { ((shown - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
        let [from, to] = [after - 1, after].map(|step| f32::from_bits((self.first + step as u32) << BELOW));
        from + (to - from) * part
    }

    /// Nits that develop into these codes, or into the nearest codes that a light can have.
    pub fn nits(&self, code: [u8; 3]) -> [f32; 3] {
        let shown = code.map(|code| srgb_to_linear(f64::from(code) / 255.0) as f32);
        let gray = INSET * luminance(shown);
        let light = shown.map(|shown| self.light((1.0 - INSET) * shown + gray));
        // Contraction keeps the luminance.
        let gray = INSET * luminance(light);
        light.map(|light| ((light - gray) / (1.0 - INSET)).max(0.0) / self.scale)
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
