//! Papers on notice boards, and writing on whiteboards.

use super::design::Design;
use super::front::front;
use super::text::{Paragraph, Setting};
use super::typeface::{TextRole, Typeface};
use super::wall::whole;
use super::words::{LetterCase, Script};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, ScalarField, SrgbColor, hsv, mix, vivid};
use std::f32::consts::TAU;
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Texture, Wrap};

/// Texels along the edge of one paper.
const EDGE: usize = 256;

/// Four papers in the quarters of an image: a letter, a note by hand, a card or photograph, and a form.
pub fn notes(stream: &mut Stream, photographs: &[Photograph]) -> Arc<Texture> {
    let mut canvas = MaterialCanvas::new(2 * EDGE, 2 * EDGE, [0.92; 3]);
    let edge = EDGE as f32;
    let mut cells = [[0.0, 0.0], [edge, 0.0], [0.0, edge], [edge, edge]].map(|[x, y]| [x, y, x + edge, y + edge]);
    stream.shuffle(&mut cells);
    let draws: [fn(&mut MaterialCanvas, &mut Stream, [f32; 4]); 3] = [letter, hand, form];
    for (draw, cell) in draws.into_iter().zip(cells) {
        let before = canvas.set_clip(cell);
        draw(&mut canvas, stream, cell);
        canvas.set_clip(before);
    }
    let cell = cells[3];
    let before = canvas.set_clip(cell);
    canvas.rect(cell, 0.0, [0.95; 3]);
    let inner = [cell[0] + 10.0, cell[1] + 10.0, cell[2] - 10.0, cell[3] - 10.0];
    match stream.pick(photographs) {
        Some(photograph) => whole(&mut canvas, photograph, inner),
        None => {
            let design = Design::draw(stream, 1200.0, &[]);
            front(&design, &mut canvas, stream, cell);
        }
    }
    canvas.set_clip(before);
    canvas.finish(Wrap::Clamp)
}

fn paragraph(face: &Typeface, height: f32, color: SrgbColor) -> Paragraph<'_> {
    Paragraph { face, script: Script::Latin, height, color, is_centered: false }
}

fn letter(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    canvas.rect(r, 0.0, hsv(0.12, stream.uniform(0.0, 0.05), 0.93));
    let face = Typeface::draw(stream, TextRole::Prose);
    let head = Typeface::draw(stream, TextRole::Headline);
    let color = vivid(stream);
    let word = Script::Latin.name(stream, LetterCase::Title);
    let at = [r[0] + 0.3 * w, r[1] + 0.1 * h];
    Setting::level(at, 0.05 * h, 0.4 * w, color).draw(canvas, &head, &word, false);
    paragraph(&face, 0.022 * h, [0.2; 3]).fill(
        canvas,
        stream,
        [r[0] + 0.1 * w, r[1] + 0.22 * h, r[2] - 0.1 * w, r[1] + 0.55 * h],
    );
    paragraph(&face, 0.022 * h, [0.2; 3]).fill(
        canvas,
        stream,
        [r[0] + 0.1 * w, r[1] + 0.6 * h, r[2] - 0.1 * w, r[1] + 0.85 * h],
    );
}

/// A colored note with lines by hand.
fn hand(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let hue = *stream.pick(&[0.15, 0.15, 0.92, 0.3, 0.55]).unwrap_or(&0.15);
    canvas.rect(r, 0.0, hsv(hue, stream.uniform(0.3, 0.55), 0.93));
    let ink = *stream.pick(&[[0.1, 0.12, 0.4], [0.08; 3]]).unwrap_or(&[0.1; 3]);
    let lines = stream.integer(3, 6);
    for line in 0..lines {
        let y = r[1] + h * (0.18 + 0.7 * line as f32 / lines as f32);
        let long = w * stream.uniform(0.4, 0.8) as f32;
        scrawl(canvas, stream, [r[0] + 0.1 * w, y], [long, 0.05 * h], 0.012 * w, ink);
    }
}

/// A line of joined writing.
fn scrawl(
    canvas: &mut MaterialCanvas,
    stream: &mut Stream,
    [x0, y0]: [f32; 2],
    [long, tall]: [f32; 2],
    width: f32,
    ink: SrgbColor,
) {
    let mut at = [x0, y0];
    let mut phase = 0.0_f32;
    let step = 0.3 * tall;
    while at[0] < x0 + long {
        phase += stream.uniform(0.9, 2.2) as f32;
        let ascends = if stream.chance(0.15) { 1.8 } else { 1.0 };
        let next = [at[0] + step * stream.uniform(0.5, 1.3) as f32, y0 - 0.5 * tall * ascends * libm::sinf(phase)];
        canvas.line(at, next, width, ink);
        at = next;
        if stream.chance(0.08) {
            at = [at[0] + 1.2 * tall, y0];
        }
    }
}

/// A table with a colored head, as a timetable or calendar.
fn form(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    canvas.rect(r, 0.0, [0.95; 3]);
    let color = vivid(stream);
    canvas.rect([r[0], r[1], r[2], r[1] + 0.16 * h], 0.0, color);
    let face = Typeface::draw(stream, TextRole::Subtitle);
    let word = Script::Latin.name(stream, LetterCase::Title);
    let at = [r[0] + 0.5 * w, r[1] + 0.08 * h];
    Setting::level(at, 0.07 * h, 0.8 * w, [0.96; 3]).draw(canvas, &face, &word, false);
    let (columns, rows) = (stream.integer(4, 7), stream.integer(4, 6));
    for row in 0..rows {
        for column in 0..columns {
            let x = r[0] + w * (0.05 + 0.9 * column as f32 / columns as f32);
            let y = r[1] + h * (0.2 + 0.75 * row as f32 / rows as f32);
            let cell = [x, y, x + 0.86 * w / columns as f32, y + 0.7 * h / rows as f32];
            canvas.frame(cell, 1.0, [0.6; 3]);
            canvas.rect([x + 3.0, y + 3.0, x + 8.0, y + 8.0], 0.0, [0.3; 3]);
            if stream.chance(0.25) {
                canvas.rect([x + 3.0, y + 11.0, cell[2] - 3.0, y + 16.0], 0.0, mix(color, [1.0; 3], 0.5));
            }
        }
    }
}

/// Writing and diagrams on a whiteboard of some width over height.
pub fn scribbles(stream: &mut Stream, aspect: f64) -> Arc<Texture> {
    let rows = 480;
    let mut canvas = MaterialCanvas::new((rows as f64 * aspect) as usize, rows, [0.93, 0.935, 0.93]);
    let [w, h] = canvas.size();
    // Traces of older writing.
    let stains = ScalarField::fractal(64, [5, 3], 4, 0.6, stream);
    canvas.map(|x, y, color| {
        let stain = stains.sample(x as f32 / w * 64.0, y as f32 / h * 64.0);
        mix(color, [0.62, 0.66, 0.72], (0.22 * stain).max(0.0))
    });
    let inks = [[0.07, 0.07, 0.09], [0.1, 0.18, 0.6], [0.7, 0.1, 0.1], [0.05, 0.42, 0.2]];
    let width = 2.6;
    for _ in 0..stream.integer(2, 5) {
        let ink = *stream.pick(&inks).unwrap_or(&inks[0]);
        let at = [w * stream.uniform(0.04, 0.6) as f32, h * stream.uniform(0.1, 0.6) as f32];
        match stream.below(4) {
            0 | 1 => {
                for line in 0..stream.integer(2, 6) {
                    let y = at[1] + 0.075 * h * line as f32;
                    let long = w * stream.uniform(0.12, 0.3) as f32;
                    scrawl(&mut canvas, stream, [at[0], y], [long, 0.035 * h], width, ink);
                }
            }
            2 => {
                // A graph with axes.
                let size = 0.3 * h;
                canvas.line([at[0], at[1]], [at[0], at[1] + size], width, ink);
                canvas.line([at[0], at[1] + size], [at[0] + 1.3 * size, at[1] + size], width, ink);
                let mut last = [at[0], at[1] + 0.8 * size];
                for i in 1..16 {
                    let t = i as f32 / 16.0;
                    let next =
                        [at[0] + 1.25 * size * t, at[1] + size * (0.8 - 0.6 * t * t + 0.08 * libm::sinf(9.0 * t))];
                    canvas.line(last, next, width, inks[2]);
                    last = next;
                }
            }
            _ => {
                // Boxes with arrows.
                for i in 0..3 {
                    let x = at[0] + 0.32 * h * i as f32;
                    canvas.ring([x, at[1] + 0.1 * h], 0.085 * h, width, ink);
                    canvas.line([x + 0.1 * h, at[1] + 0.1 * h], [x + 0.2 * h, at[1] + 0.1 * h], width, ink);
                    let turn = TAU * 0.4;
                    let (sin, cos) = libm::sincosf(turn);
                    let tip = [x + 0.2 * h, at[1] + 0.1 * h];
                    canvas.line(tip, [tip[0] + 0.03 * h * cos, tip[1] + 0.03 * h * sin], width, ink);
                    canvas.line(tip, [tip[0] + 0.03 * h * cos, tip[1] - 0.03 * h * sin], width, ink);
                }
            }
        }
    }
    canvas.finish(Wrap::Clamp)
}
