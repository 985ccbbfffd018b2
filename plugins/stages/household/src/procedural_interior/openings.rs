//! Doors and windows.

use super::piece::Piece;
use super::solids::{arc, tube};
use crate::material::{hsv, outdoors};
use crate::shape::SlotMapping;
use std::f64::consts::FRAC_PI_2;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::Color;

/// A closed door leaf in its frame, with a lever and hinges.
pub fn door(piece: &mut Piece) {
    let frame = piece.wood(0.75);
    let leaf = if piece.paint.chance(0.6) { frame } else { piece.wood(0.5) };
    let metal = piece.metal();
    let dark = piece.plain("gap", hsv(0.0, 0.0, 0.02), 0.9);
    let (a, height) = (0.5 * piece.uniform(0.76, 0.96), piece.uniform(1.96, 2.1));
    let (trim, depth) = (piece.uniform(0.06, 0.1), piece.uniform(0.012, 0.022));
    // The casing: two uprights and a head, with a stop behind the leaf.
    for side in [-1.0, 1.0] {
        let [x0, x1] = [side * a, side * (a + trim)];
        piece.block(frame, [x0.min(x1), -depth, 0.0], [x0.max(x1), 0.03, height + 0.002], 0.004);
    }
    piece.block(frame, [-a - trim, -depth - 0.001, height], [a + trim, 0.03, height + trim], 0.004);
    piece.board(dark, [-a + 0.001, 0.02, 0.002], [a - 0.001, 0.028, height]);
    let face = 0.0;
    let (x0, x1, z0, z1) = (-a + 0.004, a - 0.004, 0.008, height - 0.004);
    match piece.form.below(4) {
        0 => piece.board(leaf, [x0, face, z0], [x1, 0.022, z1]),
        1 => glazed(piece, leaf, [x0, z0, x1, z1]),
        _ => paneled(piece, leaf, [x0, z0, x1, z1]),
    }
    let side = if piece.form.chance(0.5) { 1.0 } else { -1.0 };
    let (x, z) = (side * (a - 0.07), 1.02);
    lever(piece, metal, [x, face, z], -side);
    for z in [0.22, 0.5 * height, height - 0.22] {
        piece.bar(
            metal,
            [-side * (a - 0.001), face - 0.006, z - 0.045],
            [-side * (a - 0.001), face - 0.006, z + 0.045],
            [0.0075; 2],
        );
    }
}

/// A lever with its plate and a keyhole. `turn` is where the lever points.
fn lever(piece: &mut Piece, metal: u16, [x, face, z]: [f64; 3], turn: f64) {
    let dark = piece.plain("keyhole", [0.02; 3], 0.9);
    if piece.form.chance(0.5) {
        piece.block(metal, [x - 0.02, face - 0.008, z - 0.17], [x + 0.02, face + 0.002, z + 0.05], 0.003);
    } else {
        for at in [z, z - 0.075] {
            piece.bar(metal, [x, face + 0.002, at], [x, face - 0.009, at], [0.027, 0.025]);
        }
    }
    piece.bar(dark, [x, face - 0.0065, z - 0.075], [x, face - 0.0098, z - 0.075], [0.0045; 2]);
    let bend = arc(
        Point3::new(x + turn * 0.02, face - 0.035, z),
        Vector3::x() * (-turn * 0.02),
        Vector3::y() * -0.02,
        [0.0, FRAC_PI_2],
        5,
    );
    let mut path = vec![Point3::new(x, face, z)];
    path.extend(bend);
    path.push(Point3::new(x + turn * 0.12, face - 0.055, z));
    let handle = tube(SlotMapping::fit(metal), &path, 10, 3, |t| 0.0095 - 0.0015 * t);
    piece.join(metal, handle);
}

/// A leaf of a frame around recessed panels.
fn paneled(piece: &mut Piece, leaf: u16, [x0, z0, x1, z1]: [f64; 4]) {
    let stile = piece.uniform(0.09, 0.13);
    let columns = piece.form.integer(1, 2) as usize;
    let rows: &[f64] = match piece.form.below(4) {
        0 => &[0.0, 1.0],
        1 => &[0.0, 0.42, 1.0],
        2 => &[0.0, 0.3, 0.75, 1.0],
        _ => &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0],
    };
    piece.board(leaf, [x0 + 0.02, 0.009, z0 + 0.02], [x1 - 0.02, 0.02, z1 - 0.02]);
    let wide = (x1 - x0 - stile * (columns + 1) as f64) / columns as f64;
    for column in 0..=columns {
        let x = x0 + (wide + stile) * column as f64;
        piece.board(leaf, [x, 0.0, z0], [x + stile, 0.022, z1]);
    }
    let level = |row: f64| z0 + row * (z1 - z0 - stile);
    for column in 0..columns {
        let x = x0 + stile + (wide + stile) * column as f64;
        for row in rows {
            let tall = if *row == 0.0 { 1.5 * stile } else { stile };
            piece.board(leaf, [x - 0.001, 0.0004, level(*row)], [x + wide + 0.001, 0.022, level(*row) + tall]);
        }
        for pair in rows.windows(2) {
            let low = level(pair[0]) + if pair[0] == 0.0 { 1.5 * stile } else { stile };
            let raised = [[x + 0.03, 0.003, low + 0.03], [x + wide - 0.03, 0.012, level(pair[1]) - 0.03]];
            if raised[1][2] - raised[0][2] > 0.05 {
                piece.block(leaf, raised[0], raised[1], 0.0042);
            }
        }
    }
}

/// A leaf with a pane of frosted glass.
fn glazed(piece: &mut Piece, leaf: u16, [x0, z0, x1, z1]: [f64; 4]) {
    let stile = piece.uniform(0.1, 0.14);
    let low = z0 + if piece.form.chance(0.5) { 0.25 } else { 0.95 };
    let glass = piece.plain("frosted glass", hsv(0.45, 0.06, 0.75), 0.3);
    piece.board(leaf, [x0, 0.0, z0], [x1, 0.022, low]);
    piece.board(leaf, [x0, 0.0, z1 - stile], [x1, 0.022, z1]);
    piece.board(leaf, [x0, 0.0005, low - 0.002], [x0 + stile, 0.022, z1 - stile + 0.002]);
    piece.board(leaf, [x1 - stile, 0.0005, low - 0.002], [x1, 0.022, z1 - stile + 0.002]);
    piece.board(glass, [x0 + stile - 0.005, 0.008, low - 0.005], [x1 - stile + 0.005, 0.014, z1 - stile + 0.005]);
    let rows = piece.form.integer(0, 3);
    for row in 1..=rows {
        let z = low + (z1 - stile - low) * row as f64 / (rows + 1) as f64;
        piece.board(leaf, [x0 + stile - 0.002, 0.001, z - 0.012], [x1 - stile + 0.002, 0.02, z + 0.012]);
    }
}

/// A window: casements with glass that shows the outdoors by day, or is dark at night.
pub fn window(piece: &mut Piece) {
    let (width, height) = (piece.uniform(0.7, 1.7), piece.uniform(0.9, 1.5));
    casements(piece, [width, height], 0.0);
    let sill = piece.wood(0.9);
    let reach = piece.uniform(0.05, 0.2);
    piece.block(
        sill,
        [-0.5 * width - 0.05, -reach, -0.5 * height - 0.03],
        [0.5 * width + 0.05, 0.04, -0.5 * height],
        0.006,
    );
    if piece.form.chance(0.6) {
        piece.carries([0.0, 0.02 - 0.5 * reach, -0.5 * height], [0.5 * width, 0.5 * reach - 0.02]);
    }
}

/// Casements around the origin; the front of their frame is at `y`, and their back 5 cm behind it.
pub fn casements(piece: &mut Piece, [width, height]: [f64; 2], y: f64) {
    let frame = piece.wood(0.85);
    let metal = piece.metal();
    let view = outdoors(&mut piece.paint, piece.photographs);
    let nits = if piece.paint.chance(0.6) { 100.0 * libm::pow(12.0, piece.paint.unit()) } else { 0.0 };
    let light = Color { factor: [nits as f32; 3], ..Color::texture(view) };
    let light = if nits > 0.0 { light } else { Color::constant([0.0; 3]) };
    let pane = piece.emissive([0.02, 0.025, 0.035], 0.03, light);
    let (a, b, back) = (0.5 * width, 0.5 * height, y + 0.05);
    let edge = piece.uniform(0.045, 0.07);
    piece.panel([pane, frame], [-a + 0.01, y + 0.032, -b + 0.01], [a - 0.01, back, b - 0.01]);
    let columns = if width > 1.0 { piece.form.integer(2, 3) } else { piece.form.integer(1, 2) } as usize;
    let wide = width / columns as f64;
    for column in 0..columns {
        let (x0, x1) = (-a + wide * column as f64 + 0.0015, -a + wide * (column + 1) as f64 - 0.0015);
        for [low, high] in [
            [[x0, y, -b], [x0 + edge, back, b]],
            [[x1 - edge, y, -b], [x1, back, b]],
            [[x0 + edge, y + 0.0005, -b], [x1 - edge, back, -b + edge]],
            [[x0 + edge, y + 0.0005, b - edge], [x1 - edge, back, b]],
        ] {
            piece.block(frame, low, high, 0.005);
        }
        let x = if column % 2 == 0 { x1 - 0.5 * edge } else { x0 + 0.5 * edge };
        piece.block(metal, [x - 0.012, y - 0.006, -0.03], [x + 0.012, y + 0.001, 0.03], 0.002);
        piece.block(metal, [x - 0.008, y - 0.035, -0.11], [x + 0.008, y - 0.02, 0.012], 0.004);
        piece.bar(metal, [x, y, 0.0], [x, y - 0.03, 0.0], [0.007; 2]);
    }
    if piece.form.chance(0.25) {
        // Glazing bars.
        piece.board(frame, [-a + edge, y + 0.01, 0.15 * height - 0.011], [a - edge, y + 0.034, 0.15 * height + 0.011]);
    }
}
