//! JPEG compression artifacts.

use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::{ExtendedColorType, ImageDecoder};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Cursor;
use syntable_model::dist::Dist;
use syntable_model::error::{ConfigError, Error, Result};
use syntable_model::product::{Plane, Value};
use syntable_model::random::Stream;

/// JPEG compression: the image is encoded and decoded again, baseline, without chroma subsampling. Both directions use
/// integer arithmetic only, so every machine produces the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Jpeg {
    /// Quality on the scale of libjpeg, from 1 to 100, rounded. Cameras use 85 to 95.
    #[schemars(extend("minimum" = QUALITY[0], "maximum" = QUALITY[1]))]
    pub quality: Dist,
}

/// Limits of `quality`.
const QUALITY: [f64; 2] = [1.0, 100.0];

impl Default for Jpeg {
    fn default() -> Self {
        Self { quality: Dist::Constant(90.0) }
    }
}

impl Jpeg {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.quality.within("jpeg.quality", QUALITY[0], QUALITY[1])
    }

    /// Compresses and decompresses the image. Returns the quality and the size of the file.
    pub(super) fn apply(&self, image: &mut Plane<[u8; 3]>, stream: &Stream) -> Result<Value> {
        let quality = self.quality.draw(&mut stream.child("quality")).round().clamp(QUALITY[0], QUALITY[1]) as u8;
        let (width, height) = (image.width(), image.height());
        let fail = |error: image::ImageError| {
            Error::new(format!("an image of {width} × {height} pixels cannot be encoded as JPEG: {error}"))
                .help("leave `jpeg` out")
        };
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(&mut file, quality)
            .encode(image.data().as_flattened(), width, height, ExtendedColorType::Rgb8)
            .map_err(fail)?;
        let bytes = file.len();
        JpegDecoder::new(Cursor::new(file))
            .and_then(|decoder| decoder.read_image(image.data_mut().as_flattened_mut()))
            .map_err(fail)?;
        Ok(Value::record([("quality", i64::from(quality).into()), ("bytes", (bytes as i64).into())]))
    }
}
