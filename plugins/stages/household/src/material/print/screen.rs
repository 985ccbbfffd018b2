//! Images of lit screens: photographs, windows with text, code, charts and films.

use super::artwork::{Artwork, ArtworkPlace};
use super::text::Paragraph;
use super::typeface::{TextRole, Typeface};
use super::wall::whole;
use super::words::Script;
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, SrgbColor, hsv, mix, vivid};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Texture, Wrap};

/// Width of a screen's image, texels.
const WIDTH: usize = 640;

/// The image of a screen of some width over height.
pub fn screen_image(stream: &mut Stream, aspect: f64, photographs: &[Photograph]) -> Arc<Texture> {
    let mut canvas = MaterialCanvas::new(WIDTH, ((WIDTH as f64 / aspect) as usize).max(64), [0.02; 3]);
    let [w, h] = canvas.size();
    match stream.below(6) {
        0 | 1 => film(&mut canvas, stream, photographs),
        2 => {
            wallpaper(&mut canvas, stream, photographs);
            let (x, y) = (stream.uniform(0.08, 0.3) as f32, stream.uniform(0.06, 0.2) as f32);
            window(&mut canvas, stream, [x * w, y * h, (x + 0.6) * w, (y + 0.7) * h]);
            task_bar(&mut canvas, stream);
        }
        3 => code(&mut canvas, stream),
        4 => {
            window(&mut canvas, stream, [0.0, 0.0, w, h]);
            task_bar(&mut canvas, stream);
        }
        _ => {
            wallpaper(&mut canvas, stream, photographs);
            task_bar(&mut canvas, stream);
            for i in 0..stream.integer(3, 12) {
                let (column, row) = ((i / 5) as f32, (i % 5) as f32);
                let at = [0.03 * w + 0.075 * w * column, 0.05 * h + 0.16 * h * row];
                let color = vivid(stream);
                canvas.rect([at[0], at[1], at[0] + 0.035 * w, at[1] + 0.035 * w], 4.0, color);
                canvas.rect([at[0], at[1] + 0.045 * w, at[0] + 0.035 * w, at[1] + 0.05 * w], 0.0, [0.95; 3]);
            }
        }
    }
    canvas.finish(Wrap::Clamp)
}

fn scene(canvas: &mut MaterialCanvas, stream: &mut Stream, photographs: &[Photograph], r: [f32; 4]) {
    if let Some(photograph) = stream.pick(photographs) {
        whole(canvas, photograph, r);
        return;
    }
    let colors = [vivid(stream), vivid(stream)];
    Artwork::new(&stream.child("screen"), &[]).draw(canvas, ArtworkPlace::Full, r, r, colors);
}

/// A film, with black bars above and below in half of all.
fn film(canvas: &mut MaterialCanvas, stream: &mut Stream, photographs: &[Photograph]) {
    let [w, h] = canvas.size();
    let bar = if stream.chance(0.5) { 0.11 * h } else { 0.0 };
    scene(canvas, stream, photographs, [0.0, bar, w, h - bar]);
    if stream.chance(0.3) {
        canvas.rect([0.05 * w, 0.9 * h, 0.95 * w, 0.905 * h], 0.0, [0.7; 3]);
        canvas.rect([0.05 * w, 0.9 * h, 0.4 * w, 0.905 * h], 0.0, [0.85, 0.1, 0.08]);
    }
}

fn wallpaper(canvas: &mut MaterialCanvas, stream: &mut Stream, photographs: &[Photograph]) {
    let [w, h] = canvas.size();
    if stream.chance(0.5) {
        scene(canvas, stream, photographs, [0.0, 0.0, w, h]);
        return;
    }
    let (hue, value) = (stream.unit(), stream.uniform(0.25, 0.75));
    canvas.gradient([0.0, 0.0, w, h], [hsv(hue, 0.7, value), hsv(hue + 0.08, 0.6, 0.6 * value)]);
    for _ in 0..3 {
        let at = [w * stream.unit() as f32, h * stream.unit() as f32];
        let radius = w * stream.uniform(0.15, 0.4) as f32;
        let color = hsv(hue + stream.uniform(-0.1, 0.15), 0.6, (1.3 * value).min(1.0));
        canvas.blend([0.0, 0.0, w, h], |x, y| {
            let d = libm::hypotf(x - at[0], y - at[1]) / radius;
            (color, 0.5 * (1.0 - d).max(0.0))
        });
    }
}

fn task_bar(canvas: &mut MaterialCanvas, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let tone = if stream.chance(0.5) { [0.1, 0.11, 0.13] } else { [0.88, 0.89, 0.91] };
    canvas.rect([0.0, 0.955 * h, w, h], 0.0, tone);
    for i in 0..stream.integer(4, 9) {
        let x = 0.01 * w + 0.03 * w * i as f32;
        let color = vivid(stream);
        canvas.rect([x, 0.964 * h, x + 0.02 * w, 0.992 * h], 2.0, color);
    }
}

/// A window with a title bar, a list at its side, and a page of text with images, or a table.
fn window(canvas: &mut MaterialCanvas, stream: &mut Stream, [x0, y0, x1, y1]: [f32; 4]) {
    let (w, h) = (x1 - x0, y1 - y0);
    let accent = hsv(stream.unit(), 0.6, 0.6);
    canvas.rect([x0, y0, x1, y1], 3.0, [0.96; 3]);
    canvas.rect([x0, y0, x1, y0 + 0.06 * h], 3.0, if stream.chance(0.5) { accent } else { [0.84; 3] });
    canvas.rect([x0, y0 + 0.06 * h, x1, y0 + 0.11 * h], 0.0, [0.9; 3]);
    canvas.rect([x0 + 0.12 * w, y0 + 0.07 * h, x0 + 0.7 * w, y0 + 0.1 * h], 6.0, [0.99; 3]);
    let side = if stream.chance(0.6) { 0.2 * w } else { 0.0 };
    let face = Typeface::draw(stream, TextRole::Prose);
    let text = |height: f32, color: SrgbColor| Paragraph {
        face: &face,
        script: Script::Latin,
        height,
        color,
        is_centered: false,
    };
    if side > 0.0 {
        canvas.rect([x0, y0 + 0.11 * h, x0 + side, y1], 0.0, mix(accent, [0.9; 3], 0.85));
        text(5.0, [0.3; 3]).fill(canvas, stream, [x0 + 6.0, y0 + 0.16 * h, x0 + side - 4.0, y1 - 8.0]);
    }
    let left = x0 + side + 0.04 * w;
    if stream.chance(0.35) {
        // A table with a chart.
        for row in 0..22 {
            let y = y0 + (0.14 + 0.036 * row as f32) * h;
            canvas.rect([left, y, x1 - 0.03 * w, y + 1.0], 0.0, [0.8; 3]);
            for column in 0..6 {
                let x = left + 0.11 * w * column as f32;
                let long = stream.uniform(0.02, 0.09) as f32 * w;
                canvas.rect([x, y + 4.0, x + long, y + 7.0], 0.0, [0.35; 3]);
            }
        }
        let base = y1 - 0.1 * h;
        canvas.rect([x1 - 0.36 * w, y1 - 0.5 * h, x1 - 0.04 * w, y1 - 0.06 * h], 2.0, [1.0; 3]);
        for i in 0..7 {
            let x = x1 - 0.33 * w + 0.04 * w * i as f32;
            let tall = stream.uniform(0.06, 0.34) as f32 * h;
            canvas.rect([x, base - tall, x + 0.026 * w, base], 0.0, accent);
        }
        return;
    }
    let image = [left, y0 + 0.15 * h, left + 0.4 * w, y0 + 0.45 * h];
    text(9.0, [0.12; 3]).fill(canvas, stream, [left + 0.43 * w, image[1], x1 - 0.03 * w, image[1] + 0.1 * h]);
    text(4.5, [0.3; 3]).fill(canvas, stream, [left + 0.43 * w, image[1] + 0.13 * h, x1 - 0.03 * w, image[3]]);
    text(4.5, [0.3; 3]).fill(canvas, stream, [left, image[3] + 0.05 * h, x1 - 0.03 * w, y1 - 0.04 * h]);
    scene(canvas, stream, &[], image);
}

/// An editor with colored words on a dark or white page.
fn code(canvas: &mut MaterialCanvas, stream: &mut Stream) {
    let [w, h] = canvas.size();
    let is_dark = stream.chance(0.75);
    let ground = if is_dark { [0.11, 0.12, 0.14] } else { [0.97; 3] };
    canvas.rect([0.0, 0.0, w, h], 0.0, ground);
    canvas.rect([0.0, 0.0, 0.16 * w, h], 0.0, mix(ground, [0.5; 3], 0.12));
    canvas.rect([0.0, 0.0, w, 0.04 * h], 0.0, mix(ground, [0.5; 3], 0.2));
    let value = if is_dark { 0.85 } else { 0.45 };
    let inks = [0.58, 0.08, 0.3, 0.8, 0.0].map(|hue| hsv(hue, if hue == 0.0 { 0.0 } else { 0.5 }, value));
    let mut indent = 0;
    let mut y = 0.06 * h;
    while y < 0.97 * h {
        let mut x = 0.19 * w + 0.022 * w * indent as f32;
        for _ in 0..stream.integer(1, 7) {
            let long = stream.uniform(0.012, 0.08) as f32 * w;
            let ink = *stream.pick(&inks).unwrap_or(&inks[0]);
            canvas.rect([x, y, x + long, y + 0.009 * h.max(300.0)], 1.0, ink);
            x += long + 0.01 * w;
        }
        if stream.chance(0.5) {
            let long = stream.uniform(0.04, 0.11) as f32 * w;
            canvas.rect([0.02 * w, y, 0.02 * w + long, y + 3.0], 1.0, mix(ground, [0.6; 3], 0.5));
        }
        indent = (indent + stream.integer(-1, 1)).clamp(0, 6);
        y += if stream.chance(0.12) { 14.0 } else { 7.5 };
    }
}
