//! WebP textures, through the `image` crate: glTF files name them by `EXT_texture_webp`.

use super::raster;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// Decodes a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    // The decoder replaces missing bytes of the last chunk by zeros.
    let stated = bytes.get(4..8).and_then(|size| size.try_into().ok()).map_or(u32::MAX, u32::from_le_bytes);
    if (bytes.len() as u64) < u64::from(stated) + 8 {
        return Err(Error::new(format!("the WebP is cut short after {} bytes", bytes.len())));
    }
    raster::decode("WebP", image::ImageFormat::WebP, bytes, budget)
}

/// A RIFF container of WebP.
fn matches(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")
}

syntable_mesh::register_image_format!(
    ImageFormat::new("WebP", &["webp"], matches, ImageDecoder::Texture(decode)).with_preference(5)
);
