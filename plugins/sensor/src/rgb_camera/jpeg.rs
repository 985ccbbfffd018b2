//! The round trip through JPEG.

use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::{ExtendedColorType, ImageDecoder};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Cursor;
use syntable_model::dist::Dist;
use syntable_model::error::{Error, Invalid, Result};
use syntable_model::product::{Plane, Value};
use syntable_model::random::Stream;

/// JPEG compression: the picture is encoded and decoded again, baseline, without chroma subsampling. Both ways use
/// integers alone, so that every machine has the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Jpeg {
    /// Quality from 1 to 100, as libjpeg counts it; rounded. Cameras use 85 to 95.
    pub quality: Dist,
}

impl Default for Jpeg {
    fn default() -> Self {
        Self { quality: Dist::Constant(90.0) }
    }
}

impl Jpeg {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.quality.within("jpeg.quality", 1.0, 100.0)
    }

    /// Sends the picture round; tells how.
    pub(super) fn apply(&self, picture: &mut Plane<[u8; 3]>, stream: &Stream) -> Result<Value> {
        let quality = self.quality.draw(&mut stream.child("quality")).round().clamp(1.0, 100.0) as u8;
        let (width, height) = (picture.width(), picture.height());
        let fail = |error: image::ImageError| {
            Error::new(format!("a picture of {width} × {height} pixels cannot go through JPEG: {error}"))
                .help("leave `jpeg` out")
        };
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(&mut file, quality)
            .encode(picture.data().as_flattened(), width, height, ExtendedColorType::Rgb8)
            .map_err(fail)?;
        let bytes = file.len();
        JpegDecoder::new(Cursor::new(file))
            .and_then(|decoder| decoder.read_image(picture.data_mut().as_flattened_mut()))
            .map_err(fail)?;
        Ok(Value::record([("quality", i64::from(quality).into()), ("bytes", (bytes as i64).into())]))
    }
}
