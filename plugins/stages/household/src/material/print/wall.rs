//! Wall art: photographs, posters, paintings and drawings.

use super::artwork::{Artwork, ArtworkPlace};
use super::design::Design;
use super::front::front;
use super::relief::ReliefMap;
use super::scheme::Stock;
use super::sheet::{PrintedSheet, texels_per_m, wear};
use super::text::Setting;
use super::typeface::{TextRole, Typeface};
use super::words::{LetterCase, Script};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, PrintFinish, ScalarField, SrgbColor, hsv, mix, shade};
use std::f32::consts::TAU;
use syntable_model::random::Stream;
use syntable_model::scene::Wrap;

/// The motif of one piece of wall art, and its proportions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallArt {
    motif: Motif,
    aspect: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motif {
    /// A whole photograph, by number.
    Photograph(usize),
    /// An illustration.
    Artwork,
    /// An advertisement or cover.
    Poster,
    /// A few words.
    Words,
    /// Flat shapes.
    Shapes,
    /// Fields of color with brush marks.
    Painting,
    /// A plant drawn in lines.
    Drawing,
}

impl WallArt {
    /// Random wall art: mostly photographs if any are given.
    pub fn draw(stream: &mut Stream, photographs: &[Photograph]) -> Self {
        let motifs = [Motif::Artwork, Motif::Poster, Motif::Words, Motif::Shapes, Motif::Painting, Motif::Drawing];
        let drawn = stream.pick(&motifs).copied().unwrap_or(Motif::Artwork);
        let number = stream.below(photographs.len() as u64) as usize;
        let aspect = *stream.pick(&[0.667, 0.707, 0.75, 1.0, 1.333, 1.5]).unwrap_or(&0.707);
        match photographs.get(number) {
            Some(photograph) if stream.chance(0.75) => {
                Self { motif: Motif::Photograph(number), aspect: f64::from(photograph.aspect()).clamp(0.5, 2.0) }
            }
            _ => Self { motif: drawn, aspect },
        }
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        self.aspect
    }
}

/// Wall art of `[width, height]` meters.
pub fn wall_art(
    stream: &mut Stream,
    kind: &WallArt,
    [width, height]: [f64; 2],
    photographs: &[Photograph],
) -> PrintedSheet {
    let scale = texels_per_m([width, height]).min(1400.0);
    let design = Design::draw(stream, scale, photographs);
    let paper = hsv(0.11, stream.uniform(0.0, 0.1), stream.uniform(0.86, 0.95));
    let (columns, rows) = ((width * scale).ceil() as usize, (height * scale).ceil() as usize);
    let mut canvas = MaterialCanvas::new(columns.max(64), rows.max(64), paper);
    canvas.set_finish(PrintFinish::matt(stream.uniform(0.3, 0.8) as f32));
    let [w, h] = canvas.size();
    let all = [0.0, 0.0, w, h];
    let mut relief = ReliefMap::new(&canvas);
    match kind.motif {
        Motif::Photograph(number) => {
            if let Some(photograph) = photographs.get(number) {
                whole(&mut canvas, photograph, all);
            }
        }
        Motif::Artwork => {
            let artwork = Artwork::new(&stream.child("wall"), &[]);
            artwork.draw(&mut canvas, ArtworkPlace::Full, all, all, [design.scheme.ground, design.scheme.second]);
        }
        Motif::Poster => front(&design, &mut canvas, stream, all),
        Motif::Words => words(&mut canvas, stream),
        Motif::Shapes => shapes(&mut canvas, stream),
        Motif::Painting => painting(&mut canvas, &mut relief, stream),
        Motif::Drawing => drawing(&mut canvas, stream),
    }
    wear(&mut canvas, &mut relief, stream, Stock::Matt, &[]);
    PrintedSheet::bake(&canvas, &relief, Wrap::Clamp)
}

/// A photograph that fills a box; what does not fit is cut off evenly.
pub fn whole(canvas: &mut MaterialCanvas, photograph: &Photograph, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let aspect = w / h / photograph.aspect();
    let [du, dv] = if aspect > 1.0 { [1.0, 1.0 / aspect] } else { [aspect, 1.0] };
    let (u0, v0) = (0.5 * (1.0 - du), 0.5 * (1.0 - dv));
    canvas.paint(r, |_, _| -1.0, |x, y| photograph.sample(u0 + du * (x - r[0]) / w, v0 + dv * (y - r[1]) / h));
}

/// Two to five harmonious colors.
fn tones(stream: &mut Stream) -> [SrgbColor; 5] {
    let hue = stream.unit();
    let spread = *stream.pick(&[0.04, 0.08, 0.5, 0.33]).unwrap_or(&0.08);
    let strength = stream.uniform(0.15, 0.75);
    [0, 1, 2, 3, 4].map(|i| {
        let turn = spread * stream.uniform(-1.0, 1.0);
        let value = [0.88, 0.7, 0.5, 0.3, 0.8][i] * stream.uniform(0.85, 1.08);
        hsv(hue + turn, strength * stream.uniform(0.4, 1.2).min(1.2), value.min(0.95))
    })
}

fn words(canvas: &mut MaterialCanvas, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let colors = tones(stream);
    let (ground, ink) =
        if stream.chance(0.5) { ([0.93, 0.92, 0.89], shade(colors[3], 0.7)) } else { (colors[3], [0.94; 3]) };
    canvas.rect([0.0, 0.0, w, h], 0.0, ground);
    let face = Typeface::draw(stream, TextRole::Headline);
    let lines = stream.integer(2, 4);
    for line in 0..lines {
        let word = Script::Latin.name(stream, LetterCase::Capitals);
        let y = h * (0.3 + 0.45 * (line as f32 + 0.5) / lines as f32);
        let tall = 0.32 * h / lines as f32;
        Setting::level([0.5 * w, y], tall, 0.8 * w, ink).draw(canvas, &face, &word, false);
    }
    if stream.chance(0.6) {
        canvas.frame([0.06 * w, 0.05 * h, 0.94 * w, 0.95 * h], 0.006 * w, ink);
    }
}

fn shapes(canvas: &mut MaterialCanvas, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let colors = tones(stream);
    canvas.rect([0.0, 0.0, w, h], 0.0, mix(colors[0], [0.95, 0.93, 0.88], 0.6));
    for _ in 0..stream.integer(4, 9) {
        let color = *stream.pick(&colors).unwrap_or(&colors[1]);
        let at = [w * stream.uniform(0.15, 0.85) as f32, h * stream.uniform(0.15, 0.85) as f32];
        let size = w.min(h) * stream.uniform(0.08, 0.32) as f32;
        match stream.below(4) {
            0 => canvas.ellipse(at, [size; 2], color),
            1 => {
                let long = size * stream.uniform(0.5, 2.2) as f32;
                canvas.rect([at[0] - size, at[1] - long, at[0] + size, at[1] + long], 0.0, color);
            }
            2 => canvas.ring(at, size, 0.25 * size, color),
            _ => {
                // Half a disc, as a sun or an arch.
                let before = canvas.set_clip([0.0, 0.0, w, at[1]]);
                canvas.ellipse(at, [size, 1.4 * size], color);
                canvas.set_clip(before);
            }
        }
    }
}

fn painting(canvas: &mut MaterialCanvas, relief: &mut ReliefMap, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let colors = tones(stream);
    let size = 128;
    let broad = ScalarField::fractal(size, [3, 4], 4, 0.6, stream);
    let brush = ScalarField::fractal(size, [6, 40], 3, 0.7, stream);
    let horizon = stream.uniform(0.35, 0.7) as f32;
    let scale = size as f32;
    let is_level = stream.chance(0.5);
    let tone = |x: f32, y: f32| {
        let (u, v) = (x / w, y / h);
        let cloud = broad.sample(u * scale, v * scale);
        let stroke = brush.sample(u * scale * 1.5, v * scale * 1.5);
        (if is_level { v - horizon + 0.22 * cloud } else { 0.55 * cloud + 0.25 * (u - 0.5) }, stroke)
    };
    canvas.map(|x, y, _| {
        let (t, stroke) = tone(x as f32, y as f32);
        let t = 2.0 + 2.2 * t + 0.2 * stroke;
        let i = (t.clamp(0.0, 3.99)) as usize;
        let color = mix(colors[i], colors[(i + 1) % 5], 1.6 * (t.clamp(0.0, 4.0) - i as f32) - 0.3);
        shade(color, 1.0 + 0.12 * stroke)
    });
    relief.add_all(|x, y| 1.6 * tone(x, y).1);
}

fn drawing(canvas: &mut MaterialCanvas, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let ink = shade(tones(stream)[3], 0.75);
    let filled = stream.chance(0.5);
    let line = 0.006 * w.min(h);
    for _ in 0..stream.integer(1, 3) {
        let (mut x, mut y) = (w * stream.uniform(0.4, 0.6) as f32, 0.9 * h);
        let mut angle = stream.uniform(-0.3, 0.3) as f32 - 0.25 * TAU;
        let bend = stream.uniform(-0.03, 0.03) as f32;
        let step = 0.035 * h;
        for i in 0..20 {
            let (sin, cos) = libm::sincosf(angle);
            let next = [x + step * cos, y + step * sin];
            canvas.line([x, y], next, line, ink);
            [x, y] = next;
            angle += bend;
            if i > 3 {
                let side = if i % 2 == 0 { 0.9 } else { -0.9 };
                let (sin, cos) = libm::sincosf(angle + side);
                let long = h * (0.13 - 0.004 * i as f32);
                let tip = [x + long * cos, y + long * sin];
                let wide = 0.22 * long;
                let middle = [0.5 * (x + tip[0]), 0.5 * (y + tip[1])];
                let corners = [
                    [x, y],
                    [middle[0] - sin * wide, middle[1] + cos * wide],
                    tip,
                    [middle[0] + sin * wide, middle[1] - cos * wide],
                ];
                if filled {
                    canvas.polygon(&corners, mix(ink, [0.9, 0.9, 0.85], 0.25));
                } else {
                    for k in 0..4 {
                        canvas.line(corners[k], corners[(k + 1) % 4], line, ink);
                    }
                }
            }
        }
    }
}
