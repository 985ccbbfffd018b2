//! PNG textures, through the `image` crate.

use super::raster;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::Image;
use syntable_model::error::Result;

/// First bytes of every PNG file.
const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Decodes a file in memory.
pub fn decode(bytes: &[u8]) -> Result<Image> {
    raster::decode("PNG", image::ImageFormat::Png, bytes)
}

syntable_mesh::register_image_format!(
    ImageFormat::new("PNG", &["png"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Texture(decode))
        .with_preference(20)
);
