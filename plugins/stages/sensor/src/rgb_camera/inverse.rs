//! Codes to radiance: the inverse of development.

use super::agx::Agx;
use super::curve::light_of_codes;
use super::tone::Tone;

/// The radiance that develops into a color, for a given tone, white in nits, and gains of the channels.
pub struct Inverse {
    lights: Lights,
    gains: [f32; 3],
}

enum Lights {
    /// Nits of every code of a channel.
    Curve(Box<[f32; 256]>),
    /// The inverse of a curve in a reduced gamut.
    Agx(Box<Agx>),
}

impl Inverse {
    /// The inverse of the developer with the same arguments.
    pub fn new(tone: Tone, white: f64, gains: [f32; 3]) -> Self {
        let lights = match tone {
            Tone::Agx => Lights::Agx(Box::new(Agx::new(white))),
            tone => Lights::Curve(Box::new(light_of_codes(tone).map(|light| (light * white) as f32))),
        };
        Self { lights, gains }
    }

    /// Radiance that develops into these codes, nits. With the tone `agx`, it develops into the nearest color that the tone can show:
    /// no light becomes a saturated primary.
    pub fn nits(&self, code: [u8; 3]) -> [f32; 3] {
        let nits = match &self.lights {
            Lights::Curve(lights) => code.map(|code| lights[usize::from(code)]),
            Lights::Agx(agx) => agx.nits(code),
        };
        std::array::from_fn(|c| nits[c] / self.gains[c])
    }
}

#[cfg(test)]
mod tests {
    use super::super::Developer;
    use super::*;

    #[test]
    fn colors_survive_the_inverse_and_the_development() {
        let gains = [1.3, 1.0, 0.6];
        for tone in [Tone::Filmic, Tone::Srgb, Tone::Linear] {
            let (inverse, developer) = (Inverse::new(tone, 37.0, gains), Developer::new(tone, 37.0, gains));
            for code in (0..=255).map(|code: u8| [code, code.wrapping_mul(7), 255 - code]) {
                assert_eq!(developer.code(inverse.nits(code)), code, "{tone:?}");
            }
        }
        let (inverse, developer) = (Inverse::new(Tone::Agx, 37.0, gains), Developer::new(Tone::Agx, 37.0, gains));
        for code in (0..=250).map(|code: u8| [code, code, code]).chain([[200, 150, 120], [60, 90, 70], [140, 160, 190]])
        {
            let again = developer.code(inverse.nits(code));
            assert!((0..3).all(|c| again[c].abs_diff(code[c]) <= 1), "{code:?}: {again:?}");
        }
    }
}
