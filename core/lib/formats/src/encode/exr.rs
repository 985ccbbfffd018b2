//! OpenEXR files.

use super::kind::{Form, Semantic, ValueKind, with_article};
use super::npy::other_writer;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, SmallVec,
    Text, WritableImage, f16, read,
};
use exr::{compression::Compression, math::Vec2};
use std::io::Cursor;
use syntable_model::error::{Error, Result};
use syntable_model::limits::{IMAGE_BYTES, IMAGE_PIXELS};
use syntable_model::product::{DType, Tensor, Value};

/// Precision of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floats: values are stored unchanged.
    Float,
    /// 16-bit floats: 11 significant bits, up to 65504; larger values become infinite.
    Half,
}

/// Encoding of a product as channels of an EXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrCoding {
    /// Names of the channels, in the order of the product.
    pub channels: &'static [&'static str],
    /// Whether the channels are linear Rec. 709.
    pub color: bool,
    unit: &'static str,
}

impl ExrCoding {
    /// The encoding of a kind of value. A refusal is a reason and a remedy.
    pub fn of(kind: &ValueKind) -> Result<Self, String> {
        let channels = match kind.form {
            Form::Image { dtype: DType::F32 | DType::F16, channels } => channels.unwrap_or(1),
            ref form @ (Form::Image { .. } | Form::Mask) => {
                return Err(format!(
                    "an EXR file holds 16- and 32-bit float images, not {}; write it with npy or png",
                    with_article(form)
                ));
            }
            ref form => {
                return Err(format!(
                    "an EXR file holds 16- and 32-bit float images, not {}; write it with {}",
                    with_article(form),
                    other_writer(form)
                ));
            }
        };
        // Programs show R, G and B in color, and read X, Y and Z as a vector.
        let vector = kind.semantic == Semantic::Normal || (kind.semantic == Semantic::Data && kind.unit == "m");
        let names: &[&str] = match channels {
            1 if kind.semantic == Semantic::Depth => &["Z"],
            1 => &["Y"],
            2 => &["X", "Y"],
            3 if vector => &["X", "Y", "Z"],
            3 => &["R", "G", "B"],
            4 => &["R", "G", "B", "A"],
            _ => {
                return Err(format!(
                    "an EXR file names up to 4 channels, not the channels of {}; write it with npy",
                    with_article(&kind.form)
                ));
            }
        };
        Ok(Self { channels: names, color: kind.semantic == Semantic::Color, unit: kind.unit })
    }

    /// The bytes of the file of a value whose kind has this coding.
    pub fn encode(&self, value: &Value, precision: Precision) -> Result<Vec<u8>> {
        encode_layers(&[ImageLayer { name: String::new(), coding: self.clone(), value: value.clone() }], precision)
    }

    /// The image of a file from [`encode`](Self::encode). Checks its header against the limits before unpacking it.
    pub fn decode(&self, file: &[u8]) -> Result<Tensor> {
        let refuse = |what: String| Error::new(what);
        check_header(file)?;
        let image =
            read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
        let image = image.non_parallel().from_buffered(Cursor::new(file));
        let layer = image.map_err(|error| refuse(format!("not a readable EXR file: {error}")))?.layer_data;
        let size = layer.size;
        let channel = |name: &&str| {
            let own = layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
            let own = own.ok_or_else(|| refuse(format!("it has no channel `{name}`")))?;
            Ok(own.sample_data.values_as_f32().collect::<Vec<f32>>())
        };
        let channels = self.channels.iter().map(channel).collect::<Result<Vec<_>>>()?;
        let pixels = (0..size.area()).flat_map(|pixel| channels.iter().map(move |channel| channel[pixel]));
        let bytes = pixels.flat_map(f32::to_le_bytes).collect();
        let edges = [size.height(), size.width()];
        Ok(match channels.len() {
            1 => Tensor::new(DType::F32, &["y", "x"], edges.to_vec(), bytes),
            count => Tensor::new(DType::F32, &["y", "x", "channel"], vec![edges[0], edges[1], count], bytes),
        })
    }

    /// The channels of a value, with names that start with `prefix`.
    fn channels(
        &self,
        value: &Tensor,
        prefix: &str,
        precision: Precision,
    ) -> impl Iterator<Item = AnyChannel<FlatSamples>> {
        let Tensor { bytes, dtype, .. } = value;
        let floats = || bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b));
        let halves = || bytes.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b));
        let channel = |(index, name): (usize, &&str)| {
            let count = self.channels.len();
            let samples = match (dtype, precision) {
                (DType::F16, _) => FlatSamples::F16(halves().skip(index).step_by(count).collect()),
                (_, Precision::Float) => FlatSamples::F32(floats().skip(index).step_by(count).collect()),
                (_, Precision::Half) => {
                    FlatSamples::F16(floats().skip(index).step_by(count).map(f16::from_f32).collect())
                }
            };
            AnyChannel::new(Text::from(format!("{prefix}{name}").as_str()), samples)
        };
        self.channels.iter().enumerate().map(channel).collect::<Vec<_>>().into_iter()
    }
}

/// Refuses a file whose header exceeds the limits, or states more blocks than fit into the file.
fn check_header(file: &[u8]) -> Result<()> {
    let refuse = |what: String| Err(Error::new(what));
    let meta = match MetaData::read_from_buffered(Cursor::new(file), false) {
        Ok(meta) => meta,
        Err(error) => return refuse(format!("not a readable EXR file: {error}")),
    };
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        let [width, height] = [width, height].map(|edge| edge as u64);
        IMAGE_PIXELS.check_product(&[width, height])?;
        IMAGE_BYTES.check_product(&[width, height, header.channels.bytes_per_pixel as u64])?;
        // The file has an offset of eight bytes for every block.
        if header.chunk_count > file.len() / 8 {
            return refuse(format!("{} blocks are more than {} bytes can hold", header.chunk_count, file.len()));
        }
    }
    Ok(())
}

/// An image of a file with several images.
pub struct ImageLayer {
    /// Name of the layer, such as `depth`, the prefix of its channels: `depth.Z`. Empty for the layer whose channels
    /// have plain names.
    pub name: String,
    /// Encoding of its value.
    pub coding: ExrCoding,
    /// The image.
    pub value: Value,
}

/// The bytes of a file with several images of one size. The unit of a layer is in the attribute `unit`, or
/// `{layer}.unit`.
pub fn encode_layers(images: &[ImageLayer], precision: Precision) -> Result<Vec<u8>> {
    let mut size: Option<Vec2<usize>> = None;
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    let mut attributes = LayerAttributes::default();
    let mut is_color = false;
    for ImageLayer { name, coding, value } in images {
        let Value::Tensor(tensor) = value else { return Err(Error::new("a value that is not an image")) };
        let own = Vec2(tensor.shape[1], tensor.shape[0]);
        let other = *size.get_or_insert(own);
        if other != own {
            let sizes = format!("{} × {}, not {} × {}", own.0, own.1, other.0, other.1);
            return Err(Error::new(format!("layer `{name}` is {sizes} as the first")));
        }
        let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
        channels.extend(coding.channels(tensor, &prefix, precision));
        if !coding.unit.is_empty() {
            // Readers expect UTF-8, but the format's library writes Latin-1. ASCII is the same in both.
            let unit = AttributeValue::Text(Text::from(coding.unit.replace('²', "^2").as_str()));
            attributes.other.insert(Text::from(format!("{prefix}unit").as_str()), unit);
        }
        is_color |= coding.color;
        if coding.color && coding.unit == "nit" {
            attributes.white_luminance = Some(1.0);
        }
    }
    let size = size.ok_or_else(|| Error::new("an EXR file without images"))?;
    // ZIP is lossless.
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::SMALL_LOSSLESS };
    let mut image = Image::from_layer(Layer::new(size, attributes, encoding, AnyChannels::sort(channels)));
    if is_color {
        let [red, green, blue, white] = REC_709.map(|[x, y]| Vec2(x, y));
        image.attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
    }
    let mut file = Cursor::new(Vec::new());
    image
        .write()
        .non_parallel()
        .to_buffered(&mut file)
        .map_err(|error| Error::new(format!("a {} × {} EXR: {error}", size.0, size.1)))?;
    Ok(with_sorted_units(&file.into_inner()))
}

/// The same file with the attributes of units in the order of their names. The library writes them in the order of a
/// hash map.
fn with_sorted_units(file: &[u8]) -> Vec<u8> {
    // Magic number and version precede the attributes: name, type, size and value of each, then a zero.
    let mut end = 8;
    let (start, mut attributes) = (&file[..end], Vec::new());
    while file[end] != 0 {
        let after_text = |at: usize| at + 1 + file[at..].iter().take_while(|byte| **byte != 0).count();
        let size = after_text(after_text(end));
        let bytes = file[size..].first_chunk().copied().map_or(0, u32::from_le_bytes);
        let next = size + 4 + bytes as usize;
        attributes.push(&file[end..next]);
        end = next;
    }
    let is_unit = |attribute: &&[u8]| attribute.split(|byte| *byte == 0).next().is_some_and(|it| it.ends_with(b"unit"));
    let mut units: Vec<&[u8]> = attributes.iter().copied().filter(is_unit).collect();
    units.sort_unstable();
    let mut units = units.into_iter();
    let sorted = attributes.iter().filter_map(|it| if is_unit(it) { units.next() } else { Some(*it) });
    [start].into_iter().chain(sorted).chain([&file[end..]]).flatten().copied().collect()
}

/// CIE x and y of the primaries of Rec. 709 and of its white point, D65.
const REC_709: [[f32; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_sorted() {
        let value = Value::Tensor(Tensor::new(DType::F32, &["y", "x"], vec![1, 1], vec![0; 4]));
        let depth = ExrCoding::of(&ValueKind { form: Form::from(&value), semantic: Semantic::Depth, unit: "m" });
        let coding = depth.expect("an image");
        let names = ["e", "b", "d", "a", "c", "f"].map(str::to_owned);
        let layer = |name: String| ImageLayer { name, coding: coding.clone(), value: value.clone() };
        let bytes = encode_layers(&names.map(layer), Precision::Float).expect("encoded");
        let at = |name: &str| bytes.windows(6).position(|it| it == format!("{name}.unit").as_bytes()).expect("there");
        assert!(["a", "b", "c", "d", "e", "f"].map(at).is_sorted());
    }

    #[test]
    fn images_come_back() {
        let pixel = |at: usize| if at == 3 { f32::INFINITY } else { 0.1 * at as f32 };
        for channels in [None, Some(3)] {
            let shape: Vec<usize> = [2, 3].into_iter().chain(channels).collect();
            let axes = &["y", "x", "channel"][..shape.len()];
            let bytes = (0..shape.iter().product()).flat_map(|at| pixel(at).to_le_bytes()).collect();
            let tensor = Tensor::new(DType::F32, axes, shape, bytes);
            let form = Form::Image { dtype: DType::F32, channels };
            let coding =
                ExrCoding::of(&ValueKind { form, semantic: Semantic::Normal, unit: "" }).expect("a float image");
            let file = coding.encode(&Value::Tensor(tensor.clone()), Precision::Float).expect("encodes");
            assert_eq!(coding.decode(&file).expect("reads"), tensor);
            let error = coding.decode(&file[..file.len() / 2]).expect_err("cut off").to_string();
            assert!(error.contains("not a readable EXR file"), "{error}");
        }
    }

    #[test]
    fn units_are_ascii_in_the_header() {
        let form = Form::Image { dtype: DType::F32, channels: None };
        let coding = ExrCoding::of(&ValueKind { form, semantic: Semantic::Data, unit: "nit²" }).expect("a float image");
        let value = Value::Tensor(Tensor::new(DType::F32, &["y", "x"], vec![1, 1], vec![0; 4]));
        let file = coding.encode(&value, Precision::Float).expect("encodes");
        assert!(file.windows(13).any(|bytes| bytes == b"string\0\x05\0\0\0ni"), "a text of five bytes");
        assert!(file.windows(5).any(|bytes| bytes == b"nit^2"));
    }

    #[test]
    fn channels_are_named_by_the_kind_of_value() {
        let names = |channels, semantic, unit| {
            let form = Form::Image { dtype: DType::F32, channels };
            ExrCoding::of(&ValueKind { form, semantic, unit }).expect("a float image").channels.join("")
        };
        assert_eq!(names(None, Semantic::Depth, "m"), "Z");
        assert_eq!(names(Some(1), Semantic::Data, ""), "Y");
        assert_eq!(names(Some(2), Semantic::Data, "px"), "XY");
        assert_eq!(names(Some(3), Semantic::Color, "nit"), "RGB");
        assert_eq!(names(Some(3), Semantic::Normal, ""), "XYZ");
        assert_eq!(names(Some(3), Semantic::Data, "m"), "XYZ");
        assert_eq!(names(Some(3), Semantic::Data, ""), "RGB");
        assert_eq!(names(Some(4), Semantic::Color, ""), "RGBA");
        for (form, want) in [
            (
                Form::Image { dtype: DType::F32, channels: Some(5) },
                "an EXR file names up to 4 channels, not the channels of an f32",
            ),
            (
                Form::Image { dtype: DType::U16, channels: None },
                "an EXR file holds 16- and 32-bit float images, not a u16 image; ",
            ),
            (Form::Mask, "an EXR file holds 16- and 32-bit float images, not a mask; write it with npy or png"),
            (Form::Record, "an EXR file holds 16- and 32-bit float images, not a record; write it with jsonl"),
        ] {
            let refusal = ExrCoding::of(&ValueKind { form, semantic: Semantic::Data, unit: "" }).expect_err("refused");
            assert!(refusal.starts_with(want), "{refusal}");
        }
    }
}
