//! Files of color images. A conversion copies a file instead of encoding its pixels again.

use crate::encode::rgb::{RgbFiles, RgbFormat};
use std::borrow::Cow;
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::{RGB, RGB_FILE};
use syntable_model::product::{Products, Value};
use syntable_model::stage::Input;

/// The product `rgb_file` of a file.
pub fn record(format: RgbFormat, bytes: Vec<u8>) -> Value {
    Value::record([("format", format.name().into()), ("bytes", Value::Bytes(bytes))])
}

/// The input of a writer that copies files.
pub fn input() -> Input {
    Input::of(RGB_FILE).if_stored()
}

/// A file with the color image of a view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbFile<'p> {
    /// Its format.
    pub format: RgbFormat,
    /// Its bytes.
    pub bytes: Cow<'p, [u8]>,
}

impl<'p> RgbFile<'p> {
    /// The file of a view: the file of the dataset if the layout allows its format and `wanted` does not ask for JPEG instead
    /// of it, and otherwise a new file.
    ///
    /// # Errors
    /// If the view has no color image, or the image is too large for the format.
    pub fn of(products: &'p Products, allowed: &[RgbFormat], wanted: RgbFiles) -> Result<Self> {
        let is_kept =
            |format: RgbFormat| allowed.contains(&format) && [RgbFormat::Png, format].contains(&wanted.format);
        if let Some((format, bytes)) = stored(products)?.filter(|(format, _)| is_kept(*format)) {
            return Ok(Self { format, bytes: bytes.into() });
        }
        Ok(Self { format: wanted.format, bytes: wanted.encode(products.get(RGB)?)?.into() })
    }

    /// A path with the extension of the file.
    pub fn named(&self, path: &str) -> String {
        let stem = path.rsplit_once('.').map_or(path, |(stem, _)| stem);
        format!("{stem}.{}", self.format.extension())
    }
}

/// The file of the dataset, if a reader gave it.
///
/// # Errors
/// If the product is no such file.
pub fn stored(products: &Products) -> Result<Option<(RgbFormat, &[u8])>> {
    let Some(file) = products.optional(RGB_FILE)? else { return Ok(None) };
    let wrong = || Error::new(format!("product `{}` is no file with `format` and `bytes`", RGB_FILE.name()));
    let Value::Record(fields) = file else { return Err(wrong()) };
    let (mut format, mut bytes) = (None, None);
    for (name, value) in fields {
        match (name.as_str(), value) {
            ("format", Value::Text(text)) => format = RgbFormat::ALL.into_iter().find(|it| it.name() == text),
            ("bytes", Value::Bytes(content)) => bytes = Some(content.as_slice()),
            _ => {}
        }
    }
    format.zip(bytes).map(Some).ok_or_else(wrong)
}
