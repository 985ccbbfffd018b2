//! Image format `plain_ppm`: plain PPM, a text format for RGB images.

use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::{DecodedImage, MAX_SIDE};
use syntable_mesh::limits::Budget;
use syntable_mesh::register_image_format;
use syntable_model::error::{Error, Result};

// The first bytes identify a format. Textures then read it, and folders of images find files by the extension.
register_image_format!(ImageFormat::new(
    "plain PPM",
    &["ppm"],
    |bytes| bytes.starts_with(b"P3"),
    ImageDecoder::Texture(decode)
));

/// Decodes `P3 width height 255`, and three numbers per pixel. A comment begins with `#` and ends with its line.
///
/// # Errors
/// If the file is damaged, or larger than the budget.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    let text = String::from_utf8_lossy(bytes);
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let mut words = lines.flat_map(str::split_ascii_whitespace).skip(1);
    let mut number = || {
        let word = words.next().ok_or_else(|| Error::new("the image ends early"))?;
        word.parse::<u32>().map_err(|_| Error::new(format!("`{word}` is not a whole number")))
    };
    let [width, height, largest] = [number()?, number()?, number()?];
    if largest != 255 {
        return Err(Error::new(format!("its largest value is {largest}, not 255")).help("export it with 8 bits"));
    }
    // Before the pixels are allocated: a header of a few bytes can state a huge image.
    budget.image(width.into(), height.into(), MAX_SIDE)?;
    let mut texels = Vec::new();
    for _ in 0..u64::from(width) * u64::from(height) {
        for channel in [number()?, number()?, number()?] {
            let too_large = || Error::new(format!("a value is {channel}, more than 255"));
            texels.push(u8::try_from(channel).map_err(|_| too_large())?);
        }
        texels.push(255);
    }
    Ok(DecodedImage { width, height, texels, kind: "plain PPM Rgb8".into() })
}
