//! The look of an image in a few numbers: contrast, color, edges and fine detail.

use super::quantity::Quantity;
use syntable_model::product::Plane;

/// Length of the longer edge at which images are compared, px: resolution and sharpening change edges less than content does.
const LONGEST: usize = 256;

/// Luma of encoded red, green and blue (Rec. 709).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The look of an image. All numbers are of encoded colors in [0, 1], at a longer edge of at most 256 px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// Standard deviation of luma.
    pub contrast: f64,
    /// Mean difference of the largest and the smallest channel of a pixel.
    pub saturation: f64,
    /// Mean red over mean red and blue: 0.5 is neutral, above it is warm.
    pub warmth: f64,
    /// Mean magnitude of the luma's gradient, per pixel.
    pub edges: f64,
    /// Mean difference of a pixel's luma from the mean of its four neighbors.
    pub detail: f64,
}

impl Appearance {
    /// The look of an image.
    pub fn of(image: &Plane<[u8; 3]>) -> Self {
        let (pixels, [width, height]) = reduced(image);
        let count = pixels.len().max(1) as f64;
        let luma: Vec<f64> = pixels.iter().map(|pixel| (0..3).map(|k| LUMA[k] * pixel[k]).sum()).collect();
        let mean = luma.iter().sum::<f64>() / count;
        let variance = luma.iter().map(|y| (y - mean) * (y - mean)).sum::<f64>() / count;
        let spread = |p: &[f64; 3]| p[0].max(p[1]).max(p[2]) - p[0].min(p[1]).min(p[2]);
        let [red, blue] = [0, 2].map(|k| pixels.iter().map(|pixel| pixel[k]).sum::<f64>());
        let (mut edges, mut detail, mut inner) = (0.0, 0.0, 0.0);
        for y in 1..height.saturating_sub(1) {
            for x in 1..width.saturating_sub(1) {
                let at = y * width + x;
                let [left, right, above, below] = [luma[at - 1], luma[at + 1], luma[at - width], luma[at + width]];
                edges += libm::hypot(right - left, below - above) / 2.0;
                detail += (luma[at] - (left + right + above + below) / 4.0).abs();
                inner += 1.0;
            }
        }
        Self {
            contrast: variance.sqrt(),
            saturation: pixels.iter().map(spread).sum::<f64>() / count,
            warmth: if red + blue > 0.0 { red / (red + blue) } else { 0.5 },
            edges: edges / f64::max(inner, 1.0),
            detail: detail / f64::max(inner, 1.0),
        }
    }

    /// The quantities of an image.
    pub fn values(&self) -> [(Quantity, f64); 5] {
        [
            (Quantity::Contrast, self.contrast),
            (Quantity::Saturation, self.saturation),
            (Quantity::Warmth, self.warmth),
            (Quantity::Edges, self.edges),
            (Quantity::Detail, self.detail),
        ]
    }
}

/// An image at a longer edge of at most [`LONGEST`]: means over boxes of whole pixels.
fn reduced(image: &Plane<[u8; 3]>) -> (Vec<[f64; 3]>, [usize; 2]) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let longest = width.max(height).max(1);
    let edge = |edge: usize| if longest <= LONGEST { edge } else { (edge * LONGEST / longest).max(1) };
    let [columns, rows] = [width, height].map(edge);
    let (mut sums, mut counts) = (vec![[0_u64; 3]; columns * rows], vec![0_u64; columns * rows]);
    for (y, row) in image.data().chunks_exact(width.max(1)).enumerate() {
        let first = y * rows / height * columns;
        for (x, pixel) in row.iter().enumerate() {
            let cell = first + x * columns / width;
            counts[cell] += 1;
            (0..3).for_each(|k| sums[cell][k] += u64::from(pixel[k]));
        }
    }
    let mean = |(sum, count): (&[u64; 3], &u64)| sum.map(|sum| sum as f64 / (255 * (*count).max(1)) as f64);
    (sums.iter().zip(&counts).map(mean).collect(), [columns, rows])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} instead of {b}");
    }

    #[test]
    fn looks_of_known_images() {
        // Half black, half white: the edge is at two columns of the 30 inner ones.
        let halves = Appearance::of(&Plane::from_fn(32, 20, |x, _| if x < 16 { [0; 3] } else { [255; 3] }));
        near(halves.contrast, 0.5);
        near(halves.saturation, 0.0);
        near(halves.warmth, 0.5);
        near(halves.edges, 2.0 * 0.5 / 30.0);
        near(halves.detail, 2.0 * 0.25 / 30.0);
        let color = Appearance::of(&Plane::from_fn(9, 9, |_, _| [255, 51, 85]));
        near(color.contrast, 0.0);
        near(color.saturation, 0.8);
        near(color.warmth, 0.75);
        let checks = Appearance::of(&Plane::from_fn(40, 40, |x, y| [if (x + y) % 2 == 0 { 0 } else { 255 }; 3]));
        near(checks.detail, 1.0);
        near(checks.edges, 0.0);
    }

    #[test]
    fn resolution_matters_little() {
        let at = |scale: u32| {
            Appearance::of(&Plane::from_fn(256 * scale, 192 * scale, |x, y| {
                let [x, y] = [x, y].map(|k| f64::from(k / scale));
                [((x * 0.1).sin() * 100.0 + 128.0) as u8, ((y * 0.07).cos() * 90.0 + 100.0) as u8, 77]
            }))
        };
        assert_eq!(at(1), at(2));
        assert_eq!(at(1), at(5));
        let empty = Appearance::of(&Plane::from_fn(1, 1, |_, _| [0; 3]));
        assert_eq!((empty.edges, empty.warmth), (0.0, 0.5));
    }
}
