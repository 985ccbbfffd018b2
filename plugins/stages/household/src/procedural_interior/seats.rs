//! Dining chairs, shell chairs, office chairs and stools.

use super::piece::Piece;
use super::solids::{Softness, arc, ball, boxed, soft_box, spline, tube};
use super::tones;
use crate::material::MaterialFamily;
use crate::shape::{SlotMapping, SolidShape, thick_sheet};
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::Point3;

/// A chair of one of four kinds.
pub fn chair(piece: &mut Piece) {
    match piece.form.below(9) {
        0..=3 => dining(piece),
        4..=6 => shell(piece),
        7 => office(piece),
        _ => stool(piece),
    }
}

/// A cloth or leather for padding.
fn padding(piece: &mut Piece) -> u16 {
    if piece.paint.chance(0.3) { piece.surface(&[MaterialFamily::Leather]) } else { piece.cloth() }
}

fn dining(piece: &mut Piece) {
    let wood = piece.wood(0.3);
    let pad = padding(piece);
    let (a, b) = (0.5 * piece.uniform(0.39, 0.46), 0.5 * piece.uniform(0.38, 0.45));
    let (seat, top) = (piece.uniform(0.43, 0.47), piece.uniform(0.8, 1.02));
    let (leg, rake) = (piece.uniform(0.015, 0.021), piece.uniform(0.05, 0.1));
    let splay = piece.uniform(0.0, 0.03);
    // Front legs, and back legs that go on as uprights of the back.
    for side in [-1.0, 1.0] {
        let x = side * (a - leg);
        piece.bar(wood, [x + side * splay, -b + leg - splay, 0.0], [x, -b + leg, seat - 0.02], [0.7 * leg, leg]);
        let path = spline(
            &[
                Point3::new(x + side * splay, b - leg + 0.6 * rake, 0.0),
                Point3::new(x, b - leg, 0.5 * seat),
                Point3::new(x, b - leg, seat),
                Point3::new(x, b - leg + rake, top),
            ],
            4,
        );
        let post = tube(SlotMapping::fit(wood), &path, 8, 4, |t| leg * (0.75 + 0.35 * libm::sin(PI * t)));
        piece.join(wood, post);
    }
    for (low, high) in [
        ([-a + leg, -b + 0.4 * leg, seat - 0.075], [a - leg, -b + 1.5 * leg, seat - 0.015]),
        ([-a + leg, b - 1.5 * leg, seat - 0.075], [a - leg, b - 0.5 * leg, seat - 0.015]),
        ([-a + 0.5 * leg, -b + leg, seat - 0.075], [-a + 1.6 * leg, b - leg, seat - 0.015]),
        ([a - 1.6 * leg, -b + leg, seat - 0.075], [a - 0.5 * leg, b - leg, seat - 0.015]),
    ] {
        piece.board(wood, low, high);
    }
    if piece.form.chance(0.5) {
        let soft = Softness { corner: 0.04, edge: 0.02, bulge: 0.015, bow: 0.006 };
        let cushion = soft_box(pad, [2.0 * a + 0.01, 2.0 * b - 0.02, 0.05], soft);
        piece.join(pad, cushion.translated(0.0, -0.012, seat));
        piece.carries([0.0, -0.012, seat + 0.04], [0.7 * a, 0.7 * b]);
    } else {
        piece.block(wood, [-a - 0.005, -b - 0.012, seat - 0.016], [a + 0.005, b - 2.0 * leg, seat + 0.008], 0.007);
        piece.carries([0.0, -0.02, seat + 0.008], [0.9 * a, 0.85 * b]);
    }
    back(piece, [wood, pad], [a - leg, b - leg, rake], [seat, top]);
    if piece.form.chance(0.5) {
        for side in [-1.0, 1.0] {
            let x = side * (a - leg);
            piece.bar(wood, [x, -b + leg, 0.17], [x, b - leg + 0.3 * rake, 0.17], [0.5 * leg; 2]);
        }
    }
}

/// The back of a dining chair between its uprights: slats across, spindles, or a pad.
fn back(piece: &mut Piece, [wood, pad]: [u16; 2], [x, y, rake]: [f64; 3], [seat, top]: [f64; 2]) {
    let depth = |z: f64| y + rake * (z - seat) / (top - seat);
    let bow = 0.03;
    let slat = |low: f64, high: f64, thick: f64, slot: u16, inner: f64| {
        let at = move |[u, v]: [f64; 2]| {
            let p = 2.0 * u - 1.0;
            let z = low + v * (high - low);
            let y = depth(z) + bow * (1.0 - p * p);
            [Point3::new(p * inner, y - 0.5 * thick, z), Point3::new(p * inner, y + 0.5 * thick, z)]
        };
        thick_sheet([10, 4], [10, 4], [SlotMapping::fit(slot); 3], at)
    };
    match piece.form.below(4) {
        0 => {
            let count = piece.form.integer(2, 4);
            for i in 0..count {
                let z = top - 0.06 - (top - seat - 0.16) * i as f64 / count as f64;
                piece.join(wood, slat(z - 0.025, z + 0.035, 0.013, wood, x));
            }
        }
        1 => {
            piece.join(wood, slat(top - 0.07, top + 0.01, 0.018, wood, x + 0.012));
            let count = piece.form.integer(3, 7);
            for i in 1..=count {
                let p = 2.0 * i as f64 / (count + 1) as f64 - 1.0;
                let at = |z: f64| [p * x, depth(z) + bow * (1.0 - p * p), z];
                let low = at(seat - 0.02);
                piece.bar(wood, [low[0], y - 0.01, low[2]], at(top - 0.03), [0.008; 2]);
            }
        }
        2 => {
            piece.join(pad, slat(seat + 0.09, top + 0.005, 0.034, pad, x + 0.01));
        }
        _ => piece.join(wood, slat(0.5 * (seat + top), top + 0.01, 0.011, wood, x + 0.004)),
    }
}

/// A seat and back of one bent shell on four legs.
fn shell(piece: &mut Piece) {
    let color = tones::cloth(&mut piece.paint);
    let shell = match piece.paint.below(3) {
        0 => piece.wood(0.0),
        1 => piece.cloth(),
        _ => piece.tinted(MaterialFamily::Plastic, color, 0.4),
    };
    let legs = if piece.paint.chance(0.5) { piece.wood(0.1) } else { piece.metal() };
    let (half, seat, rise) = (0.5 * piece.uniform(0.43, 0.5), piece.uniform(0.43, 0.47), piece.uniform(0.32, 0.42));
    let (wings, thick) = (piece.uniform(0.02, 0.1), piece.uniform(0.005, 0.02));
    // Seen from the side: from the front edge over the seat and up the back.
    let side = spline(
        &[
            Point3::new(0.0, -0.235, seat - 0.03),
            Point3::new(0.0, -0.19, seat),
            Point3::new(0.0, 0.0, seat - 0.02),
            Point3::new(0.0, 0.16, seat + 0.02),
            Point3::new(0.0, 0.22, seat + 0.13),
            Point3::new(0.0, 0.26, seat + 0.62 * rise),
            Point3::new(0.0, 0.29, seat + rise),
        ],
        3,
    );
    let last = side.len() - 1;
    let at = |[u, v]: [f64; 2]| {
        let p = 2.0 * u - 1.0;
        let i = ((v * last as f64).round() as usize).min(last);
        let (a, b) = (side[i.saturating_sub(1)], side[(i + 1).min(last)]);
        let along = (b - a).normalize();
        // Rounded at the front and at the top.
        let narrow = 1.0 - 0.28 * libm::pow((2.0 * v - 1.0).abs(), 4.0);
        let lift = wings * p * p * libm::sin(PI * (0.15 + 0.7 * v));
        let normal = syntable_model::geometry::Vector3::new(0.0, -along.z, along.y);
        let p3 = Point3::new(p * half * narrow, side[i].y, side[i].z) + normal * lift;
        [p3 + normal * (0.5 * thick), p3 - normal * (0.5 * thick)]
    };
    piece.join(shell, thick_sheet([12, last], [12, 6], [SlotMapping::fit(shell); 3], at));
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = [x * 0.23, y * 0.22, 0.0];
        let hip = [x * 0.12, y * 0.12, seat - 0.025];
        piece.bar(legs, foot, hip, [0.009, 0.014]);
        piece.bar(legs, [-0.12, y * 0.12, seat - 0.035], [0.12, y * 0.12, seat - 0.035], [0.009; 2]);
    }
    piece.carries([0.0, -0.02, seat], [0.14, 0.12]);
}

fn office(piece: &mut Piece) {
    let pad = padding(piece);
    let dark = piece.plain("case", [0.05, 0.05, 0.055], 0.45);
    let frame = piece.metal();
    let seat = piece.uniform(0.44, 0.54);
    for i in 0..5 {
        let (sin, cos) = libm::sincos(TAU * (f64::from(i) + 0.25) / 5.0);
        let end = [0.29 * cos, 0.29 * sin, 0.075];
        piece.bar(frame, [0.02 * cos, 0.02 * sin, 0.115], end, [0.022, 0.013]);
        for shift in [-0.012, 0.012] {
            let wheel = [end[0] - shift * sin, end[1] + shift * cos, 0.028];
            let other = [wheel[0] - 0.012 * sin * shift.signum(), wheel[1] + 0.012 * cos * shift.signum(), 0.028];
            piece.bar(dark, wheel, other, [0.028; 2]);
        }
    }
    piece.bar(dark, [0.0, 0.0, 0.09], [0.0, 0.0, 0.24], [0.028; 2]);
    piece.bar(frame, [0.0, 0.0, 0.2], [0.0, 0.0, seat - 0.08], [0.016; 2]);
    piece.block(dark, [-0.12, -0.12, seat - 0.095], [0.12, 0.14, seat - 0.05], 0.012);
    let soft = Softness { corner: 0.09, edge: 0.035, bulge: 0.012, bow: 0.02 };
    piece.join(pad, soft_box(pad, [0.49, 0.47, 0.09], soft).translated(0.0, 0.0, seat - 0.02));
    let (tall, lean) = (piece.uniform(0.42, 0.68), piece.uniform(4.0, 12.0));
    let back = soft_box(pad, [0.45, tall, 0.07], Softness { corner: 0.1, ..soft }).bent(|mut p| {
        // Hollow, for the sitter's back.
        p.z += 0.25 * p.x * p.x;
        p
    });
    let back = back.rotated(0, 90.0 + -lean).translated(0.0, 0.25, seat + 0.14 + 0.5 * tall);
    piece.join(pad, back);
    let spine = spline(
        &[
            Point3::new(0.0, 0.05, seat - 0.07),
            Point3::new(0.0, 0.28, seat - 0.06),
            Point3::new(0.0, 0.31, seat + 0.05),
            Point3::new(0.0, 0.3, seat + 0.3),
        ],
        4,
    );
    piece.join(dark, tube(SlotMapping::fit(dark), &spine, 8, 4, |_| 0.02));
    if piece.form.chance(0.75) {
        for side in [-1.0, 1.0] {
            let x = side * 0.27;
            piece.block(dark, [x - 0.035, -0.14, seat + 0.17], [x + 0.035, 0.12, seat + 0.2], 0.012);
            piece.bar(dark, [x, 0.0, seat - 0.04], [x, 0.0, seat + 0.18], [0.014; 2]);
            piece.bar(dark, [x, 0.0, seat - 0.045], [0.4 * x, 0.0, seat - 0.07], [0.014; 2]);
        }
    }
    piece.carries([0.0, -0.02, seat + 0.03], [0.17, 0.16]);
}

fn stool(piece: &mut Piece) {
    let wood = piece.wood(0.3);
    let frame = if piece.paint.chance(0.5) { wood } else { piece.metal() };
    let (seat, radius) =
        (if piece.form.chance(0.5) { 0.45 } else { piece.uniform(0.6, 0.76) }, piece.uniform(0.15, 0.19));
    let pad = if piece.form.chance(0.5) { padding(piece) } else { wood };
    let soft = Softness { corner: radius, edge: 0.014, bulge: if pad == wood { -0.004 } else { 0.015 }, bow: 0.0 };
    piece.join(pad, soft_box(pad, [2.0 * radius, 2.0 * radius, 0.04], soft).translated(0.0, 0.0, seat - 0.02));
    let count = piece.form.integer(3, 4);
    let spread = radius + 0.05;
    let ring = 0.4 * seat;
    for i in 0..count {
        let (sin, cos) = libm::sincos(TAU * (i as f64 + 0.5) / count as f64);
        piece.bar(
            frame,
            [spread * cos, spread * sin, 0.0],
            [0.65 * radius * cos, 0.65 * radius * sin, seat - 0.035],
            [0.011, 0.014],
        );
    }
    let hoop = 0.65 * radius + (spread - 0.65 * radius) * 0.6;
    let path = arc(
        Point3::new(0.0, 0.0, ring),
        syntable_model::geometry::Vector3::x() * hoop,
        syntable_model::geometry::Vector3::y() * hoop,
        [0.0, TAU],
        24,
    );
    let hoop: SolidShape = tube(SlotMapping::fit(frame), &path, 8, 4, |_| 0.007);
    piece.join(frame, hoop);
    let knob = ball(SlotMapping::fit(frame), Point3::new(0.0, 0.0, seat - 0.04), 0.012);
    piece.join(frame, boxed(knob));
    piece.carries([0.0, 0.0, seat], [0.6 * radius; 2]);
}
