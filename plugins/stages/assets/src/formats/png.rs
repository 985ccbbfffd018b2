//! PNG textures, through the `image` crate.

use super::raster;
use std::borrow::Cow;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// First bytes of every PNG file.
const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Chunks that the decoder would decompress without any use: a color profile, and texts. A few of their bytes can
/// expand to a gigabyte.
const UNREAD: [&[u8; 4]; 3] = [b"iCCP", b"zTXt", b"iTXt"];

/// Decodes a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    raster::decode("PNG", image::ImageFormat::Png, &readable(bytes)?, budget)
}

/// The file without these chunks before its pixels. Refuses a palette whose length is not a multiple of three (PNG,
/// section 11.2.2), because the decoder panics on it.
fn readable(bytes: &[u8]) -> Result<Cow<'_, [u8]>> {
    let mut rest = bytes.get(MAGIC.len()..).unwrap_or_default();
    // Kept bytes, and the start of the undecided ones.
    let (mut kept, mut from) = (Vec::new(), 0);
    while let Some((head, body)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_be_bytes([a, b, c, d]);
        let start = bytes.len() - rest.len();
        match &kind {
            b"PLTE" if length % 3 != 0 => {
                let message = format!("not a valid PNG: its palette has {length} bytes, not a multiple of three");
                return Err(Error::new(message).help("export the image again, best without a palette"));
            }
            // A palette cannot follow the pixels.
            b"IDAT" => break,
            _ => {}
        }
        // A checksum of four bytes follows.
        rest = body.get(length as usize + 4..).unwrap_or_default();
        if UNREAD.contains(&&kind) {
            kept.extend(&bytes[from..start]);
            from = bytes.len() - rest.len();
        }
    }
    if from == 0 {
        return Ok(Cow::Borrowed(bytes));
    }
    kept.extend(&bytes[from..]);
    Ok(Cow::Owned(kept))
}

syntable_mesh::register_image_format!(
    ImageFormat::new("PNG", &["png"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Texture(decode))
        .with_preference(20)
);

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk with a checksum that is never checked.
    fn chunk(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32).to_be_bytes()[..], kind, body, &[0; 4]].concat()
    }

    #[test]
    fn a_palette_is_of_whole_colors() {
        let header = chunk(b"IHDR", &[0, 0, 0, 1, 0, 0, 0, 1, 8, 3, 0, 0, 0]);
        let file = |palette: usize| [MAGIC, &header, &chunk(b"PLTE", &vec![7; palette]), &chunk(b"IDAT", &[])].concat();
        let error = decode(&file(49), &Budget::default()).expect_err("refused").to_string();
        assert!(error.contains("its palette has 49 bytes, not a multiple of three"), "{error}");
        assert!(readable(&file(48)).is_ok());
        // The decoder handles a truncated chunk, and one longer than the file.
        let whole = file(48);
        assert!((0..whole.len()).all(|end| readable(&whole[..end]).is_ok()));
        assert!(readable(&[MAGIC, b"\xff\xff\xff\xfftEXt"].concat()).is_ok());
    }

    #[test]
    fn profiles_and_texts_are_not_unfolded() {
        let (header, pixels) = (chunk(b"IHDR", &[0; 13]), chunk(b"IDAT", &[1; 9]));
        let plain = [MAGIC, &header, &chunk(b"gAMA", &[7; 4]), &pixels, &chunk(b"zTXt", &[2; 30])].concat();
        assert!(matches!(readable(&plain).expect("sound"), Cow::Borrowed(_)));
        let with = [
            MAGIC,
            &header,
            &chunk(b"iCCP", &[3; 50]),
            &chunk(b"gAMA", &[7; 4]),
            &chunk(b"zTXt", &[]),
            &chunk(b"iTXt", &[3; 5]),
            &pixels,
            &chunk(b"zTXt", &[2; 30]),
        ]
        .concat();
        assert_eq!(readable(&with).expect("sound"), plain);
        // A truncated chunk ends the file.
        let cut = [MAGIC, &header, &chunk(b"iCCP", &[3; 50])[..20]].concat();
        assert_eq!(readable(&cut).expect("sound"), [MAGIC, &header].concat());
    }
}
