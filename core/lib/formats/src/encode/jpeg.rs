//! JPEG files.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;

/// Range of [`encode`]'s quality.
pub const QUALITY: [u8; 2] = [1, 100];

/// The bytes of a JPEG file: baseline, Y'CbCr of BT.601 in full range (JFIF), chroma in full resolution (4:4:4). The
/// quality has the scale of libjpeg. All steps have the same result on every machine.
///
/// # Errors
/// If a side of the image is 0 or longer than 65535 pixels.
pub fn encode(rgb: &Plane<[u8; 3]>, quality: u8) -> Result<Vec<u8>> {
    let (width, height) = (rgb.width(), rgb.height());
    let mut file = Vec::with_capacity(rgb.data().len() / 2 + 1024);
    JpegEncoder::new_with_quality(&mut file, quality)
        .encode(rgb.data().as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| {
            Error::new(format!("a {width} × {height} JPEG: {error}")).help("store the images as PNG files")
        })?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::FileContent;

    /// The largest difference of a channel after encoding and decoding.
    fn difference(image: &Plane<[u8; 3]>, quality: u8) -> u8 {
        let file = FileContent::new(encode(image, quality).expect("encodes"), "image.jpg".into());
        let read = file.rgb().expect("decodes");
        assert_eq!((read.width(), read.height()), (image.width(), image.height()));
        let [read, image] = [&read, image].map(|image| image.data().as_flattened());
        read.iter().zip(image).map(|(a, b)| a.abs_diff(*b)).max().expect("pixels")
    }

    /// Subsampled chroma would mix the colors of neighbors, which differ by 255.
    #[test]
    fn colors_of_single_pixels_are_kept() {
        let image = Plane::from_fn(19, 13, |x, y| [[255, 0, 0], [0, 0, 255], [0, 255, 0]][(x + 2 * y) as usize % 3]);
        assert!(difference(&image, 100) <= 10);
        // A patch of one color is kept at any quality, up to the steps of its mean.
        assert!(difference(&Plane::from_fn(16, 16, |_, _| [200, 40, 90]), 90) <= 4);
    }

    #[test]
    fn files_are_baseline_and_shrink_with_the_quality() {
        let image = Plane::from_fn(64, 48, |x, y| [(4 * x) as u8, (5 * y) as u8, (x * y) as u8]);
        let file = |quality| encode(&image, quality).expect("encodes");
        // The header of the frame: marker, length, 8 bits, height, width, then id, sampling and table of three components.
        let frame = [0xff, 0xc0, 0, 17, 8, 0, 48, 0, 64, 3, 1, 0x11, 0, 2, 0x11, 1, 3, 0x11, 1];
        assert!(file(95).windows(frame.len()).any(|bytes| bytes == frame));
        assert!(file(50).len() < file(95).len());
        let wide = encode(&Plane::from_fn(70_000, 1, |_, _| [0; 3]), 95).expect_err("refused").to_string();
        assert!(wide.contains("70000 × 1"), "{wide}");
    }
}
