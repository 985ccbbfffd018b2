//! Tone curves of one channel, as tables of decision levels.

use super::tone::Tone;
use std::sync::OnceLock;

/// Number of equal bins of [0, white] in the lookup table. No two decision levels are nearer than two bins.
const BINS: usize = 1 << 14;

/// A curve for one channel and a given white, as a lookup table that is exact to the rounding of `255 · brightness`.
pub struct Curve {
    /// Smallest luminance of every code above 0, nits; code `n` begins at `levels[n - 1]`. The last one is NaN: no
    /// luminance reaches it.
    levels: [f32; 256],
    /// Code at the lower end of every bin. Bin `n` is around `n` bins of luminance.
    bins: Box<[u8; BINS]>,
    bins_per_nit: f32,
}

impl Curve {
    /// The curve that takes `white` nits to 255; not for [`Tone::Agx`].
    pub(super) fn new(tone: Tone, white: f64) -> Self {
        let mut levels = [f32::NAN; 256];
        levels.iter_mut().zip(levels_of(tone)).for_each(|(nits, level)| *nits = (white * level) as f32);
        let mut bins = Box::new([u8::MAX; BINS]);
        let mut start = 0;
        for (code, level) in levels_of(tone).iter().enumerate() {
            // The bin around the level, and the next one: rounding may lead there.
            let end = ((level * BINS as f64 + 0.5).floor() as usize + 2).min(BINS);
            bins[start..end].fill(code as u8);
            start = end;
        }
        Self { levels, bins, bins_per_nit: (BINS as f64 / white) as f32 }
    }

    /// The code of a luminance in nits: `255 · brightness`, rounded half up. NaN is 0.
    #[inline]
    pub fn code(&self, nits: f32) -> u8 {
        /// The sum of this and a smaller positive number has the number, rounded, in its last bits.
        const ROUNDS: f32 = 8_388_608.0;
        // `max` turns NaN into 0.
        let bin = (nits * self.bins_per_nit).max(0.0).min((BINS - 1) as f32) + ROUNDS;
        let code = self.bins[bin.to_bits() as usize % BINS];
        code + u8::from(nits >= self.levels[usize::from(code)])
    }
}

/// The light of every code above 0, over white.
fn levels_of(tone: Tone) -> &'static [f64; 255] {
    static LEVELS: [OnceLock<[f64; 255]>; 4] = [const { OnceLock::new() }; 4];
    LEVELS[tone as usize].get_or_init(|| std::array::from_fn(|code| level(tone, (code as f64 + 0.5) / 255.0)))
}

/// The light in the middle of every code, over white; not for [`Tone::Agx`].
pub(super) fn light_of_codes(tone: Tone) -> [f64; 256] {
    std::array::from_fn(|code| level(tone, code as f64 / 255.0))
}

/// The least `x` whose brightness is at least `brightness`, by bisection: every such curve is increasing on [0, 1].
fn level(tone: Tone, brightness: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if tone.brightness(middle) < brightness { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_points() {
        // A fixed white is white in every curve; a metered gray is 18 % in the filmic one, sRGB code 118.
        for tone in [Tone::Filmic, Tone::Srgb, Tone::Linear] {
            let curve = Curve::new(tone, 9.6);
            assert_eq!([9.6, 1e9, f32::INFINITY].map(|nits| curve.code(nits)), [255; 3], "{tone:?}");
            assert_eq!([0.0, -1.0, f32::NAN, f32::NEG_INFINITY].map(|nits| curve.code(nits)), [0; 4], "{tone:?}");
        }
        assert_eq!(Curve::new(Tone::Filmic, 1.2).code(0.125), 118);
        // sRGB codes of 10 %, 18 %, 50 % by the standard: 89.5 (0.3492), 117.6 (0.4613), 187.5 (0.7354).
        let curve = Curve::new(Tone::Srgb, 1.0);
        assert_eq!([0.1, 0.18, 0.5, 0.0001].map(|x| curve.code(x)), [89, 118, 188, 0]);
        assert_eq!(Curve::new(Tone::Linear, 2.0).code(1.0), 128);
    }

    #[test]
    fn levels_are_two_bins_apart() {
        for tone in [Tone::Filmic, Tone::Srgb, Tone::Linear] {
            let nearest = levels_of(tone).windows(2).map(|pair| pair[1] - pair[0]).fold(1.0, f64::min);
            assert!(nearest * BINS as f64 > 2.01, "{tone:?}: {nearest}");
        }
    }

    #[test]
    fn tables_agree_with_the_formula() {
        for tone in [Tone::Filmic, Tone::Srgb, Tone::Linear] {
            let curve = Curve::new(tone, 3.7);
            for i in 0..200_000 {
                let nits = (i as f64 / 180_000.0 * 3.7) as f32;
                let exact = 255.0 * tone.brightness(f64::from(nits) / 3.7);
                let (got, want) = (i32::from(curve.code(nits)), (exact + 0.5).floor() as i32);
                // A level itself is rounded to f32; there, and only there, the two may differ.
                let tie = ((exact + 0.5) - (exact + 0.5).round()).abs() < 1e-4;
                assert!(got == want || tie && (got - want).abs() == 1, "{tone:?} {nits}: {got}, not {exact}");
            }
        }
    }
}
