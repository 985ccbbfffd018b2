//! Closed cabinets: sideboards, dressers, wardrobes, kitchen units and refrigerators.

use super::piece::Piece;
use super::solids::{arc, tube};
use crate::material::hsv;
use crate::shape::SlotMapping;
use std::f64::consts::PI;
use syntable_model::geometry::{Point3, Vector3};

/// Slots of a cabinet.
pub struct Finishes {
    /// Of its boards.
    pub carcass: u16,
    /// Of its doors and drawers.
    pub front: u16,
    /// Of its handles.
    pub handle: u16,
    /// Of gaps.
    pub dark: u16,
}

/// A handle of a door or drawer.
#[derive(Debug, Clone, Copy)]
pub enum Handle {
    Bar,
    Bow,
    Knob,
    Edge,
    Cutout,
}

/// How all fronts of a cabinet are made.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    handle: Handle,
    /// Width of the frame around a recessed panel; 0 for plain fronts.
    frame: f64,
    /// Gap between fronts, meters.
    gap: f64,
    /// Length of bars and bows, meters.
    reach: f64,
}

/// A door or drawer front in the x-z plane, `[x0, z0, x1, z1]`, its back at `y`. `side` is where a door's handle is; 0 for
/// drawers.
pub fn front(piece: &mut Piece, slots: &Finishes, style: Style, [x0, z0, x1, z1]: [f64; 4], y: f64, side: f64) {
    let thick = 0.019;
    let (x0, x1, z0, z1) = (x0 + style.gap, x1 - style.gap, z0 + style.gap, z1 - style.gap);
    let face = y - thick;
    let frame = style.frame.min(0.28 * (x1 - x0)).min(0.3 * (z1 - z0));
    if frame > 0.02 {
        piece.board(
            slots.front,
            [x0 + 0.7 * frame, face + 0.008, z0 + 0.7 * frame],
            [x1 - 0.7 * frame, y, z1 - 0.7 * frame],
        );
        piece.board(slots.front, [x0, face, z0], [x0 + frame, y, z1]);
        piece.board(slots.front, [x1 - frame, face, z0], [x1, y, z1]);
        piece.board(slots.front, [x0 + frame, face + 0.0003, z0], [x1 - frame, y, z0 + frame]);
        piece.board(slots.front, [x0 + frame, face + 0.0003, z1 - frame], [x1 - frame, y, z1]);
    } else {
        piece.board(slots.front, [x0, face, z0], [x1, y, z1]);
    }
    let inset = if frame > 0.02 { 0.5 * frame } else { 0.04 };
    let (middle, height) = (0.5 * (x0 + x1), 0.5 * (z0 + z1));
    // Doors have their handle away from the hinge: high in low doors, in the middle of tall ones.
    let at = match side {
        0.0 => [middle, if z1 - z0 > 0.3 { z1 - 0.09 } else { height }],
        _ => {
            let x = if side > 0.0 { x1 - inset } else { x0 + inset };
            [x, if z1 > 1.35 { (0.95_f64).clamp(z0 + 0.1, z1 - 0.1) } else { z1 - 0.06 - 0.5 * style.reach }]
        }
    };
    handle(piece, slots, style, at, face, side != 0.0, [x0, x1, z1]);
}

fn handle(
    piece: &mut Piece,
    slots: &Finishes,
    style: Style,
    [x, z]: [f64; 2],
    face: f64,
    is_door: bool,
    [x0, x1, top]: [f64; 3],
) {
    let half = 0.5 * style.reach.min(0.7 * (x1 - x0));
    let along = if is_door { Vector3::z() } else { Vector3::x() };
    let foot = |t: f64| Point3::new(x, face, z) + along * t;
    match style.handle {
        Handle::Bar => {
            let out = Vector3::y() * -0.03;
            let (a, b) = (foot(-half) + out, foot(half) + out);
            piece.bar(slots.handle, a.coords.into(), b.coords.into(), [0.0055; 2]);
            for t in [-0.7 * half, 0.7 * half] {
                piece.bar(slots.handle, (foot(t) + out).coords.into(), foot(t).coords.into(), [0.004; 2]);
            }
        }
        Handle::Bow => {
            let path = arc(foot(0.0) + Vector3::y() * 0.004, along * half, Vector3::y() * -0.032, [0.0, PI], 10);
            let bow = tube(SlotMapping::fit(slots.handle), &path, 8, 5, |t| 0.004 + 0.002 * libm::sin(PI * t));
            piece.join(slots.handle, bow);
        }
        Handle::Knob => {
            let at = foot(0.0);
            piece.bar(slots.handle, at.coords.into(), [at.x, face - 0.014, at.z], [0.006, 0.007]);
            piece.bar(slots.handle, [at.x, face - 0.012, at.z], [at.x, face - 0.026, at.z], [0.0135, 0.0155]);
        }
        Handle::Edge => {
            // A lip along the upper edge.
            let length = half.max(0.06);
            let (a, b) = (0.5 * (x0 + x1) - length, 0.5 * (x0 + x1) + length);
            piece.board(slots.handle, [a, face - 0.016, top - 0.003], [b, face + 0.004, top]);
            piece.board(slots.handle, [a, face - 0.016, top - 0.012], [b, face - 0.013, top - 0.0005]);
        }
        Handle::Cutout => {
            let (a, b) = if is_door { (0.012, 0.03) } else { (0.045, 0.014) };
            let low = [x - a, face - 0.0008, z - b];
            piece.board(slots.dark, low, [x + a, face + 0.001, z + b]);
        }
    }
}

/// Materials and style of a random cabinet.
pub fn finishes(piece: &mut Piece) -> (Finishes, Style) {
    let carcass = piece.wood(0.5);
    let front = if piece.paint.chance(0.65) { carcass } else { piece.wood(0.6) };
    let handle = piece.metal();
    let dark = piece.plain("gap", hsv(0.6, 0.1, 0.03), 0.8);
    let handles = [Handle::Bar, Handle::Bow, Handle::Knob, Handle::Edge, Handle::Cutout];
    let style = Style {
        handle: piece.form.pick(&handles).copied().unwrap_or(Handle::Knob),
        frame: if piece.form.chance(0.35) { piece.form.uniform(0.05, 0.08) } else { 0.0 },
        gap: piece.form.uniform(0.001, 0.0022),
        reach: piece.form.uniform(0.1, 0.22),
    };
    (Finishes { carcass, front, handle, dark }, style)
}

/// Sides, bottom, back and top of a cabinet, between the floor height `z0` and the top `z1`. Behind the fronts it is dark.
pub fn carcass(piece: &mut Piece, slots: &Finishes, [a, b]: [f64; 2], [z0, z1]: [f64; 2], overhang: f64) {
    let thick = 0.019;
    for side in [-1.0, 1.0] {
        let [x0, x1] = [side * a, side * (a - thick)];
        piece.board(slots.carcass, [x0.min(x1), -b, z0], [x0.max(x1), b, z1 - thick]);
    }
    piece.board(slots.dark, [-a + thick, -b + 0.004, z0 + 0.004], [a - thick, b, z1 - thick]);
    piece.board(slots.carcass, [-a - overhang, -b - 0.02 - overhang, z1 - 0.022], [a + overhang, b, z1]);
}

/// Legs, a plinth, or nothing below a cabinet. Returns the height of its bottom.
fn base(piece: &mut Piece, slots: &Finishes, [a, b]: [f64; 2]) -> f64 {
    match piece.form.below(3) {
        0 => {
            let height = piece.uniform(0.05, 0.1);
            piece.board(slots.carcass, [-a + 0.004, -b + 0.03, 0.0], [a - 0.004, b - 0.01, height]);
            height
        }
        1 => {
            let (height, radius) = (piece.uniform(0.1, 0.2), piece.uniform(0.012, 0.022));
            let lean = piece.uniform(0.0, 0.03);
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let at = [x * (a - 0.06), y * (b - 0.06)];
                let foot = [at[0] + x * lean, at[1] + y * lean, 0.0];
                piece.bar(slots.handle, foot, [at[0], at[1], height + 0.002], [0.6 * radius, radius]);
            }
            piece.board(slots.carcass, [-a, -b, height], [a, b, height + 0.019]);
            height
        }
        _ => {
            piece.board(slots.carcass, [-a, -b, 0.001], [a, b, 0.02]);
            0.0
        }
    }
}

pub fn sideboard(piece: &mut Piece) {
    let (slots, style) = finishes(piece);
    let (a, b) = (0.5 * piece.uniform(0.9, 1.9), 0.5 * piece.uniform(0.36, 0.48));
    let height = piece.uniform(0.6, 0.95);
    let z0 = base(piece, &slots, [a, b]);
    carcass(piece, &slots, [a, b], [z0, height], 0.004);
    piece.carries([0.0, 0.0, height], [a, b]);
    let columns = ((2.0 * a) / piece.uniform(0.4, 0.55)).round().max(2.0) as usize;
    let wide = 2.0 * a / columns as f64;
    let top = height - 0.024;
    let drawers = piece.form.chance(0.5);
    for column in 0..columns {
        let x = -a + wide * column as f64;
        let has_drawer = drawers && piece.form.chance(0.7);
        let split = if has_drawer { top - 0.16 } else { top };
        if has_drawer {
            front(piece, &slots, style, [x, split, x + wide, top], -b, 0.0);
        }
        let side = if column % 2 == 0 { 1.0 } else { -1.0 };
        front(piece, &slots, style, [x, z0, x + wide, split], -b, side);
    }
}

pub fn dresser(piece: &mut Piece) {
    let (slots, style) = finishes(piece);
    let columns = piece.form.integer(1, 2) as usize;
    let (a, b) = (0.5 * piece.uniform(0.5, 0.85) * columns as f64, 0.5 * piece.uniform(0.4, 0.5));
    let rows = piece.form.integer(3, 6) as usize;
    let z0 = base(piece, &slots, [a, b]);
    let heights: Vec<f64> = (0..rows).map(|row| 0.24 - 0.016 * row as f64).collect();
    let top = z0 + heights.iter().sum::<f64>();
    carcass(piece, &slots, [a, b], [z0, top + 0.024], 0.006);
    piece.carries([0.0, 0.0, top + 0.024], [a, b]);
    let wide = 2.0 * a / columns as f64;
    let mut z = z0;
    for height in heights {
        for column in 0..columns {
            let x = -a + wide * column as f64;
            front(piece, &slots, style, [x, z, x + wide, z + height], -b, 0.0);
        }
        z += height;
    }
}

pub fn wardrobe(piece: &mut Piece) {
    let (slots, style) = finishes(piece);
    let doors = piece.form.integer(2, 4) as usize;
    let (wide, b) = (piece.uniform(0.4, 0.52), 0.5 * piece.uniform(0.45, 0.62));
    let a = 0.5 * wide * doors as f64;
    let height = piece.uniform(1.75, 2.25);
    piece.board(slots.carcass, [-a + 0.002, -b + 0.03, 0.0], [a - 0.002, b - 0.01, 0.07]);
    carcass(piece, &slots, [a, b], [0.06, height], 0.003);
    piece.carries([0.0, 0.0, height], [a, b]);
    let split = if piece.form.chance(0.4) { 0.5 } else { 0.07 };
    for door in 0..doors {
        let x = -a + wide * door as f64;
        let side = if door % 2 == 0 { 1.0 } else { -1.0 };
        front(piece, &slots, style, [x, split, x + wide, height - 0.024], -b, side);
        if split > 0.1 {
            front(piece, &slots, style, [x, 0.07, x + wide, 0.285], -b, 0.0);
            front(piece, &slots, style, [x, 0.285, x + wide, split], -b, 0.0);
        }
    }
}
