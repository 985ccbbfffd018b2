//! Random options of a recipe: a plain number, or one tagged table.
//!
//! `5`, `{ uniform = [a, b] }`, `{ log_uniform = [a, b] }`, `{ normal = { mean, std, min, max } }`,
//! `{ choice = [..] }`; for whole numbers `{ integers = [a, b] }` with both ends included.

use crate::error::ConfigError;
use crate::random::Stream;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A random number of an option.
#[derive(Debug, Clone, PartialEq)]
pub enum Dist {
    /// Always this value.
    Constant(f64),
    /// Uniform in [low, high).
    Uniform(f64, f64),
    /// Uniform in the logarithm; both bounds above zero.
    LogUniform(f64, f64),
    /// Gaussian, clamped to [min, max].
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation (not variance).
        std: f64,
        /// Draws below are set to this.
        min: f64,
        /// Draws above are set to this.
        max: f64,
    },
    /// One of these, uniformly.
    Choice(Vec<f64>),
}

/// A random whole number of an option.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum IntDist {
    /// Always this value.
    Constant(i64),
    /// Uniform in [low, high], both ends included.
    Integers(i64, i64),
    /// One of these, uniformly.
    Choice(Vec<i64>),
}

impl Dist {
    /// Draws a value.
    pub fn draw(&self, stream: &mut Stream) -> f64 {
        match *self {
            Self::Constant(value) => value,
            Self::Uniform(low, high) => stream.uniform(low, high),
            Self::LogUniform(low, high) => libm::exp(stream.uniform(libm::log(low), libm::log(high))).clamp(low, high),
            Self::Normal { mean, std, min, max } => (mean + std * stream.normal()).clamp(min, max),
            Self::Choice(ref values) => *stream.pick(values).expect("a choice is not empty"),
        }
    }

    /// The smallest and largest value it can give.
    pub fn range(&self) -> (f64, f64) {
        match *self {
            Self::Constant(value) => (value, value),
            Self::Uniform(low, high) | Self::LogUniform(low, high) => (low, high),
            Self::Normal { min, max, .. } => (min, max),
            Self::Choice(ref values) => {
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
            }
        }
    }

    /// Refuses a distribution that can leave [low, high].
    pub fn within(&self, key: &str, low: f64, high: f64) -> Result<(), ConfigError> {
        let (min, max) = self.range();
        if min >= low && max <= high {
            return Ok(());
        }
        let wrong = if min < low { min } else { max };
        Err(ConfigError::new(key, format!("`{key}` can become {wrong}, outside {low} to {high}")))
    }
}

impl IntDist {
    /// Draws a value.
    pub fn draw(&self, stream: &mut Stream) -> i64 {
        match *self {
            Self::Constant(value) => value,
            Self::Integers(low, high) => stream.integer(low, high),
            Self::Choice(ref values) => *stream.pick(values).expect("a choice is not empty"),
        }
    }

    /// The smallest and largest value it can give.
    pub fn range(&self) -> (i64, i64) {
        match *self {
            Self::Constant(value) => (value, value),
            Self::Integers(low, high) => (low, high),
            Self::Choice(ref values) => {
                values.iter().fold((i64::MAX, i64::MIN), |(low, high), &v| (low.min(v), high.max(v)))
            }
        }
    }

    /// Refuses a distribution that can leave [low, high].
    pub fn within(&self, key: &str, low: i64, high: i64) -> Result<(), ConfigError> {
        let (min, max) = self.range();
        if min >= low && max <= high {
            return Ok(());
        }
        let wrong = if min < low { min } else { max };
        Err(ConfigError::new(key, format!("`{key}` can become {wrong}, outside {low} to {high}")))
    }
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Tagged {
    Uniform([f64; 2]),
    LogUniform([f64; 2]),
    Normal {
        mean: f64,
        std: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        min: Option<f64>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max: Option<f64>,
    },
    Choice(Vec<f64>),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum IntTagged {
    Integers([i64; 2]),
    Choice(Vec<i64>),
}

fn bounds<T: PartialOrd + Copy + std::fmt::Debug>(name: &str, [low, high]: [T; 2]) -> Result<(T, T), String> {
    if low <= high {
        Ok((low, high))
    } else {
        Err(format!("`{name} = [{low:?}, {high:?}]` is empty; write the smaller bound first"))
    }
}

impl TryFrom<Tagged> for Dist {
    type Error = String;
    fn try_from(tagged: Tagged) -> Result<Self, String> {
        let dist = match tagged {
            Tagged::Uniform(pair) => bounds("uniform", pair).map(|(a, b)| Self::Uniform(a, b))?,
            Tagged::LogUniform(pair) => {
                let (a, b) = bounds("log_uniform", pair)?;
                if a <= 0.0 {
                    return Err(format!("`log_uniform = [{a:?}, {b:?}]` must have bounds above zero"));
                }
                Self::LogUniform(a, b)
            }
            Tagged::Normal { mean, std, min, max } => {
                let (min, max) = (min.unwrap_or(mean - 4.0 * std), max.unwrap_or(mean + 4.0 * std));
                if std < 0.0 {
                    return Err(format!("`std = {std:?}` is negative"));
                }
                bounds("min, max", [min, max]).map(|(min, max)| Self::Normal { mean, std, min, max })?
            }
            Tagged::Choice(values) if values.is_empty() => return Err("`choice = []` offers nothing".into()),
            Tagged::Choice(values) => Self::Choice(values),
        };
        match dist.range() {
            (low, high) if low.is_finite() && high.is_finite() => Ok(dist),
            _ => Err("a distribution needs finite numbers".into()),
        }
    }
}

impl TryFrom<IntTagged> for IntDist {
    type Error = String;
    fn try_from(tagged: IntTagged) -> Result<Self, String> {
        match tagged {
            IntTagged::Integers(pair) => bounds("integers", pair).map(|(a, b)| Self::Integers(a, b)),
            IntTagged::Choice(values) if values.is_empty() => Err("`choice = []` offers nothing".into()),
            IntTagged::Choice(values) => Ok(Self::Choice(values)),
        }
    }
}

impl Serialize for Dist {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.clone() {
            Self::Constant(value) => serializer.serialize_f64(value),
            Self::Uniform(a, b) => Tagged::Uniform([a, b]).serialize(serializer),
            Self::LogUniform(a, b) => Tagged::LogUniform([a, b]).serialize(serializer),
            Self::Normal { mean, std, min, max } => {
                Tagged::Normal { mean, std, min: Some(min), max: Some(max) }.serialize(serializer)
            }
            Self::Choice(values) => Tagged::Choice(values).serialize(serializer),
        }
    }
}

impl Serialize for IntDist {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.clone() {
            Self::Constant(value) => serializer.serialize_i64(value),
            Self::Integers(a, b) => IntTagged::Integers([a, b]).serialize(serializer),
            Self::Choice(values) => IntTagged::Choice(values).serialize(serializer),
        }
    }
}

struct NumberOrTable<D>(std::marker::PhantomData<D>);

impl<'de> serde::de::Visitor<'de> for NumberOrTable<Dist> {
    type Value = Dist;
    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a number, or a table such as { uniform = [0, 1] }, { log_uniform = [1, 10] }, { normal = { mean = 0, std = 1 } } or { choice = [1, 2] }")
    }
    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Dist, E> {
        if value.is_finite() {
            Ok(Dist::Constant(value))
        } else {
            Err(E::custom(format!("`{value}` is not a finite number")))
        }
    }
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Dist, E> {
        self.visit_f64(value as f64)
    }
    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Dist, E> {
        self.visit_f64(value as f64)
    }
    fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Dist, A::Error> {
        Tagged::deserialize(serde::de::value::MapAccessDeserializer::new(map))?
            .try_into()
            .map_err(serde::de::Error::custom)
    }
}

impl<'de> serde::de::Visitor<'de> for NumberOrTable<IntDist> {
    type Value = IntDist;
    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a whole number, or a table such as { integers = [1, 40] } or { choice = [1, 2, 4] }")
    }
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<IntDist, E> {
        Ok(IntDist::Constant(value))
    }
    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<IntDist, E> {
        i64::try_from(value).map(IntDist::Constant).map_err(E::custom)
    }
    fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<IntDist, A::Error> {
        IntTagged::deserialize(serde::de::value::MapAccessDeserializer::new(map))?
            .try_into()
            .map_err(serde::de::Error::custom)
    }
}

impl<'de> Deserialize<'de> for Dist {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberOrTable::<Dist>(std::marker::PhantomData))
    }
}

impl<'de> Deserialize<'de> for IntDist {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberOrTable::<IntDist>(std::marker::PhantomData))
    }
}

impl JsonSchema for Dist {
    fn schema_name() -> Cow<'static, str> {
        "Dist".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let pair = |description: &str| {
            json_schema!({
                "description": description,
                "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2
            })
        };
        let number = |description: &str| json_schema!({ "description": description, "type": "number" });
        json_schema!({
            "description": "A number, or a distribution to draw it from.",
            "type": ["number", "object"],
            "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
            "properties": {
                "uniform": pair("Uniform between two bounds."),
                "log_uniform": pair("Uniform in the logarithm, between two positive bounds."),
                "normal": {
                    "description": "Normal (Gaussian); values beyond `min` and `max` become these.",
                    "type": "object", "required": ["mean", "std"], "additionalProperties": false,
                    "properties": {
                        "mean": number("Mean of the distribution without limits."),
                        "std": {
                            "description": "Standard deviation of the distribution without limits.",
                            "type": "number", "minimum": 0
                        },
                        "min": number("Smallest value; `mean - 4 * std` if not given."),
                        "max": number("Largest value; `mean + 4 * std` if not given.")
                    }
                },
                "choice": {
                    "description": "One of these, each as likely.",
                    "type": "array", "items": { "type": "number" }, "minItems": 1
                }
            }
        })
    }
}

impl JsonSchema for IntDist {
    fn schema_name() -> Cow<'static, str> {
        "IntDist".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A whole number, or a distribution to draw it from; bounds are included.",
            "type": ["integer", "object"],
            "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
            "properties": {
                "integers": {
                    "description": "Uniform between two bounds, both included.",
                    "type": "array", "items": { "type": "integer" }, "minItems": 2, "maxItems": 2
                },
                "choice": {
                    "description": "One of these, each as likely.",
                    "type": "array", "items": { "type": "integer" }, "minItems": 1
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Options {
        a: Dist,
        n: IntDist,
    }

    fn check(toml: &str, expected: Result<Options, &str>) {
        match (toml::from_str::<Options>(toml), expected) {
            (Ok(got), Ok(want)) => {
                assert_eq!(got, want);
                let text = toml::to_string(&got).expect("serializes");
                assert_eq!(toml::from_str::<Options>(&text).expect("reads back"), want, "{text}");
            }
            (Err(got), Err(want)) => assert!(got.to_string().contains(want), "got {got}\nwant {want}"),
            (got, want) => panic!("got {got:?}\nwant {want:?}"),
        }
    }

    #[test]
    fn numbers_and_tables() {
        use {Dist::*, IntDist::Integers};
        check("a = 2\nn = 3", Ok(Options { a: Constant(2.0), n: IntDist::Constant(3) }));
        check(
            "a = { uniform = [0, 1.5] }\nn = { integers = [1, 40] }",
            Ok(Options { a: Uniform(0.0, 1.5), n: Integers(1, 40) }),
        );
        check(
            "a = { normal = { mean = 1, std = 2, max = 3 } }\nn = { choice = [1, 5] }",
            Ok(Options { a: Normal { mean: 1.0, std: 2.0, min: -7.0, max: 3.0 }, n: IntDist::Choice(vec![1, 5]) }),
        );
    }

    #[test]
    fn wrong_ones_say_why() {
        check("a = { uniform = [2, 1] }\nn = 1", Err("write the smaller bound first"));
        check("a = 1\nn = { integers = [40, 1] }", Err("`integers = [40, 1]` is empty"));
        check("a = { unifrom = [2, 1] }\nn = 1", Err("unifrom"));
        check("a = { log_uniform = [0, 1] }\nn = 1", Err("above zero"));
        check("a = inf\nn = 1", Err("not a finite number"));
        check("a = 1\nn = 1.5", Err("a whole number, or a table"));
    }

    #[test]
    fn draws_stay_in_range() {
        let mut stream = Stream::root(1);
        for dist in [
            Dist::Uniform(-1.0, 2.0),
            Dist::LogUniform(1e-3, 10.0),
            Dist::Normal { mean: 0.0, std: 1.0, min: -0.5, max: 0.5 },
            Dist::Choice(vec![1.0, -4.0]),
        ] {
            let (low, high) = dist.range();
            assert!((0..1000).map(|_| dist.draw(&mut stream)).all(|x| (low..=high).contains(&x)), "{dist:?}");
        }
    }
}
