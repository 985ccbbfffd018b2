//! Seals, ribbons, bursts and the marks that packages carry.

use super::scheme::{Scheme, ink_on};
use super::text::Setting;
use super::typeface::Typeface;
use super::words::Script;
use crate::material::{MaterialCanvas, SrgbColor, mix, shade};
use std::f32::consts::TAU;
use syntable_model::random::Stream;

/// A seal with a claim: burst, disc, ribbon or plate of a radius.
pub fn seal(
    canvas: &mut MaterialCanvas,
    stream: &mut Stream,
    scheme: &Scheme,
    (face, script): (&Typeface, Script),
    center: [f32; 2],
    radius: f32,
) {
    let color = if stream.chance(0.6) { scheme.accent } else { hue_of_seal(stream) };
    let ink = ink_on(color, scheme.ground);
    let before = canvas.set_finish(scheme.ornament);
    match stream.below(5) {
        0 => canvas.star(center, radius, stream.integer(14, 30) as usize, 0.14, color),
        1 => {
            canvas.ellipse(center, [radius; 2], color);
            canvas.ring(center, 0.88 * radius, 0.05 * radius, ink);
        }
        2 => ribbon(canvas, center, [1.25 * radius, 0.42 * radius], color),
        3 => {
            canvas.ellipse(center, [radius; 2], shade(color, 0.75));
            canvas.ellipse(center, [0.92 * radius; 2], mix(color, [1.0; 3], 0.1));
        }
        _ => {
            let [x, y] = center;
            canvas.rect([x - radius, y - 0.6 * radius, x + radius, y + 0.6 * radius], 0.2 * radius, color);
        }
    }
    canvas.set_finish(before);
    let turn = if stream.chance(0.5) { stream.uniform(-0.3, 0.1) as f32 } else { 0.0 };
    for (dy, height) in [(-0.2, 0.3), (0.24, 0.2)] {
        let claim = script.claim(stream);
        let (sin, cos) = libm::sincosf(turn);
        let at = [center[0] - sin * dy * radius, center[1] + cos * dy * radius];
        let setting = Setting { turn, ..Setting::level(at, height * radius, 1.45 * radius, ink) };
        setting.draw(canvas, face, &claim, script.joins());
    }
}

fn hue_of_seal(stream: &mut Stream) -> SrgbColor {
    *stream.pick(&[[0.1, 0.45, 0.15], [0.75, 0.08, 0.08], [0.95, 0.78, 0.1], [0.08, 0.2, 0.5]]).unwrap_or(&[0.5; 3])
}

/// A ribbon with notched, folded ends; `half` its extents.
pub fn ribbon(canvas: &mut MaterialCanvas, [x, y]: [f32; 2], [hx, hy]: [f32; 2], color: SrgbColor) {
    for side in [-1.0, 1.0] {
        let (tip, fold) = (x + side * 1.28 * hx, x + side * 0.86 * hx);
        let drop = 0.35 * hy;
        canvas.polygon(
            &[
                [fold, y - hy + drop],
                [tip, y - hy + drop],
                [tip - side * 0.18 * hx, y + drop],
                [tip, y + hy + drop],
                [fold, y + hy + drop],
            ],
            shade(color, 0.72),
        );
        let edge = x + side * hx;
        canvas.polygon(&[[fold, y + hy], [edge, y + hy], [fold, y + hy + drop]], shade(color, 0.45));
    }
    canvas.rect([x - hx, y - hy, x + hx, y + hy], 0.0, color);
}

/// Rays from a point to the edges of a box.
pub fn rays(canvas: &mut MaterialCanvas, r: [f32; 4], [cx, cy]: [f32; 2], count: usize, color: SrgbColor) {
    canvas.fill(r, color, |x, y| {
        let phase = libm::atan2f(y - cy, x - cx) / TAU * count as f32;
        let from_edge = (phase - phase.floor() - 0.5).abs() - 0.25;
        from_edge * TAU / count as f32 * ((x - cx) * (x - cx) + (y - cy) * (y - cy)).sqrt()
    });
}

/// Three bent arrows in a triangle with a number below, as on packages that can be recycled.
pub fn recycling_mark(canvas: &mut MaterialCanvas, [cx, cy]: [f32; 2], radius: f32, color: SrgbColor) {
    let at = |angle: f32, r: f32| {
        let (sin, cos) = libm::sincosf(angle - TAU / 4.0);
        [cx + r * cos, cy + r * sin]
    };
    for i in 0..3 {
        let angle = TAU * i as f32 / 3.0;
        let (a, b) = (at(angle + 0.25, 0.9 * radius), at(angle + TAU / 3.0 - 0.55, 0.8 * radius));
        canvas.line(a, b, 0.2 * radius, color);
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let length = (dx * dx + dy * dy).sqrt().max(1e-3);
        let [ux, uy] = [dx / length * 0.3 * radius, dy / length * 0.3 * radius];
        canvas.polygon(&[[b[0] - uy, b[1] + ux], [b[0] + 1.4 * ux, b[1] + 1.4 * uy], [b[0] + uy, b[1] - ux]], color);
    }
}

/// A crest: shield, wreath, crown or letters in a ring, for premium and old brands.
pub fn crest(canvas: &mut MaterialCanvas, stream: &mut Stream, [x, y]: [f32; 2], r: f32, colors: [SrgbColor; 2]) {
    let [color, ground] = colors;
    match stream.below(4) {
        0 => {
            let shield = |s: f32| {
                let mut corners = vec![[x - 0.8 * s, y - 0.9 * s], [x + 0.8 * s, y - 0.9 * s]];
                corners.extend((0..=8).map(|i| {
                    let t = i as f32 / 8.0;
                    let bulge = libm::sinf(t * TAU / 2.0);
                    [x + (0.8 - 1.6 * t) * s, y + (0.1 + 0.9 * bulge) * s]
                }));
                corners
            };
            canvas.polygon(&shield(r), color);
            canvas.polygon(&shield(0.86 * r), ground);
            canvas.star([x, y], 0.5 * r, 5, 0.55, color);
        }
        1 => {
            for i in 0..18 {
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                let angle = side * (0.5 + 0.27 * (i / 2) as f32);
                let (sin, cos) = libm::sincosf(angle);
                let at = [x + r * sin, y - 0.15 * r - 0.95 * r * cos];
                leaf(canvas, at, 0.26 * r, angle + side * 0.9, color);
            }
            canvas.star([x, y], 0.36 * r, 6, 0.5, color);
        }
        2 => {
            let low = y + 0.5 * r;
            let crown: Vec<[f32; 2]> = (0..7)
                .map(|i| [x + (i as f32 - 3.0) / 3.0 * r, if i % 2 == 0 { y - 0.5 * r } else { y + 0.1 * r }])
                .chain([[x + 0.9 * r, low], [x - 0.9 * r, low]])
                .collect();
            canvas.polygon(&crown, color);
            canvas.rect([x - 0.9 * r, low + 0.08 * r, x + 0.9 * r, low + 0.24 * r], 0.0, color);
        }
        _ => {
            canvas.ring([x, y], 0.92 * r, 0.08 * r, color);
            canvas.ring([x, y], 0.74 * r, 0.03 * r, color);
            for i in 0..5 {
                let (sin, cos) = libm::sincosf(TAU * i as f32 / 5.0);
                canvas.ellipse([x + 0.36 * r * sin, y - 0.36 * r * cos], [0.22 * r; 2], color);
            }
            canvas.ellipse([x, y], [0.2 * r; 2], ground);
        }
    }
}

/// A flat leaf with its tip away from `at`, turned clockwise from up.
fn leaf(canvas: &mut MaterialCanvas, [x, y]: [f32; 2], length: f32, turn: f32, color: SrgbColor) {
    let (sin, cos) = libm::sincosf(turn);
    let reach = length + 1.0;
    canvas.fill([x - reach, y - reach, x + reach, y + reach], color, |px, py| {
        let (dx, dy) = (px - x, py - y);
        let (along, across) = ((dx * sin - dy * cos) / length, (dx * cos + dy * sin) / length);
        let half = 0.28 * (1.0 - (2.0 * along - 1.0) * (2.0 * along - 1.0));
        if (0.0..=1.0).contains(&along) { (across.abs() - half) * length } else { length }
    });
}

/// The dots of a printed date, as an ink jet sprays it.
pub fn stamp(canvas: &mut MaterialCanvas, stream: &mut Stream, face: &Typeface, at: [f32; 2], height: f32) {
    let number = |stream: &mut Stream, from: i64, to: i64| format!("{:02}", stream.integer(from, to));
    let day = format!("{}.{}.{}", number(stream, 1, 28), number(stream, 1, 12), number(stream, 24, 29));
    let lot = format!(
        "L{}{} {}:{}",
        number(stream, 10, 99),
        number(stream, 10, 99),
        number(stream, 0, 23),
        number(stream, 0, 59)
    );
    let thin = Typeface { weight: 0.12, serif: 0.0, slant: 0.0, is_round: true, stretch: 0.9, ..face.clone() };
    for (i, text) in [day, lot].iter().enumerate() {
        let top = [at[0], at[1] + 1.5 * i as f32 * height];
        super::text::flush_left(canvas, &thin, &super::glyph::letters(text), top, height, [0.1; 3]);
    }
}
