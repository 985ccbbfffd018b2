//! Wall art, mirrors and clocks.

use super::piece::Piece;
use super::solids::{arc, rounded, tube};
use super::tones;
use crate::material::{MaterialFamily, SurfaceFinish, WallArt, clock_face, hsv, wall_art as art_print};
use crate::shape::{Lathe, Profile, SlotMapping};
use std::f64::consts::TAU;
use syntable_model::geometry::{Point3, Vector3};

/// One to four framed or bare prints, side by side or above each other.
pub fn wall_art(piece: &mut Piece) {
    let count = *piece.form.pick(&[1, 1, 1, 2, 3, 4]).unwrap_or(&1);
    let frame = match piece.paint.below(4) {
        0 => piece.metal(),
        1 => piece.plain("frame", hsv(0.0, 0.0, 0.03), 0.4),
        _ => piece.wood(0.3),
    };
    let mat = piece.tinted(MaterialFamily::Paper, hsv(0.12, 0.04, 0.9), 0.9);
    let size = if count == 1 { piece.uniform(0.3, 0.95) } else { piece.uniform(0.22, 0.42) };
    let style = piece.form.below(5);
    let gap = piece.uniform(0.03, 0.09);
    let is_row = count == 2 || count == 3 || piece.form.chance(0.3);
    let mut x = 0.0;
    for number in 0..count {
        let kind = WallArt::draw(&mut piece.paint, piece.photographs);
        let aspect = kind.aspect();
        let (a, b) = (0.5 * size * libm::sqrt(aspect), 0.5 * size / libm::sqrt(aspect));
        let at = match (is_row, number) {
            (true, _) => [x + a, 0.0],
            (false, _) => {
                let reach = 0.5 * (size * 1.16 + gap);
                [if number % 2 == 0 { -reach } else { reach }, if number < 2 { reach } else { -reach }]
            }
        };
        x += 2.0 * a + gap + if style < 3 { 0.08 } else { 0.0 };
        let sheet = art_print(&mut piece.paint, &kind, [2.0 * a, 2.0 * b], piece.photographs);
        let turn = piece.form.normal() * 0.5;
        piece.placed([at[0], 0.0, at[1]], 0.0, |piece| match style {
            0..=2 => framed(piece, [frame, mat], &sheet, [a, b], style),
            3 => {
                // Canvas on a stretcher.
                let print = piece.print(&sheet, None);
                piece.panel([print, mat], [-a, -0.02, -b], [a, 0.016, b]);
            }
            _ => poster(piece, mat, &sheet, [a, b], turn),
        });
    }
}

/// Four mitered bars around a mat and a print; some behind glass.
fn framed(
    piece: &mut Piece,
    [frame, mat]: [u16; 2],
    sheet: &crate::material::PrintedSheet,
    [a, b]: [f64; 2],
    style: u64,
) {
    let coat = piece.paint.chance(0.6).then_some(0.03);
    let print = piece.print(sheet, coat);
    let border = if style == 0 { 0.0 } else { a.min(b) * piece.uniform(0.12, 0.35) };
    let (wide, deep) = (piece.uniform(0.01, 0.035), piece.uniform(0.015, 0.028));
    let (x, z) = (a + border, b + border);
    piece.panel([print, mat], [-a, 0.001, -b], [a, 0.006, b]);
    if border > 0.0 {
        // A mat with a window: four strips, a little in front of the print.
        for (low, high) in [
            ([-x, -0.001, b], [x, 0.006, z]),
            ([-x, -0.001, -z], [x, 0.006, -b]),
            ([-x, -0.001, -b], [-a, 0.006, b]),
            ([a, -0.001, -b], [x, 0.006, b]),
        ] {
            let strip = rounded(low, high, 0.0004, |_| SlotMapping::fit(mat));
            piece.join(mat, strip);
        }
    }
    for (low, high) in [
        ([-x - wide, 0.008 - deep, z - 0.003], [x + wide, 0.016, z + wide]),
        ([-x - wide, 0.008 - deep, -z - wide], [x + wide, 0.016, -z + 0.003]),
        ([-x - wide, 0.0083 - deep, -z - wide + 0.001], [-x + 0.003, 0.0155, z + wide - 0.001]),
        ([x - 0.003, 0.0083 - deep, -z - wide + 0.001], [x + wide, 0.0155, z + wide - 0.001]),
    ] {
        piece.block(frame, low, high, if style == 2 { 0.3 * wide } else { 0.0015 });
    }
}

/// A sheet of paper with pieces of tape at its corners.
fn poster(piece: &mut Piece, mat: u16, sheet: &crate::material::PrintedSheet, [a, b]: [f64; 2], turn: f64) {
    let print = piece.print(sheet, None);
    let tape = piece.plain("tape", hsv(0.13, 0.12, 0.82), 0.5);
    let curl = piece.uniform(0.001, 0.01);
    let slots = [SlotMapping::fit(print), SlotMapping::tile(mat, 0.3), SlotMapping::tile(mat, 0.3)];
    let at = |[u, v]: [f64; 2]| {
        let (p, q) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        let lift = curl * p * p * q * q + 0.15 * curl * libm::sin(5.0 * u + 3.0 * v);
        let point = |y: f64| Point3::new(p * a, y - lift, q * b);
        [point(-0.0006), point(0.0)]
    };
    let paper = crate::shape::thick_sheet([8, 8], [8, 8], slots, at).rotated(1, turn);
    piece.keep(paper);
    for (x, z) in [(-a, -b), (a, -b), (a, b), (-a, b)] {
        let strip = rounded([-0.022, -0.0004, -0.009], [0.022, 0.0004, 0.009], 0.0, |_| SlotMapping::fit(tape));
        let angle = if x * z > 0.0 { 45.0 } else { -45.0 };
        let pose = strip.rotated(1, angle).translated(x, -curl - 0.001, z).rotated(1, turn);
        piece.join(tape, pose);
    }
}

/// A mirror, round or rectangular, in a frame.
pub fn mirror(piece: &mut Piece) {
    let frame = if piece.paint.chance(0.5) { piece.metal() } else { piece.wood(0.2) };
    let glass = SurfaceFinish::plain([0.9, 0.92, 0.91], 0.02, 1.0).named("mirror");
    let glass = piece.add(glass);
    if piece.form.chance(0.4) {
        let radius = piece.uniform(0.2, 0.45);
        let side = SlotMapping::fit(glass);
        let disc = Profile::at(0.0, -0.01).to(radius, -0.01, side).to(radius, 0.0, side).to(0.0, 0.0, side);
        piece.join(glass, Lathe::new(&disc).segments(64).solid().rotated(0, 90.0));
        let ring = arc(Point3::origin(), Vector3::x() * radius, Vector3::z() * radius, [0.0, TAU], 64);
        let thick = piece.uniform(0.006, 0.02);
        piece.join(frame, tube(SlotMapping::fit(frame), &ring, 8, 4, |_| thick));
        return;
    }
    let (a, b) = (0.5 * piece.uniform(0.35, 0.7), 0.5 * piece.uniform(0.6, 1.5));
    let wide = piece.uniform(0.015, 0.06);
    piece.board(glass, [-a - 0.004, 0.0, -b - 0.004], [a + 0.004, 0.006, b + 0.004]);
    let back = piece.plain("back", [0.3, 0.25, 0.2], 0.9);
    piece.board(back, [-a - 0.004, 0.006, -b - 0.004], [a + 0.004, 0.014, b + 0.004]);
    for (low, high) in [
        ([-a - wide, -0.018, b], [a + wide, 0.0155, b + wide]),
        ([-a - wide, -0.018, -b - wide], [a + wide, 0.0155, -b]),
        ([-a - wide, -0.0177, -b - wide + 0.001], [-a, 0.015, b + wide - 0.001]),
        ([a, -0.0177, -b - wide + 0.001], [a + wide, 0.015, b + wide - 0.001]),
    ] {
        piece.block(frame, low, high, 0.004);
    }
}

/// A wall clock with a printed face, hands and a rim.
pub fn clock(piece: &mut Piece) {
    let radius = piece.uniform(0.11, 0.2);
    let (texture, ink) = clock_face(&mut piece.paint);
    let face = piece.image(texture, 0.4);
    let rim = match piece.paint.below(3) {
        0 => piece.metal(),
        1 => piece.wood(0.1),
        _ => {
            let color = tones::case(&mut piece.paint);
            piece.tinted(MaterialFamily::Plastic, color, 0.3)
        }
    };
    let hand = piece.plain("hand", ink, 0.4);
    let second = piece.plain("second hand", [0.75, 0.08, 0.06], 0.4);
    let (side, front) = (SlotMapping::fit(rim), SlotMapping::planar(face, 2.0 * radius));
    let lip = piece.uniform(0.006, 0.016);
    let outline = Profile::at(0.0, 0.0)
        .to(radius + lip, 0.0, side)
        .to(radius + lip, 0.034, side)
        .round(0.006)
        .to(radius, 0.036, side)
        .round(0.003)
        .to(radius - 0.001, 0.02, side)
        .to(0.0, 0.02, front);
    piece.keep(Lathe::new(&outline).segments(64).solid().rotated(0, 90.0));
    let minutes = piece.form.unit();
    let hour = (piece.form.below(12) as f64 + minutes) / 12.0;
    let seconds = piece.form.unit();
    for (turn, reach, wide, y, slot) in [
        (hour, 0.5 * radius, 0.006, -0.023, hand),
        (minutes, 0.78 * radius, 0.004, -0.0255, hand),
        (seconds, 0.82 * radius, 0.0012, -0.028, second),
    ] {
        let bar =
            rounded([-wide, y - 0.0006, -0.16 * radius], [wide, y + 0.0006, reach], 0.0, |_| SlotMapping::fit(slot));
        // Rotation about y turns z towards x: clockwise, seen from the front.
        piece.join(slot, bar.rotated(1, 360.0 * turn));
    }
    piece.bar(hand, [0.0, -0.019, 0.0], [0.0, -0.031, 0.0], [0.006; 2]);
}
