//! A print: shapes drawn over each other with soft edges.

use super::color::SrgbColor;
use super::{byte, lettering, texture};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Encoding, Texture, Wrap};

/// Distance between the left edges of two letters, and the gap between them, in heights of a letter.
const LETTER_STEP: f32 = 0.78;
const LETTER_GAP: f32 = 0.26;

/// An image under construction. Positions are in texels, x to the right, y down.
pub struct MaterialCanvas {
    width: usize,
    height: usize,
    texels: Vec<SrgbColor>,
}

impl MaterialCanvas {
    /// A canvas of one color.
    pub fn new(width: usize, height: usize, color: SrgbColor) -> Self {
        Self { width, height, texels: vec![color; width * height] }
    }

    /// Width and height.
    pub fn size(&self) -> [f32; 2] {
        [self.width as f32, self.height as f32]
    }

    /// The texture.
    pub fn finish(self, wrap: Wrap) -> Arc<Texture> {
        let texels = self.texels.iter().flat_map(|&[r, g, b]| [byte(r), byte(g), byte(b), 255]).collect();
        texture(self.width, self.height, texels, Encoding::Srgb, wrap)
    }

    /// Replaces every texel by a function of its column, row and color.
    pub fn map(&mut self, f: impl Fn(usize, usize, SrgbColor) -> SrgbColor) {
        for (i, texel) in self.texels.iter_mut().enumerate() {
            *texel = f(i % self.width, i / self.width, *texel);
        }
    }

    /// Paints where a signed distance in texels is below zero, within the box `[x0, y0, x1, y1]`. Columns beyond the
    /// left or right edge wrap around.
    pub fn fill(&mut self, [x0, y0, x1, y1]: [f32; 4], color: SrgbColor, distance: impl Fn(f32, f32) -> f32) {
        let rows = (y0.floor().max(0.0) as usize)..(y1.ceil().clamp(0.0, self.height as f32) as usize);
        let columns = (x0.floor() as isize)..(x1.ceil() as isize);
        for y in rows {
            for x in columns.clone() {
                let cover = (0.5 - distance(x as f32 + 0.5, y as f32 + 0.5)).clamp(0.0, 1.0);
                if cover > 0.0 {
                    let texel = &mut self.texels[y * self.width + x.rem_euclid(self.width as isize) as usize];
                    *texel = super::mix(*texel, color, cover);
                }
            }
        }
    }

    /// A rectangle `[x0, y0, x1, y1]` with rounded corners.
    pub fn rect(&mut self, r: [f32; 4], radius: f32, color: SrgbColor) {
        let [cx, cy] = [(r[0] + r[2]) / 2.0, (r[1] + r[3]) / 2.0];
        let [hx, hy] = [(r[2] - r[0]) / 2.0, (r[3] - r[1]) / 2.0];
        let radius = radius.min(hx).min(hy).max(0.0);
        self.fill([r[0] - 1.0, r[1] - 1.0, r[2] + 1.0, r[3] + 1.0], color, |x, y| {
            let (dx, dy) = ((x - cx).abs() - hx + radius, (y - cy).abs() - hy + radius);
            libm::hypotf(dx.max(0.0), dy.max(0.0)) + dx.max(dy).min(0.0) - radius
        });
    }

    /// An ellipse.
    pub fn ellipse(&mut self, [cx, cy]: [f32; 2], [rx, ry]: [f32; 2], color: SrgbColor) {
        self.fill([cx - rx - 1.0, cy - ry - 1.0, cx + rx + 1.0, cy + ry + 1.0], color, |x, y| {
            (libm::hypotf((x - cx) / rx, (y - cy) / ry) - 1.0) * rx.min(ry)
        });
    }

    /// A circular ring.
    pub fn ring(&mut self, [cx, cy]: [f32; 2], radius: f32, width: f32, color: SrgbColor) {
        let reach = radius + width;
        self.fill([cx - reach, cy - reach, cx + reach, cy + reach], color, |x, y| {
            (libm::hypotf(x - cx, y - cy) - radius).abs() - width / 2.0
        });
    }

    /// A star with pointed tips.
    pub fn star(&mut self, [cx, cy]: [f32; 2], radius: f32, tips: usize, depth: f32, color: SrgbColor) {
        self.fill([cx - radius, cy - radius, cx + radius, cy + radius], color, |x, y| {
            let angle = libm::atan2f(y - cy, x - cx) * tips as f32 / std::f32::consts::TAU;
            let zigzag = 2.0 * (angle - angle.floor() - 0.5).abs();
            (libm::hypotf(x - cx, y - cy) - radius * (1.0 - depth * (1.0 - zigzag))) * 0.6
        });
    }

    /// A line with round ends.
    pub fn line(&mut self, a: [f32; 2], b: [f32; 2], width: f32, color: SrgbColor) {
        let reach = width / 2.0 + 1.0;
        let bounds = [a[0].min(b[0]) - reach, a[1].min(b[1]) - reach, a[0].max(b[0]) + reach, a[1].max(b[1]) + reach];
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let squared = (dx * dx + dy * dy).max(1e-9);
        self.fill(bounds, color, |x, y| {
            let t = (((x - a[0]) * dx + (y - a[1]) * dy) / squared).clamp(0.0, 1.0);
            libm::hypotf(x - a[0] - t * dx, y - a[1] - t * dy) - width / 2.0
        });
    }

    /// Diagonal stripes in a rectangle.
    pub fn stripes(&mut self, r: [f32; 4], slope: f32, period: f32, duty: f32, color: SrgbColor) {
        let steep = (1.0 + slope * slope).sqrt();
        self.fill(r, color, |x, y| {
            let phase = ((x + slope * y) / period).rem_euclid(1.0);
            ((phase - 0.5).abs() - duty / 2.0) * period / steep
        });
    }

    /// A word of a height, centered at a point; smaller if it would be wider than `width`.
    pub fn word(&mut self, stream: &mut Stream, center: [f32; 2], height: f32, width: f32, color: SrgbColor) {
        let word = lettering::word(stream);
        let weight = stream.uniform(0.11, 0.19) as f32;
        let height = height.min(width / (LETTER_STEP * word.len() as f32));
        self.letters(word, center, height, weight * height, color);
    }

    /// Any one letter of a height, centered at a point.
    pub fn letter(&mut self, stream: &mut Stream, center: [f32; 2], height: f32, color: SrgbColor) {
        let first = stream.below(lettering::ALPHABET.len() as u64) as usize;
        self.letters(&lettering::ALPHABET[first..=first], center, height, 0.15 * height, color);
    }

    fn letters(&mut self, text: &str, [x, y]: [f32; 2], height: f32, weight: f32, color: SrgbColor) {
        let start = x - (text.len() as f32 * LETTER_STEP - LETTER_GAP) * height / 2.0;
        for (i, letter) in text.chars().enumerate() {
            let left = start + i as f32 * LETTER_STEP * height;
            let at =
                |p: [f32; 2]| [left + p[0] * (LETTER_STEP - LETTER_GAP) * height, y + (p[1] - 0.5) * (height - weight)];
            for stroke in lettering::strokes(letter) {
                stroke.windows(2).for_each(|pair| self.line(at(pair[0]), at(pair[1]), weight, color));
            }
        }
    }

    /// Lines of small print in a rectangle.
    pub fn small_print(&mut self, stream: &mut Stream, r: [f32; 4], line: f32, color: SrgbColor) {
        let mut y = r[1];
        while y + line <= r[3] {
            let mut x = r[0];
            let end = r[0] + (r[2] - r[0]) * stream.uniform(0.6, 1.0) as f32;
            while x < end {
                let word = (line * stream.uniform(0.8, 3.5) as f32).min(end - x);
                self.rect([x, y + 0.22 * line, x + word, y + 0.68 * line], 0.0, color);
                x += word + 0.5 * line;
            }
            y += line;
        }
    }

    /// A bar code on white.
    pub fn bar_code(&mut self, stream: &mut Stream, r: [f32; 4]) {
        self.rect(r, 0.0, [0.95; 3]);
        let module = (r[2] - r[0]) / 50.0;
        let mut x = r[0] + 3.0 * module;
        while x < r[2] - 4.0 * module {
            let width = module * stream.integer(1, 3) as f32;
            self.rect([x, r[1] + 2.0 * module, x + width, r[3] - 2.0 * module], 0.0, [0.08; 3]);
            x += width + module * stream.integer(1, 3) as f32;
        }
    }
}
