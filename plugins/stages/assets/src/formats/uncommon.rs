//! Textures of formats that old tools write: BMP, TGA, TIFF and GIF (its first frame), through the `image` crate.

use super::raster;
use syntable_mesh::format::{ImageDecoder, ImageFormat};

/// Length of a TGA header, bytes.
const TGA_HEADER: usize = 18;

/// Whether bytes begin like a TGA file, which has no signature: a known kind of image and of pixels, and a size.
fn is_tga(bytes: &[u8]) -> bool {
    let Some(header) = bytes.first_chunk::<TGA_HEADER>() else { return false };
    let [_, palette, kind, .., width_low, width_high, height_low, height_high, depth, _] = *header;
    let is_mapped = matches!(kind, 1 | 9);
    let is_kind = is_mapped || matches!(kind, 2 | 3 | 10 | 11);
    let is_depth = matches!(depth, 8 | 15 | 16 | 24 | 32);
    let has_size = [width_low, width_high] != [0; 2] && [height_low, height_high] != [0; 2];
    is_kind && is_depth && has_size && palette == u8::from(is_mapped)
}

/// Declares a format that the `image` crate decodes.
macro_rules! format {
    ($name:literal, $extensions:expr, $format:ident, $matches:expr) => {
        ImageFormat::new(
            $name,
            $extensions,
            $matches,
            ImageDecoder::Texture(|bytes, budget| raster::decode($name, image::ImageFormat::$format, bytes, budget)),
        )
    };
}

syntable_mesh::register_image_format!(
    format!("BMP", &["bmp"], Bmp, |bytes| bytes.starts_with(b"BM")).with_preference(4),
    format!("TIFF", &["tif", "tiff"], Tiff, |bytes| bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*"))
        .with_preference(3),
    format!("GIF", &["gif"], Gif, |bytes| bytes.starts_with(b"GIF8")).with_preference(2),
    // Without a signature, it comes last.
    format!("TGA", &["tga"], Tga, is_tga),
);
