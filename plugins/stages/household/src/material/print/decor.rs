//! Decoration of crockery, balls, fruit and the keys of remote controls.

use super::marks::crest;
use super::text::Setting;
use super::typeface::{TextRole, Typeface};
use super::words::{LetterCase, Script};
use crate::material::{MaterialCanvas, ScalarField, SrgbColor, hsv, mix, palette, shade, vivid};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Texture, Wrap};

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
            crest(&mut canvas, stream, c, 0.2 * h, [other, glaze]);
            let face = Typeface::draw(stream, TextRole::Subtitle);
            let (script, case) = (Script::draw(stream), LetterCase::draw(stream));
            let word = script.name(stream, case);
            Setting::level([0.25 * w, 0.75 * h], 0.1 * h, 0.3 * w, glaze).draw(&mut canvas, &face, &word, false);
        }
    }
    canvas.finish(Wrap::Repeat)
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
