//! Relief of packages: dents, creases, wrinkles and embossing, as a normal map.

use crate::material::{MaterialCanvas, ScalarField, byte, texture};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Encoding, Texture, Wrap};

/// Texels of a canvas per texel of its relief, along one edge.
pub const COARSER: usize = 2;

/// Heights over a canvas at half its resolution. Positions and heights are in texels of the canvas.
pub struct ReliefMap {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl ReliefMap {
    /// A level relief for a canvas.
    pub fn new(canvas: &MaterialCanvas) -> Self {
        let [width, height] = canvas.size().map(|n| (n as usize / COARSER).max(2));
        Self { width, height, values: vec![0.0; width * height] }
    }

    /// Adds a function of the position within a box.
    pub fn add(&mut self, [x0, y0, x1, y1]: [f32; 4], f: impl Fn(f32, f32) -> f32) {
        let scale = COARSER as f32;
        let clamp = |x: f32, most: usize| (x / scale).clamp(0.0, most as f32) as usize;
        for y in clamp(y0, self.height)..clamp(y1 + scale, self.height) {
            for x in clamp(x0, self.width)..clamp(x1 + scale, self.width) {
                self.values[y * self.width + x] += f((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
            }
        }
    }

    /// Adds a function everywhere.
    pub fn add_all(&mut self, f: impl Fn(f32, f32) -> f32) {
        self.add([0.0, 0.0, (self.width * COARSER) as f32, (self.height * COARSER) as f32], f);
    }

    /// A smooth dent, `depth` deep.
    pub fn dent(&mut self, [cx, cy]: [f32; 2], [rx, ry]: [f32; 2], depth: f32) {
        self.add([cx - rx, cy - ry, cx + rx, cy + ry], |x, y| {
            let d = ((x - cx) / rx) * ((x - cx) / rx) + ((y - cy) / ry) * ((y - cy) / ry);
            let fade = (1.0 - d).max(0.0);
            -depth * fade * fade
        });
    }

    /// A crease along a line: a ridge of some width and height, or a groove if the height is negative.
    pub fn crease(&mut self, [a, b]: [[f32; 2]; 2], width: f32, height: f32) {
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let squared = (dx * dx + dy * dy).max(1e-6);
        let bounds = [a[0].min(b[0]) - width, a[1].min(b[1]) - width, a[0].max(b[0]) + width, a[1].max(b[1]) + width];
        self.add(bounds, |x, y| {
            let t = ((x - a[0]) * dx + (y - a[1]) * dy) / squared;
            let t = t.clamp(0.0, 1.0);
            let (px, py) = (x - a[0] - t * dx, y - a[1] - t * dy);
            let d = ((px * px + py * py).sqrt() / width).min(1.0);
            height * (1.0 - d) * (1.0 - d) * (4.0 * t * (1.0 - t)).min(1.0)
        });
    }

    /// Dents and creases of handling; `amount` is about 1 for a used package.
    pub fn handle(&mut self, stream: &mut Stream, amount: f64) {
        let [w, h] = [self.width, self.height].map(|n| (n * COARSER) as f32);
        let place = |stream: &mut Stream| [stream.unit() as f32 * w, stream.unit() as f32 * h];
        let edge = w.min(h);
        for _ in 0..(amount * stream.uniform(2.0, 7.0)) as usize {
            let radius = [0, 1].map(|_| edge * stream.uniform(0.04, 0.2) as f32);
            let at = place(stream);
            let depth = stream.uniform(0.05, 0.16) as f32 * radius[0].min(radius[1]);
            self.dent(at, radius, if stream.chance(0.75) { depth } else { -depth });
        }
        for _ in 0..(amount * stream.uniform(1.0, 6.0)) as usize {
            let a = place(stream);
            let (sin, cos) = libm::sincosf(stream.uniform(0.0, std::f64::consts::TAU) as f32);
            let length = edge * stream.uniform(0.05, 0.3) as f32;
            let b = [a[0] + length * cos, a[1] + length * sin];
            let height = stream.uniform(-2.0, 2.0) as f32;
            self.crease([a, b], stream.uniform(2.0, 6.0) as f32, height);
        }
        let waves = ScalarField::fractal(64, [3, 3], 3, 0.5, stream);
        let swell = (amount * stream.uniform(0.6, 2.4)) as f32;
        self.add_all(|x, y| swell * waves.sample(x / w * 64.0, y / h * 64.0));
    }

    /// Ridges across the direction of a sealed edge at row `y`, over a band of half height `reach`.
    pub fn crimp(&mut self, y: f32, reach: f32, period: f32) {
        let w = (self.width * COARSER) as f32;
        self.add([0.0, y - reach, w, y + reach], |_, py| {
            let inside = (1.0 - (py - y).abs() / reach).clamp(0.0, 1.0);
            0.9 * (4.0 * inside).min(1.0) * libm::sinf(std::f32::consts::TAU * (py - y) / period)
        });
    }

    /// Rises where letters and foil lie: the metallic part of a canvas is `height` higher.
    pub fn emboss(&mut self, canvas: &MaterialCanvas, height: f32) {
        for y in 0..self.height {
            for x in 0..self.width {
                self.values[y * self.width + x] += height * canvas.metallic(x * COARSER, y * COARSER);
            }
        }
    }

    /// The normal map, with the metallic part of the canvas in its alpha channel.
    pub fn texture(&self, canvas: &MaterialCanvas, wrap: Wrap) -> Arc<Texture> {
        let (w, h) = (self.width, self.height);
        let step = 2.0 * COARSER as f32;
        let mut texels = Vec::with_capacity(4 * w * h);
        for y in 0..h {
            let (above, below) = (y.saturating_sub(1) * w, (y + 1).min(h - 1) * w);
            for x in 0..w {
                let (left, right) = match wrap {
                    Wrap::Clamp => (x.saturating_sub(1), (x + 1).min(w - 1)),
                    _ => ((x + w - 1) % w, (x + 1) % w),
                };
                let dx = (self.values[y * w + right] - self.values[y * w + left]) / step;
                let dv = (self.values[above + x] - self.values[below + x]) / step;
                let scale = 1.0 / (dx * dx + dv * dv + 1.0).sqrt();
                texels.extend([-dx * scale, -dv * scale, scale].map(|c| byte(0.5 + 0.5 * c)));
                texels.push(byte(canvas.metallic(x * COARSER, y * COARSER)));
            }
        }
        texture(w, h, texels, Encoding::Linear, wrap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slopes along u and v at a texel of a normal map.
    fn slopes(texture: &Texture, x: usize, y: usize) -> [f32; 2] {
        let i = 4 * (y * texture.width as usize + x);
        let [nx, ny, nz] = std::array::from_fn(|k| f32::from(texture.texels[i + k]) / 127.5 - 1.0);
        [-nx / nz, -ny / nz]
    }

    #[test]
    fn a_dent_slopes_towards_its_center() {
        let canvas = MaterialCanvas::new(100, 100, [0.5; 3]);
        let mut relief = ReliefMap::new(&canvas);
        relief.dent([50.0, 50.0], [30.0, 30.0], 6.0);
        let map = relief.texture(&canvas, Wrap::Clamp);
        assert_eq!((map.width, map.height, map.encoding), (50, 50, Encoding::Linear));
        let [left, right, above, below] =
            [slopes(&map, 18, 25), slopes(&map, 32, 25), slopes(&map, 25, 18), slopes(&map, 25, 32)];
        // Down to the middle: along u from the left, up from the right; v points up.
        assert!(left[0] < -0.1 && right[0] > 0.1, "{left:?} {right:?}");
        assert!(above[1] > 0.1 && below[1] < -0.1, "{above:?} {below:?}");
        assert!(slopes(&map, 2, 2).iter().all(|s| s.abs() < 0.01));
    }
}
