//! The development of an image, read back from its record.

use super::developer::Developer;
use super::tone::Tone;
use syntable_model::error::{Error, Result};
use syntable_model::product::Value;
use syntable_model::product::standard::EXPOSURE;

/// Conversion of the radiance of an image into codes: the part of [`EXPOSURE`] that is the same for every pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Development {
    tone: Tone,
    white_nits: f64,
    gains: [f32; 3],
}

impl Development {
    /// The development in a record of [`EXPOSURE`].
    ///
    /// # Errors
    /// If the record has no white or no tone, because another sensor wrote it; permanent.
    pub fn recorded(exposure: &Value) -> Result<Self> {
        let text = |value: &Value| match value {
            Value::Text(name) => Tone::named(name),
            _ => None,
        };
        let tone = field(exposure, "tone").and_then(text).ok_or_else(|| unknown("tone"))?;
        let white_nits = field(exposure, "white_nits").and_then(number).ok_or_else(|| unknown("white_nits"))?;
        let gains = match field(exposure, "white_balance") {
            None => [1.0; 3],
            Some(balance) => field(balance, "gains_rgb").and_then(three).ok_or_else(|| unknown("white_balance"))?,
        };
        Ok(Self { tone, white_nits, gains })
    }

    /// A developer that treats other pixels like the image's.
    pub fn developer(&self) -> Developer {
        Developer::new(self.tone, self.white_nits, self.gains)
    }
}

fn unknown(field: &str) -> Error {
    Error::new(format!("`{}` does not tell `{field}` as the sensor `rgb_camera` does", EXPOSURE.name()))
        .help("let rgb_camera make the image, or leave out the products that depend on it")
}

fn field<'a>(record: &'a Value, name: &str) -> Option<&'a Value> {
    match record {
        Value::Record(fields) => fields.iter().find(|(field, _)| field == name).map(|(_, value)| value),
        _ => None,
    }
}

fn number(value: &Value) -> Option<f64> {
    match *value {
        Value::Float(number) => Some(number),
        _ => None,
    }
}

fn three(value: &Value) -> Option<[f32; 3]> {
    match value {
        Value::List(values) => {
            let numbers: Vec<f32> = values.iter().filter_map(number).map(|gain| gain as f32).collect();
            numbers.try_into().ok()
        }
        _ => None,
    }
}
