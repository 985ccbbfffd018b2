//! KTX2 textures: Basis Universal (ETC1S, UASTC) and ASTC through `basisu`, and plain 8-bit colors, also with Zstandard.

use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use ktx2::{Format, Header, Reader, SupercompressionScheme};
use ruzstd::StreamingDecoder;
use std::io::Read;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::image::{DecodedImage, MAX_SIDE};
use syntable_mesh::limits::Budget;
use syntable_model::error::{Error, Result};

/// First bytes of every KTX2 file.
const MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";
/// The first ASTC format of Vulkan with 8 bits per channel, and the last.
const ASTC: std::ops::RangeInclusive<u32> = 157..=184;
/// The name of the entry with the directions of rows and columns.
const ORIENTATION: &str = "KTXorientation";

/// Decodes the largest image of a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage> {
    let broken = |what: String| Error::new(format!("not a valid KTX2: {what}"));
    let reader = Reader::new(bytes).map_err(|error| broken(error.to_string()))?;
    let header = reader.header();
    let (width, height) = (header.pixel_width, header.pixel_height);
    if header.pixel_depth > 0 || header.face_count != 1 || header.layer_count > 1 || height == 0 {
        return Err(unsupported("an array, a volume or a cube, not one image"));
    }
    if let Some((_, start)) = reader.key_value_data().find(|(key, _)| *key == ORIENTATION)
        && !start.starts_with(b"rd")
    {
        return Err(unsupported("an image that does not start at its upper left corner"));
    }
    budget.image(width.into(), height.into(), MAX_SIDE)?;
    let pixels = width as usize * height as usize;
    let (texels, kind) = match header.format {
        Some(format) if !ASTC.contains(&format.value()) => {
            let channels = channels(format)?;
            budget.bytes((pixels * channels.len()) as u64)?;
            let packed = reader.levels().next().ok_or_else(|| broken("no image".into()))?.data;
            let plain = unpack(packed, &header, pixels * channels.len())?;
            (expand(&plain, channels), format!("{format:?}"))
        }
        _ => {
            // The library allocates the stated bytes. Blocks of 16 bytes have 4 x 4 pixels or more.
            let most = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4)) * 16;
            let stated = reader.levels().next().map_or(0, |level| level.uncompressed_byte_length);
            if stated > most {
                return Err(broken(format!("{stated} bytes for {width} x {height} pixels")));
            }
            budget.bytes(most)?;
            transcode(bytes)?
        }
    };
    if texels.len() != pixels * 4 {
        return Err(broken(format!("{} bytes for {width} x {height} pixels", texels.len())));
    }
    Ok(DecodedImage { width, height, texels, kind: format!("KTX2 {kind}") })
}

fn unsupported(what: &str) -> Error {
    Error::unsupported(format!("a KTX2 of an unsupported kind: {what}"))
        .help("convert it to PNG: `ktx extract in.ktx2 out.png`, or `gltf-transform ktxdecompress in.glb out.glb`")
}

/// Which byte of a texel each channel of the file goes to.
fn channels(format: Format) -> Result<&'static [usize]> {
    Ok(match format {
        Format::R8_UNORM | Format::R8_SRGB => &[0],
        Format::R8G8_UNORM | Format::R8G8_SRGB => &[0, 1],
        Format::R8G8B8_UNORM | Format::R8G8B8_SRGB => &[0, 1, 2],
        Format::B8G8R8_UNORM | Format::B8G8R8_SRGB => &[2, 1, 0],
        Format::R8G8B8A8_UNORM | Format::R8G8B8A8_SRGB => &[0, 1, 2, 3],
        Format::B8G8R8A8_UNORM | Format::B8G8R8A8_SRGB => &[2, 1, 0, 3],
        other => return Err(unsupported(&format!("{other:?}"))),
    })
}

/// The bytes of an image, which must be as many as wanted.
fn unpack(packed: &[u8], header: &Header, wanted: usize) -> Result<Vec<u8>> {
    let plain = match header.supercompression_scheme {
        None => packed.to_vec(),
        Some(SupercompressionScheme::Zstandard) => {
            let broken = |what: String| Error::new(format!("not a valid KTX2: Zstandard: {what}"));
            let decoder = StreamingDecoder::new(packed).map_err(|error| broken(error.to_string()))?;
            let mut plain = Vec::with_capacity(wanted);
            decoder.take(wanted as u64 + 1).read_to_end(&mut plain).map_err(|error| broken(error.to_string()))?;
            plain
        }
        Some(other) => return Err(unsupported(&format!("{other:?}"))),
    };
    match plain.len() == wanted {
        true => Ok(plain),
        false => Err(Error::new(format!("not a valid KTX2: {} bytes for an image of {wanted}", plain.len()))),
    }
}

/// RGBA texels; missing colors are 0, missing alpha is opaque.
fn expand(plain: &[u8], channels: &[usize]) -> Vec<u8> {
    let texel = |values: &[u8]| {
        let mut texel = [0, 0, 0, 255];
        channels.iter().zip(values).for_each(|(&channel, &value)| texel[channel] = value);
        texel
    };
    plain.chunks_exact(channels.len()).flat_map(texel).collect()
}

fn transcode(bytes: &[u8]) -> Result<(Vec<u8>, String)> {
    let refuse = |error: basisu::Error| match error {
        basisu::Error::InvalidData | basisu::Error::Truncated => {
            Error::new("not a valid KTX2: its blocks are damaged, or of a codec other than ETC1S, UASTC and ASTC")
        }
        other => unsupported(&format!("{other:?}")),
    };
    let transcoder = Transcoder::new(bytes).map_err(refuse)?;
    let source = transcoder.source_format();
    if !matches!(source, SourceFormat::Etc1s | SourceFormat::UastcLdr | SourceFormat::AstcLdr(_)) {
        return Err(unsupported(&format!("{source:?}")));
    }
    let kind = format!("{source:?}");
    Ok((transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(refuse)?, kind))
}

syntable_mesh::register_image_format!(
    ImageFormat::new("KTX2", &["ktx2"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Texture(decode))
        .with_preference(1)
);
