//! Letters of scripts with thousands of forms, composed of strokes by rules: they look like writing and mean nothing.

use super::glyph::Glyph;
use syntable_model::random::Stream;

/// A square letter of horizontal, vertical and slanted strokes, as in East Asian writing.
pub fn square(stream: &mut Stream) -> Glyph {
    let mut strokes = Vec::new();
    let layout = stream.below(5);
    let (left, right) = ([0.0, 0.0, 0.4, 1.0], [0.5, 0.0, 1.0, 1.0]);
    let (above, below) = ([0.0, 0.0, 1.0, 0.45], [0.0, 0.55, 1.0, 1.0]);
    match layout {
        0 | 1 => [left, right].iter().for_each(|r| radical(&mut strokes, *r, stream)),
        2 | 3 => [above, below].iter().for_each(|r| radical(&mut strokes, *r, stream)),
        _ => radical(&mut strokes, [0.0, 0.0, 1.0, 1.0], stream),
    }
    Glyph { strokes, width: 0.92 }
}

/// One part of a square letter, in the box `[x0, y0, x1, y1]`.
fn radical(strokes: &mut Vec<Vec<[f32; 2]>>, [x0, y0, x1, y1]: [f32; 4], stream: &mut Stream) {
    let at = |x: f32, y: f32| [0.92 * (x0 + x * (x1 - x0)), 0.04 + 0.96 * (y0 + y * (y1 - y0))];
    match stream.below(7) {
        0 => {
            strokes.push(vec![at(0.05, 0.1), at(0.05, 0.95), at(0.95, 0.95), at(0.95, 0.1), at(0.05, 0.1)]);
            strokes.push(vec![at(0.05, 0.5), at(0.95, 0.5)]);
        }
        1 => {
            strokes.push(vec![at(0.0, 0.25), at(1.0, 0.25)]);
            strokes.push(vec![at(0.5, 0.0), at(0.5, 1.0)]);
            strokes.push(vec![at(0.5, 0.3), at(0.0, 0.85)]);
            strokes.push(vec![at(0.5, 0.3), at(1.0, 0.85)]);
        }
        2 => {
            for y in [0.1, 0.5, 0.9] {
                strokes.push(vec![at(0.1, y), at(0.9, y)]);
            }
            strokes.push(vec![at(0.5, 0.1), at(0.5, 0.9)]);
        }
        3 => {
            strokes.push(vec![at(0.5, 0.0), at(0.35, 0.5), at(0.0, 1.0)]);
            strokes.push(vec![at(0.4, 0.4), at(0.7, 0.75), at(1.0, 1.0)]);
        }
        4 => {
            strokes.push(vec![at(0.0, 0.3), at(1.0, 0.2)]);
            strokes.push(vec![at(0.6, 0.0), at(0.55, 0.9), at(0.3, 0.95)]);
            strokes.push(vec![at(0.15, 0.65), at(0.4, 0.55)]);
        }
        5 => {
            strokes.push(vec![at(0.0, 0.1), at(0.25, 0.3)]);
            strokes.push(vec![at(0.0, 0.45), at(0.2, 0.6)]);
            strokes.push(vec![at(0.0, 1.0), at(0.3, 0.7)]);
            strokes.push(vec![at(0.4, 0.2), at(1.0, 0.2), at(0.9, 1.0)]);
        }
        _ => {
            strokes.push(vec![at(0.1, 0.0), at(0.1, 1.0)]);
            strokes.push(vec![at(0.1, 0.1), at(0.9, 0.1), at(0.9, 1.0), at(0.75, 0.95)]);
            strokes.push(vec![at(0.3, 0.4), at(0.7, 0.4)]);
            strokes.push(vec![at(0.3, 0.7), at(0.7, 0.7)]);
        }
    }
}

/// A joined letter on a baseline with teeth, bowls and dots, as in Arabic writing.
pub fn joined(stream: &mut Stream) -> Glyph {
    let base = 0.86;
    let mut strokes: Vec<Vec<[f32; 2]>> = Vec::new();
    let width = match stream.below(6) {
        0 => {
            // A tall stroke that joins the line.
            strokes.push(vec![[0.0, base], [0.22, base], [0.26, 0.05]]);
            0.26
        }
        1 => {
            strokes.push(vec![[0.0, base], [0.2, base], [0.24, 0.6], [0.28, base], [0.44, base]]);
            0.44
        }
        2 => {
            let bowl = (0..=8).map(|i| libm::sincosf(std::f32::consts::PI * i as f32 / 8.0));
            strokes.push(bowl.map(|(sin, cos)| [0.3 - 0.3 * cos, base - 0.1 + 0.4 * sin]).collect());
            0.6
        }
        3 => {
            let eye = (0..=8).map(|i| libm::sincosf(std::f32::consts::TAU * i as f32 / 8.0));
            strokes.push(eye.map(|(sin, cos)| [0.2 + 0.14 * sin, base - 0.16 - 0.16 * cos]).collect());
            strokes.push(vec![[0.0, base], [0.44, base]]);
            0.44
        }
        4 => {
            strokes.push(vec![[0.3, 0.62], [0.3, 1.02], [0.18, 1.24], [0.0, 1.3]]);
            0.3
        }
        _ => {
            let teeth = [0.0, 0.12, 0.24, 0.36, 0.48];
            let tooth = |(i, x): (usize, &f32)| [*x, if i % 2 == 1 { base - 0.22 } else { base }];
            strokes.push(teeth.iter().enumerate().map(tooth).collect());
            0.48
        }
    };
    for dot in 0..stream.below(3) {
        let y = if stream.chance(0.5) { 0.36 } else { 1.2 };
        let x = 0.5 * width + 0.16 * (dot as f32 - 0.4);
        strokes.push(vec![[x, y], [x, y]]);
    }
    Glyph { strokes, width }
}

/// A letter that hangs from a line along its top, as in Devanagari writing.
pub fn hanging(stream: &mut Stream) -> Glyph {
    let top = 0.14;
    let width = 0.52;
    let mut strokes = vec![vec![[-0.1, top], [width + 0.1, top]]];
    let arc = |center: [f32; 2], radius: f32, from: f32, turn: f32| -> Vec<[f32; 2]> {
        (0..=7)
            .map(|i| {
                let (sin, cos) = libm::sincosf(from + turn * i as f32 / 7.0);
                [center[0] + radius * cos, center[1] + radius * sin]
            })
            .collect()
    };
    let has_bar = stream.chance(0.75);
    if has_bar {
        strokes.push(vec![[0.88 * width, top], [0.88 * width, 1.0]]);
    }
    match stream.below(5) {
        0 => strokes.push(arc([0.24, 0.56], 0.2, -2.6, 4.6)),
        1 => strokes.push(vec![[0.1, top], [0.1, 0.62], [0.88 * width, 0.62]]),
        2 => {
            strokes.push(arc([0.2, 0.42], 0.15, -1.6, 4.2));
            strokes.push(arc([0.2, 0.75], 0.16, -1.4, 4.0));
        }
        3 => strokes.push(vec![[0.26, top], [0.26, 0.4], [0.06, 0.62], [0.4, 1.0]]),
        _ => strokes.push(arc([0.18, 0.7], 0.17, 0.0, 6.2)),
    }
    if stream.chance(0.3) {
        strokes.push(arc([0.36, 0.02], 0.16, 3.2, 2.4));
    }
    Glyph { strokes, width }
}
