//! PNG textures, through the `image` crate.

use super::raster;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::Image;
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// First bytes of every PNG file.
const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Decodes a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<Image> {
    check_palette(bytes)?;
    raster::decode("PNG", image::ImageFormat::Png, bytes, budget)
}

/// Refuses a palette whose length is not a multiple of three (PNG, section 11.2.2): the decoder panics on it.
fn check_palette(bytes: &[u8]) -> Result<()> {
    let mut rest = bytes.get(MAGIC.len()..).unwrap_or_default();
    while let Some((head, body)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_be_bytes([a, b, c, d]);
        match &kind {
            b"PLTE" if length % 3 != 0 => {
                let message = format!("not a sound PNG: its palette has {length} bytes, not a multiple of three");
                return Err(Error::new(message).help("export the image again, best without a palette"));
            }
            // No palette comes after the pixels.
            b"IDAT" => return Ok(()),
            // A checksum of four bytes follows.
            _ => rest = body.get(length as usize + 4..).unwrap_or_default(),
        }
    }
    Ok(())
}

syntable_mesh::register_image_format!(
    ImageFormat::new("PNG", &["png"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Texture(decode))
        .with_preference(20)
);

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk with a checksum that nobody looks at.
    fn chunk(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32).to_be_bytes()[..], kind, body, &[0; 4]].concat()
    }

    #[test]
    fn a_palette_is_of_whole_colors() {
        let header = chunk(b"IHDR", &[0, 0, 0, 1, 0, 0, 0, 1, 8, 3, 0, 0, 0]);
        let file = |palette: usize| [MAGIC, &header, &chunk(b"PLTE", &vec![7; palette]), &chunk(b"IDAT", &[])].concat();
        let error = decode(&file(49), &Budget::default()).expect_err("refused").to_string();
        assert!(error.contains("its palette has 49 bytes, not a multiple of three"), "{error}");
        assert!(check_palette(&file(48)).is_ok());
        // What is cut short, or longer than the file, is left to the decoder.
        let whole = file(48);
        assert!((0..whole.len()).all(|end| check_palette(&whole[..end]).is_ok()));
        assert!(check_palette(&[MAGIC, b"\xff\xff\xff\xfftEXt"].concat()).is_ok());
    }
}
