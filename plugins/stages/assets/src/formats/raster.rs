//! Decoding of 8-bit textures with the `image` crate.

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use syntable_mesh::image::{DecodedImage, MAX_SIDE};
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// Decodes an image to RGBA. Palettes and gray become color, 16 bits become 8, CMYK becomes RGB as Adobe stores it.
pub(super) fn decode(name: &str, format: ImageFormat, bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    let broken = |error: ImageError| match error {
        ImageError::Unsupported(_) => Error::unsupported(format!("a {name} of an unsupported kind: {error}"))
            .help("save the image as PNG, with 8 bits per channel"),
        error => Error::new(format!("not a valid {name}: {error}")),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The size is checked below; the decoders check their own buffers against this limit.
    let mut limits = Limits::default();
    limits.max_alloc = Some(budget.image_bytes().saturating_add(1 << 20));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    budget.image(width.into(), height.into(), MAX_SIDE)?;
    let kind = format!("{name} {:?}", decoder.original_color_type());
    let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok(DecodedImage { width, height, texels: image.into_rgba8().into_raw(), kind })
}
