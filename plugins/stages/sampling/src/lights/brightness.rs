//! Brightness and color temperature of lights.

use self::limits::{ILLUMINANCE_LX, LUMINANCE_NITS, LUMINOUS_FLUX_LM, TEMPERATURE_K, TINT};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::dist::Dist;
use syntable_model::error::ConfigError;
use syntable_model::photometry::blackbody;
use syntable_model::random::Stream;

/// Limits of photometric options.
pub mod limits {
    /// Illuminance, lux.
    pub const ILLUMINANCE_LX: [f64; 2] = [0.0, 1e7];
    /// Luminance, nits.
    pub const LUMINANCE_NITS: [f64; 2] = [0.0, 1e10];
    /// Luminous flux, lumens.
    pub const LUMINOUS_FLUX_LM: [f64; 2] = [0.0, 1e9];
    /// Color temperature, kelvin.
    pub const TEMPERATURE_K: [f64; 2] = [1000.0, 40_000.0];
    /// Factor of a channel.
    pub const TINT: [f64; 2] = [0.0, 1.0];
}

/// Brightness of a light, as one of three photometric quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Brightness {
    /// Unoccluded illuminance at the center of the support on a plane that faces the light, lux, from 0 to 10⁷.
    IlluminanceLx(#[schemars(extend("minimum" = ILLUMINANCE_LX[0], "maximum" = ILLUMINANCE_LX[1]))] Dist),
    /// Luminance of the light's surface, nits (cd/m²), from 0 to 10¹⁰.
    LuminanceNits(#[schemars(extend("minimum" = LUMINANCE_NITS[0], "maximum" = LUMINANCE_NITS[1]))] Dist),
    /// Luminous flux of each light, lumens, as on the package of a light bulb, from 0 to 10⁹.
    LuminousFluxLm(#[schemars(extend("minimum" = LUMINOUS_FLUX_LM[0], "maximum" = LUMINOUS_FLUX_LM[1]))] Dist),
}

impl Brightness {
    /// Rejects distributions that leave their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        let (key, dist, [low, high]) = match self {
            Self::IlluminanceLx(dist) => ("brightness.illuminance_lx", dist, ILLUMINANCE_LX),
            Self::LuminanceNits(dist) => ("brightness.luminance_nits", dist, LUMINANCE_NITS),
            Self::LuminousFluxLm(dist) => ("brightness.luminous_flux_lm", dist, LUMINOUS_FLUX_LM),
        };
        dist.within(key, low, high)
    }

    /// Draws a luminance, nits, using these conversions from lux and from lumens.
    pub fn draw(
        &self,
        stream: &mut Stream,
        from_lux: impl FnOnce(f64) -> f64,
        from_lumens: impl FnOnce(f64) -> f64,
    ) -> f64 {
        match self {
            Self::IlluminanceLx(lux) => from_lux(lux.draw(stream)),
            Self::LuminanceNits(nits) => nits.draw(stream),
            Self::LuminousFluxLm(lumens) => from_lumens(lumens.draw(stream)),
        }
    }
}

/// Color of a light: its temperature and its filter.
#[derive(Clone, Copy)]
pub struct LightColor<'o> {
    /// Color temperature, kelvin.
    pub temperature_k: &'o Dist,
    /// Factors of red, green and blue, each drawn on its own.
    pub tint: Option<&'o Dist>,
}

impl LightColor<'_> {
    /// Rejects color temperatures that no light has, and filters that amplify light.
    pub fn check(self) -> Result<(), ConfigError> {
        check_temperature("temperature_k", self.temperature_k)?;
        self.tint.map_or(Ok(()), |tint| tint.within("tint", TINT[0], TINT[1]))
    }

    /// Draws the color, linear Rec. 709. Its luminance is 1 without a filter.
    pub fn draw(self, stream: &Stream) -> [f64; 3] {
        let color = blackbody(self.temperature_k.draw(&mut stream.child("temperature")));
        let Some(tint) = self.tint else { return color };
        let mut stream = stream.child("tint");
        color.map(|channel| channel * tint.draw(&mut stream))
    }
}

/// Rejects color temperatures that no light has.
pub fn check_temperature(key: &str, temperature_k: &Dist) -> Result<(), ConfigError> {
    temperature_k.within(key, TEMPERATURE_K[0], TEMPERATURE_K[1])
}
