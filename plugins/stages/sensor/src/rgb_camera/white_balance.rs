//! White balance.

use super::meter::lit;
use super::ranks::Ranks;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;
use syntable_model::dist::Dist;
use syntable_model::error::ConfigError;
use syntable_model::photometry::blackbody;
use syntable_model::product::Value;
use syntable_model::random::Stream;

/// The light that becomes white: `"none"`, `"auto"`, `"gray_world"` or `{ kelvin = 4000 }`.
///
/// The channels are scaled by von Kries gains in linear Rec. 709, so that light of a black body at that temperature
/// becomes a gray of the same luminance.
///
/// An estimate is the black body from 2000 K to 10,000 K whose ratios of red to green and blue to green are nearest, in
/// their logarithms, to the medians over the pixels between the 10th and the 90th percentile of luminance. With
/// medians, up to half of the image may differ from the rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum WhiteBalance {
    /// No gains: light of the chromaticity of D65 is white.
    #[default]
    None,
    /// The light that falls on the surfaces: their radiance over their albedo. A room of one color keeps it.
    Auto,
    /// The light that leaves the surfaces, as in cameras that do not know the albedo (Buchsbaum, J. Franklin Institute
    /// 1980, with means): a brown table in a brown room becomes gray.
    GrayWorld,
    /// Light of a black body at this temperature, kelvin, from 2000 to 40,000.
    Kelvin(Dist),
}

/// Limits of `kelvin`. Below, a black body has hardly any blue.
const KELVIN: [f64; 2] = [2000.0, 40_000.0];
/// Range of estimated temperatures, reciprocal megakelvin.
const MIRED: std::ops::RangeInclusive<u32> = 100..=500;
/// Fraction of the darkest and of the brightest pixels that the estimate leaves out.
const TAIL: f64 = 0.1;
/// Minimum albedo, in each channel, of surfaces that count in the estimate of the light.
const MIN_ALBEDO: f32 = 0.02;

impl WhiteBalance {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        match self {
            Self::Kelvin(kelvin) => kelvin.within("white_balance.kelvin", KELVIN[0], KELVIN[1]),
            Self::None | Self::Auto | Self::GrayWorld => Ok(()),
        }
    }

    /// Whether the estimate needs the albedo of the surfaces.
    pub(super) fn reads_albedo(&self) -> bool {
        *self == Self::Auto
    }

    /// The gains of the channels for an image, and their record; `None` without white balance. `albedo` has the pixels
    /// of `radiance` if it is needed.
    pub(super) fn gains(
        &self,
        radiance: &[[f32; 3]],
        albedo: Option<&[[f32; 3]]>,
        stream: &Stream,
    ) -> Option<([f32; 3], Value)> {
        let (mode, kelvin) = match self {
            Self::None => return None,
            Self::Auto => ("auto", estimated(incident(radiance, albedo.unwrap_or_default()))),
            Self::GrayWorld => ("gray_world", estimated(radiance.iter().map(|&pixel| (pixel, [1.0; 3])))),
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

/// Radiance of the pixels that show a surface with an albedo, and the albedo. Other pixels are black.
fn incident<'a>(
    radiance: &'a [[f32; 3]],
    albedo: &'a [[f32; 3]],
) -> impl Iterator<Item = ([f32; 3], [f32; 3])> + Clone + 'a {
    radiance.iter().zip(albedo).map(|(pixel, albedo)| {
        let reflects = albedo.iter().all(|&a| a >= MIN_ALBEDO);
        (if reflects { *pixel } else { [0.0; 3] }, *albedo)
    })
}

/// The temperature of the light, kelvin, estimated from the radiance and the albedo of each pixel; `None` if no pixel is
/// lit.
fn estimated(pixels: impl Iterator<Item = ([f32; 3], [f32; 3])> + Clone) -> Option<f64> {
    let black_unless_lit = |(pixel, _): ([f32; 3], _)| {
        let is_lit = pixel.iter().all(|v| *v > 0.0 && *v < f32::INFINITY);
        if is_lit { pixel } else { [0.0; 3] }
    };
    let (lit, count) = lit(pixels.clone().map(black_unless_lit));
    let last = count.checked_sub(1)?;
    let ranks = Ranks::new(&lit);
    let quantile = |fraction: f64| ranks.at((last as f64 * fraction) as usize);
    let (low, high) = (quantile(TAIL), quantile(1.0 - TAIL));
    let is_inner = |y: f32| low <= y && y <= high;
    let inner = lit.iter().filter(|y| is_inner(**y)).count();
    // Red over green and blue over green of the light that falls on the surface.
    let ratios = |(y, ([r, g, b], albedo)): (&f32, ([f32; 3], [f32; 3]))| {
        let green = albedo[1] / g;
        let (red, blue) = (r / albedo[0] * green, b / albedo[2] * green);
        // The last in the order.
        if is_inner(*y) { (red, blue) } else { (f32::NAN, f32::NAN) }
    };
    let (reds, blues): (Vec<f32>, Vec<f32>) = lit.iter().zip(pixels).map(ratios).unzip();
    let log_of_median = |ratios: &[f32]| libm::log(f64::from(Ranks::new(ratios).at(inner / 2)));
    let (red, blue) = (log_of_median(&reds), log_of_median(&blues));
    let distance = |[r, b]: [f64; 2]| (r - red).powi(2) + (b - blue).powi(2);
    let distances = MIRED.zip(black_bodies()).map(|(mired, ratios)| (distance(*ratios), mired));
    let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(1e6 / f64::from(nearest.1))
}

/// Logarithms of red over green and of blue over green, for each temperature of [`MIRED`].
fn black_bodies() -> &'static [[f64; 2]] {
    static RATIOS: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
        let ratios = |mired: u32| {
            let [r, g, b] = blackbody(1e6 / f64::from(mired));
            [libm::log(r / g), libm::log(b / g)]
        };
        MIRED.map(ratios).collect()
    });
    &RATIOS
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
            Self::GrayWorld => serializer.serialize_str("gray_world"),
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
        f.write_str("\"none\", \"auto\", \"gray_world\" or { kelvin = 4000 }")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<WhiteBalance, E> {
        match text {
            "none" => Ok(WhiteBalance::None),
            "auto" => Ok(WhiteBalance::Auto),
            "gray_world" => Ok(WhiteBalance::GrayWorld),
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
            "description": "The light that becomes white: \"none\", \"auto\" (the light that falls on the surfaces), \"gray_world\" (estimated from the image alone) or { kelvin = 4000 }.",
            "oneOf": [
                { "description": "No white balance, or one that is estimated.", "type": "string", "enum": ["none", "auto", "gray_world"] },
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
    use syntable_model::photometry::luminance;

    /// Radiance and albedo of a room; two fifths of the image are painted, the rest has the color of the walls.
    fn room(kelvin: f64, walls: [f64; 3], paint: [f64; 3]) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let light = blackbody(kelvin);
        let mut stream = Stream::root(3);
        (0..5000)
            .map(|i| {
                let gray = stream.uniform(0.1, 0.9);
                let albedo = (if i % 5 < 2 { paint } else { walls }).map(|tint| gray * tint);
                (std::array::from_fn(|c| (100.0 * albedo[c] * light[c]) as f32), albedo.map(|a| a as f32))
            })
            .unzip()
    }

    fn kelvin_of(balance: &WhiteBalance, radiance: &[[f32; 3]], albedo: &[[f32; 3]]) -> Option<f64> {
        let (gains, _) = balance.gains(radiance, Some(albedo), &Stream::root(0)).expect("a white balance");
        // A black body has these gains.
        let nearest = MIRED.map(|mired| 1e6 / f64::from(mired)).find(|&kelvin| {
            blackbody(kelvin).iter().zip(gains).all(|(v, gain)| (v * f64::from(gain) - 1.0).abs() < 1e-5)
        });
        assert!(nearest.is_some() || gains == [1.0; 3], "{gains:?}");
        nearest
    }

    #[test]
    fn the_light_is_found_in_spite_of_colored_objects() {
        for kelvin in [2100.0, 2700.0, 4000.0, 6500.0, 9000.0] {
            for paint in [[1.0; 3], [1.0, 0.2, 0.1], [0.3, 1.0, 0.3]] {
                let (radiance, albedo) = room(kelvin, [1.0; 3], paint);
                for balance in [WhiteBalance::Auto, WhiteBalance::GrayWorld] {
                    let got = kelvin_of(&balance, &radiance, &albedo).expect("lit");
                    assert!((1e6 / got - 1e6 / kelvin).abs() <= 1.0, "{balance:?}: {got} K, not {kelvin} K, {paint:?}");
                }
            }
        }
        for balance in [WhiteBalance::Auto, WhiteBalance::GrayWorld] {
            assert_eq!(kelvin_of(&balance, &[[0.0; 3]; 4], &[[0.5; 3]; 4]), None);
            assert_eq!(kelvin_of(&balance, &[], &[]), None);
        }
    }

    #[test]
    fn a_room_of_one_color_keeps_it() {
        let (brown, teal) = ([0.6, 0.3, 0.12], [0.2, 0.6, 0.6]);
        for kelvin in [3000.0, 6500.0] {
            for walls in [brown, teal] {
                let (radiance, albedo) = room(kelvin, walls, walls);
                let got = kelvin_of(&WhiteBalance::Auto, &radiance, &albedo).expect("lit");
                assert!((1e6 / got - 1e6 / kelvin).abs() <= 1.0, "{got} K, not {kelvin} K");
                let fooled = kelvin_of(&WhiteBalance::GrayWorld, &radiance, &albedo).expect("lit");
                assert!((1e6 / fooled - 1e6 / kelvin).abs() > 30.0, "{fooled} K");
            }
        }
    }

    #[test]
    fn light_and_background_have_no_albedo() {
        let (mut radiance, mut albedo) = room(3500.0, [1.0; 3], [1.0; 3]);
        radiance.extend([[900.0, 2000.0, 4000.0]; 20_000]);
        albedo.extend([[0.0; 3]; 20_000]);
        let got = kelvin_of(&WhiteBalance::Auto, &radiance, &albedo).expect("lit");
        assert!((1e6 / got - 1e6 / 3500.0).abs() <= 1.0, "{got} K");
    }

    #[test]
    fn the_chosen_light_becomes_gray_of_the_same_luminance() {
        let balance = WhiteBalance::Kelvin(Dist::Constant(3200.0));
        let (gains, _) = balance.gains(&[], None, &Stream::root(0)).expect("a white balance");
        let light = blackbody(3200.0);
        let balanced: [f64; 3] = std::array::from_fn(|c| light[c] * f64::from(gains[c]));
        assert!(balanced.iter().all(|v| (v - 1.0).abs() < 1e-6), "{balanced:?}");
        assert!((luminance(light) - luminance(balanced)).abs() < 1e-6);
    }
}
