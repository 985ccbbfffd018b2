//! Radiators, wall sockets and cables.

use super::piece::Piece;
use super::solids::{arc, rounded, spline, tube};
use super::tones;
use crate::material::{MaterialFamily, hsv, shade};
use crate::shape::{SlotMapping, SolidShape, extrude};
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::{Point3, Vector3};

/// A panel or column radiator with its pipes, valve and feet.
pub fn radiator(piece: &mut Piece) {
    let tint = piece.paint.uniform(0.0, 0.08);
    let enamel = match piece.paint.below(5) {
        0 => piece.plain("enamel", hsv(0.6, 0.05, 0.2), 0.35),
        _ => piece.plain("enamel", hsv(0.12, tint, 0.88), 0.3),
    };
    let metal = piece.metal();
    let (half, height) = (0.5 * piece.uniform(0.5, 1.5), piece.uniform(0.35, 0.75));
    let low = piece.uniform(0.09, 0.14);
    if piece.form.chance(0.6) {
        panel(piece, enamel, half, [low, low + height])
    } else {
        columns(piece, enamel, half, [low, low + height])
    }
    let cap = piece.plain("valve", [0.85; 3], 0.4);
    let side = if piece.form.chance(0.5) { 1.0 } else { -1.0 };
    for (x, z) in [(side * (half + 0.035), low + 0.04), (side * (half + 0.035), low + height - 0.05)] {
        piece.bar(metal, [x - side * 0.06, 0.0, z], [x, 0.0, z], [0.009; 2]);
        if z > low + 0.1 {
            piece.bar(cap, [x, 0.0, z], [x + side * 0.06, 0.0, z], [0.019, 0.017]);
        }
    }
    for x in [side * (half + 0.035), side * (half + 0.01)] {
        let top = if x.abs() > half + 0.02 { low + height - 0.05 } else { low + 0.04 };
        piece.bar(metal, [x, 0.0, 0.0], [x, 0.0, top], [0.0075; 2]);
    }
    for x in [-0.6 * half, 0.6 * half] {
        piece.board(enamel, [x - 0.015, -0.005, 0.0], [x + 0.015, 0.02, low + 0.03]);
    }
}

/// A pressed panel with upright ribs, with grilles on top and at the sides.
fn panel(piece: &mut Piece, enamel: u16, half: f64, [low, high]: [f64; 2]) {
    let pitch = piece.uniform(0.033, 0.05);
    let count = (2.0 * half / pitch) as usize;
    let pitch = 2.0 * half / count as f64;
    let (front, deep) = (-0.05, 0.008);
    // Seen from above: the ribs of the front, and a straight back.
    let mut outline = vec![[-half, front + 0.02]];
    for i in 0..count {
        let x = -half + pitch * i as f64;
        for (t, y) in [(0.08, 0.0), (0.3, -deep), (0.7, -deep), (0.92, 0.0)] {
            outline.push([x + t * pitch, front + y]);
        }
    }
    outline.push([half, front + 0.02]);
    let ribs = extrude(&outline, [low + 0.05, high - 0.05], 0.0, SlotMapping::fit(enamel), SlotMapping::fit(enamel));
    let corners = ribs.bounds().corners().to_vec();
    piece.join(enamel, ribs.without_parts().with_part(corners));
    for (z0, z1) in [(low, low + 0.052), (high - 0.052, high)] {
        piece.block(enamel, [-half, front - 0.004, z0], [half, front + 0.02, z1], 0.004);
    }
    piece.block(enamel, [-half, 0.03, low], [half, 0.045, high], 0.005);
    for side in [-1.0, 1.0] {
        let [x0, x1] = [side * half, side * (half + 0.0015)];
        piece.board(enamel, [x0.min(x1), front + 0.002, low], [x0.max(x1), 0.044, high - 0.004]);
    }
    let mut grille = SolidShape::default();
    let bars = (2.0 * half / 0.022) as usize;
    for i in 0..bars {
        let x = -half + 2.0 * half * (i as f64 + 0.5) / bars as f64;
        let slat = rounded([x - 0.0035, front + 0.016, high - 0.008], [x + 0.0035, 0.032, high - 0.002], 0.0, |_| {
            SlotMapping::fit(enamel)
        });
        grille = grille.and(slat);
    }
    piece.cluster(grille);
}

/// Rows of upright tubes.
fn columns(piece: &mut Piece, enamel: u16, half: f64, [low, high]: [f64; 2]) {
    let pitch = 0.046;
    let count = (2.0 * half / pitch) as usize;
    let depth = piece.form.integer(2, 3);
    let mut all = SolidShape::default();
    for i in 0..count {
        let x = (i as f64 + 0.5 - 0.5 * count as f64) * pitch;
        for row in 0..depth {
            let y = 0.034 * (row as f64 - 0.5 * (depth - 1) as f64);
            let path = [low + 0.02, low + 0.03, high - 0.03, high - 0.02].map(|z| Point3::new(x, y, z));
            all = all.and(tube(SlotMapping::fit(enamel), &path, 8, 3, |_| 0.0125));
        }
        for z in [low + 0.02, high - 0.02] {
            let reach = 0.017 * (depth - 1) as f64 + 0.014;
            let head = rounded([x - 0.022, -reach, z - 0.02], [x + 0.022, reach, z + 0.02], 0.008, |_| {
                SlotMapping::fit(enamel)
            });
            all = all.and(head);
        }
    }
    piece.cluster(all);
}

/// Wall sockets and switches in a plate.
pub fn socket(piece: &mut Piece) {
    let color = if piece.paint.chance(0.8) { hsv(0.12, 0.03, 0.88) } else { tones::case(&mut piece.paint) };
    let plate = piece.tinted(MaterialFamily::Plastic, color, 0.3);
    let dark = piece.plain("recess", shade(color, 0.72), 0.4);
    let metal = piece.plain("pin", [0.7, 0.68, 0.62], 0.4);
    let count = piece.form.integer(1, 4) as usize;
    let edge = 0.0715;
    let is_upright = piece.form.chance(0.25);
    let half = 0.5 * edge * (count - 1) as f64;
    let (a, b) = if is_upright { (0.0, half) } else { (half, 0.0) };
    piece.block(plate, [-a - 0.041, -0.008, -b - 0.041], [a + 0.041, 0.0, b + 0.041], 0.003);
    for number in 0..count {
        let shift = -half + edge * number as f64;
        let (x, z) = if is_upright { (0.0, shift) } else { (shift, 0.0) };
        if piece.form.chance(0.4) {
            // A rocker, pressed on one side.
            let tilt = if piece.form.chance(0.5) { 3.0 } else { -3.0 };
            let rocker = rounded([-0.028, -0.011, -0.028], [0.028, 0.0, 0.028], 0.002, |_| SlotMapping::fit(plate));
            piece.join(plate, rocker.rotated(0, tilt).translated(x, -0.002, z));
            continue;
        }
        piece.block(plate, [x - 0.028, -0.0105, z - 0.028], [x + 0.028, 0.0, z + 0.028], 0.003);
        let ring = arc(Point3::new(x, -0.0105, z), Vector3::x() * 0.0205, Vector3::z() * 0.0205, [0.0, TAU], 24);
        piece.join(plate, tube(SlotMapping::fit(plate), &ring, 6, 24, |_| 0.0015));
        piece.bar(dark, [x, -0.004, z], [x, -0.0109, z], [0.0195; 2]);
        for side in [-1.0, 1.0] {
            piece.bar(metal, [x + side * 0.0095, -0.004, z], [x + side * 0.0095, -0.0114, z], [0.0027; 2]);
            piece.board(
                metal,
                [x - 0.003, -0.0115, z + side * 0.0185 - 0.002],
                [x + 0.003, -0.004, z + side * 0.0185 + 0.002],
            );
        }
    }
}

/// A cable that lies on the floor, with a plug, some with a power strip.
pub fn cable(piece: &mut Piece) {
    let color = tones::case(&mut piece.paint);
    let jacket = piece.plain("cable", color, 0.45);
    let radius = piece.uniform(0.003, 0.0045);
    let length = piece.uniform(0.8, 2.2);
    // A curve whose direction drifts, so that it winds but does not coil.
    let waves: Vec<[f64; 3]> =
        (0..4).map(|_| [piece.uniform(0.4, 1.3), piece.uniform(1.0, 7.0), piece.uniform(0.0, TAU)]).collect();
    let count = 90;
    let mut at = Point3::new(0.0, 0.0, radius);
    let mut path = vec![at];
    for i in 0..count {
        let s = i as f64 / count as f64;
        let turn: f64 = waves.iter().map(|[size, rate, phase]| size * libm::sin(rate * s + phase)).sum();
        at += Vector3::new(libm::cos(turn), libm::sin(turn), 0.0) * (length / count as f64);
        path.push(at);
    }
    // Where it crosses itself, it lies on top.
    for i in 0..path.len() {
        let crosses = (0..i.saturating_sub(8)).any(|k| {
            let d = path[i] - path[k];
            libm::hypot(d.x, d.y) < 2.5 * radius
        });
        if crosses {
            path[i].z += 2.0 * radius;
        }
    }
    for _ in 0..2 {
        let heights: Vec<f64> = path.iter().map(|p| p.z).collect();
        for i in 1..path.len() - 1 {
            path[i].z = heights[i].max(0.5 * (heights[i - 1] + heights[i + 1]));
        }
    }
    piece.join(jacket, tube(SlotMapping::fit(jacket), &path, 7, 9, |_| radius));
    let heading = |a: Point3<f64>, b: Point3<f64>| libm::atan2(b.y - a.y, b.x - a.x).to_degrees();
    let (start, end) = (path[0], path[path.len() - 1]);
    let back = heading(path[2], path[0]);
    piece.placed([start.x, start.y, 0.0], back, |piece| plug(piece, jacket));
    let out = heading(path[path.len() - 3], end);
    if piece.form.chance(0.65) {
        piece.placed([end.x, end.y, 0.0], out, |piece| strip(piece, jacket));
    } else {
        piece.placed([end.x, end.y, 0.0], out, |piece| brick(piece, jacket));
    }
}

fn plug(piece: &mut Piece, jacket: u16) {
    let pin = piece.plain("pin", [0.75, 0.73, 0.68], 0.3);
    piece.bar(jacket, [-0.005, 0.0, 0.0175], [0.038, 0.0, 0.0175], [0.009, 0.0175]);
    for side in [-1.0, 1.0] {
        piece.bar(pin, [0.036, 0.0095 * side, 0.0175], [0.056, 0.0095 * side, 0.0175], [0.0024; 2]);
    }
}

fn strip(piece: &mut Piece, jacket: u16) {
    let value = if piece.paint.chance(0.7) { 0.87 } else { 0.06 };
    let white = piece.plain("strip", hsv(0.12, 0.02, value), 0.35);
    let dark = piece.plain("hole", [0.02; 3], 0.9);
    let count = piece.form.integer(3, 6) as usize;
    let length = 0.05 + 0.045 * count as f64;
    piece.block(white, [0.0, -0.027, 0.0], [length, 0.027, 0.04], 0.006);
    for i in 0..count {
        let x = 0.04 + 0.045 * i as f64;
        piece.bar(dark, [x, 0.0, 0.03], [x, 0.0, 0.0404], [0.0185; 2]);
        if piece.form.chance(0.4) {
            let tall = piece.uniform(0.03, 0.05);
            piece.bar(jacket, [x, 0.0, 0.038], [x, 0.0, 0.038 + tall], [0.0175, 0.012]);
        }
    }
}

fn brick(piece: &mut Piece, jacket: u16) {
    piece.block(jacket, [0.0, -0.03, 0.0], [0.12, 0.03, 0.032], 0.006);
    let rest: Vec<Point3<f64>> = (0..=10)
        .map(|i| {
            let t = f64::from(i) / 10.0;
            Point3::new(0.115 + 0.3 * t, 0.04 * libm::sin(PI * t * 1.6), 0.0025 + 0.014 * (1.0 - t) * (1.0 - t))
        })
        .collect();
    piece.join(jacket, tube(SlotMapping::fit(jacket), &spline(&rest, 2), 6, 5, |_| 0.0024));
}
