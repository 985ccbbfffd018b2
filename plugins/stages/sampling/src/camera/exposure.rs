//! The exposure option of cameras: `"auto"`, `{ auto = { compensation_ev = 0.5 } }` or `{ ev100 = 9 }`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use syntable_model::scene::Exposure;

/// An [`Exposure`] as recipes write it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposureOption(pub Exposure);

impl Default for ExposureOption {
    fn default() -> Self {
        Self(Exposure::Auto { compensation_ev: 0.0 })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum TaggedExposure {
    Auto(Auto),
    Ev100(f64),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Auto {
    #[serde(default)]
    compensation_ev: f64,
}

impl Serialize for ExposureOption {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Exposure::Auto { compensation_ev: 0.0 } => serializer.serialize_str("auto"),
            Exposure::Auto { compensation_ev } => TaggedExposure::Auto(Auto { compensation_ev }).serialize(serializer),
            Exposure::Fixed { ev100 } => TaggedExposure::Ev100(ev100).serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ExposureOption {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ExposureVisitor)
    }
}

struct ExposureVisitor;

impl<'de> Visitor<'de> for ExposureVisitor {
    type Value = ExposureOption;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"auto\", { auto = { compensation_ev = 0.5 } } or { ev100 = 9.0 }")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<ExposureOption, E> {
        match text {
            "auto" => Ok(ExposureOption::default()),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ExposureOption, A::Error> {
        let tagged = TaggedExposure::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
        Ok(ExposureOption(match tagged {
            TaggedExposure::Auto(Auto { compensation_ev }) => Exposure::Auto { compensation_ev },
            TaggedExposure::Ev100(ev100) => Exposure::Fixed { ev100 },
        }))
    }
}

impl JsonSchema for ExposureOption {
    fn schema_name() -> Cow<'static, str> {
        "Exposure".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let stops = |description: &str| json_schema!({ "description": description, "type": "number", "minimum": -40, "maximum": 40 });
        json_schema!({
            "description": "How luminance maps to image brightness: \"auto\", { auto = { compensation_ev = 0.5 } } or { ev100 = 9.0 }.",
            "oneOf": [
                { "description": "The light meter of `rgb_camera` chooses the exposure.", "type": "string", "enum": ["auto"] },
                {
                    "description": "The options of the light meter, or a fixed exposure value.",
                    "type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
                    "properties": {
                        "auto": {
                            "description": "The light meter of `rgb_camera` chooses the exposure.",
                            "type": "object", "additionalProperties": false,
                            "properties": {
                                "compensation_ev": stops("Stops brighter (positive) or darker than the meter chooses; 0 by default.")
                            }
                        },
                        "ev100": stops("Fixed exposure value at ISO 100: 1.2 · 2^EV100 nits become white.")
                    }
                }
            ]
        })
    }
}
