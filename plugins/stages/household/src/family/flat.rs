//! Soft, flat goods: magazines, towels and cloths.

use super::bags::Crumple;
use super::{FamilyContext, HouseholdModel};
use crate::material::{MaterialFamily, SurfaceFinish, hsv, magazine as magazine_print};
use crate::shape::{SlotMapping, SolidShape, loft, thick_sheet};
use nalgebra::Point3;
use std::f64::consts::PI;
use std::sync::Arc;

pub fn magazine(draw: &mut FamilyContext) -> HouseholdModel {
    let width = draw.uniform(0.17, 0.225);
    let height = width * draw.uniform(1.25, 1.42);
    let thick = draw.uniform(0.0025, 0.007);
    let (curl, lift) = (draw.uniform(-0.002, 0.012), draw.uniform(0.0, 0.01));
    let slots = [SlotMapping::fit(0), SlotMapping::fit(2), SlotMapping::tile(1, 0.05)];
    let shape = thick_sheet([20, 8], [5, 8], slots, |[u, v]| {
        let corner = u * u * (v - 0.5).max(0.0) * 2.0;
        let z = curl * u * u + lift * corner * corner;
        // Thinner where the pages end at the fold.
        let t = thick * (0.75 + 0.25 * (u / 0.12).min(1.0));
        let (x, y) = (width * (u - 0.5), height * (v - 0.5));
        [Point3::new(x, y, z + t), Point3::new(x, y, z)]
    });
    let shape = shape.uv_in(0, [0.5, 0.0, 1.0, 1.0]).uv_in(2, [0.0, 0.0, 0.5, 1.0]);
    let mass = shape.volume() * draw.uniform(850.0, 1150.0);
    let print = magazine_print(&mut draw.appearance, [width, height], draw.photographs);
    let cover = draw.sheet(&print);
    let page = draw.materials.get(MaterialFamily::Cardboard, 6);
    let paper = SurfaceFinish::plain(hsv(0.12, draw.appearance.uniform(0.02, 0.1), 0.88), 0.8, 0.0).detailed(&page);
    HouseholdModel::new(shape, vec![cover.clone(), Arc::new(paper.named("pages")), cover], mass).friction(0.35)
}

pub fn towel(draw: &mut FamilyContext) -> HouseholdModel {
    let is_folded = draw.form.chance(0.55);
    let shape = if is_folded { folded(draw) } else { crumpled(draw) };
    let mass = shape.volume() * draw.uniform(120.0, 320.0);
    let families = [MaterialFamily::Fabric, MaterialFamily::Knit, MaterialFamily::Tablecloth];
    let family = *draw.appearance.pick(&families).unwrap_or(&MaterialFamily::Fabric);
    let material = draw.material(family);
    HouseholdModel::new(shape, vec![material], mass).friction(0.65)
}

/// A stack of folds: a fold on one long side, the edges of layers on the other.
fn folded(draw: &mut FamilyContext) -> SolidShape {
    let (width, length) = (draw.uniform(0.1, 0.2), draw.uniform(0.16, 0.3));
    let layers = draw.form.integer(2, 4);
    let thick = layers as f64 * draw.uniform(0.007, 0.011);
    let (a, b) = (0.5 * width, 0.5 * thick);
    // The outline from the upper left corner to the right, around the fold, and back below.
    let mut section: Vec<[f64; 2]> =
        (0..=8).map(|i| [-a + 0.004 + (width - 0.004 - b) * f64::from(i) / 8.0, b]).collect();
    section.extend((1..8).map(|i| {
        let (sin, cos) = libm::sincos(PI * f64::from(i) / 8.0);
        [a - b + b * sin, b * cos]
    }));
    section.extend((0..=8).map(|i| [a - b - (width - 0.004 - b) * f64::from(i) / 8.0, -b]));
    for layer in 0..layers {
        let (low, high) = (-b + thick * layer as f64 / layers as f64, -b + thick * (layer + 1) as f64 / layers as f64);
        section.push([-a, low + 0.3 * (high - low)]);
        section.push([-a, high - 0.3 * (high - low)]);
        if layer + 1 < layers {
            section.push([-a + 0.003, high]);
        }
    }
    let rows = 14;
    let rings: Vec<Vec<Point3<f64>>> = (0..=rows)
        .map(|i| {
            let t = f64::from(i) / f64::from(rows);
            let y = length * (t - 0.5);
            let end = (t.min(1.0 - t) * f64::from(rows)).min(1.0);
            let scale = 0.9 + 0.1 * end;
            section.iter().map(|[x, z]| Point3::new(*x, y, scale * z)).collect()
        })
        .collect();
    let soft = Crumple::draw(&mut draw.form.child("soft"), 6, [0.05, 0.15], 0.0035);
    loft(&rings, SlotMapping::tile(0, 0.12), 3).bent(|p| {
        let shift = soft.at(Point3::new(p.x, p.y, 0.0));
        // More at the top than on the table.
        p + shift * (0.3 + 0.7 * (p.z + b) / thick)
    })
}

/// A cloth that fell: a sheet with ridges.
fn crumpled(draw: &mut FamilyContext) -> SolidShape {
    let edge = draw.uniform(0.16, 0.27);
    let aspect = draw.uniform(0.75, 1.0);
    let thick = draw.uniform(0.0025, 0.0045);
    let ridges = Crumple::draw(&mut draw.form.child("ridges"), 6, [0.08, 0.17], draw.uniform(0.022, 0.042));
    let fine = Crumple::draw(&mut draw.form.child("fine"), 8, [0.035, 0.07], draw.uniform(0.002, 0.004));
    let outline = Crumple::draw(&mut draw.form.child("outline"), 5, [0.1, 0.25], 0.025);
    let slots = [SlotMapping::tile(0, 0.12); 3];
    thick_sheet([26, 26], [5, 5], slots, |[u, v]| {
        let flat = Point3::new(edge * (u - 0.5), edge * aspect * (v - 0.5), 0.0);
        let shift = outline.at(flat);
        let ridge = ridges.at(flat);
        // Folds are round at their tops and rest on the table between them.
        let height = (ridge.z + 0.6 * ridge.x).abs() + fine.at(flat).z.abs();
        let (x, y) = (flat.x + 0.7 * shift.x, flat.y + 0.7 * shift.y);
        [Point3::new(x, y, height + thick), Point3::new(x, y, height)]
    })
}
