//! Radiance to codes, by the tone curve of the recipe.

use super::agx::Agx;
use super::curve::Curve;
use super::tone::Tone;

/// Converts radiance into 8-bit codes, for a given white.
pub struct Developer {
    codes: Codes,
    gains: [f32; 3],
}

enum Codes {
    /// One curve applied to each channel.
    Curve(Box<Curve>),
    /// A curve in a reduced gamut.
    Agx(Box<Agx>),
}

impl Developer {
    /// The developer of a tone, for a white in nits and gains of the channels.
    pub fn new(tone: Tone, white: f64, gains: [f32; 3]) -> Self {
        let codes = match tone {
            Tone::Agx => Codes::Agx(Box::new(Agx::new(white))),
            tone => Codes::Curve(Box::new(Curve::new(tone, white))),
        };
        Self { codes, gains }
    }

    /// The codes of a color in nits.
    pub fn code(&self, nits: [f32; 3]) -> [u8; 3] {
        let mut code = [[0; 3]];
        self.develop(&[nits], &mut code);
        code[0]
    }

    /// Fills `codes` with the codes of colors in nits, one by one.
    pub fn develop(&self, nits: &[[f32; 3]], codes: &mut [[u8; 3]]) {
        let balanced = |nits: &[f32; 3]| std::array::from_fn(|c| nits[c] * self.gains[c]);
        let pixels = codes.iter_mut().zip(nits);
        match &self.codes {
            Codes::Curve(curve) => {
                pixels.for_each(|(code, nits)| *code = balanced(nits).map(|nits| curve.code(nits)));
            }
            Codes::Agx(agx) => pixels.for_each(|(code, nits)| *code = agx.code(balanced(nits))),
        }
    }
}
