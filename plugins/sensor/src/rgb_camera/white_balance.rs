//! White balance.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use syntable_model::dist::Dist;
use syntable_model::error::ConfigError;
use syntable_model::photometry::{blackbody, luminance};
use syntable_model::product::Value;
use syntable_model::random::Stream;

/// The light that becomes white: `"none"`, `"auto"` or `{ kelvin = 4000 }`.
///
/// The channels are scaled by von Kries gains in linear Rec. 709, so that light of a black body at that temperature
/// becomes a gray of the same luminance.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum WhiteBalance {
    /// No gains: light of the chromaticity of D65 is white.
    #[default]
    None,
    /// The light is estimated from the image.
    ///
    /// Robust gray world: the medians of red over green and of blue over green stand for a gray surface (Buchsbaum,
    /// J. Franklin Institute 1980, with means; with medians, colored objects can fill up to half of the image). Only
    /// pixels between the 10th and the 90th percentile of luminance count. The estimate is the black body from 2500 K to
    /// 10,000 K that is nearest in the logarithms of both ratios, so that a green table is not taken for green light.
    Auto,
    /// Light of a black body at this temperature, kelvin, from 2000 to 40,000.
    Kelvin(Dist),
}

/// Limits of `kelvin`. Below, a black body has hardly any blue.
const KELVIN: [f64; 2] = [2000.0, 40_000.0];
/// Range of estimated temperatures, reciprocal megakelvin.
const MIRED: std::ops::RangeInclusive<u32> = 100..=400;
/// Fraction of the darkest and of the brightest pixels that the estimate leaves out.
const TAIL: f64 = 0.1;

impl WhiteBalance {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        match self {
            Self::Kelvin(kelvin) => kelvin.within("white_balance.kelvin", KELVIN[0], KELVIN[1]),
            Self::None | Self::Auto => Ok(()),
        }
    }

    /// The gains of the channels for an image, and their record; none without white balance.
    pub(super) fn gains(&self, radiance: &[[f32; 3]], stream: &Stream) -> Option<([f32; 3], Value)> {
        let (mode, kelvin) = match self {
            Self::None => return None,
            Self::Auto => ("auto", estimated(radiance)),
            Self::Kelvin(kelvin) => ("kelvin", Some(kelvin.draw(&mut stream.child("kelvin")))),
        };
        // An image without light has no estimate.
        let gains = kelvin.map_or([1.0; 3], |kelvin| blackbody(kelvin).map(f64::recip));
        let record = Value::record([
            ("mode", mode.into()),
            ("kelvin", kelvin.map_or(Value::Float(f64::NAN), Value::Float)),
            ("gains_rgb", gains.into()),
        ]);
        Some((gains.map(|gain| gain as f32), record))
    }
}

/// The estimated temperature of the light in an image, kelvin; none if no pixel is lit.
pub fn estimated(radiance: &[[f32; 3]]) -> Option<f64> {
    let lit: Vec<(f32, [f32; 3])> = radiance
        .iter()
        .filter(|pixel| pixel.iter().all(|v| v.is_finite() && *v > 0.0))
        .map(|&pixel| (luminance(pixel.map(f64::from)) as f32, pixel))
        .collect();
    let last = lit.len().checked_sub(1)?;
    let mut sorted: Vec<f32> = lit.iter().map(|(y, _)| *y).collect();
    let mut quantile =
        |fraction: f64| *sorted.select_nth_unstable_by((last as f64 * fraction) as usize, f32::total_cmp).1;
    let (low, high) = (quantile(TAIL), quantile(1.0 - TAIL));
    let ratio = |channel: usize| {
        let mut ratios: Vec<f32> =
            lit.iter().filter(|(y, _)| (low..=high).contains(y)).map(|(_, pixel)| pixel[channel] / pixel[1]).collect();
        let middle = ratios.len() / 2;
        let median = *ratios.select_nth_unstable_by(middle, f32::total_cmp).1;
        libm::log(f64::from(median))
    };
    let (red, blue) = (ratio(0), ratio(2));
    let distance = |mired: u32| {
        let [r, g, b] = blackbody(1e6 / f64::from(mired));
        (libm::log(r / g) - red).powi(2) + (libm::log(b / g) - blue).powi(2)
    };
    let nearest = MIRED.map(|mired| (distance(mired), mired)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(1e6 / f64::from(nearest.1))
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tagged {
    kelvin: Dist,
}

impl Serialize for WhiteBalance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => serializer.serialize_str("none"),
            Self::Auto => serializer.serialize_str("auto"),
            Self::Kelvin(kelvin) => Tagged { kelvin: kelvin.clone() }.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for WhiteBalance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TextOrTable)
    }
}

struct TextOrTable;

impl<'de> Visitor<'de> for TextOrTable {
    type Value = WhiteBalance;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"none\", \"auto\" or { kelvin = 4000 }")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<WhiteBalance, E> {
        match text {
            "none" => Ok(WhiteBalance::None),
            "auto" => Ok(WhiteBalance::Auto),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<WhiteBalance, A::Error> {
        let tagged = Tagged::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
        Ok(WhiteBalance::Kelvin(tagged.kelvin))
    }
}

impl JsonSchema for WhiteBalance {
    fn schema_name() -> Cow<'static, str> {
        "WhiteBalance".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut kelvin = generator.subschema_for::<Dist>();
        kelvin.insert("description".into(), "Temperature of a black body, kelvin, from 2000 to 40,000.".into());
        kelvin.insert("minimum".into(), KELVIN[0].into());
        kelvin.insert("maximum".into(), KELVIN[1].into());
        json_schema!({
            "description": "The light that becomes white: \"none\", \"auto\" (estimated from the image) or { kelvin = 4000 }.",
            "oneOf": [
                { "description": "No white balance, or one that is estimated from the image.", "type": "string", "enum": ["none", "auto"] },
                {
                    "description": "The temperature of the light that becomes white.",
                    "type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
                    "properties": { "kelvin": kelvin }
                }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of gray objects; two fifths of the image have a saturated color.
    fn room(kelvin: f64, paint: [f64; 3]) -> Vec<[f32; 3]> {
        let light = blackbody(kelvin);
        let mut stream = Stream::root(3);
        (0..5000)
            .map(|i| {
                let gray = stream.uniform(0.1, 0.9);
                let tint = if i % 5 < 2 { paint } else { [1.0; 3] };
                std::array::from_fn(|c| (100.0 * gray * tint[c] * light[c]) as f32)
            })
            .collect()
    }

    #[test]
    fn the_light_is_found_in_spite_of_colored_objects() {
        for kelvin in [2700.0, 4000.0, 6500.0, 9000.0] {
            for paint in [[1.0; 3], [1.0, 0.2, 0.1], [0.3, 1.0, 0.3]] {
                let got = estimated(&room(kelvin, paint)).expect("lit");
                assert!((1e6 / got - 1e6 / kelvin).abs() <= 1.0, "{got} K instead of {kelvin} K beside {paint:?}");
            }
        }
        assert_eq!(estimated(&[[0.0; 3]; 4]), None);
        assert_eq!(estimated(&[]), None);
    }

    #[test]
    fn the_chosen_light_becomes_gray_of_the_same_luminance() {
        let balance = WhiteBalance::Kelvin(Dist::Constant(3200.0));
        let (gains, _) = balance.gains(&[], &Stream::root(0)).expect("a white balance");
        let light = blackbody(3200.0);
        let balanced: [f64; 3] = std::array::from_fn(|c| light[c] * f64::from(gains[c]));
        assert!(balanced.iter().all(|v| (v - 1.0).abs() < 1e-6), "{balanced:?}");
        assert!((luminance(light) - luminance(balanced)).abs() < 1e-6);
    }
}
