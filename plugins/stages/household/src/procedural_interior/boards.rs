//! Notice boards and whiteboards.

use super::piece::Piece;
use super::solids::{ball, boxed, rounded};
use crate::material::{MaterialFamily, hsv, notes, scribbles, vivid};
use crate::shape::{SlotMapping, thick_sheet};
use syntable_model::geometry::Point3;

/// A sheet of paper that shows one of the four quarters of an image, hung at its top; `lift` is how far its lower end
/// stands off.
pub fn paper(piece: &mut Piece, slot: u16, quarter: u64, [x, y, z]: [f64; 3], [wide, tall]: [f64; 2], lift: f64) {
    let turn = piece.form.normal() * 3.0;
    let side = piece.uniform(-1.0, 1.0);
    let at = |[u, v]: [f64; 2]| {
        let off = lift * (1.0 - v) * (1.0 - v) * (1.0 + 0.6 * side * (2.0 * u - 1.0));
        let point = |back: f64| Point3::new(wide * (u - 0.5), back - off - 0.0004, tall * (v - 0.5));
        [point(-0.0005), point(0.0)]
    };
    let (u, v) = (0.5 * (quarter % 2) as f64, 0.5 * (quarter / 2) as f64);
    let sheet = thick_sheet([3, 5], [3, 5], [SlotMapping::fit(slot); 3], at);
    let sheet = sheet.uv_in(slot, [u + 0.004, v + 0.004, u + 0.496, v + 0.496]);
    piece.keep(boxed(sheet.rotated(1, turn)).translated(x, y, z));
}

/// Four bars around a rectangle of half extents.
fn rim(piece: &mut Piece, slot: u16, [a, b]: [f64; 2], wide: f64) {
    for (low, high) in [
        ([-a - wide, -0.012, b], [a + wide, 0.0125, b + wide]),
        ([-a - wide, -0.012, -b - wide], [a + wide, 0.0125, -b]),
        ([-a - wide, -0.0117, -b - wide + 0.001], [-a, 0.012, b + wide - 0.001]),
        ([a, -0.0117, -b - wide + 0.001], [a + wide, 0.012, b + wide - 0.001]),
    ] {
        piece.block(slot, low, high, 0.003);
    }
}

/// A board of cork or cloth with pinned papers.
pub fn notice_board(piece: &mut Piece) {
    let board = if piece.paint.chance(0.65) { piece.surface(&[MaterialFamily::Cork]) } else { piece.cloth() };
    let frame = if piece.paint.chance(0.6) { piece.wood(0.3) } else { piece.metal() };
    let (a, b) = (0.5 * piece.uniform(0.5, 1.2), 0.5 * piece.uniform(0.4, 0.9));
    piece.board(board, [-a - 0.002, -0.004, -b - 0.002], [a + 0.002, 0.011, b + 0.002]);
    let wide = piece.uniform(0.012, 0.03);
    rim(piece, frame, [a, b], wide);
    let sheets = [0; 2].map(|_| {
        let sheet = notes(&mut piece.paint, piece.photographs);
        piece.image(sheet, 0.8)
    });
    let pins = [0; 3].map(|_| {
        let color = vivid(&mut piece.paint);
        piece.plain("pin", color, 0.25)
    });
    let columns = (2.0 * a / 0.2) as usize;
    let rows = (2.0 * b / 0.24).max(1.0) as usize;
    for cell in 0..columns * rows {
        if piece.form.chance(0.22) {
            continue;
        }
        let (pitch_x, pitch_z) = (2.0 * a / columns as f64, 2.0 * b / rows as f64);
        let x = -a + pitch_x * ((cell % columns) as f64 + 0.5) + piece.uniform(-0.02, 0.02);
        let z = -b + pitch_z * ((cell / columns) as f64 + 0.5) + piece.uniform(-0.02, 0.02);
        let scale = piece.uniform(0.75, 1.0);
        let size = *piece.form.pick(&[[0.15, 0.21], [0.1, 0.15], [0.15, 0.1], [0.076, 0.076]]).unwrap_or(&[0.15, 0.21]);
        let (wide, tall) = ((scale * size[0]).min(0.95 * pitch_x), (scale * size[1]).min(0.95 * pitch_z));
        let (slot, quarter) = (sheets[cell % 2], piece.form.below(4));
        let lift = piece.uniform(0.002, 0.02);
        let depth = -0.004 - 0.0002 * (cell % 7) as f64;
        paper(piece, slot, quarter, [x, depth, z], [wide, tall], lift);
        let pin = pins[cell % 3];
        let at = Point3::new(x + piece.uniform(-0.01, 0.01), -0.0085, z + 0.42 * tall);
        let knob = ball(SlotMapping::fit(pin), at, 0.005);
        piece.cluster(knob);
    }
}

/// A whiteboard with writing, a tray with pens and a sponge, and magnets.
pub fn whiteboard(piece: &mut Piece) {
    let (a, b) = (0.5 * piece.uniform(0.6, 1.8), 0.5 * piece.uniform(0.45, 1.1));
    let texture = scribbles(&mut piece.paint, a / b);
    let face = piece.image(texture, 0.12);
    let frame = piece.plain("aluminum", hsv(0.6, 0.02, 0.72), 0.35);
    piece.panel([face, frame], [-a, -0.004, -b], [a, 0.011, b]);
    let wide = piece.uniform(0.01, 0.024);
    rim(piece, frame, [a, b], wide);
    let cap = piece.plain("corner", [0.2; 3], 0.5);
    for (x, z) in [(-a, -b), (a, -b), (a, b), (-a, b)] {
        let (x, z) = (x + 0.5 * wide * x.signum(), z + 0.5 * wide * z.signum());
        piece.block(cap, [x - 0.6 * wide, -0.0135, z - 0.6 * wide], [x + 0.6 * wide, 0.012, z + 0.6 * wide], 0.003);
    }
    let reach = 0.45 * a;
    let low = -b - wide;
    piece.board(frame, [-reach, -0.07, low - 0.003], [reach, -0.01, low]);
    piece.board(frame, [-reach, -0.072, low - 0.003], [reach, -0.069, low + 0.009]);
    for number in 0..piece.form.integer(1, 4) {
        let color = *piece
            .paint
            .pick(&[[0.05, 0.05, 0.06], [0.7, 0.06, 0.05], [0.05, 0.15, 0.6], [0.03, 0.4, 0.15]])
            .unwrap_or(&[0.05; 3]);
        let pen = piece.plain("pen", color, 0.35);
        let x = -reach + 0.16 * (number as f64 + 0.2);
        if x + 0.13 < reach {
            piece.bar(
                pen,
                [x, -0.045, low + 0.009],
                [x + 0.125, -0.043 + 0.001 * number as f64, low + 0.009],
                [0.009, 0.0085],
            );
        }
    }
    let sponge =
        rounded([reach - 0.11, -0.06, low], [reach - 0.01, -0.015, low + 0.03], 0.006, |_| SlotMapping::fit(cap));
    piece.join(cap, sponge);
    for _ in 0..piece.form.below(6) {
        let color = vivid(&mut piece.paint);
        let magnet = piece.plain("magnet", color, 0.35);
        let (x, z) = (piece.uniform(-0.95, 0.95) * a, piece.uniform(-0.9, 0.9) * b);
        piece.bar(magnet, [x, -0.003, z], [x, -0.011, z], [0.014; 2]);
    }
}
