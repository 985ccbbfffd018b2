//! Tone curves, as formulas.

use super::sigmoid::sigmoid;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::color::linear_to_srgb;

/// Tone curve, from luminance to brightness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// A metered gray becomes 18 %, highlights roll off (Reinhard et al., 2002), sRGB-encoded.
    #[default]
    Filmic,
    /// Linear up to white, sRGB-encoded.
    Srgb,
    /// Linear up to white, not encoded: code = 255 · luminance / white.
    Linear,
    /// A metered gray becomes 18 %, and bright colors fade to white instead of clipping (after AgX by Sobotka, 2022).
    /// White is three stops above the white of the other curves.
    Agx,
}

impl Tone {
    /// All tone curves.
    const ALL: [Self; 4] = [Self::Filmic, Self::Srgb, Self::Linear, Self::Agx];

    /// The curve of a [`name`](Self::name).
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|tone| tone.name() == name)
    }

    /// Name in recipes and in the output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Filmic => "filmic",
            Self::Srgb => "srgb",
            Self::Linear => "linear",
            Self::Agx => "agx",
        }
    }

    /// The brightness in [0, 1] of a gray of `x` = luminance / white.
    pub fn brightness(self, x: f64) -> f64 {
        match self {
            Self::Filmic => linear_to_srgb(shoulder(GAIN * x.min(1.0))),
            Self::Srgb => linear_to_srgb(x.min(1.0)),
            Self::Linear => x.min(1.0),
            Self::Agx => sigmoid(GAIN * x),
        }
    }
}

/// Gain of the filmic curve: a metered gray, `12.5 / 100 · 2^EV` nits of `1.2 · 2^EV`, becomes 18 %.
pub(super) const GAIN: f64 = 0.18 * 1.2 * 100.0 / 12.5;
/// End of the linear part of the filmic curve.
const KNEE: f64 = 0.4;

/// Linear up to the knee, then the curve of Reinhard et al. (2002, equation 4), `t (1 + t/T²) / (1 + t)`, scaled so
/// that it continues the line smoothly and reaches 1 at [`GAIN`].
fn shoulder(x: f64) -> f64 {
    if x <= KNEE {
        return x;
    }
    let (t, t_white) = ((x - KNEE) / (1.0 - KNEE), (GAIN - KNEE) / (1.0 - KNEE));
    (KNEE + (1.0 - KNEE) * t * (1.0 + t / (t_white * t_white)) / (1.0 + t)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filmic_curve_is_smooth_and_monotone() {
        let slope = |x: f64| (shoulder(x + 1e-6) - shoulder(x)) / 1e-6;
        assert!((slope(KNEE - 1e-5) - 1.0).abs() < 1e-3 && (slope(KNEE + 1e-6) - 1.0).abs() < 1e-3);
        assert!((shoulder(GAIN) - 1.0).abs() < 1e-12);
        let mut last = -1.0;
        for i in 0..=1000 {
            let y = shoulder(GAIN * f64::from(i) / 1000.0);
            assert!(y > last && y <= 1.0);
            last = y;
        }
    }
}
