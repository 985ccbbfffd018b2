//! Image and array files that datasets have, read back.

use png::{BitDepth, ColorType, Decoder, Transformations};
use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Most pixels that an image of a dataset may have.
const MAX_PIXELS: u64 = 1 << 28;

/// The samples of a PNG file, and how many a pixel has.
enum Samples {
    Eight(Vec<u8>, usize),
    Sixteen(Vec<u16>, usize),
}

/// How PNG files begin.
const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// How JPEG files begin.
const JPEG: [u8; 3] = [0xff, 0xd8, 0xff];

/// An 8-bit RGB image from a PNG or JPEG file; gray becomes RGB, transparency is dropped.
pub fn rgb(path: &Path) -> Result<Plane<[u8; 3]>> {
    if is_jpeg(path)? {
        return jpeg(path);
    }
    let ([width, height], samples) = read(path)?;
    match samples {
        Samples::Eight(samples, channels) => {
            let color = |pixel: &[u8]| if channels < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
            Ok(Plane::from_vec(width, height, samples.chunks_exact(channels).map(color).collect()))
        }
        Samples::Sixteen(..) => Err(unlike(path, "an 8-bit image", "16-bit")),
    }
}

/// A color image of a file that has a record of its width and height.
pub fn rgb_of_size(path: &Path, size: [u32; 2]) -> Result<Plane<[u8; 3]>> {
    of_size(rgb(path)?, path, size)
}

/// [`depth`] of a file that has a record of its width and height.
pub fn depth_of_size(path: &Path, unit_mm: f64, size: [u32; 2]) -> Result<Plane<f32>> {
    of_size(depth(path, unit_mm)?, path, size)
}

/// Refuses an image whose record says another width and height.
fn of_size<T>(image: Plane<T>, path: &Path, size: [u32; 2]) -> Result<Plane<T>> {
    let found = [image.width(), image.height()];
    if found == size {
        return Ok(image);
    }
    let said = |[width, height]: [u32; 2]| format!("{width} × {height}");
    Err(Error::new(format!("it has {} pixels, its record says {}", said(found), said(size))).in_file(path).permanent())
}

fn is_jpeg(path: &Path) -> Result<bool> {
    Ok(start(path)?.starts_with(&JPEG))
}

/// The first bytes of a file, which must have some.
fn start(path: &Path) -> Result<Vec<u8>> {
    check_file(path)?;
    let mut start = Vec::new();
    let file = File::open(path).map_err(|error| Error::io(path, &error))?;
    file.take(PNG.len() as u64).read_to_end(&mut start).map_err(|error| Error::io(path, &error))?;
    if start.is_empty() {
        return Err(Error::new("the file is empty").in_file(path).permanent());
    }
    Ok(start)
}

fn jpeg(path: &Path) -> Result<Plane<[u8; 3]>> {
    let bytes = fs::read(path).map_err(|error| Error::io(path, &error))?;
    let refuse = |what: String| Error::new(what).in_file(path).permanent();
    // The same pixels on every processor.
    let options = DecoderOptions::new_safe().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes), options);
    let fail = |error| refuse(format!("not a readable JPEG file: {error}"));
    decoder.decode_headers().map_err(fail)?;
    if let Some(turned) = decoder.exif().and_then(|exif| orientation(exif)).filter(|it| *it != 1) {
        return Err(refuse(format!(
            "its EXIF orientation is {turned}: viewers turn the image, its labels may or may not be"
        ))
        .help("turn the pixels and the labels alike, and set the orientation to 1"));
    }
    let [width, height] = decoder.dimensions().map_or([0; 2], |(width, height)| [width as u32, height as u32]);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(refuse(format!("{width} × {height} pixels are too many")));
    }
    let samples = decoder.decode().map_err(fail)?;
    let pixels: Vec<[u8; 3]> = samples.as_chunks().0.to_vec();
    if pixels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(refuse(format!("not a color image of {width} × {height} pixels")));
    }
    Ok(Plane::from_vec(width, height, pixels))
}

/// The tag `Orientation` (0x0112) of the first directory of an EXIF block, from its TIFF header on (Exif 2.32, section 4.6).
fn orientation(exif: &[u8]) -> Option<u16> {
    let is_little = match exif.get(..4)? {
        [b'I', b'I', 42, 0] => true,
        [b'M', b'M', 0, 42] => false,
        _ => return None,
    };
    let number = |at: usize, size: usize| -> Option<u32> {
        let bytes = exif.get(at..at.checked_add(size)?)?;
        let add = |sum: u32, byte: &u8| sum << 8 | u32::from(*byte);
        Some(if is_little { bytes.iter().rev().fold(0, add) } else { bytes.iter().fold(0, add) })
    };
    let directory = number(4, 4)? as usize;
    let entries = (0..number(directory, 2)? as usize).map(|entry| directory + 2 + 12 * entry);
    let mut of_tag = entries.filter(|&at| number(at, 2) == Some(0x0112));
    number(of_tag.next()? + 8, 2).map(|value| value as u16)
}

/// A gray image of 8 or 16 bits from a PNG file.
pub fn gray(path: &Path) -> Result<Plane<u16>> {
    let ([width, height], samples) = read(path)?;
    match samples {
        Samples::Eight(samples, 1) => Ok(Plane::from_vec(width, height, samples.into_iter().map(u16::from).collect())),
        Samples::Sixteen(samples, 1) => Ok(Plane::from_vec(width, height, samples)),
        Samples::Eight(..) | Samples::Sixteen(..) => Err(unlike(path, "a gray image", "colored")),
    }
}

/// Depth in meters from a gray PNG file whose step is `unit_mm`; infinite where it is 0. A depth is the smallest one that
/// is stored as these many steps, whether the writer truncates or rounds.
pub fn depth(path: &Path, unit_mm: f64) -> Result<Plane<f32>> {
    let meters = |&steps: &u16| {
        if steps == 0 {
            return f32::INFINITY;
        }
        let depth = (f64::from(steps) * unit_mm / 1000.0) as f32;
        if f64::from(depth) * 1000.0 / unit_mm < f64::from(steps) { depth.next_up() } else { depth }
    };
    Ok(gray(path)?.map(meters))
}

/// Refuses what is no file: reading a pipe would wait for ever. A file that a dataset names and does not have is a fault of the
/// dataset.
fn check_file(path: &Path) -> Result<()> {
    let there = fs::metadata(path).map_err(|error| {
        let error = Error::io(path, &error);
        if error.is_transient() { error } else { error.of_request() }
    })?;
    if there.is_file() { Ok(()) } else { Err(Error::new("it is not a file").in_file(path).permanent()) }
}

fn unlike(path: &Path, expected: &str, found: &str) -> Error {
    Error::new(format!("not {expected}: it is {found}")).in_file(path).permanent()
}

fn read(path: &Path) -> Result<([u32; 2], Samples)> {
    let fail = |error: png::DecodingError| match error {
        // That a file ends early says something about the file.
        png::DecodingError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            Error::io(path, &error)
        }
        error => Error::new(format!("not a readable PNG file: {error}")).in_file(path).permanent(),
    };
    let start = start(path)?;
    if start.iter().zip(PNG).any(|(byte, own)| *byte != own) {
        let what = if start.starts_with(&JPEG) {
            "it is a JPEG file, and masks and depth need exact numbers"
        } else {
            "it is no PNG file"
        };
        return Err(Error::new(what).in_file(path).help("write the image as a PNG file").permanent());
    }
    let file = File::open(path).map_err(|error| Error::io(path, &error))?;
    let mut decoder = Decoder::new(BufReader::new(file));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(fail)?;
    let size = [reader.info().width, reader.info().height];
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let length = reader.output_buffer_size().filter(|_| pixels <= MAX_PIXELS);
    let too_large = || Error::new(format!("{} × {} pixels are too many", size[0], size[1])).in_file(path).permanent();
    let mut buffer = vec![0; length.ok_or_else(too_large)?];
    let info = reader.next_frame(&mut buffer).map_err(fail)?;
    buffer.truncate(info.buffer_size());
    let channels = match info.color_type {
        ColorType::Grayscale | ColorType::Indexed => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
    };
    Ok((
        size,
        match info.bit_depth {
            BitDepth::Sixteen => {
                let samples = buffer.chunks_exact(2).map(|bytes| u16::from_be_bytes([bytes[0], bytes[1]])).collect();
                Samples::Sixteen(samples, channels)
            }
            _ => Samples::Eight(buffer, channels),
        },
    ))
}

/// A square matrix from a NumPy file of format 1.0 with little-endian 64-bit floats in rows, as SynTable writes occlusion
/// orders: its edge, and its entries row by row.
pub fn square_npy(path: &Path) -> Result<(usize, Vec<f64>)> {
    check_file(path)?;
    let bytes = fs::read(path).map_err(|error| Error::io(path, &error))?;
    let refuse = |what: &str| {
        Error::new(format!("not a square matrix of float64 as NumPy writes it: {what}")).in_file(path).permanent()
    };
    let header = bytes.strip_prefix(b"\x93NUMPY\x01\x00").ok_or_else(|| refuse("the file starts otherwise"))?;
    let length = header.get(..2).map(|two| usize::from(u16::from_le_bytes([two[0], two[1]])));
    let text = length.and_then(|length| header.get(2..2 + length)).and_then(|text| std::str::from_utf8(text).ok());
    let text = text.ok_or_else(|| refuse("its header is cut off"))?;
    if !text.contains("'<f8'") || !text.contains("'fortran_order': False") {
        return Err(refuse(text.trim()));
    }
    let shape = text.split_once("'shape': (").and_then(|(_, rest)| rest.split_once(')')).map_or("", |(shape, _)| shape);
    let edges: Vec<usize> = shape.split(',').filter_map(|edge| edge.trim().parse().ok()).collect();
    let data = &header[2 + text.len()..];
    match edges.as_slice() {
        &[rows, columns]
            if rows == columns
                && rows.checked_mul(rows).and_then(|entries| entries.checked_mul(8)) == Some(data.len()) =>
        {
            let entry = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().expect("eight bytes"));
            Ok((rows, data.chunks_exact(8).map(entry).collect()))
        }
        _ => Err(refuse(&format!("its shape is ({shape}), and {} bytes follow", data.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_images_are_called_so() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        for (bytes, says) in
            [(&b""[..], "the file is empty"), (b"hi", "it is no PNG file"), (&PNG[..], "not a readable PNG file")]
        {
            fs::write(&path, bytes).expect("written");
            for error in [rgb(&path).err(), gray(&path).err(), depth(&path, 1.0).err()] {
                let error = error.expect("no image").to_string();
                assert!(error.contains(says) && error.contains("a.png"), "{error}");
            }
        }
        fs::write(&path, JPEG).expect("written");
        let error = gray(&path).expect_err("no PNG").to_string();
        assert!(error.contains("it is a JPEG file") && error.contains("write the image as a PNG"), "{error}");
    }

    #[test]
    fn the_orientation_is_that_of_the_first_directory() {
        // Two entries: the image's width (0x0100), then the orientation.
        let little = b"II*\0\x08\0\0\0\x02\0\0\x01\x03\0\x01\0\0\0\x40\0\0\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0";
        let big = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0";
        assert_eq!((orientation(little), orientation(big)), (Some(6), Some(3)));
        for end in 0..little.len() {
            assert!(orientation(&little[..end]).is_none_or(|it| it == 6), "{end} bytes");
        }
        assert_eq!((orientation(b""), orientation(b"II*\0\xff\xff\xff\xff")), (None, None));
    }
}
