//! Drawing for people: colors, masks and outlines over images, and panels side by side.

pub mod legend;
pub mod text;

use syntable_model::prelude::*;
use syntable_model::product::{PerInstance, Plane};

/// An 8-bit RGB color.
pub type DrawColor = [u8; 3];

/// Gap between panels, px.
const GAP: u32 = 4;
/// Color of the gaps.
pub const BACKGROUND: DrawColor = [24; 3];
/// Color of texts.
pub const CAPTION: DrawColor = [190; 3];

/// An image composed of panels.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawCanvas(Plane<DrawColor>);

impl DrawCanvas {
    /// Panels in a row.
    pub fn beside(panels: &[Plane<DrawColor>]) -> Self {
        let width = panels.iter().map(|panel| panel.width() + GAP).sum::<u32>().saturating_sub(GAP);
        let height = panels.iter().map(Plane::height).max().unwrap_or(0);
        let mut canvas = Self(Plane::from_fn(width, height, |_, _| BACKGROUND));
        let mut x = 0;
        for panel in panels {
            paste(&mut canvas.0, panel, x, 0);
            x += panel.width() + GAP;
        }
        canvas
    }

    /// Rows in a column.
    pub fn below(rows: &[Self]) -> Self {
        let width = rows.iter().map(Self::width).max().unwrap_or(0);
        let height = rows.iter().map(|row| row.height() + GAP).sum::<u32>().saturating_sub(GAP);
        let mut canvas = Self(Plane::from_fn(width, height, |_, _| BACKGROUND));
        let mut y = 0;
        for row in rows {
            paste(&mut canvas.0, &row.0, 0, y);
            y += row.height() + GAP;
        }
        canvas
    }

    /// The same with more rows of background below.
    pub fn taller(&self, rows: u32) -> Plane<DrawColor> {
        let mut sheet = Plane::from_fn(self.width(), self.height() + rows, |_, _| BACKGROUND);
        paste(&mut sheet, &self.0, 0, 0);
        sheet
    }

    /// Width, px.
    pub fn width(&self) -> u32 {
        self.0.width()
    }

    /// Height, px.
    pub fn height(&self) -> u32 {
        self.0.height()
    }

    /// All pixels, row by row.
    pub fn data(&self) -> &[DrawColor] {
        self.0.data()
    }
}

/// Pastes a panel onto an image, with its top-left corner at (x, y). It must fit.
pub fn paste(onto: &mut Plane<DrawColor>, panel: &Plane<DrawColor>, x: u32, y: u32) {
    let (stride, width) = (onto.width() as usize, panel.width() as usize);
    for (row, pixels) in panel.data().chunks_exact(width.max(1)).enumerate() {
        let start = (y as usize + row) * stride + x as usize;
        onto.data_mut()[start..start + width].copy_from_slice(pixels);
    }
}

/// Visible masks over the image in gray, each in the color of its instance.
pub fn visible(rgb: &Plane<DrawColor>, visible: &PerInstance<Mask>) -> Plane<DrawColor> {
    let mut plane = gray(rgb, 1.0);
    for (id, mask) in visible.iter() {
        fill(&mut plane, mask, color(id), 0.65);
    }
    plane
}

/// Outlines of the amodal masks, `line` pixels wide, over the image in gray, with the occluded parts filled.
pub fn occlusion(
    rgb: &Plane<DrawColor>,
    amodal: &PerInstance<Mask>,
    occluded: &PerInstance<Mask>,
    line: u32,
) -> Plane<DrawColor> {
    let mut plane = gray(rgb, 0.6);
    for (id, mask) in occluded.iter() {
        fill(&mut plane, mask, color(id), 0.8);
    }
    for (id, mask) in amodal.iter() {
        fill(&mut plane, &outline(mask, line), color(id), 1.0);
    }
    plane
}

/// The color of an instance: hues a golden angle apart, so that neighboring ids differ most, in three tones.
pub fn color(id: InstanceId) -> DrawColor {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let n = f64::from(id.0);
    let hue = (n * GOLDEN).fract() * 6.0;
    let (saturation, value) = [(0.85, 1.0), (0.55, 1.0), (0.9, 0.75)][usize::from(id.0 % 3)];
    // HSV to RGB: each channel is a trapezoid over the hue.
    [5.0, 3.0, 1.0].map(|offset| {
        let k = (offset + hue) % 6.0;
        let level = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        (level * 255.0).round() as u8
    })
}

/// The image in gray, with its brightness multiplied by a factor.
pub fn gray(plane: &Plane<DrawColor>, factor: f64) -> Plane<DrawColor> {
    plane.map(|&[r, g, b]| {
        let luma = 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        [(luma * factor).round() as u8; 3]
    })
}

/// Blends a color over the pixels of a mask.
pub fn fill(plane: &mut Plane<DrawColor>, mask: &Mask, color: DrawColor, opacity: f64) {
    let (width, height) = (plane.width() as usize, mask.height() as usize);
    for position in mask.runs().flatten() {
        let (x, y) = (position as usize / height, position as usize % height);
        let pixel = &mut plane.data_mut()[y * width + x];
        for (old, new) in pixel.iter_mut().zip(color) {
            *old = (f64::from(*old) * (1.0 - opacity) + f64::from(new) * opacity).round() as u8;
        }
    }
}

/// The pixels of a mask within `line` rows or columns of a pixel outside the mask. Pixels beyond the border of the
/// image do not count.
pub fn outline(mask: &Mask, line: u32) -> Mask {
    let plane = mask.to_plane();
    let (width, height, line) = (mask.width() as i32, mask.height() as i32, line as i32);
    let is_outside =
        |x: i32, y: i32| (0..width).contains(&x) && (0..height).contains(&y) && !*plane.at(x as u32, y as u32);
    let is_border = |position: &u32| {
        let (x, y) = (*position as i32 / height, *position as i32 % height);
        let beside = |d: i32| [(x - d, y), (x + d, y), (x, y - d), (x, y + d)];
        (1..=line).flat_map(beside).any(|(x, y)| is_outside(x, y))
    };
    // Start and end of the outline, along the mask's own pixels.
    let mut flips: Vec<u32> = Vec::new();
    for position in mask.runs().flatten().filter(is_border) {
        match flips.last_mut() {
            Some(end) if *end == position => *end += 1,
            _ => flips.extend([position, position + 1]),
        }
    }
    Mask::from_flips(mask.width(), mask.height(), &flips)
}

/// Scales an image down to a width: each pixel is the mean of the pixels that it covers. A larger width changes
/// nothing.
pub fn shrink(plane: &Plane<DrawColor>, width: u32) -> Plane<DrawColor> {
    if width >= plane.width() {
        return plane.clone();
    }
    let height = (u64::from(plane.height()) * u64::from(width)).div_ceil(u64::from(plane.width())) as u32;
    let range = |i: u32, new: u32, old: u32| {
        let at = |i: u32| (u64::from(i) * u64::from(old) / u64::from(new)) as u32;
        at(i)..at(i + 1).max(at(i) + 1)
    };
    Plane::from_fn(width, height, |x, y| {
        let (columns, rows) = (range(x, width, plane.width()), range(y, height, plane.height()));
        let count = (columns.len() * rows.len()) as u32;
        let mut sum = [0_u32; 3];
        for pixel in rows.flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| plane.at(x, y)) {
            for (sum, &value) in sum.iter_mut().zip(pixel) {
                *sum += u32::from(value);
            }
        }
        sum.map(|sum| ((sum + count / 2) / count) as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn colors_differ() {
        let colors: Vec<DrawColor> = (1..=40).map(|id| color(InstanceId(id))).collect();
        assert_eq!(colors.iter().collect::<BTreeSet<_>>().len(), 40);
        for pair in colors.windows(2) {
            let distance: i32 = pair[0].iter().zip(pair[1]).map(|(&a, b)| (i32::from(a) - i32::from(b)).abs()).sum();
            assert!(distance > 150, "{pair:?}");
        }
    }

    #[test]
    fn masks_are_outlined_inside() {
        let outlined = outline(&Mask::from_fn(6, 5, |x, y| x < 5 && y >= 1), 1);
        let rows: Vec<String> =
            (0..5).map(|y| (0..6).map(|x| if *outlined.to_plane().at(x, y) { '#' } else { '.' }).collect()).collect();
        assert_eq!(rows, ["......", "#####.", "....#.", "....#.", "....#."]);
    }

    #[test]
    fn images_shrink_by_means() {
        let plane = Plane::from_fn(4, 2, |x, y| [(x * 10 + y * 100) as u8; 3]);
        let small = shrink(&plane, 2);
        assert_eq!((small.width(), small.height()), (2, 1));
        assert_eq!(small.data(), [[55; 3], [75; 3]]);
        let odd = shrink(&Plane::from_fn(7, 3, |_, _| [9; 3]), 3);
        assert_eq!((odd.width(), odd.height()), (3, 2));
        assert!(odd.data().iter().all(|pixel| *pixel == [9; 3]));
    }

    #[test]
    fn panels_are_composed() {
        let panel = |width, height, value| Plane::from_fn(width, height, move |_, _| [value; 3]);
        let row = DrawCanvas::beside(&[panel(2, 2, 1), panel(3, 1, 2)]);
        assert_eq!((row.width(), row.height()), (2 + GAP + 3, 2));
        assert_eq!((row.0.at(1, 1), row.0.at(2, 0), row.0.at(2 + GAP, 0)), (&[1; 3], &BACKGROUND, &[2; 3]));
        let sheet = DrawCanvas::below(&[row.clone(), row]);
        assert_eq!((sheet.height(), *sheet.0.at(0, 2 + GAP)), (4 + GAP, [1; 3]));
    }
}
