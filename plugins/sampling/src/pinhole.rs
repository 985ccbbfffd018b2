//! Camera `pinhole`: intrinsics from focal length and aperture, from a matrix K, or from a field of view.

use schemars::{Schema, SchemaGenerator, json_schema};
use std::borrow::Cow;
use syntable_model::prelude::*;
use syntable_model::scene::{Exposure, Intrinsics};

/// A pinhole camera. Intrinsics come from `focal_length_mm` and `aperture_mm`, or from `k`, or from `fov_deg`.
///
/// The default is the RealSense L515 of the paper, 70° × 55°: `fx = width · focal / aperture_x`, and fy likewise from
/// the vertical aperture, so that pixels are square only if the apertures say so. With `fov_deg` pixels are square. The
/// principal point is the image's middle unless `k` says otherwise.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pinhole {
    /// Width and height of the image, px.
    #[schemars(inner(range(min = 1, max = 16384)))]
    resolution: [u32; 2],
    /// Focal length, mm; 1.88 unless `k` or `fov_deg` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    focal_length_mm: Option<f64>,
    /// Width and height of the sensor, mm; 2.63 and 1.96 unless `k` or `fov_deg` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    aperture_mm: Option<[f64; 2]>,
    /// Intrinsics matrix, row by row, px; the origin is the top-left corner of the image, pixel centres lie at
    /// half-integers.
    #[serde(skip_serializing_if = "Option::is_none")]
    k: Option<[[f64; 3]; 3]>,
    /// Horizontal field of view, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180))]
    fov_deg: Option<f64>,
    /// How scene light becomes a picture: "auto", { ev100 = 9.0 }, or { auto_ev = 0.5 } for half a stop brighter than
    /// the automatic choice.
    exposure: ExposureOption,
}

const FOCAL_LENGTH_MM: f64 = 1.88;
const APERTURE_MM: [f64; 2] = [2.63, 1.96];

impl Default for Pinhole {
    fn default() -> Self {
        Self {
            resolution: [640, 480],
            focal_length_mm: None,
            aperture_mm: None,
            k: None,
            fov_deg: None,
            exposure: ExposureOption(Exposure::Auto { compensation_ev: 0.0 }),
        }
    }
}

impl Config for Pinhole {
    type Stage = dyn CameraModel;
    const KIND: &'static str = "pinhole";
    const EXAMPLE: &'static str =
        "resolution = [640, 480]\nfocal_length_mm = 1.88\naperture_mm = [2.63, 1.96]\nexposure = \"auto\"";
    fn build(self) -> Result<Box<dyn CameraModel>, Invalid> {
        Ok(Box::new(Built { intrinsics: self.intrinsics()?, exposure: self.exposure.0 }))
    }
}
register!(Pinhole);

struct Built {
    intrinsics: Intrinsics,
    exposure: Exposure,
}

impl CameraModel for Built {
    fn camera(&self, _: &Context) -> Result<(Intrinsics, Exposure)> {
        Ok((self.intrinsics, self.exposure))
    }
}

impl Pinhole {
    fn intrinsics(&self) -> Result<Intrinsics, Invalid> {
        let [width, height] = self.resolution;
        let (w, h) = (f64::from(width), f64::from(height));
        let by_lens = self.focal_length_mm.is_some() || self.aperture_mm.is_some();
        if [by_lens, self.k.is_some(), self.fov_deg.is_some()].into_iter().filter(|given| *given).count() > 1 {
            let key = if self.k.is_some() { "k" } else { "fov_deg" };
            return Err(Invalid::new(key, "intrinsics are given in two ways")
                .help("keep one: focal_length_mm with aperture_mm, or k, or fov_deg"));
        }
        let (fx, fy, cx, cy) = if let Some(k) = self.k {
            let [[fx, skew, cx], [zero, fy, cy], last] = k;
            if skew != 0.0 || zero != 0.0 || last != [0.0, 0.0, 1.0] {
                return Err(Invalid::new("k", format!("`k = {k:?}` is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")));
            }
            (fx, fy, cx, cy)
        } else if let Some(fov) = self.fov_deg {
            let focal = w / 2.0 / (fov.to_radians() / 2.0).tan();
            (focal, focal, w / 2.0, h / 2.0)
        } else {
            let focal = self.focal_length_mm.unwrap_or(FOCAL_LENGTH_MM);
            let [x, y] = self.aperture_mm.unwrap_or(APERTURE_MM);
            if x <= 0.0 || y <= 0.0 {
                return Err(Invalid::new("aperture_mm", format!("`aperture_mm = [{x}, {y}]` must be above zero")));
            }
            (w * focal / x, h * focal / y, w / 2.0, h / 2.0)
        };
        if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|x| x.is_finite())) {
            return Err(Invalid::new("k", format!("focal lengths must be above zero: fx = {fx}, fy = {fy}")));
        }
        Ok(Intrinsics { width, height, fx, fy, cx, cy })
    }
}

/// [`Exposure`] as recipes write it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ExposureOption(Exposure);

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Tagged {
    Ev100(f64),
    AutoEv(f64),
}

impl Serialize for ExposureOption {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Exposure::Fixed { ev100 } => Tagged::Ev100(ev100).serialize(serializer),
            Exposure::Auto { compensation_ev: 0.0 } => serializer.serialize_str("auto"),
            Exposure::Auto { compensation_ev } => Tagged::AutoEv(compensation_ev).serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ExposureOption {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = ExposureOption;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("\"auto\", { ev100 = 9.0 } or { auto_ev = 0.5 }")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<ExposureOption, E> {
                match text {
                    "auto" => Ok(ExposureOption(Exposure::Auto { compensation_ev: 0.0 })),
                    other => Err(E::invalid_value(serde::de::Unexpected::Str(other), &self)),
                }
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<ExposureOption, A::Error> {
                Ok(ExposureOption(match Tagged::deserialize(serde::de::value::MapAccessDeserializer::new(map))? {
                    Tagged::Ev100(ev100) => Exposure::Fixed { ev100 },
                    Tagged::AutoEv(compensation_ev) => Exposure::Auto { compensation_ev },
                }))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl JsonSchema for ExposureOption {
    fn schema_name() -> Cow<'static, str> {
        "Exposure".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "\"auto\", { ev100 = 9.0 } or { auto_ev = 0.5 }.",
            "type": ["string", "object"],
            "pattern": "^auto$",
            "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
            "properties": {
                "ev100": { "type": "number", "minimum": -20, "maximum": 30 },
                "auto_ev": { "type": "number", "minimum": -10, "maximum": 10 }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Intrinsics, Invalid> {
        toml::from_str::<Pinhole>(text).expect("well-formed").intrinsics()
    }

    #[test]
    fn the_released_apertures_give_the_published_focal_lengths() {
        let k = parse("focal_length_mm = 1.88\naperture_mm = [2.6327803436685087, 1.9573321100745658]").expect("sound");
        assert!((k.fx - 457.01).abs() < 0.005 && (k.fy - 461.04).abs() < 0.005, "{k:?}");
        assert_eq!((k.cx, k.cy), (320.0, 240.0));
        let fov = |size: f64, focal: f64| 2.0 * (size / 2.0 / focal).atan().to_degrees();
        assert!((fov(640.0, k.fx) - 70.0).abs() < 0.1 && (fov(480.0, k.fy) - 55.0).abs() < 0.1);
    }

    #[test]
    fn other_ways() {
        let k = parse("fov_deg = 90.0\nresolution = [200, 100]").expect("sound");
        assert!((k.fx - 100.0).abs() < 1e-9 && k.fx == k.fy);
        let k = parse("k = [[600.0, 0.0, 310.0], [0.0, 610.0, 250.0], [0.0, 0.0, 1.0]]").expect("sound");
        assert_eq!((k.fx, k.fy, k.cx, k.cy), (600.0, 610.0, 310.0, 250.0));
        assert!(parse("fov_deg = 90.0\nfocal_length_mm = 2.0").expect_err("two").message.contains("two ways"));
        assert!(parse("k = [[600.0, 1.0, 310.0], [0.0, 610.0, 250.0], [0.0, 0.0, 1.0]]").is_err());
        assert!(parse("aperture_mm = [0.0, 1.0]").is_err());
    }

    #[test]
    fn exposures_round_trip() {
        for text in ["exposure = \"auto\"", "exposure = { ev100 = 9.0 }", "exposure = { auto_ev = 0.5 }"] {
            let config: Pinhole = toml::from_str(text).expect("well-formed");
            let again: Pinhole = toml::from_str(&toml::to_string(&config).expect("plain data")).expect("well-formed");
            assert_eq!(config.exposure, again.exposure, "{text}");
        }
        assert!(toml::from_str::<Pinhole>("exposure = \"bright\"").is_err());
    }
}
