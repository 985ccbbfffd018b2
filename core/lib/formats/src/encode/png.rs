//! PNG files.

use super::kind::{Form, Semantic, ValueKind, with_article};
use super::npy::other_writer;
use png::{BitDepth, ColorType, Compression, Encoder};
use std::sync::LazyLock;
use syntable_model::color::srgb_to_linear;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::left_out::LeftOut;
use syntable_model::product::{DType, Mask, Plane, Tensor, Value};
use syntable_model::stage::Output;

/// Encoding of a product as samples of a PNG file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PngCoding {
    /// A mask: 0 and 255.
    Mask,
    /// Truth values: 0 and 255.
    Bits,
    /// 8-bit samples, unchanged, of 1, 3 or 4 channels.
    Bytes,
    /// 16-bit samples, unchanged.
    Words,
    /// Depth in meters, as 16-bit multiples of a unit.
    Depth,
    /// Unit vectors as 8-bit RGB.
    Normal,
    /// Linear colors in [0, 1], sRGB-encoded with 8 bits.
    Color,
}

impl PngCoding {
    /// The encoding of a kind of value. A refusal is a reason and a remedy.
    pub fn of(kind: &ValueKind) -> Result<Self, String> {
        let (dtype, channels) = match kind.form {
            Form::Mask => return Ok(Self::Mask),
            Form::Image { dtype, channels } => (dtype, channels.unwrap_or(1)),
            ref form => {
                return Err(format!(
                    "a PNG file holds images and masks, not {}; write it with {}",
                    with_article(form),
                    other_writer(form)
                ));
            }
        };
        match (dtype, channels, kind.semantic) {
            (DType::Bool, 1, _) => Ok(Self::Bits),
            (DType::U8, 1 | 3 | 4, _) => Ok(Self::Bytes),
            (DType::U16, 1, _) => Ok(Self::Words),
            (DType::F32, 1, Semantic::Depth) if kind.unit == "m" => Ok(Self::Depth),
            (DType::F32, 3, Semantic::Normal) => Ok(Self::Normal),
            (DType::F32, 3, Semantic::Color) if kind.unit.is_empty() => Ok(Self::Color),
            (DType::F32, 3, Semantic::Color) => Err(format!(
                "a PNG file holds colors between 0 and 1, not {}; write it with exr, or write `rgb`, the exposed image",
                kind.unit
            )),
            (DType::F16 | DType::F32, 1..=4, _) => {
                Err(format!("a PNG file holds integers, not {}; write it with exr or npy", with_article(&kind.form)))
            }
            (DType::Bool | DType::U8 | DType::U16, ..) => {
                Err(format!("a PNG file has no channels for {}; write it with npy", with_article(&kind.form)))
            }
            _ => Err(format!(
                "a PNG file holds unsigned integers of 8 or 16 bits, not {}; write it with npy",
                with_article(&kind.form)
            )),
        }
    }

    /// The image of a value whose kind has this coding. A step of a depth image is `depth_scale_mm`.
    pub fn image(self, value: &Value, depth_scale_mm: f64) -> Result<PngImage> {
        let tensor = match value {
            Value::Mask(mask) => return Ok(PngImage::mask(mask, 255)),
            Value::Tensor(Tensor { shape, .. }) if shape.len() < 2 => return Err(Error::new("an image of one axis")),
            Value::Tensor(tensor) => tensor,
            _ => return Err(Error::new("a value that is not an image")),
        };
        let samples = self.samples(tensor, depth_scale_mm);
        Ok(PngImage { width: tensor.shape[1] as u32, height: tensor.shape[0] as u32, samples })
    }

    /// The pixels of a value that [`image`](Self::image) stores with the maximum, since they are too deep. `remedy` tells
    /// how to store them.
    pub fn beyond(self, value: &Value, depth_scale_mm: f64, remedy: &'static str) -> Option<LeftOut> {
        let (Self::Depth, Value::Tensor(tensor)) = (self, value) else { return None };
        let depths = tensor.bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes));
        Some(depth_beyond(depths, depth_scale_mm, remedy))
    }

    fn samples(self, tensor: &Tensor, depth_scale_mm: f64) -> PngSamples {
        let bytes = &tensor.bytes;
        let floats = || bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b));
        match self {
            Self::Mask | Self::Bits => {
                PngSamples::Gray8(bytes.iter().map(|&bit| if bit == 0 { 0 } else { 255 }).collect())
            }
            Self::Bytes => match tensor.shape.get(2) {
                Some(3) => PngSamples::Rgb8(bytes.clone()),
                Some(4) => PngSamples::Rgba8(bytes.clone()),
                _ => PngSamples::Gray8(bytes.clone()),
            },
            Self::Words => PngSamples::Gray16(bytes.as_chunks().0.iter().map(|&b| u16::from_le_bytes(b)).collect()),
            Self::Depth => {
                PngSamples::Gray16(floats().map(|m| depth_units(m, depth_scale_mm, Rounding::Nearest)).collect())
            }
            Self::Normal => {
                let normals: Vec<f32> = floats().collect();
                PngSamples::Rgb8(normals.as_chunks().0.iter().flat_map(|&normal| normal_code(normal)).collect())
            }
            Self::Color => PngSamples::Rgb8(floats().map(srgb_code).collect()),
        }
    }
}

/// The samples of an image, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PngSamples {
    /// One 8-bit sample per pixel.
    Gray8(Vec<u8>),
    /// One 16-bit sample per pixel.
    Gray16(Vec<u16>),
    /// Three 8-bit samples per pixel.
    Rgb8(Vec<u8>),
    /// Four 8-bit samples per pixel.
    Rgba8(Vec<u8>),
}

/// An image that a PNG file can hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PngImage {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// `width · height` times the number of channels.
    pub samples: PngSamples,
}

impl PngImage {
    /// An RGB plane.
    pub fn rgb(plane: &Plane<[u8; 3]>) -> Self {
        let samples = PngSamples::Rgb8(plane.data().as_flattened().to_vec());
        Self { width: plane.width(), height: plane.height(), samples }
    }

    /// A plane of 8-bit values.
    pub fn gray8(plane: &Plane<u8>) -> Self {
        Self { width: plane.width(), height: plane.height(), samples: PngSamples::Gray8(plane.data().to_vec()) }
    }

    /// A plane of 16-bit values.
    pub fn gray16(plane: &Plane<u16>) -> Self {
        Self { width: plane.width(), height: plane.height(), samples: PngSamples::Gray16(plane.data().to_vec()) }
    }

    /// A mask: `set` where it is set, 0 elsewhere.
    pub fn mask(mask: &Mask, set: u8) -> Self {
        Self::gray8(&mask.to_plane().map(|&bit| if bit { set } else { 0 }))
    }

    /// The bytes of a PNG file. Compression is fast: rendered images do not get much smaller with slow compression.
    pub fn encode(&self) -> Result<Vec<u8>> {
        self.encode_with(&[])
    }

    /// Like [`encode`](Self::encode), with texts before the pixels, each with its keyword (PNG specification, section
    /// 11.3.3).
    pub fn encode_with(&self, texts: &[(&str, &str)]) -> Result<Vec<u8>> {
        let mut swapped;
        let (color, depth, bytes): (_, _, &[u8]) = match &self.samples {
            PngSamples::Gray8(bytes) => (ColorType::Grayscale, BitDepth::Eight, bytes),
            PngSamples::Rgb8(bytes) => (ColorType::Rgb, BitDepth::Eight, bytes),
            PngSamples::Rgba8(bytes) => (ColorType::Rgba, BitDepth::Eight, bytes),
            PngSamples::Gray16(samples) => {
                swapped = vec![0; 2 * samples.len()];
                let pairs = swapped.as_chunks_mut().0;
                pairs.iter_mut().zip(samples).for_each(|(pair, sample)| *pair = sample.to_be_bytes());
                (ColorType::Grayscale, BitDepth::Sixteen, &swapped)
            }
        };
        let mut file = Vec::with_capacity(bytes.len() / 2 + 1024);
        let mut encoder = Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(Compression::Fast);
        let mut said = texts.iter();
        said.try_for_each(|(keyword, text)| encoder.add_text_chunk((*keyword).to_owned(), (*text).to_owned()))
            .and_then(|()| encoder.write_header())
            .and_then(|mut writer| {
                writer.write_image_data(bytes)?;
                writer.finish()
            })
            .map_err(|error| Error::new(format!("a {} × {} PNG: {error}", self.width, self.height)))?;
        Ok(file)
    }

    /// Writes a PNG file at a path relative to the dataset.
    pub fn write(&self, output: &Output, path: &str) -> Result<()> {
        output.write(path, &self.encode()?)
    }
}

/// Rounding of a depth to an integer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// Toward zero, as SynTable does.
    Truncate,
    /// Toward zero, after a product in single precision, which may round up to the next unit, as SynTable's release
    /// does.
    TruncateSingle,
    /// To the nearest, as BOP does.
    Nearest,
}

/// A depth in meters as a multiple of `unit_mm` millimeters in 16 bits: 0 without a value, 65535 beyond the range.
pub fn depth_units(depth_m: f32, unit_mm: f64, rounding: Rounding) -> u16 {
    if !depth_m.is_finite() {
        return 0;
    }
    let units = f64::from(depth_m) * (1000.0 / unit_mm);
    // The cast clamps to 16 bits.
    match rounding {
        Rounding::Truncate => units as u16,
        Rounding::TruncateSingle => (depth_m * (1000.0 / unit_mm) as f32) as u16,
        Rounding::Nearest => units.round() as u16,
    }
}

/// The pixels of a depth image whose depth 16 bits cannot hold. `remedy` tells how to store them.
fn depth_beyond(depths_m: impl Iterator<Item = f32>, unit_mm: f64, remedy: &'static str) -> LeftOut {
    let most = f64::from(u16::MAX);
    // It would round to more than the maximum.
    let beyond = |m: f32| f64::from(m) * (1000.0 / unit_mm) >= most + 0.5;
    let (mut count, mut of) = (0, 0);
    for m in depths_m.filter(|m| m.is_finite()) {
        (count, of) = (count + usize::from(beyond(m)), of + 1);
    }
    let what =
        format!("pixels are deeper than the image can store, and have its maximum, {:.2} m", most * unit_mm / 1e3);
    LeftOut::new(count, of, what).help(remedy)
}

/// The 16-bit image of a depth, in multiples of `unit_mm` millimeters. Reports the pixels beyond its range with `remedy`.
pub fn depth_image(
    depth: &Plane<f32>,
    unit_mm: f64,
    rounding: Rounding,
    (log, remedy): (&dyn Log, &'static str),
) -> PngImage {
    log.left_out(&depth_beyond(depth.data().iter().copied(), unit_mm, remedy));
    PngImage::gray16(&depth.map(|&depth| depth_units(depth, unit_mm, rounding)))
}

/// A normal of the camera frame (x right, y down, z forward) in the usual colors: y up, z toward the viewer.
fn normal_code([x, y, z]: [f32; 3]) -> [u8; 3] {
    if [x, y, z] == [0.0; 3] {
        return [0; 3];
    }
    // 127 steps to either side of 128; the cast clamps.
    [x, -y, -z].map(|v| (v * 127.0 + 128.0).round() as u8)
}

/// The 8-bit sRGB code (IEC 61966-2-1) nearest to a linear value.
fn srgb_code(x: f32) -> u8 {
    /// Linear values halfway between codes.
    static LEVELS: LazyLock<[f32; 255]> =
        LazyLock::new(|| std::array::from_fn(|code| srgb_to_linear((code as f64 + 0.5) / 255.0) as f32));
    LEVELS.partition_point(|&level| level <= x) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_truncated_or_rounded_and_clamped() {
        let mm = |depth, rounding| depth_units(depth, 1.0, rounding);
        assert_eq!([0.0019, 1.2345, 65.6, 1e9, -1.0].map(|d| mm(d, Rounding::Truncate)), [1, 1234, 65535, 65535, 0]);
        assert_eq!([0.0019, 1.2345, 65.6, 1e9, -1.0].map(|d| mm(d, Rounding::Nearest)), [2, 1235, 65535, 65535, 0]);
        assert_eq!([f32::INFINITY, f32::NAN, f32::NEG_INFINITY].map(|d| mm(d, Rounding::Nearest)), [0; 3]);
        assert_eq!(depth_units(1.23456, 0.1, Rounding::Nearest), 12346);
    }

    #[test]
    fn depths_beyond_sixteen_bits_are_counted() {
        let depths = [0.0, 6.5535, 6.55354, 6.55356, 12.0, f32::INFINITY, f32::NAN];
        let log = Sums::default();
        let image = depth_image(&Plane::from_vec(7, 1, depths.to_vec()), 0.1, Rounding::Nearest, (&log, "raise it"));
        assert_eq!(image.samples, PngSamples::Gray16(vec![0, 65535, 65535, 65535, 65535, 0, 0]));
        let bytes = depths.iter().flat_map(|depth| depth.to_le_bytes()).collect();
        let value = Value::Tensor(Tensor::new(DType::F32, &["y", "x"], vec![1, 7], bytes));
        let of_value = PngCoding::Depth.beyond(&value, 0.1, "raise it").expect("a depth");
        let text = "2 of 5 pixels are deeper than the image can store, and have its maximum, 6.55 m";
        assert_eq!(*log.0.lock().expect("sound"), [(text.to_owned(), of_value.help.clone())]);
        assert_eq!(of_value.to_string(), text);
        assert_eq!(
            PngCoding::Depth.beyond(&value, 0.2, "raise it").map(|beyond| (beyond.count, beyond.of)),
            Some((0, 5))
        );
    }

    /// Reports of omitted data, with the remedy.
    #[derive(Default)]
    struct Sums(std::sync::Mutex<Vec<(String, Option<std::borrow::Cow<'static, str>>)>>);
    impl Log for Sums {
        fn warn(&self, _: &Error) {}
        fn left_out(&self, left_out: &LeftOut) {
            self.0.lock().expect("sound").push((left_out.to_string(), left_out.help.clone()));
        }
    }

    #[test]
    fn images_read_back() {
        let check = |image: PngImage, want: &[u8]| {
            let file = image.encode().expect("encodes");
            let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
            let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
            let info = reader.next_frame(&mut bytes).expect("decodes");
            assert_eq!((info.width, info.height), (image.width, image.height));
            assert_eq!(bytes, want);
        };
        check(PngImage::gray16(&Plane::from_fn(2, 2, |x, y| (x * 256 + y) as u16)), &[0, 0, 1, 0, 0, 1, 1, 1]);
        check(PngImage::rgb(&Plane::from_fn(2, 1, |x, _| [x as u8, 7, 255])), &[0, 7, 255, 1, 7, 255]);
        check(PngImage::mask(&Mask::from_fn(2, 2, |x, y| x > y), 255), &[0, 255, 0, 0]);
    }

    #[test]
    fn previews_are_encoded() {
        // sRGB codes of 0.1 %, 18 % and 50 % by the standard: 3.3, 117.6, 187.5.
        assert_eq!([-1.0, 0.0, 0.001, 0.18, 0.5, 1.0, 9.0].map(srgb_code), [0, 0, 3, 118, 188, 255, 255]);
        assert_eq!(normal_code([0.0, 0.0, -1.0]), [128, 128, 255]);
        assert_eq!(normal_code([1.0, 0.0, 0.0]), [255, 128, 128]);
        assert_eq!(normal_code([0.0, 1.0, 0.0]), [128, 1, 128]);
        assert_eq!(normal_code([0.0; 3]), [0; 3]);
    }

    #[test]
    fn the_kind_of_value_decides_and_no_name() {
        let image = |dtype, channels| Form::Image { dtype, channels };
        let coding = |form, semantic, unit| PngCoding::of(&ValueKind { form, semantic, unit });
        for (form, semantic, unit, want) in [
            (Form::Mask, Semantic::Mask, "", PngCoding::Mask),
            (image(DType::Bool, None), Semantic::Data, "", PngCoding::Bits),
            (image(DType::U8, Some(3)), Semantic::Color, "", PngCoding::Bytes),
            (image(DType::U8, None), Semantic::Data, "m", PngCoding::Bytes),
            (image(DType::U16, Some(1)), Semantic::Label, "", PngCoding::Words),
            (image(DType::F32, None), Semantic::Depth, "m", PngCoding::Depth),
            (image(DType::F32, Some(3)), Semantic::Normal, "", PngCoding::Normal),
            (image(DType::F32, Some(3)), Semantic::Color, "", PngCoding::Color),
        ] {
            assert_eq!(coding(form.clone(), semantic, unit), Ok(want), "{form}");
        }
        for (form, semantic, unit, want) in [
            (image(DType::F32, Some(3)), Semantic::Color, "nit", "a PNG file holds colors between 0 and 1, not nit; "),
            (
                image(DType::F32, None),
                Semantic::Data,
                "",
                "a PNG file holds integers, not an f32 image; write it with exr",
            ),
            (image(DType::F32, None), Semantic::Depth, "mm", "a PNG file holds integers, not an f32 image; "),
            (
                image(DType::U8, Some(2)),
                Semantic::Data,
                "",
                "a PNG file has no channels for a u8 image of 2 channels; ",
            ),
            (
                image(DType::U32, None),
                Semantic::Label,
                "",
                "a PNG file holds unsigned integers of 8 or 16 bits, not a u32 image; write it with npy",
            ),
            (
                image(DType::I16, None),
                Semantic::Data,
                "",
                "a PNG file holds unsigned integers of 8 or 16 bits, not an i16 image; write it with npy",
            ),
            (
                image(DType::F16, Some(3)),
                Semantic::Normal,
                "",
                "a PNG file holds integers, not an f16 image of 3 channels; write it with exr or npy",
            ),
            (
                Form::Tensor(DType::Bool),
                Semantic::Data,
                "",
                "a PNG file holds images and masks, not a bool array; write it with npy",
            ),
            (Form::Record, Semantic::Data, "", "a PNG file holds images and masks, not a record; "),
        ] {
            let refusal = coding(form.clone(), semantic, unit).expect_err("refused");
            assert!(refusal.starts_with(want), "{refusal}");
        }
    }

    #[test]
    fn depth_is_a_multiple_of_its_unit() {
        let bytes = [1.25_f32, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let value = Value::Tensor(Tensor::new(DType::F32, &["y", "x"], vec![1, 2], bytes));
        let image = PngCoding::Depth.image(&value, 0.25).expect("an image");
        assert_eq!(image, PngImage { width: 2, height: 1, samples: PngSamples::Gray16(vec![5000, 0]) });
    }
}
