//! Images for the pages: JPEG files of a limited size, and depth in colors.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, RgbImage, imageops};
use syntable_model::color::linear_to_srgb;
use syntable_model::error::{Error, Result};
use syntable_model::product::Plane;

/// Maximum edge of an image, px. Larger images are scaled down.
const EDGE: u32 = 960;
/// Quality of JPEG files, of 100.
const QUALITY: u8 = 84;
/// Colors of depth from near to far, linear Rec. 709: a light yellow, orange, a reddish purple, a dark blue.
const RAMP: [[f32; 3]; 5] =
    [[0.95, 0.87, 0.50], [0.93, 0.43, 0.12], [0.58, 0.10, 0.16], [0.17, 0.05, 0.25], [0.015, 0.02, 0.12]];

/// A color image as a JPEG file.
pub fn jpeg(image: &Plane<[u8; 3]>) -> Result<Vec<u8>> {
    let (width, height) = (image.width(), image.height());
    let bytes: Vec<u8> = image.data().iter().flatten().copied().collect();
    let whole = RgbImage::from_raw(width, height, bytes).ok_or_else(|| Error::new("the image has no pixels"))?;
    let longest = width.max(height);
    let small = if longest > EDGE {
        let scaled = |edge: u32| (u64::from(edge) * u64::from(EDGE) / u64::from(longest)).max(1) as u32;
        imageops::resize(&whole, scaled(width), scaled(height), imageops::FilterType::Triangle)
    } else {
        whole
    };
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, QUALITY)
        .encode(small.as_raw(), small.width(), small.height(), ExtendedColorType::Rgb8)
        .map_err(|error| Error::new(format!("the image cannot be stored as JPEG: {error}")))?;
    Ok(out)
}

/// Minimum and maximum depth of an image, m; `None` if no pixel has a depth.
pub fn range(depth: &Plane<f32>) -> Option<[f32; 2]> {
    let known = depth.data().iter().copied().filter(|depth| is_known(*depth));
    known.fold(None, |range: Option<[f32; 2]>, depth| {
        let [near, far] = range.unwrap_or([depth, depth]);
        Some([near.min(depth), far.max(depth)])
    })
}

fn is_known(depth: f32) -> bool {
    depth.is_finite() && depth > 0.0
}

/// Depth in colors from the nearest to the farthest; black without depth.
pub fn colored(depth: &Plane<f32>) -> Plane<[u8; 3]> {
    let [near, far] = range(depth).unwrap_or([0.0, 1.0]);
    let scale = if far > near { 1.0 / (far - near) } else { 0.0 };
    depth.map(|&depth| if is_known(depth) { ramp((depth - near) * scale) } else { [0; 3] })
}

/// The color at a position between near, 0, and far, 1.
fn ramp(at: f32) -> [u8; 3] {
    let at = at.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let first = (at as usize).min(RAMP.len() - 2);
    let part = at - first as f32;
    std::array::from_fn(|channel| {
        let (from, to) = (RAMP[first][channel], RAMP[first + 1][channel]);
        (255.0 * linear_to_srgb(from + part * (to - from))).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_light_far_is_dark_and_nothing_is_black() {
        let depth = Plane::from_vec(5, 1, vec![1.0, 1.5, 2.0, f32::INFINITY, 0.0]);
        assert_eq!(range(&depth), Some([1.0, 2.0]));
        let colors = colored(&depth);
        let luma = |pixel: &[u8; 3]| pixel.iter().map(|it| u32::from(*it)).sum::<u32>();
        let [near, middle, far, none, hole] = [0, 1, 2, 3, 4].map(|x| luma(colors.at(x, 0)));
        assert!(near > middle && middle > far && far > 0 && none == 0 && hole == 0, "{:?}", colors.data());
        assert_eq!(range(&depth.map(|_| f32::NAN)), None);
    }

    #[test]
    fn large_images_are_scaled_down_with_their_shape() {
        let image = Plane::from_fn(1920, 1080, |x, _| [(x / 8) as u8, 100, 50]);
        let decoded = image::load_from_memory(&jpeg(&image).expect("a file")).expect("it is JPEG").to_rgb8();
        assert_eq!(decoded.dimensions(), (960, 540));
        let [red, green, blue] = decoded.get_pixel(480, 270).0;
        assert!(red.abs_diff(120) < 4 && green.abs_diff(100) < 4 && blue.abs_diff(50) < 4, "{red} {green} {blue}");
    }
}
