//! Tools and stationery, lying along x.

use super::{FamilyContext, HouseholdModel, density, ellipse};
use crate::material::{LabelKind, MaterialFamily, hsv, label, shade, vivid};
use crate::shape::{Lathe, Profile, SlotMapping, SweepPath, extrude, loft, rounded_box, sweep};
use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};

pub fn hammer(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.24, 0.33);
    let size = draw.uniform(0.85, 1.12);
    let path: Vec<Point3<f64>> = (0..=16).map(|i| Point3::new(length * f64::from(i) / 16.0, 0.0, 0.0)).collect();
    let grip = SweepPath::along(&path, Vector3::z()).scaled(|t| {
        let end = (t / 0.02).min(1.0).sqrt().max(0.7);
        let swell = 1.0 - 0.28 * libm::sin(PI * (t - 0.1).clamp(0.0, 0.8) / 0.8);
        [end * swell, end * swell]
    });
    let handle = sweep(&grip, &ellipse(0.0165 * size, 0.0115 * size, 20), SlotMapping::tile(0, 0.25), 4);
    // The head is across the handle's end: block, neck and face to one side, claw to the other.
    let x = length - 0.006;
    let block = rounded_box([0.026 * size, 0.036 * size, 0.026 * size], 0.003, 2, |_| SlotMapping::tile(1, 0.15));
    let face = Profile::at(0.0, 0.0)
        .to(0.0095 * size, 0.0, SlotMapping::tile(1, 0.15))
        .to(0.0095 * size, 0.018 * size, SlotMapping::tile(1, 0.15))
        .round(0.004)
        .to(0.0135 * size, 0.023 * size, SlotMapping::tile(1, 0.15))
        .round(0.002)
        .to(0.0135 * size, 0.038 * size, SlotMapping::tile(1, 0.15))
        .round(0.0018)
        .to(0.0, 0.038 * size, SlotMapping::tile(1, 0.15));
    let middle = 0.021 * size;
    let face = Lathe::new(&face).segments(32).banded(&[[0.0, middle], [middle, 0.038 * size]]);
    let face = face.rotated(0, -90.0).translated(x, 0.012 * size, 0.0);
    let ball = draw.form.chance(0.3);
    let reach = draw.uniform(0.045, 0.06) * size;
    let claw: Vec<Point3<f64>> = (0..=8)
        .map(|i| {
            let t = f64::from(i) / 8.0;
            let droop = if ball { 0.0 } else { 0.35 * reach * t * t };
            Point3::new(x - droop, -0.012 * size - reach * t, 0.0)
        })
        .collect();
    let taper = SweepPath::along(&claw, Vector3::z()).scaled(|t| {
        if ball {
            let round = (1.0 - t).min(0.2) / 0.2;
            [0.75 * round.sqrt().max(0.25), 0.75 * round.sqrt().max(0.25)]
        } else {
            [1.0 - 0.8 * t, 1.0 + 0.15 * t]
        }
    });
    let claw = sweep(&taper, &ellipse(0.0105 * size, 0.0115 * size, 16), SlotMapping::tile(1, 0.15), 3);
    let block = block.translated(x, 0.0, 0.0);
    // The parts of the head overlap.
    let head = block.and(face).and(claw).dense(0.85 * density::STEEL);
    let shape = handle.dense(density::WOOD).and(head);
    let mass = shape.moments().total;
    let wooden = draw.appearance.chance(0.6);
    let grip = if wooden {
        draw.material(MaterialFamily::Timber)
    } else {
        let color = vivid(&mut draw.appearance);
        draw.plastic_of("grip", shade(color, 0.7))
    };
    let materials = vec![grip, draw.metal()];
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}

pub fn screwdriver(draw: &mut FamilyContext) -> HouseholdModel {
    let (grip, r) = (draw.uniform(0.075, 0.115), draw.uniform(0.0115, 0.0165));
    let (shaft, s) = (draw.uniform(0.075, 0.15), draw.uniform(0.0025, 0.004));
    let grip_slot = SlotMapping::tile(0, 0.1);
    let outline = Profile::at(0.0, 0.0)
        .to(0.6 * r, 0.0, grip_slot)
        .round(0.15 * r)
        .to(r, 0.5 * r, grip_slot)
        .round(0.6 * r)
        .to(r, 0.45 * grip, grip_slot)
        .round(0.02)
        .to(0.72 * r, 0.72 * grip, grip_slot)
        .round(0.02)
        .to(0.9 * r, 0.88 * grip, grip_slot)
        .round(0.004)
        .to(0.5 * r, grip, grip_slot)
        .to(0.0, grip, grip_slot);
    // Six flutes along the grip.
    let depth = draw.uniform(0.04, 0.12);
    let handle = Lathe::new(&outline)
        .segments(48)
        .banded(&[[0.0, 0.5 * grip], [0.5 * grip, 0.75 * grip], [0.75 * grip, grip]])
        .bent(|p| {
            let along = libm::sin(p.z / grip * PI).max(0.0);
            let factor = 1.0 - depth * along * (0.5 - 0.5 * libm::cos(6.0 * libm::atan2(p.y, p.x)));
            Point3::new(p.x * factor, p.y * factor, p.z)
        });
    let flat = draw.form.chance(0.5);
    let rings: Vec<Vec<Point3<f64>>> =
        [(0.0, [1.0, 1.0]), (0.86, [1.0, 1.0]), (0.93, [1.15, 0.6]), (1.0, [1.25, 0.16])]
            .into_iter()
            .map(|(t, scale)| {
                let [a, b] = if flat {
                    scale
                } else {
                    [1.0_f64, 1.0].map(|x| x * (1.0 - 0.75 * ((t - 0.86) / 0.14_f64).max(0.0)))
                };
                ellipse(s * a, s * b, 16)
                    .into_iter()
                    .map(|[x, y]| Point3::new(x, y, grip - 0.004 + (shaft + 0.004) * t))
                    .collect()
            })
            .collect();
    let shaft = loft(&rings, SlotMapping::tile(1, 0.1), 3);
    let shape = handle.dense(density::RUBBER).and(shaft.dense(density::STEEL));
    let mass = shape.moments().total;
    let color = vivid(&mut draw.appearance);
    let materials = vec![draw.plastic_of("grip", color), draw.polished("steel")];
    HouseholdModel::new(shape.rotated(1, 90.0), materials, mass).friction(0.45)
}

pub fn wrench(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.12, 0.21);
    let thick = draw.uniform(0.0048, 0.0075);
    let heads = [length * draw.uniform(0.085, 0.1), length * draw.uniform(0.07, 0.085)];
    let shank = length * draw.uniform(0.036, 0.046);
    let tilt = draw.uniform(0.15, 0.3);
    let mut outline = Vec::new();
    for (end, r) in heads.into_iter().enumerate() {
        let sign = if end == 0 { 1.0 } else { -1.0 };
        let center = 0.5 * length - r;
        let root = libm::asin(shank / r);
        let jaw = 0.52 * r;
        let half = libm::asin(jaw / r);
        let mut point = |x: f64, y: f64| outline.push([sign * (center + x), sign * y]);
        let mut circle = |from: f64, to: f64, steps: usize| {
            for i in 0..=steps {
                let (sin, cos) = libm::sincos(from + (to - from) * i as f64 / steps as f64);
                point(r * cos, r * sin);
            }
        };
        circle(-PI + root, tilt - half, 9);
        let (sin, cos) = libm::sincos(tilt);
        let deep = -0.25 * r;
        let (inner, outer) =
            ([deep * cos + jaw * sin, deep * sin - jaw * cos], [deep * cos - jaw * sin, deep * sin + jaw * cos]);
        point(inner[0], inner[1]);
        point(outer[0], outer[1]);
        let mut circle = |from: f64, to: f64, steps: usize| {
            for i in 0..=steps {
                let (sin, cos) = libm::sincos(from + (to - from) * i as f64 / steps as f64);
                outline.push([sign * (center + r * cos), sign * r * sin]);
            }
        };
        circle(tilt + half, PI - root, 9);
    }
    let shape = extrude(&outline, [0.0, thick], 0.0006, SlotMapping::tile(0, 0.2), SlotMapping::tile(0, 0.2));
    let mass = shape.volume() * density::STEEL;
    let materials = vec![draw.metal()];
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}

pub fn tape(draw: &mut FamilyContext) -> HouseholdModel {
    let outer = draw.uniform(0.032, 0.056);
    let (inner, h) = (outer * draw.uniform(0.58, 0.76), draw.uniform(0.012, 0.05));
    let core = 0.0025;
    let (tape, paper) = (SlotMapping::tile(0, 0.1), SlotMapping::tile(1, 0.1));
    let outline = Profile::at(inner, 0.0)
        .to(inner + core, 0.0, paper)
        .to(outer, 0.0, tape)
        .round(0.0005)
        .to(outer, h, tape)
        .round(0.0005)
        .to(inner + core, h, tape)
        .to(inner, h, paper)
        .closed(paper);
    let cell = vec![[inner, 0.0], [outer, 0.0], [outer, h], [inner, h]];
    let shape = Lathe::new(&outline).segments(48).hollow(&[cell], &[], 12);
    let mass = shape.volume() * 850.0;
    let brown = draw.appearance.chance(0.4);
    let color = if brown { hsv(0.09, 0.5, draw.appearance.uniform(0.4, 0.7)) } else { vivid(&mut draw.appearance) };
    let materials = vec![draw.plain("tape", color, 0.3), draw.material(MaterialFamily::Cardboard)];
    HouseholdModel::new(shape, materials, mass).friction(0.5)
}

pub fn marker(draw: &mut FamilyContext) -> HouseholdModel {
    let (length, r) = (draw.uniform(0.115, 0.142), draw.uniform(0.0058, 0.0092));
    let cap = length * draw.uniform(0.28, 0.4);
    let (body, lid) = (SlotMapping::fit(0), SlotMapping::tile(1, 0.1));
    let outline = Profile::at(0.0, 0.0)
        .to(0.85 * r, 0.0, lid)
        .round(0.0012)
        .to(0.92 * r, 0.006, lid)
        .to(0.92 * r, 0.0065, lid)
        .to(0.94 * r, 0.0066, body)
        .to(0.94 * r, length - cap, body)
        .to(r, length - cap, lid)
        .round(0.0004)
        .to(r, length - 0.004, lid)
        .round(0.002)
        .to(0.6 * r, length, lid)
        .round(0.001)
        .to(0.0, length, lid);
    let clip = rounded_box([0.0024, 0.0045, 0.8 * cap], 0.0008, 1, |_| SlotMapping::tile(1, 0.1));
    let clip = clip.translated(r + 0.0008, 0.0, length - 0.52 * cap);
    let shape = Lathe::new(&outline).segments(32).solid();
    let mass = shape.volume() * draw.uniform(650.0, 950.0);
    let extents = [TAU * r, length - cap];
    let print = label(&mut draw.appearance, LabelKind::Glued, extents, draw.photographs);
    let color = vivid(&mut draw.appearance);
    let materials = vec![draw.sheet(&print), draw.plastic_of("cap", color)];
    HouseholdModel::new(shape.and(clip).rotated(1, 90.0), materials, mass).friction(0.45)
}
