//! Prints for packages, books, balls and crockery: every variant has its own design.

use super::color::{SrgbColor, hsv, mix, palette, shade, vivid};
use super::{MaterialCanvas, ScalarField};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Texture, Wrap};

/// A rectangle in texture coordinates: u0, v0 (lower left), u1, v1.
pub type UvRect = [f64; 4];

/// Longest edge of a print, texels.
const LONGEST: f64 = 512.0;

/// The design that the panels of one package have in common.
struct Design {
    colors: [SrgbColor; 4],
    layout: u64,
    emblem: u64,
    seed: Stream,
}

impl Design {
    fn new(stream: &mut Stream) -> Self {
        let colors = palette(stream);
        Self { colors, layout: stream.below(6), emblem: stream.below(6), seed: stream.child("brand") }
    }

    /// The show side: ground, brand, emblem, some small print.
    fn front(&self, canvas: &mut MaterialCanvas, r: [f32; 4], stream: &mut Stream) {
        let [_, main, accent, ink] = self.colors;
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let x = (r[0] + r[2]) / 2.0;
        let y = |t: f32| r[1] + t * h;
        self.ground(canvas, r);
        // The brand is written with the same strokes on every panel.
        let mut brand = self.seed.clone();
        let (brand_y, emblem_y) = if self.layout.is_multiple_of(2) { (0.2, 0.58) } else { (0.78, 0.36) };
        let size = (0.17 * h).min(0.2 * w);
        if self.layout == 1 || self.layout == 4 {
            let plate = [x - 0.46 * w, y(brand_y) - 0.75 * size, x + 0.46 * w, y(brand_y) + 0.75 * size];
            canvas.rect(plate, 0.3 * size, main);
            canvas.word(&mut brand, [x, y(brand_y)], size, 0.8 * w, self.colors[0]);
        } else {
            canvas.word(&mut brand, [x, y(brand_y)], size, 0.84 * w, ink);
        }
        self.emblem(canvas, [x, y(emblem_y)], 0.3 * w.min(0.75 * h), accent);
        let line = (0.03 * h).max(4.0);
        if self.layout.is_multiple_of(2) {
            canvas.small_print(stream, [x - 0.35 * w, y(0.85), x + 0.35 * w, y(0.97)], line, ink);
        } else {
            canvas.word(stream, [x, y(0.08)], (0.06 * h).min(0.1 * w), 0.6 * w, ink);
        }
    }

    fn ground(&self, canvas: &mut MaterialCanvas, r: [f32; 4]) {
        let [background, main, accent, _] = self.colors;
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        canvas.rect(r, 0.0, background);
        match self.layout {
            0 => canvas.rect([r[0], r[1] + 0.36 * h, r[2], r[1] + 0.82 * h], 0.0, mix(background, main, 0.8)),
            2 => canvas.stripes([r[0], r[1] + 0.4 * h, r[2], r[3]], 0.7, w / 5.0, 0.5, mix(background, main, 0.35)),
            3 => {
                canvas.rect([r[0], r[1], r[2], r[1] + 0.06 * h], 0.0, accent);
                canvas.rect([r[0], r[3] - 0.06 * h, r[2], r[3]], 0.0, accent);
            }
            4 => canvas.stripes(r, 0.0, w / 7.0, 0.3, mix(background, accent, 0.25)),
            5 => {
                for i in 0..24 {
                    let at = |n: i32, m: i32| ((i * n + 3) % m) as f32 / m as f32;
                    let p = [r[0] + w * at(7, 24), r[1] + h * at(11, 25)];
                    canvas.ellipse(p, [0.035 * w.min(h); 2], mix(background, accent, 0.4));
                }
            }
            _ => {}
        }
    }

    fn emblem(&self, canvas: &mut MaterialCanvas, c: [f32; 2], r: f32, color: SrgbColor) {
        let [background, main, _, ink] = self.colors;
        match self.emblem {
            0 => {
                canvas.ellipse(c, [r; 2], color);
                canvas.ellipse([c[0] - 0.3 * r, c[1] - 0.3 * r], [0.3 * r, 0.2 * r], mix(color, [1.0; 3], 0.5));
                canvas.line([c[0], c[1] - r], [c[0] + 0.3 * r, c[1] - 1.35 * r], 0.14 * r, shade(color, 0.4));
            }
            1 => {
                canvas.star(c, r, 16, 0.2, color);
                canvas.ellipse(c, [0.65 * r; 2], background);
                canvas.star(c, 0.5 * r, 5, 0.55, main);
            }
            2 => {
                canvas.ring(c, 0.85 * r, 0.18 * r, color);
                canvas.ring(c, 0.5 * r, 0.18 * r, ink);
                canvas.ellipse(c, [0.22 * r; 2], color);
            }
            3 => {
                for i in 0..6 {
                    let (sin, cos) = libm::sincosf(i as f32 * std::f32::consts::TAU / 6.0);
                    canvas.ellipse([c[0] + 0.6 * r * cos, c[1] + 0.6 * r * sin], [0.38 * r; 2], color);
                }
                canvas.ellipse(c, [0.35 * r; 2], ink);
            }
            4 => {
                for (i, shift) in [-0.55_f32, 0.0, 0.55].into_iter().enumerate() {
                    let tone = mix(color, main, i as f32 * 0.4);
                    canvas.ellipse([c[0] + shift * r, c[1] + 0.2 * shift.abs() * r], [0.55 * r, 0.75 * r], tone);
                }
            }
            _ => {
                canvas.rect([c[0] - r, c[1] - 0.7 * r, c[0] + r, c[1] + 0.7 * r], 0.25 * r, color);
                canvas.star(c, 0.6 * r, 4, 0.6, background);
            }
        }
    }

    /// The side with facts: a table, small print, a bar code.
    fn facts(&self, canvas: &mut MaterialCanvas, r: [f32; 4], stream: &mut Stream) {
        let [background, main, _, ink] = self.colors;
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        canvas.rect(r, 0.0, background);
        let [x0, x1] = [r[0] + 0.1 * w, r[2] - 0.1 * w];
        canvas.rect([x0, r[1] + 0.06 * h, x1, r[1] + 0.14 * h], 0.02 * h, main);
        let line = (0.028 * h).max(4.0);
        canvas.small_print(stream, [x0, r[1] + 0.2 * h, x1, r[1] + 0.45 * h], line, ink);
        let table = [x0, r[1] + 0.5 * h, x1, r[1] + 0.78 * h];
        canvas.rect(table, 0.0, [0.93; 3]);
        canvas.small_print(
            stream,
            [table[0] + 0.03 * w, table[1] + 2.0, table[2] - 0.03 * w, table[3] - 2.0],
            line,
            [0.15; 3],
        );
        if w > 24.0 {
            canvas.bar_code(stream, [x1 - 0.5 * w, r[1] + 0.82 * h, x1, r[1] + 0.95 * h]);
        }
    }

    /// A narrow side: brand alone.
    fn side(&self, canvas: &mut MaterialCanvas, r: [f32; 4], stream: &mut Stream) {
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let c = [(r[0] + r[2]) / 2.0, (r[1] + r[3]) / 2.0];
        self.ground(canvas, r);
        canvas.word(&mut self.seed.clone(), c, (0.12 * h).min(0.25 * w), 0.8 * w, self.colors[3]);
        let line = (0.03 * h).max(4.0);
        canvas.small_print(
            stream,
            [r[0] + 0.15 * w, r[1] + 0.7 * h, r[2] - 0.15 * w, r[3] - 0.1 * h],
            line,
            self.colors[3],
        );
    }
}

/// The unfolded walls and lids of a carton of `[x, y, z]` meters, and the texture rectangle of each side: -x, +x, -y,
/// +y, -z, +z.
pub fn carton(stream: &mut Stream, [sx, sy, sz]: [f64; 3]) -> (Arc<Texture>, [UvRect; 6]) {
    // In a row: front (-y), right (+x), back (+y), left (-x); top above and bottom below the front.
    let (width, height) = (2.0 * (sx + sy), sz + 2.0 * sy);
    let scale = LONGEST / f64::max(width, height);
    let texels = |meters: f64| (meters * scale) as f32;
    let design = Design::new(stream);
    let mut canvas =
        MaterialCanvas::new((width * scale).ceil() as usize, (height * scale).ceil() as usize, design.colors[0]);
    let columns = [0.0, sx, sx + sy, 2.0 * sx + sy, width];
    let wall = |i: usize| [texels(columns[i]), texels(sy), texels(columns[i + 1]), texels(sy + sz)];
    let rects = [
        [columns[3], sy, columns[4], sy + sz],
        [columns[1], sy, columns[2], sy + sz],
        [columns[0], sy, columns[1], sy + sz],
        [columns[2], sy, columns[3], sy + sz],
        [0.0, sy + sz, sx, height],
        [0.0, 0.0, sx, sy],
    ];
    design.front(&mut canvas, wall(0), stream);
    let facts_on_side = stream.chance(0.7);
    if facts_on_side {
        design.facts(&mut canvas, wall(1), stream);
    } else {
        design.side(&mut canvas, wall(1), stream);
    }
    if stream.chance(0.6) {
        design.front(&mut canvas, wall(2), stream);
    } else {
        design.facts(&mut canvas, wall(2), stream);
    }
    design.side(&mut canvas, wall(3), stream);
    design.side(&mut canvas, [0.0, 0.0, texels(sx), texels(sy)], stream);
    let [_, y0, x1, y1] = rects[4].map(texels);
    canvas.rect([0.0, y0, x1, y1], 0.0, design.colors[0]);
    canvas.bar_code(stream, [0.3 * x1, y0 + 0.25 * (y1 - y0), 0.7 * x1, y1 - 0.25 * (y1 - y0)]);
    let [w, h] = canvas.size().map(f64::from);
    let uv = rects.map(|[x0, y0, x1, y1]| [x0 * scale / w, 1.0 - y1 * scale / h, x1 * scale / w, 1.0 - y0 * scale / h]);
    (canvas.finish(Wrap::Clamp), uv)
}

/// A label around a can, jar or bottle; `aspect` is circumference over height.
pub fn label(stream: &mut Stream, aspect: f64) -> Arc<Texture> {
    let width = LONGEST;
    let height = (width / aspect).clamp(96.0, 384.0);
    let design = Design::new(stream);
    let mut canvas = MaterialCanvas::new(width as usize, height as usize, design.colors[0]);
    let [w, h] = canvas.size();
    design.ground(&mut canvas, [0.0, 0.0, w, h]);
    if stream.chance(0.3) {
        design.front(&mut canvas, [0.0, 0.0, w / 3.0, h], stream);
        design.front(&mut canvas, [w / 3.0, 0.0, 2.0 * w / 3.0, h], stream);
    } else {
        design.front(&mut canvas, [0.1 * w, 0.0, 0.6 * w, h], stream);
    }
    design.facts(&mut canvas, [0.7 * w, 0.08 * h, 0.95 * w, 0.92 * h], stream);
    if stream.chance(0.5) {
        let edge = design.colors[2];
        canvas.rect([-1.0, 0.0, w + 1.0, 0.05 * h], 0.0, edge);
        canvas.rect([-1.0, 0.95 * h, w + 1.0, h], 0.0, edge);
    }
    canvas.finish(Wrap::Repeat)
}

/// Painted bands and rows of motifs around crockery; v runs along the profile.
pub fn bands(stream: &mut Stream) -> Arc<Texture> {
    let glaze = match stream.below(3) {
        0 => hsv(0.1, stream.uniform(0.0, 0.1), stream.uniform(0.85, 0.95)),
        1 => hsv(stream.unit(), stream.uniform(0.3, 0.8), stream.uniform(0.4, 0.9)),
        _ => hsv(stream.unit(), stream.uniform(0.1, 0.3), stream.uniform(0.75, 0.95)),
    };
    let [main, other] = [vivid(stream), vivid(stream)];
    let mut canvas = MaterialCanvas::new(384, 256, glaze);
    let [w, h] = canvas.size();
    match stream.below(5) {
        0 => {}
        1 => {
            for _ in 0..stream.integer(1, 4) {
                let (y, thick) = (h * stream.uniform(0.05, 0.9) as f32, h * stream.uniform(0.01, 0.1) as f32);
                canvas.rect([-1.0, y, w + 1.0, y + thick], 0.0, if stream.chance(0.5) { main } else { other });
            }
        }
        2 => {
            let count = stream.integer(5, 14);
            let y = h * stream.uniform(0.25, 0.7) as f32;
            let tips = stream.integer(4, 9) as usize;
            for i in 0..count {
                let c = [w * (i as f32 + 0.5) / count as f32, y];
                let r = (0.4 * w / count as f32).min(0.2 * h);
                if stream.chance(0.5) {
                    canvas.star(c, r, tips, 0.5, main);
                    canvas.ellipse(c, [0.3 * r; 2], other);
                } else {
                    canvas.ellipse(c, [0.6 * r; 2], main);
                }
            }
        }
        3 => {
            // A whole number of periods, so that the stripes tile.
            let period = w / stream.integer(4, 16) as f32;
            canvas.stripes([0.0, 0.0, w, h], 0.0, period, stream.uniform(0.2, 0.6) as f32, main);
        }
        _ => {
            let [y, split] = [h * stream.uniform(0.2, 0.5) as f32, h * stream.uniform(0.5, 0.8) as f32];
            canvas.rect([-1.0, split, w + 1.0, h], 0.0, main);
            let c = [0.25 * w, y.max(0.3 * h)];
            Design::new(stream).emblem(&mut canvas, c, 0.22 * h, other);
            canvas.word(stream, [0.25 * w, 0.75 * h], 0.1 * h, 0.3 * w, glaze);
        }
    }
    canvas.finish(Wrap::Repeat)
}

/// The cover of a book of `[width, height, thickness]` meters, and the texture rectangles: front, spine, back.
pub fn book(stream: &mut Stream, [width, height, thickness]: [f64; 3]) -> (Arc<Texture>, [UvRect; 3]) {
    let total = 2.0 * width + thickness;
    let scale = LONGEST / f64::max(total, height);
    let design = Design::new(stream);
    let [w, h] = [(total * scale).ceil(), (height * scale).ceil()];
    let mut canvas = MaterialCanvas::new(w as usize, h as usize, design.colors[0]);
    let [a, b, c] = [width, width + thickness, total].map(|x| (x * scale) as f32);
    let h32 = h as f32;
    design.front(&mut canvas, [b, 0.0, c, h32], stream);
    design.facts(&mut canvas, [0.0, 0.0, a, h32], stream);
    canvas.rect([a, 0.0, b, h32], 0.0, design.colors[1]);
    let letters = (0.6 * (b - a)).max(3.0);
    let mut y = 0.15 * h32;
    while y < 0.6 * h32 {
        canvas.letter(stream, [(a + b) / 2.0, y], letters, design.colors[0]);
        y += 0.9 * letters;
    }
    canvas.ellipse([(a + b) / 2.0, 0.85 * h32], [0.3 * (b - a); 2], design.colors[2]);
    let [a, b] = [width * scale / w, (width + thickness) * scale / w];
    let rects = [[b, 0.0, total * scale / w, 1.0], [a, 0.0, b, 1.0], [0.0, 0.0, a, 1.0]];
    (canvas.finish(Wrap::Clamp), rects)
}

/// The top of a remote control, `aspect` = length over width; v runs along it.
pub fn remote(stream: &mut Stream, aspect: f64) -> Arc<Texture> {
    let dark = hsv(stream.unit(), 0.1, stream.uniform(0.08, 0.2));
    let light = hsv(stream.unit(), 0.05, stream.uniform(0.6, 0.9));
    let (body, key) = if stream.chance(0.75) { (dark, light) } else { (light, dark) };
    let width = 128.0;
    let mut canvas = MaterialCanvas::new(128, (width * aspect).min(768.0) as usize, body);
    let h = canvas.size()[1];
    canvas.ellipse([0.22 * width as f32, 0.06 * h], [8.0; 2], [0.8, 0.1, 0.08]);
    let wheel = stream.chance(0.6);
    if wheel {
        let c = [0.5 * width as f32, 0.3 * h];
        canvas.ring(c, 0.28 * width as f32, 0.12 * width as f32, key);
        canvas.ellipse(c, [0.13 * width as f32; 2], mix(body, key, 0.6));
    }
    let first = if wheel { 0.45 } else { 0.14 };
    let rows = stream.integer(4, 7);
    let accent = vivid(stream);
    for row in 0..rows {
        for column in 0..3 {
            let x = width as f32 * (0.24 + 0.26 * column as f32);
            let y = h * (first + (0.93 - first) * (row as f32 + 0.5) / rows as f32);
            let color = if row == rows - 1 { shade(accent, 0.6 + 0.25 * column as f32) } else { key };
            canvas.rect([x - 11.0, y - 8.0, x + 11.0, y + 8.0], 5.0, color);
            canvas.line([x - 4.0, y], [x + 4.0, y], 2.0, body);
        }
    }
    canvas.finish(Wrap::Clamp)
}

/// A ball: panels, stripes or dots; u around, v from pole to pole.
pub fn ball(stream: &mut Stream) -> Arc<Texture> {
    let [background, main, accent, ink] = palette(stream);
    let mut canvas = MaterialCanvas::new(384, 192, background);
    let [w, h] = canvas.size();
    match stream.below(4) {
        0 => {
            let seam = |x: f32| 0.5 * h + 0.22 * h * libm::sinf(2.0 * std::f32::consts::TAU * x / w);
            for x in 0..w as usize {
                let (a, b) = (x as f32, x as f32 + 1.0);
                canvas.line([a, seam(a)], [b, seam(b)], 5.0, ink);
            }
        }
        1 => {
            let panels = 2 * stream.integer(2, 5);
            for i in (0..panels).step_by(2) {
                let x = w * i as f32 / panels as f32;
                canvas.rect([x, -1.0, x + w / panels as f32, h + 1.0], 0.0, if i % 4 == 0 { main } else { accent });
            }
        }
        2 => {
            for i in 0..stream.integer(2, 5) {
                let y = h * (0.2 + 0.15 * i as f32);
                canvas.rect([-1.0, y, w + 1.0, y + 0.07 * h], 0.0, if i % 2 == 0 { main } else { accent });
            }
        }
        _ => {
            for _ in 0..stream.integer(10, 30) {
                // Wider near the poles, where the image is compressed.
                let y = stream.uniform(0.12, 0.88) as f32;
                let r = 0.07 * h;
                let squeeze = 1.0 / libm::sinf(std::f32::consts::PI * y);
                let c = [w * stream.unit() as f32, h * y];
                canvas.ellipse(c, [r * squeeze, r], if stream.chance(0.5) { main } else { accent });
            }
        }
    }
    canvas.finish(Wrap::Repeat)
}

/// The skin of a fruit: u around, v from end to end; `tip` is the color of both ends.
pub fn skin(stream: &mut Stream, base: SrgbColor, blush: SrgbColor, tip: SrgbColor) -> Arc<Texture> {
    let size = 256;
    let streaks = ScalarField::fractal(size, [24, 3], 3, 0.6, stream);
    let clouds = ScalarField::fractal(size, [3, 2], 4, 0.6, stream);
    let [near, _, id] = ScalarField::cells(size, 24, 1.0, stream);
    let bias = stream.uniform(-0.3, 0.5) as f32;
    let spots = stream.uniform(0.0, 0.25) as f32;
    let spot = mix(shade(base, 1.25), tip, stream.unit() as f32);
    let mut canvas = MaterialCanvas::new(size, size, base);
    canvas.map(|x, y, _| {
        let i = y * size + x;
        let v = y as f32 / size as f32;
        let color = mix(base, blush, bias + 0.5 * clouds.values()[i] + 0.2 * streaks.values()[i]);
        let end = (v.min(1.0 - v) / 0.05).min(1.0);
        let dot = if id.values()[i] < spots && near.values()[i] < 0.22 { 0.6 } else { 0.0 };
        mix(mix(color, spot, dot), tip, (1.0 - end) * 0.8)
    });
    canvas.finish(Wrap::Repeat)
}
