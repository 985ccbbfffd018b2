//! Fruit.

use super::{FamilyContext, HouseholdModel, ellipse};
use crate::material::{hsv, skin};
use crate::shape::{Lathe, Profile, SlotMapping, SweepPath, sweep};
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;

pub fn apple(draw: &mut FamilyContext) -> HouseholdModel {
    let r = draw.uniform(0.033, 0.044);
    let tall = draw.uniform(0.86, 1.02);
    let (top, bottom) = (draw.uniform(0.22, 0.34), draw.uniform(0.12, 0.22));
    let steps = 26;
    let point = |i: i32| {
        // From the dimple below to the dimple above; shoulders wider than the foot.
        let a = PI * (f64::from(i) / f64::from(steps));
        let dimple = |depth: f64, away: f64| depth * libm::exp(-(away / 0.42).powi(2));
        let z = -libm::cos(a) * tall + dimple(bottom, a) - dimple(top, PI - a);
        let radius = libm::pow(libm::sin(a).max(0.0), 0.92) * (1.0 + 0.06 * -libm::cos(a));
        [if i == 0 || i == steps { 0.0 } else { r * radius }, r * z]
    };
    let first = point(0);
    let outline = (1..=steps).fold(Profile::at(first[0], first[1]), |outline, i| {
        let [radius, z] = point(i);
        outline.to(radius, z, SlotMapping::fit(0))
    });
    // Five lobes, barely.
    let lobes = draw.uniform(0.0, 0.03);
    let body = Lathe::new(&outline).segments(48).solid().bent(|p| {
        let factor = 1.0 + lobes * libm::cos(5.0 * libm::atan2(p.y, p.x)) * (0.5 - 0.5 * p.z / r).clamp(0.0, 1.0);
        Point3::new(p.x * factor, p.y * factor, p.z)
    });
    let base = point(steps)[1];
    let lean = draw.uniform(0.0, 0.006);
    let stem: Vec<Point3<f64>> = (0..=4)
        .map(|i| f64::from(i) / 4.0)
        .map(|t| Point3::new(lean * t * t, 0.0, base - 0.003 + draw_length(r) * t))
        .collect();
    let stem = sweep(&SweepPath::along(&stem, Vector3::y()), &ellipse(0.0012, 0.0012, 8), SlotMapping::fit(1), 4);
    let mass = body.volume() * draw.uniform(780.0, 870.0);
    let hue = *draw.appearance.pick(&[0.0, 0.01, 0.25, 0.16, 0.98]).unwrap_or(&0.0);
    let base = hsv(
        hue + draw.appearance.uniform(-0.02, 0.02),
        draw.appearance.uniform(0.6, 0.85),
        draw.appearance.uniform(0.5, 0.8),
    );
    let blush = hsv(draw.appearance.uniform(-0.02, 0.14), 0.75, draw.appearance.uniform(0.4, 0.8));
    let texture = skin(&mut draw.appearance, base, blush, hsv(0.12, 0.6, 0.35));
    let materials = vec![draw.printed(texture, [0.25, 0.45]), draw.plain("stem", hsv(0.08, 0.6, 0.22), 0.8)];
    HouseholdModel::new(body.and(stem), materials, mass).friction(0.45)
}

fn draw_length(r: f64) -> f64 {
    0.003 + 0.42 * r
}

pub fn banana(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.15, 0.2);
    let r = draw.uniform(0.0145, 0.0185);
    let bend = draw.uniform(0.9, 1.5);
    let radius = length / bend;
    let steps = 28;
    let path: Vec<Point3<f64>> = (0..=steps)
        .map(|i| {
            let (sin, cos) = libm::sincos(bend * (f64::from(i) / f64::from(steps) - 0.5));
            Point3::new(radius * sin, radius * (1.0 - cos), 0.0)
        })
        .collect();
    // A stalk, a swelling body and a short tip.
    let girth = SweepPath::along(&path, Vector3::z()).scaled(|t| {
        let body =
            libm::pow(((t - 0.1) / 0.12).clamp(0.0, 1.0), 0.6) * libm::pow(((0.985 - t) / 0.17).clamp(0.0, 1.0), 0.55);
        let factor = 0.28 + 0.72 * body;
        let end = if t >= 1.0 { 0.75 } else { 1.0 };
        [factor * end; 2]
    });
    // Five blunt edges.
    let section: Vec<[f64; 2]> = ellipse(r, r, 20)
        .into_iter()
        .map(|[x, y]| {
            let factor = 0.97 + 0.05 * libm::cos(5.0 * libm::atan2(y, x));
            [x * factor, y * factor]
        })
        .collect();
    let shape = sweep(&girth, &section, SlotMapping::fit(0), 4);
    let mass = shape.volume() * draw.uniform(900.0, 980.0);
    let ripe = draw.appearance.unit();
    let base = hsv(0.19 - 0.055 * ripe, 0.75, 0.6 + 0.25 * ripe);
    let blush = hsv(0.21 - 0.1 * ripe, 0.7, 0.75);
    let texture = skin(&mut draw.appearance, base, blush, hsv(0.09, 0.6, 0.2));
    let materials = vec![draw.printed(texture, [0.4, 0.6])];
    HouseholdModel::new(shape, materials, mass).friction(0.5)
}
