//! Images of small surfaces: the view from a window, the face of a clock, and leaves.

use super::glyph::letters;
use super::text::Setting;
use super::typeface::{TextRole, Typeface};
use super::wall::whole;
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, ScalarField, SrgbColor, hsv, mix, shade};
use std::f32::consts::TAU;
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Texture, Wrap};

/// The outdoors through a window, out of focus: sky, trees or houses, and the ground.
pub fn outdoors(stream: &mut Stream, photographs: &[Photograph]) -> Arc<Texture> {
    let size = 192;
    let mut canvas = MaterialCanvas::new(size, size, [0.8; 3]);
    let edge = size as f32;
    if let Some(photograph) = stream.pick(photographs).filter(|_| photographs.len() > 40) {
        whole(&mut canvas, photograph, [0.0, 0.0, edge, edge]);
        return canvas.finish(Wrap::Clamp);
    }
    let is_blue = stream.chance(0.5);
    let sky = if is_blue { [0.55, 0.72, 0.95] } else { [0.86, 0.89, 0.92] };
    let horizon = stream.uniform(0.35, 0.75) as f32;
    let leaves = ScalarField::fractal(64, [6, 6], 4, 0.6, stream);
    let skyline = ScalarField::fractal(64, [7, 1], 3, 0.5, stream);
    let green = hsv(stream.uniform(0.2, 0.34), stream.uniform(0.25, 0.5), stream.uniform(0.25, 0.5));
    let wall = hsv(stream.uniform(0.02, 0.13), stream.uniform(0.05, 0.35), stream.uniform(0.45, 0.8));
    let has_houses = stream.chance(0.5);
    canvas.map(|x, y, _| {
        let (u, v) = (x as f32 / edge, y as f32 / edge);
        let top = horizon + 0.2 * skyline.sample(64.0 * u, 8.0);
        let house = has_houses && libm::sinf(9.0 * u + 1.0) > -0.2;
        let top = if house { horizon - 0.12 + 0.1 * (libm::floorf(5.0 * u) * 0.37).fract() } else { top };
        let noise = leaves.sample(64.0 * u, 64.0 * v);
        let far = mix(sky, [0.97; 3], v / horizon.max(0.1));
        let near = if house {
            let pane = (14.0 * u).fract() > 0.55 && (12.0 * v).fract() > 0.5;
            shade(wall, if pane { 0.45 } else { 1.0 })
        } else {
            shade(green, 1.0 + 0.8 * noise)
        };
        let ground = mix(near, [0.5, 0.5, 0.48], ((v - horizon - 0.15) / 0.2).clamp(0.0, 0.8));
        mix(far, ground, (v - top) / 0.03)
    });
    canvas.finish(Wrap::Clamp)
}

/// The face of a clock, with the color of its hands.
pub fn clock_face(stream: &mut Stream) -> (Arc<Texture>, SrgbColor) {
    let is_dark = stream.chance(0.25);
    let (ground, ink) = if is_dark { ([0.08, 0.08, 0.1], [0.92; 3]) } else { ([0.93, 0.92, 0.89], [0.06; 3]) };
    let mut canvas = MaterialCanvas::new(320, 320, ground);
    let middle = 160.0;
    let face = Typeface::draw(stream, TextRole::Subtitle);
    let numbers = stream.below(3);
    let mark = |canvas: &mut MaterialCanvas, step: f32, from: f32, to: f32, width: f32| {
        let (sin, cos) = libm::sincosf(TAU * step);
        let at = |r: f32| [middle + middle * r * sin, middle - middle * r * cos];
        canvas.line(at(from), at(to), width, ink);
    };
    for minute in 0..60 {
        let step = minute as f32 / 60.0;
        if minute % 5 == 0 {
            mark(&mut canvas, step, if numbers == 0 { 0.76 } else { 0.86 }, 0.93, 5.0);
        } else if numbers != 2 {
            mark(&mut canvas, step, 0.9, 0.93, 1.6);
        }
    }
    if numbers > 0 {
        for hour in 1..=12 {
            let (sin, cos) = libm::sincosf(TAU * hour as f32 / 12.0);
            let at = [middle + 0.68 * middle * sin, middle - 0.68 * middle * cos];
            let upright = Typeface { slant: 0.0, ..face.clone() };
            Setting::level(at, 28.0, 44.0, ink).draw(&mut canvas, &upright, &letters(&hour.to_string()), false);
        }
    }
    (canvas.finish(Wrap::Clamp), ink)
}

/// A leaf from its stalk (below) to its tip: a middle rib, side ribs, and a margin of another color.
pub fn leaf(stream: &mut Stream, color: SrgbColor, tip: SrgbColor) -> Arc<Texture> {
    let mut canvas = MaterialCanvas::new(64, 128, color);
    let grain = ScalarField::fractal(64, [6, 6], 4, 0.6, stream);
    let ribs = stream.uniform(7.0, 13.0) as f32;
    let margin = if stream.chance(0.3) { stream.uniform(0.3, 0.8) as f32 } else { 0.0 };
    let bands = if stream.chance(0.2) { 0.25 } else { 0.0 };
    canvas.map(|x, y, color| {
        let (u, v) = ((x as f32 + 0.5) / 32.0 - 1.0, 1.0 - y as f32 / 128.0);
        let noise = grain.sample(x as f32, y as f32);
        let rib = libm::expf(-(u / 0.07) * (u / 0.07));
        let side = libm::powf(libm::fabsf(libm::sinf(ribs * (v - 0.5 * u.abs()) * 3.1)), 12.0);
        let band = bands * libm::sinf(22.0 * v + 3.0 * noise);
        let tone = 1.0 + 0.16 * noise - 0.14 * side + band - 0.15 * (1.0 - v);
        let edge = ((u.abs() - 0.55) / 0.35).clamp(0.0, 1.0);
        let green = mix(shade(color, tone), tip, margin * edge + 0.25 * ((v - 0.8) / 0.2).max(0.0));
        mix(green, [0.7, 0.75, 0.5], 0.35 * rib)
    });
    canvas.finish(Wrap::Clamp)
}
