//! Packages: cartons, cans, bottles, jars, tubes. All are closed and full, or partly so.

use super::glass::clear_solid;
use super::{FamilyContext, HouseholdModel};
use crate::material::{LabelKind, carton as carton_print, hsv, label, mix, shade, vivid};
use crate::shape::{Lathe, Profile, SlotMapping, loft, rounded_box};
use nalgebra::Point3;
use std::f64::consts::TAU;

const LABEL: SlotMapping = SlotMapping::fit(0);
const END: SlotMapping = SlotMapping::tile(1, 0.1);
const CAP: SlotMapping = SlotMapping::tile(2, 0.1);

/// Outer sizes of usual cartons, meters: cereal, crackers, tea, rice, medicine, cube, pasta, soap.
const CARTONS: [[f64; 3]; 8] = [
    [0.19, 0.06, 0.275],
    [0.16, 0.06, 0.21],
    [0.15, 0.075, 0.085],
    [0.11, 0.05, 0.17],
    [0.085, 0.028, 0.055],
    [0.1, 0.1, 0.1],
    [0.085, 0.045, 0.24],
    [0.095, 0.06, 0.032],
];

pub fn carton(draw: &mut FamilyContext) -> HouseholdModel {
    let usual = *draw.form.pick(&CARTONS).unwrap_or(&CARTONS[0]);
    let size = usual.map(|edge| edge * draw.uniform(0.85, 1.12));
    let edge = draw.uniform(0.0012, 0.0025);
    let (print, rects) = carton_print(&mut draw.appearance, size, draw.photographs);
    let shape = rounded_box(size, edge, 2, |side| SlotMapping::fit(side as u16)).in_atlas(&rects);
    let mass = size.iter().product::<f64>() * draw.uniform(160.0, 420.0);
    let material = draw.sheet(&print);
    HouseholdModel::new(shape, vec![material], mass).friction(0.45)
}

pub fn can(draw: &mut FamilyContext) -> HouseholdModel {
    // Drink, food, fish, spread, spray: radius and height.
    const CANS: [[f64; 2]; 5] = [[0.033, 0.12], [0.037, 0.11], [0.042, 0.036], [0.05, 0.075], [0.027, 0.15]];
    let kind = draw.form.below(5) as usize;
    let [r, h] = CANS[kind].map(|x| x * draw.uniform(0.92, 1.08));
    let neck = if kind == 0 || kind == 4 { 0.8 } else { 1.0 };
    let (rim, dip) = (0.0015, draw.uniform(0.002, 0.0035));
    let mut outline = Profile::at(0.0, dip)
        .to(0.75 * neck * r, dip, END)
        .to((neck * r - rim).min(0.97 * r - rim), 0.0, END)
        .to((neck * r).min(0.985 * r), 0.0, END)
        .round(0.4 * rim);
    let shoulder = if neck < 1.0 { 0.1 * r + (1.0 - neck) * r } else { rim };
    if neck < 1.0 {
        outline = outline.to(r, 0.6 * shoulder, END).round(0.004);
    } else {
        outline = outline.to(r, 0.001, END);
    }
    outline = outline.to(r, shoulder, END).to(r, h - shoulder, LABEL);
    if neck < 1.0 {
        outline = outline.to(r, h - 0.9 * shoulder, END).round(0.004).to(neck * r, h - 0.002, END);
    }
    outline = outline
        .to(neck * r, h, END)
        .round(0.4 * rim)
        .to(neck * r - rim, h, END)
        .round(0.4 * rim)
        .to(neck * r - 1.2 * rim, h - dip, END)
        .to(0.0, h - dip, END);
    let shape = Lathe::new(&outline).segments(48).solid();
    let label_kind = if neck < 1.0 && draw.appearance.chance(0.8) { LabelKind::Metal } else { LabelKind::Tin };
    let extents = [TAU * r, h - 2.0 * shoulder];
    let print = label(&mut draw.appearance, label_kind, extents, draw.photographs);
    let materials = vec![draw.sheet(&print), draw.metal()];
    let mass = shape.volume() * draw.uniform(820.0, 1120.0);
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}

pub fn bottle(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, h) = (draw.uniform(0.026, 0.042), draw.uniform(0.15, 0.29));
    let neck = draw.uniform(0.010, 0.014).min(0.45 * r);
    let shoulder = h * draw.uniform(0.58, 0.74);
    let throat = shoulder + (h - shoulder) * draw.uniform(0.35, 0.6);
    let (low, high) = (0.12 * h, shoulder - 0.05 * h);
    let waist = if draw.form.chance(0.3) { draw.uniform(0.86, 0.95) } else { 1.0 };
    let cap = neck + draw.uniform(0.0015, 0.003);
    let cap_low = h - draw.uniform(0.012, 0.025).min(0.6 * (h - throat));
    let outline = Profile::at(0.0, 0.0)
        .to(0.93 * r, 0.0, END)
        .to(r, 0.07 * r, END)
        .round(0.1 * r)
        .to(r, low, END)
        .to(waist * r, 0.5 * (low + high), LABEL)
        .round(0.3)
        .to(r, high, LABEL)
        .curve([r, shoulder], [neck, shoulder], [neck, throat], 9, END)
        .to(neck, cap_low, END)
        .to(cap, cap_low, CAP)
        .to(cap, h, CAP)
        .round(0.0012)
        .to(0.0, h, CAP);
    let middle = 0.5 * (shoulder + throat);
    let shape = Lathe::new(&outline).segments(48).banded(&[[0.0, high], [high, middle], [middle, throat], [throat, h]]);
    let color = if draw.appearance.chance(0.4) {
        hsv(draw.appearance.uniform(0.05, 0.4), 0.7, draw.appearance.uniform(0.1, 0.35))
    } else {
        vivid(&mut draw.appearance)
    };
    let print = label(&mut draw.appearance, LabelKind::Glued, [TAU * r, high - low], draw.photographs);
    let cap_color = vivid(&mut draw.appearance);
    let gloss = draw.appearance.uniform(0.06, 0.35);
    let print = draw.sheet(&print);
    let mut filling = draw.appearance.child("glass");
    let body = if filling.chance(0.3) {
        // Glass and drink bend light nearly alike: a full bottle is as good as solid.
        let tint = mix(color, [1.0; 3], filling.uniform(0.2, 0.9) as f32);
        clear_solid("bottle", tint, filling.uniform(1.34, 1.5), filling.uniform(0.0, 0.04))
    } else {
        draw.plain("bottle", color, gloss)
    };
    let materials = vec![print, body, draw.plastic_of("cap", cap_color)];
    // From nearly empty to full.
    let mass = shape.volume() * draw.uniform(130.0, 1000.0);
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}

pub fn jar(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, h) = (draw.uniform(0.03, 0.048), draw.uniform(0.07, 0.15));
    let lid = draw.uniform(0.012, 0.018);
    let mouth = r * draw.uniform(0.78, 0.95);
    let shoulder = h - lid - draw.uniform(0.008, 0.014);
    let outline = Profile::at(0.0, 0.0)
        .to(r, 0.0, END)
        .round(0.005)
        .to(r, 0.12 * h, END)
        .to(r, 0.85 * shoulder, LABEL)
        .curve([r, shoulder], [mouth, shoulder], [0.97 * mouth, h - lid - 0.002], 6, END)
        .to(0.97 * mouth, h - lid, END)
        .to(1.03 * mouth, h - lid, CAP)
        .round(0.0008)
        .to(1.03 * mouth, h, CAP)
        .round(0.002)
        .to(0.94 * mouth, h, CAP)
        .to(0.92 * mouth, h - 0.001, CAP)
        .to(0.0, h - 0.001, CAP);
    let shape = Lathe::new(&outline).segments(48).banded(&[[0.0, h - lid], [h - lid, h]]);
    let extents = [TAU * r, 0.85 * shoulder - 0.12 * h];
    let print = label(&mut draw.appearance, LabelKind::Glued, extents, draw.photographs);
    let content =
        hsv(draw.appearance.uniform(0.0, 0.18), draw.appearance.uniform(0.4, 0.9), draw.appearance.uniform(0.25, 0.8));
    let lid_color = vivid(&mut draw.appearance);
    let lid_material = if draw.appearance.chance(0.5) { draw.metal() } else { draw.plain("lid", lid_color, 0.3) };
    let materials = vec![draw.sheet(&print), draw.plain("glass", content, 0.05), lid_material];
    let mass = shape.volume() * draw.uniform(950.0, 1350.0);
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}

pub fn tube(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, length) = (draw.uniform(0.014, 0.021), draw.uniform(0.1, 0.17));
    // From round at the neck to a flat seam, lying along y with the seam level.
    let n = 32;
    let rings: Vec<Vec<Point3<f64>>> = (0..=16)
        .map(|i| {
            let t = f64::from(i) / 16.0;
            let flat = libm::pow(1.0 - t, 0.65).max(0.055);
            let (a, b) = (r * (1.0 + 0.5 * t), r * flat);
            (0..n)
                .map(|j| {
                    let (sin, cos) = libm::sincos(TAU * f64::from(j) / f64::from(n));
                    Point3::new(a * cos, -length * t, b * sin)
                })
                .collect()
        })
        .collect();
    let body = loft(&rings, SlotMapping::fit(0), 16);
    let cap = r * draw.uniform(0.62, 0.95);
    let depth = draw.uniform(0.014, 0.028);
    let outline = Profile::at(0.0, -0.002).to(cap, -0.002, CAP).to(cap, depth, CAP).round(0.002).to(0.0, depth, CAP);
    // The lathe's z becomes y.
    let cap = Lathe::new(&outline).segments(32).solid().rotated(0, -90.0);
    let cap = {
        let density = 0.004 / cap.volume();
        cap.dense(density)
    };
    let shape = body.dense(draw.uniform(700.0, 1150.0)).and(cap);
    let mass = shape.moments().total;
    let print = label(&mut draw.appearance, LabelKind::Glued, [TAU * r, length], draw.photographs);
    let cap_color = vivid(&mut draw.appearance);
    let materials =
        vec![draw.sheet(&print), draw.plain("seam", shade(cap_color, 0.8), 0.4), draw.plastic_of("cap", cap_color)];
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}
