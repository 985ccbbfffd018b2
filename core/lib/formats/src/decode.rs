//! Reads the image and array files of datasets.

use crate::encode::npy;
use crate::encode::rgb::RgbFormat;
use crate::image_file;
use crate::json;
use crate::orientation::turned;
use png::{BitDepth, ColorType, Decoder, Transformations};
use std::fs;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::files::replacement;
use syntable_model::limits::{IMAGE_BYTES, IMAGE_PIXELS, JSON_VALUES, Limit, MEMBER_BYTES, TEXT_BYTES};
use syntable_model::mirror::DatasetFile;
use syntable_model::panics::guarded;
use syntable_model::product::standard::{RGB, RGB_FILE};
use syntable_model::product::{DType, KeyId, Plane, Products, Tensor, Value};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The samples of a PNG file, and the number of samples per pixel.
enum DecodedSamples {
    Eight(Vec<u8>, usize),
    Sixteen(Vec<u16>, usize),
}

/// The samples of a PNG file with a palette.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PaletteUse {
    /// The colors.
    Colors,
    /// The places of the colors in the palette.
    Places,
}

/// First bytes of PNG files.
const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// First bytes of JPEG files.
const JPEG: [u8; 3] = [0xff, 0xd8, 0xff];
/// Names of the libraries in errors.
const PNG_LIBRARY: &str = "the library that decodes PNG";
const JPEG_LIBRARY: &str = "the library that decodes JPEG";

/// The content of a NumPy file.
#[derive(Debug, Clone)]
pub enum NpyArray {
    /// Numbers.
    Numbers(Tensor),
    /// Texts, and the lengths of the axes.
    Texts(Vec<String>, Vec<usize>),
}

/// The bytes of a file, or of a member of an archive.
#[derive(Debug, Clone)]
pub struct FileContent {
    bytes: Vec<u8>,
    /// Path for messages.
    path: PathBuf,
    /// Width and height of the image, if the dataset states them.
    stated: Option<[u32; 2]>,
}

/// An 8-bit RGB image from a PNG or JPEG file; gray becomes RGB, transparency is dropped.
pub fn rgb(path: &Path) -> Result<Plane<[u8; 3]>> {
    FileContent::read(path)?.rgb()
}

/// A gray image of 8 or 16 bits from a PNG file.
pub fn gray(path: &Path) -> Result<Plane<u16>> {
    FileContent::read(path)?.gray()
}

/// A color image from a file whose width and height are recorded elsewhere.
pub fn rgb_of_size(path: &Path, size: [u32; 2]) -> Result<Plane<[u8; 3]>> {
    FileContent::read(path)?.stated(size).rgb()
}

/// Depth from a file whose width and height are recorded elsewhere.
pub fn depth_of_size(path: &Path, unit_mm: f64, size: [u32; 2]) -> Result<Plane<f32>> {
    FileContent::read(path)?.stated(size).depth(unit_mm)
}

/// [`gray`] of a file whose width and height are recorded elsewhere.
pub fn gray_of_size(path: &Path, size: [u32; 2]) -> Result<Plane<u16>> {
    FileContent::read(path)?.stated(size).gray()
}

/// Opens a file. Refuses paths that are not files, because reading a pipe would block forever. If a dataset lacks a
/// file that it names, the error is a fault of the dataset.
pub fn open(path: &Path) -> Result<DatasetFile> {
    let there = fs::metadata(path).map_err(|error| {
        let error = Error::io(path, &error);
        if error.is_transient() { error } else { error.of_request() }
    })?;
    if !there.is_file() {
        return Err(Error::new("it is not a file").in_file(path));
    }
    DatasetFile::open(path).map_err(|error| Error::io(path, &error))
}

/// Reads a file from its beginning. Refuses a file larger than the limit, without reading it.
pub fn read_at_most(file: DatasetFile, limit: &Limit, path: &Path) -> Result<Vec<u8>> {
    let fail = |error: std::io::Error| Error::io(path, &error);
    let length = file.size().map_err(fail)?;
    limit.check(length).map_err(|error| error.in_file(path))?;
    let mut bytes = Vec::with_capacity(length as usize);
    // The file may grow meanwhile.
    file.take(limit.most).read_to_end(&mut bytes).map_err(fail)?;
    replacement(&bytes).map_or(Ok(bytes), |error| Err(error.in_file(path)))
}

/// Reads a text file of at most [`TEXT_BYTES`]; see [`open`].
pub fn text(path: &Path) -> Result<String> {
    let bytes = read_at_most(open(path)?, &TEXT_BYTES, path)?;
    String::from_utf8(bytes).map_err(|_| Error::new("it is not UTF-8 text").in_file(path))
}

/// Refuses JSON that is too long, or has too many values, for parsing into a tree.
pub fn check_json(text: &[u8]) -> Result<()> {
    TEXT_BYTES.check(text.len() as u64)?;
    // Every value except the first of a list or an object follows a comma.
    if text.len() as u64 / 2 > JSON_VALUES.most {
        JSON_VALUES.check(json::values(text))?;
    }
    Ok(())
}

impl FileContent {
    /// Wraps bytes; `path` names them in messages.
    pub fn new(bytes: Vec<u8>, path: PathBuf) -> Self {
        Self { bytes, path, stated: None }
    }

    /// Reads a file of at most [`MEMBER_BYTES`]; see [`open`].
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_at_most(open(path)?, &MEMBER_BYTES, path)?;
        Ok(Self::new(bytes, path.to_owned()))
    }

    /// Sets the width and height of the image. An image of another size is refused before it is decoded.
    pub fn stated(self, size: [u32; 2]) -> Self {
        Self { stated: Some(size), ..self }
    }

    /// Refuses an image by its header if its size differs from the stated size, or exceeds the limits.
    fn check_header(&self, size: [u32; 2], bytes: Option<u64>) -> Result<()> {
        let said = |[width, height]: [u32; 2]| format!("{width} × {height}");
        if let Some(stated) = self.stated.filter(|stated| *stated != size) {
            return Err(self.refuse(format!("it has {} pixels, its record says {}", said(size), said(stated))));
        }
        let of_file = |error: Error| error.in_file(&self.path);
        IMAGE_PIXELS.check_size(size).map_err(of_file)?;
        IMAGE_BYTES.check(bytes.unwrap_or(u64::MAX)).map_err(of_file)
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Decodes it with a library that may panic; see [`guarded`].
    pub fn guarded<T>(&self, library: &str, decode: impl FnOnce() -> Result<T>) -> Result<T> {
        guarded(library, &self.path, decode)
    }

    /// An error of its content, with its path.
    pub fn located(&self, error: Error) -> Error {
        error.in_file(&self.path)
    }

    /// An error with its path.
    pub fn refuse(&self, what: impl Into<String>) -> Error {
        Error::new(what).in_file(&self.path)
    }

    /// Width and height of a PNG or JPEG file, px, from its header.
    pub fn size(&self) -> Result<[u32; 2]> {
        let size = guarded("the reader of the header", &self.path, || {
            if self.bytes.starts_with(&JPEG) {
                let mut decoder = JpegDecoder::new(ZCursor::new(&self.bytes));
                let fail = |error| self.refuse(format!("not a readable JPEG file: {error}"));
                decoder.decode_headers().map_err(fail)?;
                return Ok(decoder.dimensions().map_or([0; 2], |(width, height)| [width as u32, height as u32]));
            }
            let fail = |error: png::DecodingError| self.refuse(format!("not a readable PNG file: {error}"));
            let header = Decoder::new(Cursor::new(&self.bytes));
            let reader = header.read_info().map_err(fail)?;
            let info = reader.info();
            Ok([info.width, info.height])
        })?;
        self.check_header(size, Some(0))?;
        Ok(size)
    }

    /// A photograph from a PNG or JPEG file, turned upright by its EXIF orientation; otherwise as [`rgb`](Self::rgb).
    pub fn upright(&self) -> Result<Plane<[u8; 3]>> {
        if self.bytes.starts_with(&JPEG) {
            let (image, orientation) = guarded(JPEG_LIBRARY, &self.path, || self.decode_jpeg())?;
            return Ok(turned(image, orientation));
        }
        if !self.bytes.is_empty() && !self.bytes.starts_with(&PNG) {
            return Err(self.refuse("it is neither a JPEG nor a PNG file"));
        }
        let exif = png_chunks(&self.bytes).find(|(name, _)| *name == b"eXIf");
        Ok(turned(self.rgb()?, exif.and_then(|(_, exif)| orientation(exif)).unwrap_or(1)))
    }

    /// An 8-bit RGB image from a PNG or JPEG file; gray becomes RGB, transparency is dropped. Refuses an EXIF orientation, because
    /// the labels of the image may or may not be turned with it.
    pub fn rgb(&self) -> Result<Plane<[u8; 3]>> {
        if self.bytes.starts_with(&JPEG) {
            return self.jpeg();
        }
        let ([width, height], samples) = self.png()?;
        match samples {
            DecodedSamples::Eight(samples, 3) => Ok(Plane::from_vec(width, height, samples.as_chunks().0.to_vec())),
            DecodedSamples::Eight(samples, channels) => {
                let color = |pixel: &[u8]| if channels < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
                Ok(Plane::from_vec(width, height, samples.chunks_exact(channels).map(color).collect()))
            }
            DecodedSamples::Sixteen(..) => Err(self.unlike("an 8-bit image", "16-bit")),
        }
    }

    /// Puts the products `rgb` and `rgb_file`, if they are wanted. Returns width and height. The pixels are always decoded, because
    /// a JPEG file has no checksum: otherwise a conversion would copy damaged files.
    pub fn put_rgb(self, wants: &[KeyId], products: &mut Products) -> Result<[u32; 2]> {
        let rgb = self.rgb()?;
        let size = [rgb.width(), rgb.height()];
        if wants.contains(&RGB.id()) {
            products.put(RGB, rgb)?;
        }
        if let Some(format) = self.plain_format().filter(|_| wants.contains(&RGB_FILE.id())) {
            products.put(RGB_FILE, image_file::record(format, self.bytes))?;
        }
        Ok(size)
    }

    /// The format of a readable color image, if all programs show the same 8-bit RGB pixels: its file has no palette, transparency,
    /// orientation, or gray samples.
    fn plain_format(&self) -> Option<RgbFormat> {
        if self.bytes.starts_with(&JPEG) {
            // `rgb` refuses an orientation.
            return (jpeg_components(&self.bytes) == Some(3)).then_some(RgbFormat::Jpeg);
        }
        let has = |name: &[u8; 4]| png_chunks(&self.bytes).any(|(chunk, _)| chunk == name);
        let is_rgb8 = self.bytes.get(24..26) == Some(&[8, 2]);
        (is_rgb8 && !has(b"tRNS") && !has(b"eXIf")).then_some(RgbFormat::Png)
    }

    /// A gray image of 8 or 16 bits from a PNG file.
    pub fn gray(&self) -> Result<Plane<u16>> {
        self.of_labels(self.png()?)
    }

    fn of_labels(&self, ([width, height], samples): ([u32; 2], DecodedSamples)) -> Result<Plane<u16>> {
        match samples {
            DecodedSamples::Eight(samples, 1) => {
                Ok(Plane::from_vec(width, height, samples.into_iter().map(u16::from).collect()))
            }
            DecodedSamples::Sixteen(samples, 1) => Ok(Plane::from_vec(width, height, samples)),
            DecodedSamples::Eight(..) | DecodedSamples::Sixteen(..) => Err(self.unlike("a gray image", "colored")),
        }
    }

    /// Labels from a PNG file: a gray image of 8 or 16 bits, or the places of colors in a palette.
    pub fn labels(&self) -> Result<Plane<u16>> {
        self.of_labels(guarded(PNG_LIBRARY, &self.path, || self.decode_png(PaletteUse::Places))?)
    }

    /// Depth in meters from a gray PNG file whose step is `unit_mm`; infinite where it is 0. A depth is the smallest
    /// depth that is stored as this number of steps, whether the writer truncates or rounds.
    pub fn depth(&self, unit_mm: f64) -> Result<Plane<f32>> {
        let meters = |steps: u16| {
            let depth = (f64::from(steps) * unit_mm / 1000.0) as f32;
            if f64::from(depth) * 1000.0 / unit_mm < f64::from(steps) { depth.next_up() } else { depth }
        };
        // Many pixels have the same number of steps, and two divisions cost more than a look into a table.
        let mut known = vec![f32::NAN; 1 << 16];
        known[0] = f32::INFINITY;
        Ok(self.gray()?.map(|&steps| {
            let depth = &mut known[usize::from(steps)];
            if depth.is_nan() {
                *depth = meters(steps);
            }
            *depth
        }))
    }

    fn unlike(&self, expected: &str, found: &str) -> Error {
        self.refuse(format!("not {expected}: it is {found}"))
    }

    fn jpeg(&self) -> Result<Plane<[u8; 3]>> {
        let (image, orientation) = guarded(JPEG_LIBRARY, &self.path, || self.decode_jpeg())?;
        if orientation == 1 {
            return Ok(image);
        }
        let message =
            format!("its EXIF orientation is {orientation}: viewers turn the image, its labels may or may not be");
        Err(self.refuse(message).help("turn the pixels and the labels alike, and set the orientation to 1"))
    }

    /// The image as it is in the file, and its EXIF orientation, 1 by default.
    fn decode_jpeg(&self) -> Result<(Plane<[u8; 3]>, u16)> {
        // The same pixels on every processor.
        let options = DecoderOptions::new_safe().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&self.bytes), options);
        let fail = |error| self.refuse(format!("not a readable JPEG file: {error}"));
        decoder.decode_headers().map_err(fail)?;
        let orientation = decoder.exif().and_then(|exif| orientation(exif)).unwrap_or(1);
        let [width, height] = decoder.dimensions().map_or([0; 2], |(width, height)| [width as u32, height as u32]);
        self.check_header([width, height], Some(3 * u64::from(width) * u64::from(height)))?;
        let samples = decoder.decode().map_err(fail)?;
        let pixels: Vec<[u8; 3]> = samples.as_chunks().0.to_vec();
        drop(samples);
        if pixels.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(self.refuse(format!("not a color image of {width} × {height} pixels")));
        }
        Ok((Plane::from_vec(width, height, pixels), orientation))
    }

    fn png(&self) -> Result<([u32; 2], DecodedSamples)> {
        guarded(PNG_LIBRARY, &self.path, || self.decode_png(PaletteUse::Colors))
    }

    fn decode_png(&self, palette: PaletteUse) -> Result<([u32; 2], DecodedSamples)> {
        let fail = |error: png::DecodingError| self.refuse(format!("not a readable PNG file: {error}"));
        if self.bytes.is_empty() {
            return Err(self.refuse("the file is empty"));
        }
        if self.bytes.iter().zip(PNG).any(|(byte, own)| *byte != own) {
            let what = if self.bytes.starts_with(&JPEG) {
                "it is a JPEG file, and masks and depth need exact numbers"
            } else {
                "it is no PNG file"
            };
            return Err(self.refuse(what).help("write the image as a PNG file"));
        }
        let mut decoder = Decoder::new(Cursor::new(&self.bytes));
        decoder.set_transformations(Transformations::EXPAND);
        // No reader uses these chunks, and they can decompress to very large sizes.
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let header = decoder.read_header_info().map_err(fail)?;
        let size = [header.width, header.height];
        // The transparency of a palette, which is only known later, at most doubles the size from the header.
        self.check_header(size, Some(0))?;
        let has_places = palette == PaletteUse::Places && header.color_type == ColorType::Indexed;
        if has_places {
            decoder.set_transformations(Transformations::IDENTITY);
        }
        let mut reader = decoder.read_info().map_err(fail)?;
        let length = reader.output_buffer_size();
        self.check_header(size, length.map(|length| length as u64))?;
        let mut buffer = vec![0; length.unwrap_or_default()];
        let info = reader.next_frame(&mut buffer).map_err(fail)?;
        buffer.truncate(info.buffer_size());
        let channels = match info.color_type {
            ColorType::Grayscale | ColorType::Indexed => 1,
            ColorType::GrayscaleAlpha => 2,
            ColorType::Rgb => 3,
            ColorType::Rgba => 4,
        };
        let samples = match info.bit_depth {
            BitDepth::Sixteen => {
                let samples = buffer.as_chunks().0.iter().map(|bytes| u16::from_be_bytes(*bytes)).collect();
                DecodedSamples::Sixteen(samples, channels)
            }
            bits if has_places => DecodedSamples::Eight(unpacked(&buffer, bits as usize, size), channels),
            _ => DecodedSamples::Eight(buffer, channels),
        };
        Ok((size, samples))
    }

    /// An image of integers from a PNG file, with an axis of channels if it is colored.
    pub fn image(&self) -> Result<Tensor> {
        let ([width, height], samples) = self.png()?;
        let (dtype, channels, bytes) = match samples {
            DecodedSamples::Eight(samples, channels) => (DType::U8, channels, samples),
            DecodedSamples::Sixteen(samples, channels) => {
                (DType::U16, channels, samples.into_iter().flat_map(u16::to_le_bytes).collect())
            }
        };
        let size = [height as usize, width as usize];
        Ok(match channels {
            1 => Tensor::new(dtype, &["y", "x"], size.to_vec(), bytes),
            channels => Tensor::new(dtype, &["y", "x", "channel"], vec![size[0], size[1], channels], bytes),
        })
    }

    /// JSON as a value: objects are records, in the order of the file.
    pub fn json(&self) -> Result<Value> {
        check_json(&self.bytes).map_err(|error| error.in_file(&self.path))?;
        let json: serde_json::Value = serde_json::from_slice(&self.bytes)
            .map_err(|error| json::located(&error, None, &[]).in_file(&self.path))?;
        Value::of(&json)
    }

    /// The array of a NumPy file with little-endian numbers in rows.
    pub fn npy(&self) -> Result<Tensor> {
        match self.npy_array()? {
            NpyArray::Numbers(tensor) => Ok(tensor),
            NpyArray::Texts(..) => Err(self.refuse("not a NumPy file of numbers: its values are texts".to_owned())),
        }
    }

    /// An array of numbers or texts from a NumPy file.
    pub fn npy_array(&self) -> Result<NpyArray> {
        let refuse = |what: &str| self.refuse(format!("not a NumPy file that can be read: {what}"));
        let rest = self.bytes.strip_prefix(b"\x93NUMPY").ok_or_else(|| refuse("the file starts otherwise"))?;
        let cut = || refuse("its header is cut off");
        // From format 2 on, the length of the header has four bytes.
        let (major, rest) = (*rest.first().ok_or_else(cut)?, rest.get(2..).ok_or_else(cut)?);
        let width = if major == 1 { 2 } else { 4 };
        let (length, rest) = rest.split_at_checked(width).ok_or_else(cut)?;
        let length = length.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte));
        let (header, data) = rest.split_at_checked(length).ok_or_else(cut)?;
        let header = std::str::from_utf8(header).map_err(|_| cut())?.trim();
        let value = |key: &str| header.split_once(key).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
        let descr = value("'descr'").and_then(|rest| rest.strip_prefix('\'')?.split_once('\''));
        let descr = descr.map_or("", |(descr, _)| descr);
        let letters: Option<usize> = descr.strip_prefix(npy::TEXT).and_then(|length| length.parse().ok());
        let dtype = npy::dtype(descr);
        if dtype.is_none() && letters.is_none() {
            let what = format!("it has no numbers or texts of a type that is read, little-endian: {header}");
            return Err(
                refuse(&what).help("write it again, for instance with `np.ascontiguousarray(a).astype(\"<f4\")`")
            );
        }
        if value("'fortran_order'").is_none_or(|rest| !rest.starts_with("False")) {
            return Err(refuse(&format!("it is in Fortran order: {header}")).help("save `np.ascontiguousarray(a)`"));
        }
        let shape = value("'shape'").and_then(|rest| rest.strip_prefix('(')?.split_once(')'));
        let lengths = shape.map(|(shape, _)| shape.split(',').map(str::trim).filter(|length| !length.is_empty()));
        let lengths = lengths.and_then(|lengths| lengths.map(|length| length.parse().ok()).collect::<Option<Vec<_>>>());
        let shape: Vec<usize> = lengths.ok_or_else(|| refuse(header))?;
        let size = dtype.map(DType::size).or(letters.and_then(|letters| letters.checked_mul(npy::LETTER_BYTES)));
        let size = size.ok_or_else(|| refuse(header))?;
        let factors: Vec<u64> = shape.iter().map(|length| *length as u64).chain([size as u64]).collect();
        MEMBER_BYTES.check_product(&factors).map_err(|error| error.in_file(&self.path))?;
        if byte_count(&shape, size) != Some(data.len()) {
            return Err(refuse(&format!("{header}, and {} bytes follow", data.len())));
        }
        let Some(dtype) = dtype else {
            let count = shape.iter().product();
            let text = |at: usize| npy::text_of(&data[at * size..][..size]);
            let texts = (0..count).map(text).collect::<Option<_>>();
            return texts
                .map(|texts| NpyArray::Texts(texts, shape))
                .ok_or_else(|| refuse("a text has no valid letters"));
        };
        let axes = match shape.len() {
            2 => vec!["y".into(), "x".into()],
            3 => vec!["y".into(), "x".into(), "channel".into()],
            axes => vec!["axis".into(); axes],
        };
        Ok(NpyArray::Numbers(Tensor { dtype, axes, shape, bytes: data.to_vec() }))
    }

    /// A square matrix of 64-bit floats, as SynTable writes occlusion orders: its edge, and its entries row by row.
    pub fn square_npy(&self) -> Result<(usize, Vec<f64>)> {
        let array = self.npy()?;
        match array.shape.as_slice() {
            [rows, columns] if rows == columns && array.dtype == DType::F64 => {
                let entries = array.bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
                Ok((*rows, entries.collect()))
            }
            shape => {
                Err(self.refuse(format!("not a square matrix of f64: it is of {} and of shape {shape:?}", array.dtype)))
            }
        }
    }
}

/// Number of bytes of an array of elements of a size; none if no array can have these lengths, even if one of them is 0.
pub fn byte_count(shape: &[usize], element: usize) -> Option<usize> {
    let largest = shape.iter().try_fold(element, |product, length| product.checked_mul((*length).max(1)))?;
    Some(if shape.contains(&0) { 0 } else { largest })
}

/// Samples of 1, 2, 4 or 8 bits, as bytes. Each row starts with a new byte, and its first sample has the highest bits.
fn unpacked(packed: &[u8], bits: usize, [width, height]: [u32; 2]) -> Vec<u8> {
    let (per_byte, mask) = (8 / bits, u8::MAX >> (8 - bits));
    let row_bytes = (width as usize).div_ceil(per_byte);
    let sample = |row: &[u8], x: usize| row[x / per_byte] >> (8 - bits * (x % per_byte + 1)) & mask;
    let rows = packed.chunks_exact(row_bytes.max(1)).take(height as usize);
    rows.flat_map(|row| (0..width as usize).map(move |x| sample(row, x))).collect()
}

/// Names and data of the chunks of a PNG file (PNG specification, section 5.3).
fn png_chunks(file: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    let mut rest = file.get(PNG.len()..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (head, after) = rest.split_first_chunk::<8>()?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let chunk = (&rest[4..8], after.get(..length).unwrap_or_default());
        rest = after.get(length.checked_add(4)?..).unwrap_or_default();
        Some(chunk)
    })
}

/// Number of components in the frame header of a JPEG file (ITU T.81, section B.2.2).
fn jpeg_components(file: &[u8]) -> Option<u8> {
    let mut at = 2;
    loop {
        let segment = file.get(at..)?;
        match segment {
            // Bytes that fill up to a marker.
            [0xff, 0xff, ..] => at += 1,
            [0xff, 0xc0..=0xc2, ..] => return segment.get(9).copied(),
            [0xff, _, high, low, ..] => at += 2 + usize::from(u16::from_be_bytes([*high, *low])),
            _ => return None,
        }
    }
}

/// The tag `Orientation` (0x0112) of the first directory of an EXIF block that starts with its TIFF header (Exif 2.32,
/// section 4.6).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_read_as_they_are_written() {
        use syntable_model::product::{Mask, Product};
        let of = |bytes: &[u8]| FileContent::new(bytes.to_vec(), "a.npy".into()).npy();
        let values: [Value; 5] = [
            Plane::from_fn(3, 2, |x, y| [x as f32, y as f32, f32::INFINITY]).encode(),
            Mask::from_fn(4, 3, |x, y| x > y).into(),
            [[1_i64, -2], [3, 4]].into(),
            7_u64.into(),
            Value::List(Vec::new()),
        ];
        for value in values {
            let array = npy::Array::of(&value).expect("an array");
            let bytes = array.encode();
            let read = of(&bytes).expect("readable");
            assert_eq!((&read.shape, &read.bytes), (&array.shape, &array.bytes), "{value:?}");
            assert_eq!(npy::descr(read.dtype), array.descr);
            for end in 0..bytes.len() {
                let error = of(&bytes[..end]).expect_err("cut off").to_string();
                assert!(error.contains("a.npy") && error.contains("not a NumPy file"), "{error}");
            }
        }
        // Format 2.0, as NumPy writes it for long headers.
        let header = b"{'descr': '<u2', 'fortran_order': False, 'shape': (2,), }\n";
        let mut second = b"\x93NUMPY\x02\x00".to_vec();
        second.extend((header.len() as u32).to_le_bytes());
        second.extend([&header[..], &[1, 0, 2, 0]].concat());
        assert_eq!(of(&second).expect("readable").bytes, [1, 0, 2, 0]);
        for other in ["'>u2'", "'>U3'", "'<U'", "[('a', '<f8')]"] {
            let text = String::from_utf8_lossy(&second[12..12 + header.len()]).replace("'<u2'", other);
            let mut file = b"\x93NUMPY\x01\x00".to_vec();
            file.extend((text.len() as u16).to_le_bytes());
            file.extend(text.as_bytes());
            file.extend([1, 0, 2, 0]);
            assert!(of(&file).expect_err("refused").to_string().contains(other));
        }
    }

    #[test]
    fn files_that_are_no_images_are_called_so() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        for (bytes, says) in
            [(&b""[..], "the file is empty"), (b"hi", "it is no PNG file"), (&PNG[..], "not a readable PNG file")]
        {
            fs::write(&path, bytes).expect("written");
            for error in [rgb(&path).err(), gray(&path).err(), depth_of_size(&path, 1.0, [1, 1]).err()] {
                let error = error.expect("no image").to_string();
                assert!(error.contains(says) && error.contains("a.png"), "{error}");
            }
        }
        fs::write(&path, JPEG).expect("written");
        let error = gray(&path).expect_err("no PNG").to_string();
        assert!(error.contains("it is a JPEG file") && error.contains("write the image as a PNG"), "{error}");
    }

    #[test]
    fn places_in_a_palette_are_labels() {
        for (depth, bits) in [(BitDepth::One, 1), (BitDepth::Two, 2), (BitDepth::Four, 4), (BitDepth::Eight, 8)] {
            let label = |x: u32, y: u32| (x + 3 * y) as u16 % (1 << bits.min(7));
            // 11 samples do not fill the last byte of a row.
            let (width, height) = (11, 3);
            let rows = (0..height).flat_map(|y| {
                let mut row = vec![0_u8; (width as usize * bits).div_ceil(8)];
                (0..width).for_each(|x| {
                    let place = x as usize * bits;
                    row[place / 8] |= (label(x, y) as u8) << (8 - bits - place % 8);
                });
                row
            });
            let (rows, mut file) = (rows.collect::<Vec<u8>>(), Vec::new());
            let mut encoder = png::Encoder::new(&mut file, width, height);
            encoder.set_color(ColorType::Indexed);
            encoder.set_depth(depth);
            encoder.set_palette(vec![7; 3 << bits]);
            encoder.write_header().and_then(|mut it| it.write_image_data(&rows)).expect("encoded");
            let content = FileContent::new(file, "labels.png".into());
            assert_eq!(content.labels().expect("labels"), Plane::from_fn(width, height, label), "{bits} bits");
            assert!(content.gray().expect_err("a color image").to_string().contains("it is colored"));
        }
    }

    #[test]
    fn plain_files_have_the_pixels_of_the_image() {
        let encoded = |color, bytes: &[u8], more: Option<(&[u8; 4], &[u8])>| {
            let mut file = Vec::new();
            let mut encoder = png::Encoder::new(&mut file, 2, 1);
            encoder.set_color(color);
            if color == ColorType::Indexed {
                encoder.set_palette(vec![7; 9]);
            }
            let mut writer = encoder.write_header().expect("a header");
            if let Some((name, data)) = more {
                writer.write_chunk(png::chunk::ChunkType(*name), data).expect("a chunk");
            }
            writer.write_image_data(bytes).expect("pixels");
            drop(writer);
            FileContent::new(file, "a.png".into())
        };
        let of = |content: FileContent| {
            let mut products = Products::new();
            content.put_rgb(&[RGB.id(), RGB_FILE.id()], &mut products).expect("readable");
            image_file::stored(&products).expect("a file").map(|(format, bytes)| (format, bytes.len()))
        };
        let rgb = encoded(ColorType::Rgb, &[1, 2, 3, 4, 5, 6], None);
        let length = rgb.bytes().len();
        assert_eq!(of(rgb), Some((RgbFormat::Png, length)));
        for (color, bytes, more) in [
            (ColorType::Grayscale, &[1, 2][..], None),
            (ColorType::Indexed, &[0, 1], None),
            (ColorType::Rgba, &[1, 2, 3, 4, 5, 6, 7, 8], None),
            (ColorType::Rgb, &[1, 2, 3, 4, 5, 6], Some((b"tRNS", &[0, 1, 0, 2, 0, 3][..]))),
            (ColorType::Rgb, &[1, 2, 3, 4, 5, 6], Some((b"eXIf", b"II*\0\x08\0\0\0\0\0"))),
        ] {
            assert_eq!(of(encoded(color, bytes, more)), None, "{color:?}");
        }
        let frame = |end: &[u8]| [&b"\xff\xd8\xff\xe0\0\x04ab\xff\xff\xc2\0\x0b\x08\0\x01\0\x01"[..], end].concat();
        assert_eq!([jpeg_components(&frame(&[3])), jpeg_components(&frame(&[]))], [Some(3), None]);
    }

    #[test]
    fn the_orientation_matches_the_first_directory() {
        // Two entries: the image's width (0x0100), then the orientation.
        let little = b"II*\0\x08\0\0\0\x02\0\0\x01\x03\0\x01\0\0\0\x40\0\0\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0";
        let big = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0";
        assert_eq!((orientation(little), orientation(big)), (Some(6), Some(3)));
        for end in 0..little.len() {
            assert!(orientation(&little[..end]).is_none_or(|it| it == 6), "{end} bytes");
        }
        assert_eq!((orientation(b""), orientation(b"II*\0\xff\xff\xff\xff")), (None, None));
    }

    #[test]
    fn photographs_are_upright_in_both_formats() {
        let exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0";
        // The bottom row of the file, here bright, is the left column of the photograph.
        let file = Plane::from_fn(16, 8, |_, y| if y < 4 { [10; 3] } else { [240; 3] });
        let jpeg = crate::encode::jpeg::encode(&file, 95).expect("encodes");
        let segment = [&b"\xff\xe1\0"[..], &[8 + exif.len() as u8], b"Exif\0\0", exif].concat();
        let jpeg = [&jpeg[..2], &segment, &jpeg[2..]].concat();
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 16, 8);
        encoder.set_color(ColorType::Rgb);
        let mut writer = encoder.write_header().expect("encodes");
        writer.write_chunk(png::chunk::eXIf, exif).expect("encodes");
        writer.write_image_data(file.data().as_flattened()).expect("encodes");
        drop(writer);
        for (name, bytes) in [("a.jpg", jpeg), ("a.png", png)] {
            let photograph = FileContent::new(bytes, name.into()).upright().expect("readable");
            assert_eq!((photograph.width(), photograph.height()), (8, 16), "{name}");
            let [left, right] = [0, 7].map(|x| photograph.at(x, 9)[1]);
            assert!(left > 200 && right < 50, "{name}: {left} {right}");
        }
    }
}
