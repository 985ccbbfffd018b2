//! Pictures: PNG and JPEG, known by their content and never by their name.

use crate::files::root::read_file;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Encoding, Texture, Wrap};

/// Most pixels along one side.
pub const MAX_SIDE: u32 = 16_384;
/// Most pixels of a picture.
pub const MAX_PIXELS: u64 = 128 << 20;

/// An 8-bit RGBA picture, row 0 at the top.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// RGBA, row-major `[height, width, 4]`.
    pub texels: Vec<u8>,
    /// What the file holds: format, channels and depth, such as `PNG Rgb16`.
    pub kind: String,
}

/// Checks a size against the limits, before anything is allocated.
pub fn check_size(width: u64, height: u64) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::new(format!("a picture of {width} x {height} pixels has none")));
    }
    if width > MAX_SIDE.into() || height > MAX_SIDE.into() || width * height > MAX_PIXELS {
        return Err(Error::new(format!(
            "{width} x {height} pixels are more than the limit of {MAX_SIDE} a side and {MAX_PIXELS} in all"
        ))
        .help("shrink the picture"));
    }
    Ok(())
}

impl Picture {
    /// Reads a file. The error names it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::decode(&read_file(path)?).map_err(|error| error.in_file(path))
    }

    /// Decodes PNG or JPEG. Palettes and grey become colour, 16 bits become 8, CMYK becomes RGB as Adobe stores it.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let mut reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| Error::new(error.to_string().to_lowercase()))?;
        let format = match reader.format() {
            Some(ImageFormat::Png) => "PNG",
            Some(ImageFormat::Jpeg) => "JPEG",
            Some(other) => {
                return Err(Error::new(format!("{other:?} pictures are not read")).help("save it as PNG or JPEG"));
            }
            None => return Err(Error::new("not an image").help("pictures are PNG or JPEG")),
        };
        if format == "JPEG" {
            check_jpeg_end(bytes)?;
        }
        let broken = |error: image::ImageError| Error::new(format!("not a sound {format}: {error}"));
        // The sizes are checked below; the decoders check their own buffers against the sum.
        let mut limits = Limits::default();
        limits.max_alloc = Some(MAX_PIXELS * 8 + (1 << 20));
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(broken)?;
        let (width, height) = decoder.dimensions();
        check_size(width.into(), height.into())?;
        let kind = format!("{format} {:?}", decoder.original_color_type());
        let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
        Ok(Self { width, height, texels: image.into_rgba8().into_raw(), kind })
    }

    /// Turns a normal map of the DirectX convention, green downwards, into the OpenGL convention, green upwards.
    pub fn flip_green(&mut self) {
        for texel in self.texels.chunks_exact_mut(4) {
            texel[1] = 255 - texel[1];
        }
    }

    /// Mean of every channel in [0, 1], as stored.
    pub fn mean(&self) -> [f64; 4] {
        let count = f64::from(self.width) * f64::from(self.height) * 255.0;
        let mut sums = [0_u64; 4];
        for texel in self.texels.chunks_exact(4) {
            for (sum, &value) in sums.iter_mut().zip(texel) {
                *sum += u64::from(value);
            }
        }
        sums.map(|sum| sum as f64 / count)
    }

    /// Whether any pixel is not opaque.
    pub fn has_alpha(&self) -> bool {
        self.texels.chunks_exact(4).any(|texel| texel[3] != 255)
    }

    /// The picture as a texture.
    pub fn into_texture(self, encoding: Encoding, wrap: [Wrap; 2]) -> Texture {
        let Self { width, height, texels, .. } = self;
        let digest = Hasher::new("texture")
            .number(width.into())
            .number(height.into())
            .bytes(&[encoding as u8, wrap[0] as u8, wrap[1] as u8])
            .bytes(&texels)
            .finish();
        Texture { width, height, texels, encoding, wrap, digest }
    }
}

/// A JPEG ends with an end-of-image marker after its last scan. The decoder fills a missing rest with grey in silence,
/// so the marker is looked for here. Entropy-coded data cannot hold either marker: there 0xff is followed by 0x00.
fn check_jpeg_end(bytes: &[u8]) -> Result<()> {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    match (last(0xda), last(0xd9)) {
        (None, _) => Err(Error::new("not a sound JPEG: it has no picture data")),
        (Some(scan), Some(end)) if end > scan => Ok(()),
        _ => Err(Error::new(format!("the JPEG is cut short after {} bytes", bytes.len()))),
    }
}
