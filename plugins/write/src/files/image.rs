//! PNG files.

use png::{BitDepth, ColorType, Compression, Encoder};
use syntable_model::error::{Error, Result};
use syntable_model::product::{Mask, Plane};
use syntable_model::stage::Output;

/// The samples of a picture, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Samples {
    /// One 8-bit sample a pixel.
    Gray8(Vec<u8>),
    /// One 16-bit sample a pixel.
    Gray16(Vec<u16>),
    /// Three 8-bit samples a pixel.
    Rgb8(Vec<u8>),
    /// Four 8-bit samples a pixel.
    Rgba8(Vec<u8>),
}

/// A picture for a PNG file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// The samples, as many as width, height and channels ask for.
    pub samples: Samples,
}

impl Picture {
    /// An RGB plane.
    pub fn rgb(plane: &Plane<[u8; 3]>) -> Self {
        let samples = Samples::Rgb8(plane.data().as_flattened().to_vec());
        Self { width: plane.width(), height: plane.height(), samples }
    }

    /// A plane of 8-bit values.
    pub fn gray8(plane: &Plane<u8>) -> Self {
        Self { width: plane.width(), height: plane.height(), samples: Samples::Gray8(plane.data().to_vec()) }
    }

    /// A plane of 16-bit values.
    pub fn gray16(plane: &Plane<u16>) -> Self {
        Self { width: plane.width(), height: plane.height(), samples: Samples::Gray16(plane.data().to_vec()) }
    }

    /// A mask: `set` where it is set, 0 elsewhere.
    pub fn mask(mask: &Mask, set: u8) -> Self {
        Self::gray8(&mask.to_plane().map(|&bit| if bit { set } else { 0 }))
    }

    /// The bytes of a PNG file. Fast compression: on rendered pictures it is also about as small as the slow one.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let swapped;
        let (color, depth, bytes): (_, _, &[u8]) = match &self.samples {
            Samples::Gray8(bytes) => (ColorType::Grayscale, BitDepth::Eight, bytes),
            Samples::Rgb8(bytes) => (ColorType::Rgb, BitDepth::Eight, bytes),
            Samples::Rgba8(bytes) => (ColorType::Rgba, BitDepth::Eight, bytes),
            Samples::Gray16(samples) => {
                swapped = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect::<Vec<_>>();
                (ColorType::Grayscale, BitDepth::Sixteen, &swapped)
            }
        };
        let mut file = Vec::with_capacity(bytes.len() / 2 + 1024);
        let mut encoder = Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(Compression::Fast);
        encoder
            .write_header()
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

/// How a depth becomes a whole number of units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// Towards zero, as SynTable does.
    Truncate,
    /// To the nearest, as BOP does.
    Nearest,
}

/// A depth in metres in units of `unit_mm` millimetres, 16 bits. 0 says that there is none; what is too far is 65535.
pub fn depth_units(depth_m: f32, unit_mm: f64, rounding: Rounding) -> u16 {
    if !depth_m.is_finite() {
        return 0;
    }
    let units = f64::from(depth_m) * (1000.0 / unit_mm);
    // The cast clamps to what 16 bits hold.
    match rounding {
        Rounding::Truncate => units as u16,
        Rounding::Nearest => units.round() as u16,
    }
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
    fn pictures_read_back() {
        let check = |picture: Picture, want: &[u8]| {
            let file = picture.encode().expect("encodes");
            let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
            let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
            let info = reader.next_frame(&mut bytes).expect("decodes");
            assert_eq!((info.width, info.height), (picture.width, picture.height));
            assert_eq!(bytes, want);
        };
        check(Picture::gray16(&Plane::from_fn(2, 2, |x, y| (x * 256 + y) as u16)), &[0, 0, 1, 0, 0, 1, 1, 1]);
        check(Picture::rgb(&Plane::from_fn(2, 1, |x, _| [x as u8, 7, 255])), &[0, 7, 255, 1, 7, 255]);
        check(Picture::mask(&Mask::from_fn(2, 2, |x, y| x > y), 255), &[0, 255, 0, 0]);
    }
}
