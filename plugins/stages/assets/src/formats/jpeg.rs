//! JPEG textures, through the `image` crate.

use super::raster;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// First bytes of every JPEG file.
const MAGIC: &[u8] = &[0xff, 0xd8, 0xff];

/// Decodes a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    check_end(bytes)?;
    raster::decode("JPEG", image::ImageFormat::Jpeg, bytes, budget)
}

/// A JPEG ends with an end-of-image marker after its last scan. The decoder silently fills missing data with gray,
/// so the marker is checked here. Entropy-coded data cannot hold either marker: there 0xff is followed by 0x00.
fn check_end(bytes: &[u8]) -> Result<()> {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    match (last(0xda), last(0xd9)) {
        (None, _) => Err(Error::new("not a valid JPEG: the file has no image data")),
        (Some(scan), Some(end)) if end > scan => Ok(()),
        _ => Err(Error::new(format!("the JPEG is cut short after {} bytes", bytes.len()))),
    }
}

syntable_mesh::register_image_format!(
    ImageFormat::new("JPEG", &["jpg", "jpeg"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Texture(decode))
        .with_preference(10)
);
