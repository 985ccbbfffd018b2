//! Suitcases, backpacks, and clothes on hooks.

use super::piece::Piece;
use super::solids::{Softness, ball, boxed, circle, soft_box, spline, tube};
use super::tones;
use crate::family::Crumple;
use crate::material::MaterialFamily;
use crate::shape::{SlotMapping, SolidShape, loft, thick_sheet};
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::{Point3, Vector3};

/// A suitcase with wheels, ribs, a handle and locks; or a backpack with pockets and straps.
pub fn suitcase(piece: &mut Piece) {
    if piece.form.chance(0.45) {
        return backpack(piece);
    }
    let color = tones::cloth(&mut piece.paint);
    let gloss = piece.paint.uniform(0.2, 0.5);
    let shell = piece.tinted(MaterialFamily::Plastic, color, gloss);
    let dark = piece.plain("trim", [0.04; 3], 0.45);
    let metal = piece.metal();
    let (a, b, height) = (0.5 * piece.uniform(0.36, 0.5), 0.5 * piece.uniform(0.2, 0.3), piece.uniform(0.5, 0.72));
    let soft = Softness { corner: 0.06, edge: 0.05, bulge: 0.004, bow: 0.004 };
    // Two half shells with a zip between them, and ribs on the front.
    let body = soft_box(shell, [2.0 * a, height, b], soft).rotated(0, 90.0);
    for y in [-0.5 * b, 0.5 * b] {
        piece.join(shell, body.clone().translated(0.0, y, 0.05 + 0.5 * height));
    }
    let seam = soft_box(dark, [2.0 * a - 0.008, height - 0.008, 0.02], soft).rotated(0, 90.0);
    piece.join(dark, seam.translated(0.0, 0.0, 0.05 + 0.5 * height));
    let ribs = piece.form.integer(4, 9);
    for i in 0..ribs {
        let x = 1.5 * a * ((i as f64 + 0.5) / ribs as f64 - 0.5);
        let wide = 0.35 * 1.5 * a / ribs as f64;
        piece.block(shell, [x - wide, -b - 0.006, 0.12], [x + wide, -b + 0.02, height - 0.02], 0.004);
    }
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let at = [x * (a - 0.05), y * (b - 0.035)];
        piece.bar(dark, [at[0] - 0.011, at[1], 0.024], [at[0] + 0.011, at[1], 0.024], [0.024; 2]);
        piece.block(dark, [at[0] - 0.018, at[1] - 0.02, 0.028], [at[0] + 0.018, at[1] + 0.02, 0.07], 0.006);
    }
    let top = height + 0.05;
    if piece.form.chance(0.5) {
        let rise = piece.uniform(0.25, 0.42);
        for x in [-0.5 * a, 0.5 * a] {
            piece.bar(metal, [x, b - 0.04, top - 0.03], [x, b - 0.04, top + rise], [0.007; 2]);
        }
        piece.block(
            dark,
            [-0.5 * a - 0.015, b - 0.056, top + rise - 0.01],
            [0.5 * a + 0.015, b - 0.024, top + rise + 0.02],
            0.01,
        );
    }
    let grip = spline(
        &[
            Point3::new(-0.09, 0.0, top - 0.012),
            Point3::new(-0.07, 0.0, top + 0.018),
            Point3::new(0.07, 0.0, top + 0.018),
            Point3::new(0.09, 0.0, top - 0.012),
        ],
        4,
    );
    piece.join(dark, tube(SlotMapping::fit(dark), &grip, 8, 4, |_| 0.009));
}

fn backpack(piece: &mut Piece) {
    let cloth = piece.cloth();
    let second = if piece.paint.chance(0.5) { cloth } else { piece.cloth() };
    let dark = piece.plain("strap", [0.05; 3], 0.8);
    let (a, height) = (0.5 * piece.uniform(0.28, 0.34), piece.uniform(0.42, 0.52));
    let folds = Crumple::draw(&mut piece.form, 6, [0.1, 0.3], 0.012);
    let soft = Softness { corner: 0.11, edge: 0.06, bulge: 0.02, bow: 0.008 };
    let lean = piece.uniform(3.0, 10.0);
    let stand = |shape: SolidShape, y: f64, z: f64| {
        shape.bent(|p| p + folds.at(p)).rotated(0, 90.0 - lean).translated(0.0, y + z * 0.1, z)
    };
    let body = stand(soft_box(cloth, [2.0 * a, height, 0.17], soft), 0.0, 0.5 * height);
    piece.join(cloth, body);
    let flat = Softness { corner: 0.05, edge: 0.026, bulge: 0.008, bow: 0.004 };
    let pocket = stand(soft_box(second, [1.55 * a, 0.44 * height, 0.075], flat), -0.098, 0.29 * height);
    piece.join(second, pocket);
    for z in [0.5 * height, 0.86 * height] {
        let zip = spline(
            &[
                Point3::new(-0.8 * a, -0.075 + 0.1 * z, z - 0.05),
                Point3::new(-0.5 * a, -0.105 + 0.1 * z, z),
                Point3::new(0.5 * a, -0.105 + 0.1 * z, z),
                Point3::new(0.8 * a, -0.075 + 0.1 * z, z - 0.05),
            ],
            5,
        );
        piece.join(dark, tube(SlotMapping::fit(dark), &zip, 6, 5, |_| 0.004));
    }
    let grip = spline(
        &[
            Point3::new(-0.04, 0.06, height - 0.03),
            Point3::new(-0.035, 0.07, height + 0.03),
            Point3::new(0.035, 0.07, height + 0.03),
            Point3::new(0.04, 0.06, height - 0.03),
        ],
        4,
    );
    piece.join(dark, tube(SlotMapping::fit(dark), &grip, 6, 4, |_| 0.008));
}

/// A rail with hooks on a wall, and clothes on some of them.
pub fn coat_rack(piece: &mut Piece) {
    let wood = piece.wood(0.3);
    let metal = piece.metal();
    let hooks = piece.form.integer(3, 6) as usize;
    let pitch = piece.uniform(0.14, 0.2);
    let half = 0.5 * pitch * hooks as f64;
    piece.block(wood, [-half, -0.02, -0.05], [half, 0.0, 0.05], 0.004);
    if piece.form.chance(0.4) {
        piece.block(wood, [-half, -0.24, 0.06], [half, 0.0, 0.08], 0.004);
        piece.board(wood, [-half, -0.02, 0.045], [half, 0.0, 0.065]);
        piece.carries([0.0, -0.12, 0.08], [half, 0.1]);
    }
    for hook in 0..hooks {
        let x = -half + pitch * (hook as f64 + 0.5);
        let path = spline(
            &[
                Point3::new(x, -0.018, 0.015),
                Point3::new(x, -0.035, -0.02),
                Point3::new(x, -0.065, -0.03),
                Point3::new(x, -0.08, 0.005),
            ],
            4,
        );
        piece.join(metal, tube(SlotMapping::fit(metal), &path, 8, 6, |t| 0.0055 - 0.001 * t));
        piece.cluster(ball(SlotMapping::fit(metal), Point3::new(x, -0.081, 0.01), 0.0085));
        if piece.form.chance(0.6) {
            coat(piece, [x, -0.055, -0.01]);
        }
    }
}

/// A coat or scarf that hangs from a point.
fn coat(piece: &mut Piece, [x, y, z]: [f64; 3]) {
    let cloth = piece.cloth();
    let (length, wide) = (piece.uniform(0.6, 1.0), piece.uniform(0.17, 0.23));
    let (count, phase) = (piece.form.integer(4, 7) as f64, piece.uniform(0.0, TAU));
    let sway = piece.uniform(-0.05, 0.05);
    let points = 36;
    let rows = 18;
    let rings: Vec<Vec<Point3<f64>>> = (0..=rows)
        .map(|i| {
            // From the hem up.
            let t = 1.0 - f64::from(i) / f64::from(rows);
            let open = libm::pow(libm::sin(0.5 * PI * (0.06 + 0.94 * t).min(1.0)), 0.55);
            let (a, b) = (wide * (0.12 + 0.88 * open), 0.075 * (0.25 + 0.75 * open));
            let middle = Point3::new(x + sway * t * t, y - 0.2 * b, z - length * t);
            circle(middle, Vector3::x() * a, Vector3::y() * b, points)
                .into_iter()
                .enumerate()
                .map(|(j, p)| {
                    let angle = TAU * j as f64 / f64::from(points as u32);
                    let fold = 1.0 + 0.17 * t * libm::sin(count * angle + phase + 1.5 * t);
                    middle + (p - middle) * fold
                })
                .collect()
        })
        .collect();
    let folds = Crumple::draw(&mut piece.form, 6, [0.1, 0.3], 0.012);
    let body = loft(&rings, SlotMapping::fit(cloth), 9).bent(|p| p + folds.at(p) * 0.5);
    piece.join(cloth, boxed(body));
    // Sleeves at both sides.
    for side in [-1.0, 1.0] {
        let path = spline(
            &[
                Point3::new(x + side * 0.5 * wide, y, z - 0.1 * length),
                Point3::new(x + side * 0.98 * wide, y - 0.02, z - 0.3 * length),
                Point3::new(x + side * 1.02 * wide + sway * 0.3, y - 0.03, z - 0.72 * length),
            ],
            6,
        );
        let sleeve = tube(SlotMapping::fit(cloth), &path, 12, 12, |t| 0.06 - 0.018 * t).bent(|p| p + folds.at(p));
        piece.join(cloth, boxed(sleeve));
    }
    // A collar.
    let collar = thick_sheet([16, 3], [16, 3], [SlotMapping::fit(cloth); 3], |[u, v]| {
        let angle = PI * (1.1 + 0.8 * (u - 0.5) * 2.0) - 0.6 * PI;
        let (sin, cos) = libm::sincos(angle);
        let radius = 0.055 + 0.012 * (1.0 - v);
        let point = |r: f64| Point3::new(x + r * cos, y - 0.01 + 0.6 * r * sin, z - 0.02 - 0.06 * (1.0 - v));
        [point(radius + 0.004), point(radius)]
    });
    piece.join(cloth, boxed(collar));
}
