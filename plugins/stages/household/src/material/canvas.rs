//! An image under construction: shapes drawn over each other with soft edges, each with its finish.

use super::color::SrgbColor;
use super::{byte, texture};
use std::sync::Arc;
use syntable_model::scene::{Encoding, Texture, Wrap};

/// How a printed region reflects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintFinish {
    /// Perceptual roughness.
    pub roughness: f32,
    /// 1 for foil, 0 for all else.
    pub metallic: f32,
}

impl PrintFinish {
    /// A finish without metal.
    pub const fn matt(roughness: f32) -> Self {
        Self { roughness, metallic: 0.0 }
    }

    /// A metallic finish.
    pub const fn foil(roughness: f32) -> Self {
        Self { roughness, metallic: 1.0 }
    }
}

/// An image under construction. Positions are in texels, x to the right, y down. Every texel has a color and a
/// [`PrintFinish`]; drawing changes both.
pub struct MaterialCanvas {
    width: usize,
    height: usize,
    texels: Vec<SrgbColor>,
    finishes: Vec<PrintFinish>,
    finish: PrintFinish,
    clip: [f32; 4],
}

/// A clip box that admits every texel.
const EVERYWHERE: [f32; 4] = [-1e6, -1e6, 1e6, 1e6];

impl MaterialCanvas {
    /// A canvas of one color with roughness 0.5.
    pub fn new(width: usize, height: usize, color: SrgbColor) -> Self {
        let finish = PrintFinish::matt(0.5);
        let count = width * height;
        Self { width, height, texels: vec![color; count], finishes: vec![finish; count], finish, clip: EVERYWHERE }
    }

    /// Width and height.
    pub fn size(&self) -> [f32; 2] {
        [self.width as f32, self.height as f32]
    }

    /// The texture of the colors.
    pub fn finish(self, wrap: Wrap) -> Arc<Texture> {
        let texels = self.texels.iter().flat_map(|&[r, g, b]| [byte(r), byte(g), byte(b), 255]).collect();
        texture(self.width, self.height, texels, Encoding::Srgb, wrap)
    }

    /// The texture of the colors, with the roughness in the alpha channel.
    pub fn finish_with_roughness(&self, wrap: Wrap) -> Arc<Texture> {
        let mut texels = Vec::with_capacity(4 * self.texels.len());
        for (color, finish) in self.texels.iter().zip(&self.finishes) {
            texels.extend(color.map(byte));
            texels.push(byte(finish.roughness));
        }
        texture(self.width, self.height, texels, Encoding::Srgb, wrap)
    }

    /// Metallic part at a texel, which must be inside.
    pub fn metallic(&self, x: usize, y: usize) -> f32 {
        self.finishes[y * self.width + x].metallic
    }

    /// Whether any texel is metallic.
    pub fn has_foil(&self) -> bool {
        self.finishes.iter().any(|finish| finish.metallic > 0.0)
    }

    /// Sets the finish of everything that is drawn next, and returns the one before.
    pub fn set_finish(&mut self, finish: PrintFinish) -> PrintFinish {
        std::mem::replace(&mut self.finish, finish)
    }

    /// Keeps everything that is drawn next inside a box `[x0, y0, x1, y1]`, and returns the box before.
    pub fn set_clip(&mut self, clip: [f32; 4]) -> [f32; 4] {
        std::mem::replace(&mut self.clip, clip)
    }

    /// Replaces every texel by a function of its column, row and color.
    pub fn map(&mut self, f: impl Fn(usize, usize, SrgbColor) -> SrgbColor) {
        for (i, texel) in self.texels.iter_mut().enumerate() {
            *texel = f(i % self.width, i / self.width, *texel);
        }
    }

    /// Replaces color and finish of every texel by a function of its column, row, color and finish.
    pub fn map_all(&mut self, f: impl Fn(usize, usize, SrgbColor, PrintFinish) -> (SrgbColor, PrintFinish)) {
        for (i, (texel, finish)) in self.texels.iter_mut().zip(&mut self.finishes).enumerate() {
            (*texel, *finish) = f(i % self.width, i / self.width, *texel, *finish);
        }
    }

    /// Blends a color and an opacity in [0, 1], both functions of the position, within a box `[x0, y0, x1, y1]`. The finish follows.
    /// Columns beyond the left or right edge wrap around.
    pub fn blend(&mut self, bounds: [f32; 4], f: impl Fn(f32, f32) -> (SrgbColor, f32)) {
        self.cover(bounds, f, true);
    }

    /// As [`blend`](Self::blend), and the finish stays: light and shadow of the print.
    pub fn tint(&mut self, bounds: [f32; 4], f: impl Fn(f32, f32) -> (SrgbColor, f32)) {
        self.cover(bounds, f, false);
    }

    fn cover(&mut self, bounds: [f32; 4], f: impl Fn(f32, f32) -> (SrgbColor, f32), with_finish: bool) {
        let [x0, y0, x1, y1] = bounds;
        let [cx0, cy0, cx1, cy1] = self.clip;
        let (y0, y1) = (y0.floor().max(0.0).max(cy0.round()), y1.ceil().min(self.height as f32).min(cy1.round()));
        let (x0, x1) = (x0.floor().max(cx0.round()), x1.ceil().min(cx1.round()));
        if !(x0 < x1 && y0 < y1) {
            return;
        }
        for y in y0 as usize..y1 as usize {
            for x in x0 as isize..x1 as isize {
                let (color, cover) = f(x as f32 + 0.5, y as f32 + 0.5);
                if cover > 0.0 {
                    let i = y * self.width + x.rem_euclid(self.width as isize) as usize;
                    self.texels[i] = super::mix(self.texels[i], color, cover);
                    let (old, new) = (self.finishes[i], if with_finish { self.finish } else { self.finishes[i] });
                    let between = |a: f32, b: f32| a + (b - a) * cover.min(1.0);
                    self.finishes[i] = PrintFinish {
                        roughness: between(old.roughness, new.roughness),
                        metallic: between(old.metallic, new.metallic),
                    };
                }
            }
        }
    }

    /// Paints a color, a function of the position, where a signed distance in texels is below zero.
    pub fn paint(
        &mut self,
        bounds: [f32; 4],
        distance: impl Fn(f32, f32) -> f32,
        color: impl Fn(f32, f32) -> SrgbColor,
    ) {
        self.blend(bounds, |x, y| match (0.5 - distance(x, y)).clamp(0.0, 1.0) {
            0.0 => ([0.0; 3], 0.0),
            cover => (color(x, y), cover),
        });
    }

    /// Paints one color where a signed distance in texels is below zero.
    pub fn fill(&mut self, bounds: [f32; 4], color: SrgbColor, distance: impl Fn(f32, f32) -> f32) {
        self.blend(bounds, |x, y| (color, (0.5 - distance(x, y)).clamp(0.0, 1.0)));
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

    /// The outline of a rectangle, `width` wide inside its edge.
    pub fn frame(&mut self, r: [f32; 4], width: f32, color: SrgbColor) {
        self.rect([r[0], r[1], r[2], r[1] + width], 0.0, color);
        self.rect([r[0], r[3] - width, r[2], r[3]], 0.0, color);
        self.rect([r[0], r[1], r[0] + width, r[3]], 0.0, color);
        self.rect([r[2] - width, r[1], r[2], r[3]], 0.0, color);
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
        self.stroke([a, b], width, [false; 2], color);
    }

    /// A line whose ends are cut square at its points where `cut` is set, and round beyond its points elsewhere.
    pub fn stroke(&mut self, [a, b]: [[f32; 2]; 2], width: f32, cut: [bool; 2], color: SrgbColor) {
        let reach = width / 2.0 + 1.0;
        let bounds = [a[0].min(b[0]) - reach, a[1].min(b[1]) - reach, a[0].max(b[0]) + reach, a[1].max(b[1]) + reach];
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let squared = (dx * dx + dy * dy).max(1e-9);
        let length = squared.sqrt();
        self.fill(bounds, color, |x, y| {
            let along = ((x - a[0]) * dx + (y - a[1]) * dy) / squared;
            let t = along.clamp(0.0, 1.0);
            // Coordinates relative to the nearest point are small, so that the square root is exact enough.
            let (px, py) = (x - a[0] - t * dx, y - a[1] - t * dy);
            let mut distance = (px * px + py * py).sqrt() - width / 2.0;
            if cut[0] {
                distance = distance.max(-along * length);
            }
            if cut[1] {
                distance = distance.max((along - 1.0) * length);
            }
            distance
        });
    }

    /// A polygon, convex or not, of at least three corners.
    pub fn polygon(&mut self, corners: &[[f32; 2]], color: SrgbColor) {
        let fold = |k: usize, f: fn(f32, f32) -> f32, start: f32| corners.iter().map(|p| p[k]).fold(start, f);
        let (x0, x1) = (fold(0, f32::min, f32::MAX), fold(0, f32::max, f32::MIN));
        let (y0, y1) = (fold(1, f32::min, f32::MAX), fold(1, f32::max, f32::MIN));
        self.fill([x0 - 1.0, y0 - 1.0, x1 + 1.0, y1 + 1.0], color, |x, y| {
            let mut inside = false;
            let mut nearest = f32::MAX;
            for (i, a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                let t = (((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy).max(1e-9)).clamp(0.0, 1.0);
                let (px, py) = (x - a[0] - t * dx, y - a[1] - t * dy);
                nearest = nearest.min(px * px + py * py);
                if (a[1] > y) != (b[1] > y) && x < a[0] + dx * (y - a[1]) / dy {
                    inside = !inside;
                }
            }
            if inside { -nearest.sqrt() } else { nearest.sqrt() }
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

    /// A soft shadow: an ellipse whose opacity fades from `strength` at its center to 0 at its edge.
    pub fn shadow(&mut self, [cx, cy]: [f32; 2], [rx, ry]: [f32; 2], strength: f32) {
        self.tint([cx - rx, cy - ry, cx + rx, cy + ry], |x, y| {
            let d = ((x - cx) / rx) * ((x - cx) / rx) + ((y - cy) / ry) * ((y - cy) / ry);
            let fade = (1.0 - d).max(0.0);
            ([0.08, 0.06, 0.05], strength * fade * fade)
        });
    }

    /// A vertical gradient in a rectangle, from the first color at the top to the second at the bottom.
    pub fn gradient(&mut self, r: [f32; 4], colors: [SrgbColor; 2]) {
        let height = (r[3] - r[1]).max(1e-6);
        self.paint(r, |_, _| -1.0, |_, y| super::mix(colors[0], colors[1], (y - r[1]) / height));
    }
}
