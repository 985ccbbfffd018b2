//! Cardboard boxes and waste bins.

use super::piece::Piece;
use super::solids::{ball, boxed, rounded};
use super::tones;
use crate::family::Crumple;
use crate::material::{LabelKind, MaterialFamily, hsv, label};
use crate::shape::{Lathe, Profile, SlotMapping};
use std::f64::consts::TAU;
use syntable_model::geometry::Point3;

/// A stack of closed and open cardboard boxes.
pub fn cardboard_boxes(piece: &mut Piece) {
    let boards = [0; 2].map(|_| piece.surface(&[MaterialFamily::Cardboard]));
    let tape = if piece.paint.chance(0.6) {
        piece.plain("tape", hsv(0.09, 0.45, 0.5), 0.3)
    } else {
        piece.plain("tape", hsv(0.12, 0.06, 0.8), 0.25)
    };
    // All boxes of a stack have the same label: about the last third of a wrapped print.
    let sticker = [piece.uniform(0.09, 0.16), piece.uniform(0.07, 0.11)];
    let sheet = label(&mut piece.paint, LabelKind::Glued, [3.0 * sticker[0], sticker[1]], piece.photographs);
    let print = piece.print(&sheet, None);
    let count = piece.form.integer(1, 4);
    let mut z = 0.0;
    let (mut a, mut b) = (0.5 * piece.uniform(0.35, 0.6), 0.5 * piece.uniform(0.28, 0.42));
    for number in 0..count {
        let height = piece.uniform(0.18, 0.38);
        let yaw = piece.uniform(-7.0, 7.0);
        let shift = [piece.uniform(-0.02, 0.02), piece.uniform(-0.015, 0.015)];
        let is_open = number + 1 == count && piece.form.chance(0.4);
        let board = boards[(number % 2) as usize];
        let is_labeled = piece.form.chance(0.65);
        piece.placed([shift[0], shift[1], z], yaw, |piece| {
            carton(piece, [board, tape], [a, b, height], is_open);
            if is_labeled {
                attach(piece, [print, board], sticker, [a, b, height]);
            }
        });
        z += height + 0.002;
        a *= piece.uniform(0.78, 0.98);
        b *= piece.uniform(0.82, 0.98);
        if !is_open && number + 1 == count {
            piece.carries([shift[0], shift[1], z - 0.002], [0.8 * a, 0.8 * b]);
        }
    }
}

fn carton(piece: &mut Piece, [board, tape]: [u16; 2], [a, b, height]: [f64; 3], is_open: bool) {
    let wall = 0.004;
    if is_open {
        piece.board(board, [-a, -b, 0.0], [a, b, wall]);
        for side in [-1.0, 1.0] {
            let [x0, x1] = [side * a, side * (a - wall)];
            piece.board(board, [x0.min(x1), -b, 0.0], [x0.max(x1), b, height]);
            let [y0, y1] = [side * b, side * (b - wall)];
            piece.board(board, [-a, y0.min(y1), 0.001], [a, y0.max(y1), height - 0.001]);
            // Flaps fall outwards.
            let angle = piece.uniform(15.0, 120.0);
            let flap =
                rounded([-a + 0.002, -0.002, 0.0], [a - 0.002, 0.002, 0.95 * b], 0.001, |_| SlotMapping::fit(board));
            piece.join(board, flap.rotated(0, -side * angle).translated(0.0, side * b, height - 0.002));
            let angle = piece.uniform(15.0, 120.0);
            let flap =
                rounded([-0.002, -b + 0.006, 0.0], [0.002, b - 0.006, 0.95 * b], 0.001, |_| SlotMapping::fit(board));
            piece.join(board, flap.rotated(1, side * angle).translated(side * a, 0.0, height - 0.003));
        }
    } else {
        // Two halves of a lid with a gap, taped.
        piece.board(board, [-a, -b, 0.0], [a, b, height - wall]);
        piece.board(board, [-a, -b, height - wall - 0.001], [a, -0.001, height]);
        piece.board(board, [-a, 0.001, height - wall - 0.001], [a, b, height]);
        let wide = 0.025;
        piece.board(tape, [-a - 0.0005, -wide, height - 0.001], [a + 0.0005, wide, height + 0.0004]);
        for side in [-1.0, 1.0] {
            let [x0, x1] = [side * (a - 0.001), side * (a + 0.0006)];
            piece.board(tape, [x0.min(x1), -wide, height - 0.07], [x0.max(x1), wide, height + 0.0003]);
        }
    }
}

/// A label on the front of a box.
fn attach(piece: &mut Piece, [print, board]: [u16; 2], [wide, tall]: [f64; 2], [a, b, height]: [f64; 3]) {
    let (x, z) = (piece.uniform(-0.4, 0.4) * a, height * piece.uniform(0.45, 0.6));
    let at = [x - 0.5 * wide, -b - 0.0006, z - 0.5 * tall];
    let side = |side| if side == 2 { SlotMapping::fit(print) } else { SlotMapping::fit(board) };
    let label = rounded(at, [x + 0.5 * wide, -b + 0.001, z + 0.5 * tall], 0.0, side);
    piece.keep(label.uv_in(print, [0.66, 0.0, 1.0, 1.0]));
}

/// A waste bin: of plastic, metal, wire or wicker; with a bag or crumpled paper in some.
pub fn waste_bin(piece: &mut Piece) {
    let color = tones::paint(&mut piece.paint);
    let slot = match piece.paint.below(4) {
        0 => piece.metal(),
        1 => piece.surface(&[MaterialFamily::BrushedMetal]),
        2 => piece.tinted(MaterialFamily::Plastic, [0.05; 3], 0.4),
        _ => piece.tinted(MaterialFamily::Plastic, color, 0.4),
    };
    let (radius, height) = (piece.uniform(0.11, 0.17), piece.uniform(0.25, 0.42));
    let foot = radius * piece.uniform(0.7, 1.0);
    let side = SlotMapping::fit(slot);
    if piece.form.chance(0.3) {
        // Closed, with a lid and a pedal.
        let dark = piece.plain("lid", [0.04; 3], 0.4);
        let outline =
            Profile::at(0.0, 0.0).to(radius, 0.0, side).round(0.004).to(radius, height, side).to(0.0, height, side);
        piece.join(slot, Lathe::new(&outline).segments(40).solid());
        let lid = SlotMapping::fit(dark);
        let outline = Profile::at(0.0, height - 0.002)
            .to(radius + 0.003, height - 0.002, lid)
            .to(radius + 0.003, height + 0.016, lid)
            .curve([0.8 * radius, height + 0.05], [0.4 * radius, height + 0.06], [0.0, height + 0.06], 8, lid);
        piece.join(dark, Lathe::new(&outline).segments(40).solid());
        piece.block(dark, [-0.03, -radius - 0.03, 0.008], [0.03, -radius + 0.01, 0.022], 0.004);
        return;
    }
    let wall = 0.003;
    let outline = Profile::at(0.0, 0.0)
        .to(foot, 0.0, side)
        .round(0.006)
        .to(radius, height, side)
        .round(0.0014)
        .to(radius - wall, height, side)
        .round(0.0014)
        .to(foot - wall, wall, side)
        .to(0.0, wall, side);
    let slope = (radius - foot) / height;
    let cell = vec![[foot, 0.0], [foot - wall, 0.0], [radius - wall, height], [radius, height]];
    let disc = vec![[0.0, 0.0], [foot, 0.0], [foot, wall], [0.0, wall]];
    piece.join(slot, Lathe::new(&outline).segments(40).hollow(&[cell], &[disc], 10));
    if piece.form.chance(0.6) {
        let tone = if piece.form.chance(0.5) { 0.8 } else { 0.04 };
        let bag = piece.plain("bag", [tone; 3], 0.25);
        let folds = Crumple::draw(&mut piece.form, 8, [0.02, 0.06], 0.006);
        let lip = SlotMapping::fit(bag);
        let at = radius - slope * 0.05;
        let outline = Profile::at(at + 0.004, height - 0.05)
            .to(radius + 0.008, height - 0.02, lip)
            .to(radius + 0.006, height + 0.006, lip)
            .to(radius - 0.006, height + 0.007, lip)
            .to(radius - 0.012, height - 0.03, lip)
            .closed(lip);
        let skin = Lathe::new(&outline).segments(48).surface().bent(|p| p + folds.at(p) * 0.6);
        piece.join(bag, boxed(skin));
    }
    let paper = piece.tinted(MaterialFamily::Paper, [0.88, 0.87, 0.84], 0.9);
    for number in 0..piece.form.below(6) {
        let (sin, cos) = libm::sincos(TAU * 0.382 * number as f64);
        let folds = Crumple::draw(&mut piece.form, 6, [0.02, 0.06], 0.014);
        let middle = Point3::new(0.45 * radius * cos, 0.45 * radius * sin, 0.72 * height + 0.03 * number as f64);
        let crumpled = ball(SlotMapping::fit(paper), middle, piece.form.uniform(0.03, 0.045)).bent(|p| p + folds.at(p));
        piece.join(paper, boxed(crumpled));
    }
}
