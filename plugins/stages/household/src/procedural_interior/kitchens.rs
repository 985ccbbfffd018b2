//! Kitchen units and refrigerators.

use super::boards::paper;
use super::cabinets::{carcass, finishes, front};
use super::piece::Piece;
use super::tones;
use crate::material::{MaterialFamily, hsv, notes, vivid};

/// A row of base units under a worktop; some with wall units above.
pub fn kitchen(piece: &mut Piece) {
    use MaterialFamily::{Granite, Laminate, Marble, Worktop};
    let (slots, style) = finishes(piece);
    let worktop = piece.surface(&[Worktop, Worktop, Laminate, Granite, Marble]);
    let units = piece.form.integer(2, 4) as usize;
    let (wide, b) = (0.6, 0.29);
    let a = 0.5 * wide * units as f64;
    piece.board(slots.dark, [-a, -b + 0.05, 0.0], [a, b, 0.1]);
    carcass(piece, &slots, [a, b], [0.1, 0.86], 0.0);
    piece.block(worktop, [-a - 0.01, -b - 0.04, 0.86], [a + 0.01, b, 0.9], 0.004);
    for unit in 0..units {
        let x = -a + wide * unit as f64;
        match piece.form.below(3) {
            0 => {
                for (low, high) in [(0.1, 0.36), (0.36, 0.62), (0.62, 0.838)] {
                    front(piece, &slots, style, [x, low, x + wide, high], -b, 0.0);
                }
            }
            1 => front(piece, &slots, style, [x, 0.1, x + wide, 0.838], -b, if unit % 2 == 0 { 1.0 } else { -1.0 }),
            _ => {
                front(piece, &slots, style, [x, 0.68, x + wide, 0.838], -b, 0.0);
                front(piece, &slots, style, [x, 0.1, x + wide, 0.68], -b, if unit % 2 == 0 { 1.0 } else { -1.0 });
            }
        }
    }
    // A row of wall units above, in some.
    let has_wall_units = piece.form.chance(0.55);
    // Below wall units, the free part of the worktop is in front.
    let free = if has_wall_units { 0.13 } else { b };
    piece.carries([0.0, free - b - 0.03, 0.9], [a, free]);
    if has_wall_units {
        let (low, high, depth) = (1.42, 1.42 + piece.uniform(0.6, 0.75), 0.33);
        piece.board(slots.carcass, [-a, b - depth, low], [a, b, high]);
        piece.board(slots.carcass, [-a, b - 0.012, 0.9], [a, b, low]);
        for unit in 0..units {
            let x = -a + wide * unit as f64;
            front(piece, &slots, style, [x, low, x + wide, high], b - depth, if unit % 2 == 0 { 1.0 } else { -1.0 });
        }
    }
}

/// A refrigerator with two doors, some with papers and magnets.
pub fn refrigerator(piece: &mut Piece) {
    let body = match piece.paint.below(3) {
        0 => piece.surface(&[MaterialFamily::BrushedMetal]),
        1 => piece.plain("enamel", hsv(0.12, 0.02, 0.88), 0.25),
        _ => {
            let color = tones::paint(&mut piece.paint);
            piece.plain("enamel", color, 0.22)
        }
    };
    let handle = piece.metal();
    let seal = piece.plain("seal", hsv(0.6, 0.02, 0.3), 0.8);
    let (a, b, height) = (0.5 * piece.uniform(0.55, 0.7), 0.3, piece.uniform(1.45, 1.95));
    piece.board(seal, [-a + 0.02, -b + 0.03, 0.0], [a - 0.02, b, 0.04]);
    piece.block(body, [-a, -b, 0.03], [a, b, height], 0.008);
    piece.board(seal, [-a + 0.008, -b - 0.012, 0.045], [a - 0.008, -b + 0.01, height - 0.008]);
    let split = height * if piece.form.chance(0.5) { piece.uniform(0.3, 0.4) } else { piece.uniform(0.62, 0.72) };
    let side = if piece.form.chance(0.5) { 1.0 } else { -1.0 };
    for (low, high) in [(0.045, split - 0.004), (split + 0.004, height)] {
        piece.block(body, [-a, -b - 0.07, low], [a, -b - 0.01, high], 0.014);
        let x = side * (a - 0.05);
        let (z0, z1) = if low > 0.1 {
            (low + 0.08, (low + 0.5).min(high - 0.08))
        } else {
            ((high - 0.5).max(low + 0.08), high - 0.08)
        };
        let y = -b - 0.11;
        piece.bar(handle, [x, y, z0], [x, y, z1], [0.009; 2]);
        for z in [z0 + 0.03, z1 - 0.03] {
            piece.bar(handle, [x, y, z], [x, -b - 0.06, z], [0.007; 2]);
        }
    }
    if piece.form.chance(0.7) {
        let sheet = notes(&mut piece.paint, piece.photographs);
        let print = piece.image(sheet, 0.8);
        for number in 0..piece.form.integer(1, 5) {
            let (x, z) = (piece.uniform(-0.7, 0.45) * a, piece.uniform(split + 0.15, height - 0.2));
            let cell = number as u64 % 4;
            paper(piece, print, cell, [x, -b - 0.0705, z], [0.09, 0.12], 0.006);
            let color = vivid(&mut piece.paint);
            let magnet = piece.plain("magnet", color, 0.35);
            piece.bar(magnet, [x, -b - 0.071, z + 0.05], [x, -b - 0.079, z + 0.05], [0.011; 2]);
        }
    }
    piece.carries([0.0, 0.0, height], [a, b]);
}
