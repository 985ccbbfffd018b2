//! Windows of an image.

use crate::scene::Intrinsics;

/// A rectangle of pixels on the camera's image plane, px from the top-left corner of the image. It may extend beyond the image on
/// every side.
///
/// A pixel has the same values in all windows and tiles that contain it: labels always, light if the number of samples does not
/// depend on noise or time. Products that depend on neighboring pixels, such as denoising guides, may differ at the edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Column of the left edge; negative left of the image.
    pub x: i32,
    /// Row of the top edge; negative above the image.
    pub y: i32,
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
}

impl Window {
    /// The image.
    pub fn of(image: &Intrinsics) -> Self {
        Self { x: 0, y: 0, width: image.width, height: image.height }
    }

    /// A canvas `times` as wide and high as the image, an odd number, with the image in its center.
    pub fn canvas(image: &Intrinsics, times: u32) -> Self {
        let beyond = |edge: u32| (edge * (times.saturating_sub(1) / 2)) as i32;
        let Intrinsics { width, height, .. } = *image;
        Self { x: -beyond(width), y: -beyond(height), width: width * times, height: height * times }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Column past the right edge.
    pub fn right(&self) -> i32 {
        self.x + self.width as i32
    }

    /// Row past the bottom edge.
    pub fn bottom(&self) -> i32 {
        self.y + self.height as i32
    }
}
