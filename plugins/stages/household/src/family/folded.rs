//! Folded board: drink cartons and open boxes.

use super::{FamilyContext, HouseholdModel};
use crate::material::{MaterialFamily, SurfaceFinish, WrapKind, shade, vivid, wrapped};
use crate::shape::{Lathe, Profile, SlotMapping, SolidShape, rounded_box, vessel};
use nalgebra::Point3;
use std::sync::Arc;

/// Points on each side of a drink carton's rings.
const SIDE: usize = 8;

pub fn drink_carton(draw: &mut FamilyContext) -> HouseholdModel {
    let edge = draw.uniform(0.062, 0.096);
    let body = edge * draw.uniform(1.9, 2.7);
    let rise = 0.5 * edge * draw.uniform(0.85, 1.05);
    let fin = draw.uniform(0.012, 0.02);
    let bulge = draw.uniform(0.0, 0.0025);
    let a = 0.5 * edge;
    // `close` is 0 for the square body and 1 for the flat fin.
    let ring = |z: f64, close: f64, swell: f64| -> Vec<Point3<f64>> {
        let b = a + (0.0011 - a) * close;
        (0..4 * SIDE)
            .map(|i| {
                let t = (i % SIDE) as f64 / SIDE as f64;
                let s = 2.0 * t - 1.0;
                let out = swell * (1.0 - s * s);
                let fold = close * 0.86 * a * (1.0 - s.abs());
                match i / SIDE {
                    0 => Point3::new(a * s, -b - out, z),
                    1 => Point3::new(a + out - fold, b * s, z),
                    2 => Point3::new(-a * s, b + out, z),
                    _ => Point3::new(-a - out + fold, -b * s, z),
                }
            })
            .collect()
    };
    let levels = [
        (0.0, 0.0, 0.0),
        (0.25 * body, 0.0, 0.8 * bulge),
        (0.5 * body, 0.0, bulge),
        (0.75 * body, 0.0, 0.8 * bulge),
        (body, 0.0, 0.0),
        (body + 0.5 * rise, 0.5, 0.0),
        (body + rise, 1.0, 0.0),
        (body + rise + fin, 1.0, 0.0),
    ];
    let rings: Vec<_> = levels.iter().map(|&(z, close, swell)| ring(z, close, swell)).collect();
    let height = body + rise + fin;
    let around: Vec<f64> = (0..=4 * SIDE).map(|i| i as f64 / (4 * SIDE) as f64).collect();
    let mut shape = solid_of(&rings, &around, height);
    for pair in [0..5, 4..7, 6..8] {
        shape = shape.with_part(rings[pair].concat());
    }
    let has_cap = draw.form.chance(0.6);
    if has_cap {
        let (r, h) = (draw.uniform(0.011, 0.015), draw.uniform(0.009, 0.014));
        let cap = SlotMapping::tile(2, 0.1);
        let outline = Profile::at(0.0, -0.006).to(r, -0.006, cap).to(r, h, cap).round(0.0015).to(0.0, h, cap);
        let tilt = libm::atan2(rise, a).to_degrees();
        let screw = Lathe::new(&outline).segments(24).solid().rotated(0, tilt);
        shape = shape.and(screw.translated(0.0, -0.5 * a, body + 0.5 * rise));
    }
    let mass = edge * edge * body * draw.uniform(60.0, 1030.0);
    let print = wrapped(&mut draw.appearance, WrapKind::DrinkCarton, &[edge; 4], height, draw.photographs);
    let cap_color = vivid(&mut draw.appearance);
    let bare = shade(print.edge_color(), 0.9);
    let materials = vec![draw.sheet(&print), draw.plain("board", bare, 0.6), draw.plastic_of("cap", cap_color)];
    HouseholdModel::new(shape, materials, mass.max(0.02)).friction(0.4)
}

/// The closed surface over rings; texture heights follow the rings' own heights.
fn solid_of(rings: &[Vec<Point3<f64>>], around: &[f64], height: f64) -> SolidShape {
    let shape = vessel(rings, &[], around, [SlotMapping::fit(0), SlotMapping::tile(1, 0.1)]);
    shape.uv_by_height(0, height)
}

pub fn open_box(draw: &mut FamilyContext) -> HouseholdModel {
    let sx = draw.uniform(0.16, 0.36);
    let sy = sx * draw.uniform(0.55, 0.9);
    let sz = sx * draw.uniform(0.35, 0.8);
    let wall = draw.uniform(0.003, 0.005);
    let inside = SlotMapping::tile(1, 0.3);
    let total = 2.0 * (sx + sy);
    let slab = |size: [f64; 3], shown: Option<usize>| {
        rounded_box(size, 0.25 * wall, 1, |side| if Some(side) == shown { SlotMapping::fit(0) } else { inside })
    };
    let mut shape = slab([sx, sy, wall], None).translated(0.0, 0.0, 0.5 * wall);
    let (ox, oy) = (0.5 * (sx - wall), 0.5 * (sy - wall));
    // Front, right, back, left: sizes, shown side, place, and start of the print.
    let walls = [
        ([sx, wall, sz], 2, [0.0, -oy], 0.0),
        ([wall, sy, sz], 1, [ox, 0.0], sx),
        ([sx, wall, sz], 3, [0.0, oy], sx + sy),
        ([wall, sy, sz], 0, [-ox, 0.0], 2.0 * sx + sy),
    ];
    for (number, (size, shown, [x, y], start)) in walls.into_iter().enumerate() {
        let edge = if number % 2 == 0 { sx } else { sy };
        let rect = [start / total, 0.0, (start + edge) / total, 1.0];
        shape = shape.and(slab(size, Some(shown)).uv_in(0, rect).translated(x, y, 0.5 * sz));
        // The flap hangs from the wall's outer edge: turned from level inwards by more than a right angle.
        let reach = 0.5 * sy * draw.uniform(0.9, 0.98);
        let open = draw.uniform(95.0, 235.0);
        let length = edge - 2.5 * wall;
        let flap = slab([length, reach, wall], None).translated(0.0, 0.5 * reach, 0.0).rotated(0, open);
        let flap = flap.translated(0.0, -0.5 * if number % 2 == 0 { sy } else { sx } + 0.5 * wall, sz - 0.3 * wall);
        shape = shape.and(flap.rotated(2, 90.0 * number as f64));
    }
    let mass = shape.volume() * draw.uniform(110.0, 170.0);
    let print = wrapped(&mut draw.appearance, WrapKind::ShippingBox, &[sx, sy, sx, sy], sz, draw.photographs);
    let board = draw.material(MaterialFamily::Cardboard);
    let color = print.edge_color();
    let plain = SurfaceFinish::plain(color, 0.9, 0.0).detailed(&board).named("board");
    let material = print.material("print", None);
    HouseholdModel::new(shape, vec![Arc::new(material), Arc::new(plain)], mass).friction(0.5)
}
