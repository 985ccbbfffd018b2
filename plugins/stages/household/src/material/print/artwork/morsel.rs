//! Small bodies of food and other goods, shaded as a photographer lights them: from the upper left.

use crate::material::{MaterialCanvas, PrintFinish, ScalarField, SrgbColor, hsv, mix, shade};
use syntable_model::random::Stream;

/// Outline of a body, in its own frame of radius 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MorselShape {
    /// A ball.
    Ball,
    /// An ellipsoid, half as wide as long.
    Oval,
    /// A flat square with a wavy edge.
    Square,
    /// A flat disc.
    Disc,
    /// A ring.
    Ring,
    /// A lens-shaped leaf.
    Leaf,
    /// Half of a disc.
    Wedge,
    /// A rod with round ends.
    Rod,
}

/// Pattern on the surface of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MorselMark {
    /// Grain alone.
    Plain,
    /// A lattice of holes.
    Holes,
    /// Dark lumps.
    Chips,
    /// Pale seeds.
    Seeds,
    /// Spokes and a rind, as of a cut citrus fruit.
    Segments,
    /// A midrib.
    Veins,
    /// A groove along the body.
    Groove,
}

/// A kind of body.
#[derive(Debug, Clone, Copy)]
pub struct Morsel {
    shape: MorselShape,
    mark: MorselMark,
    /// Lit color, and the color of patches and rims.
    colors: [SrgbColor; 2],
    /// Strength of the highlight.
    gloss: f32,
    /// Strength of the grain.
    grain: f32,
}

/// Shape, mark, hue and saturation and value of both colors, gloss, grain.
type Preset = (MorselShape, MorselMark, [f64; 3], [f64; 3], f32, f32);

use MorselMark::{Chips, Groove, Holes, Plain, Seeds, Segments, Veins};
use MorselShape::{Ball, Disc, Leaf, Oval, Ring, Rod, Square, Wedge};

/// Crackers, cookies, berries, nuts, beans, leaves, fruit, rings, sticks, chips and sweets.
const PRESETS: [Preset; 18] = [
    (Square, Holes, [0.085, 0.75, 0.88], [0.06, 0.85, 0.6], 0.1, 0.25),
    (Disc, Chips, [0.085, 0.55, 0.72], [0.07, 0.65, 0.45], 0.05, 0.35),
    (Ball, Plain, [0.98, 0.85, 0.7], [0.96, 0.92, 0.36], 0.6, 0.16),
    (Ball, Plain, [0.65, 0.55, 0.42], [0.68, 0.6, 0.2], 0.4, 0.12),
    (Oval, Groove, [0.08, 0.55, 0.66], [0.06, 0.65, 0.42], 0.25, 0.22),
    (Oval, Groove, [0.06, 0.6, 0.3], [0.05, 0.7, 0.16], 0.55, 0.15),
    (Leaf, Veins, [0.29, 0.7, 0.55], [0.31, 0.8, 0.3], 0.3, 0.15),
    (Disc, Segments, [0.1, 0.85, 0.98], [0.08, 0.95, 0.9], 0.35, 0.12),
    (Wedge, Segments, [0.15, 0.75, 0.97], [0.15, 0.9, 0.9], 0.35, 0.12),
    (Ring, Plain, [0.1, 0.6, 0.85], [0.08, 0.75, 0.62], 0.15, 0.3),
    (Rod, Plain, [0.115, 0.6, 0.93], [0.1, 0.75, 0.75], 0.2, 0.15),
    (Oval, Seeds, [0.995, 0.9, 0.82], [0.97, 0.95, 0.55], 0.6, 0.1),
    (Ball, Plain, [0.02, 0.84, 0.76], [0.05, 0.85, 0.5], 0.65, 0.14),
    (Disc, Plain, [0.13, 0.65, 0.95], [0.1, 0.75, 0.75], 0.25, 0.2),
    (Square, Plain, [0.06, 0.65, 0.34], [0.05, 0.75, 0.2], 0.45, 0.1),
    (Ball, Plain, [0.3, 0.55, 0.68], [0.29, 0.7, 0.42], 0.5, 0.1),
    (Oval, Plain, [0.12, 0.2, 0.95], [0.1, 0.35, 0.82], 0.3, 0.08),
    (Rod, Plain, [0.06, 0.75, 0.62], [0.04, 0.8, 0.4], 0.3, 0.3),
];

impl Morsel {
    /// A random kind.
    pub fn draw(stream: &mut Stream) -> Self {
        let preset = stream.pick(&PRESETS).copied().unwrap_or(PRESETS[0]);
        let (shape, mark, first, second, gloss, grain) = preset;
        let turn = stream.uniform(-0.02, 0.02);
        let colors = [first, second].map(|[hue, saturation, value]| hsv(hue + turn, saturation, value));
        Self { shape, mark, colors, gloss, grain }
    }

    /// Flat bodies have a level face and a round rim.
    fn is_flat(self) -> bool {
        matches!(self.shape, Square | Disc | Leaf | Wedge)
    }

    /// Signed distance to the outline, below zero inside, in radii.
    fn distance(self, p: f32, q: f32) -> f32 {
        let norm = |x: f32, y: f32| (x * x + y * y).sqrt();
        match self.shape {
            Ball | Disc => norm(p, q) - 1.0,
            Oval => (norm(p, q / 0.6) - 1.0) * 0.6,
            Square => {
                let wave = 0.03 * (libm::sinf(22.0 * p) + libm::sinf(22.0 * q));
                let (dx, dy) = (p.abs() - 0.72, q.abs() - 0.72);
                norm(dx.max(0.0), dy.max(0.0)) + dx.max(dy).min(0.0) - 0.16 + wave
            }
            Ring => (norm(p, q) - 0.66).abs() - 0.33,
            Leaf => q.abs() - 0.42 * (1.0 - p * p),
            Wedge => (norm(p, q + 0.4) - 1.0).max(-(q + 0.4)),
            Rod => norm((p.abs() - 0.78).max(0.0), q) - 0.22,
        }
    }

    /// Height above the table, in radii.
    fn height(self, p: f32, q: f32) -> f32 {
        let depth = -self.distance(p, q);
        if depth <= 0.0 {
            return 0.0;
        }
        let (rim, top) = if self.is_flat() { (0.22, 0.22) } else { (if self.shape == Ball { 1.0 } else { 0.5 }, 0.9) };
        let t = (1.0 - depth / rim).max(0.0);
        let mut height = top * (1.0 - t * t).max(0.0).sqrt();
        if self.mark == Groove {
            height -= 0.12 * (1.0 - (q / 0.1) * (q / 0.1)).max(0.0);
        }
        height
    }

    /// Color before light, at a position with a grain in [-1, 1].
    fn albedo(self, p: f32, q: f32, grain: f32) -> SrgbColor {
        let [first, second] = self.colors;
        let rim = (1.0 + self.distance(p, q) / 0.25).clamp(0.0, 1.0);
        let color = mix(first, second, 0.75 * rim * rim + 1.5 * self.grain * grain);
        let cell = |x: f32| x - (x + 0.5).floor();
        match self.mark {
            Holes => {
                let (dx, dy) = (cell(p / 0.42), cell(q / 0.42));
                if dx * dx + dy * dy < 0.022 { shade(color, 0.5) } else { color }
            }
            Chips => {
                if grain > 0.45 {
                    shade(second, 0.35)
                } else {
                    color
                }
            }
            Seeds => {
                let row = (q / 0.22 + 0.5).floor();
                let (dx, dy) = (cell(p / 0.28 + 0.5 * row), cell(q / 0.22));
                if 2.5 * dx * dx + dy * dy < 0.035 { mix(color, [0.95, 0.85, 0.5], 0.8) } else { color }
            }
            Segments => {
                let q = if self.shape == Wedge { q + 0.4 } else { q };
                let radius = (p * p + q * q).sqrt();
                let angle = libm::atan2f(q, p) * 10.0 / std::f32::consts::TAU;
                let spoke = cell(angle).abs() * radius < 0.05 || radius < 0.08;
                if radius > 0.9 {
                    second
                } else if radius > 0.78 || spoke {
                    mix(first, [0.98, 0.96, 0.88], 0.75)
                } else {
                    shade(color, 0.92 + 0.2 * grain)
                }
            }
            Veins => {
                let rib = q.abs() < 0.025 || cell(4.0 * p - 5.0 * q.abs()).abs() < 0.06;
                if rib { mix(color, [0.8, 0.9, 0.6], 0.4) } else { color }
            }
            Plain | Groove => color,
        }
    }

    /// Paints one body with its shadow.
    pub fn paint(self, canvas: &mut MaterialCanvas, grain: &ScalarField, [cx, cy]: [f32; 2], radius: f32, turn: f32) {
        let before = canvas.set_finish(PrintFinish::matt(0.3));
        let offset = 0.16 * radius;
        canvas.shadow([cx + offset, cy + 1.6 * offset], [1.25 * radius, 1.2 * radius], 0.62);
        let (sin, cos) = libm::sincosf(turn);
        let local = move |x: f32, y: f32| {
            let (dx, dy) = ((x - cx) / radius, (y - cy) / radius);
            (dx * cos + dy * sin, dy * cos - dx * sin)
        };
        let reach = 1.15 * radius + 1.0;
        let step = 0.05;
        // No two bodies are equally bright, or equally ripe.
        let tone = 1.0 + 0.16 * grain.sample(0.7 * cx + 11.0, 0.7 * cy + 5.0);
        let ripe = 0.22 * grain.sample(0.9 * cy + 71.0, 0.9 * cx);
        let scale = 18.0;
        canvas.paint(
            [cx - reach, cy - reach, cx + reach, cy + reach],
            |x, y| {
                let (p, q) = local(x, y);
                self.distance(p, q) * radius
            },
            |x, y| {
                let (p, q) = local(x, y);
                let noise = grain.sample(scale * (p + 3.0) + 0.37 * cx, scale * (q + 3.0) + 0.53 * cy);
                let rough = |p: f32, q: f32| {
                    self.height(p, q) + 0.1 * self.grain * grain.sample(scale * (p + 3.0) + cx, scale * (q + 3.0) + cy)
                };
                let slope_p = (rough(p + step, q) - rough(p - step, q)) / (2.0 * step);
                let slope_q = (rough(p, q + step) - rough(p, q - step)) / (2.0 * step);
                // The slopes in the canvas's frame.
                let (sx, sy) = (slope_p * cos - slope_q * sin, slope_p * sin + slope_q * cos);
                let norm = (sx * sx + sy * sy + 1.0).sqrt();
                let light = ((0.45 * sx + 0.6 * sy + 0.66) / norm).max(0.0);
                let shine = ((0.3 * sx + 0.42 * sy + 0.86) / norm).max(0.0);
                let highlight = 0.8 * self.gloss * (libm::powf(shine, 60.0) + 0.18 * libm::powf(shine, 9.0));
                let albedo = mix(self.albedo(p, q, noise), self.colors[1], ripe);
                // Light from the table reaches the lower rim.
                let bounce = 0.1 * (-sy / norm).max(0.0);
                mix(shade(albedo, tone * (0.4 + 0.78 * light + bounce)), [1.0; 3], highlight.min(0.9))
            },
        );
        canvas.set_finish(before);
    }
}
