//! Pouches and bags of film and paper.

use super::{FamilyContext, HouseholdModel, ellipse};
use crate::material::{MaterialFamily, PrintedSheet, SurfaceFinish, WrapKind, shade, wrapped};
use crate::shape::{SlotMapping, SolidShape, SweepPath, loft, sweep, vessel};
use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::Material;

/// A smooth displacement: waves of random directions and lengths.
pub(crate) struct Crumple {
    waves: Vec<(Vector3<f64>, f64, Vector3<f64>)>,
}

impl Crumple {
    /// Waves of some lengths and a total amplitude, meters.
    pub(crate) fn draw(stream: &mut Stream, count: usize, lengths: [f64; 2], amplitude: f64) -> Self {
        let share = amplitude / (count as f64).sqrt();
        let wave = |_| {
            let length = stream.uniform(lengths[0], lengths[1]);
            (stream.direction() * (TAU / length), stream.uniform(0.0, TAU), stream.direction() * share)
        };
        Self { waves: (0..count).map(wave).collect() }
    }

    /// The displacement at a point.
    pub(crate) fn at(&self, p: Point3<f64>) -> Vector3<f64> {
        self.waves.iter().map(|(direction, phase, shift)| shift * libm::sin(direction.dot(&p.coords) + phase)).sum()
    }
}

/// A flattened ring of `n` points with half axes `a` and `b` at a height, evenly spaced, from -x over -y.
fn flat_ring(a: f64, b: f64, z: f64, n: usize) -> Vec<Point3<f64>> {
    // A superellipse is fuller than an ellipse, as inflated film is.
    let fine = 16 * n;
    let corner = |i: usize| {
        let (sin, cos) = libm::sincos(PI + TAU * i as f64 / fine as f64);
        let bulge = |x: f64| x.signum() * libm::pow(x.abs(), 0.85);
        [a * bulge(cos), b * bulge(sin)]
    };
    let mut lengths = vec![0.0];
    for i in 1..=fine {
        let (p, q) = (corner(i - 1), corner(i));
        lengths.push(lengths[i - 1] + libm::hypot(q[0] - p[0], q[1] - p[1]));
    }
    let total = lengths[fine];
    (0..n)
        .map(|j| {
            let i = lengths.partition_point(|length| *length < total * j as f64 / n as f64 - 1e-12);
            let [x, y] = corner(i);
            Point3::new(x, y, z)
        })
        .collect()
}

pub fn pouch(draw: &mut FamilyContext) -> HouseholdModel {
    let width = draw.uniform(0.09, 0.19);
    let height = width * draw.uniform(1.15, 1.6);
    let depth = width * draw.uniform(0.28, 0.5);
    let stands = draw.form.chance(0.5);
    let seal = draw.uniform(0.008, 0.014);
    let thin = 0.0006;
    let rows = 24;
    let rings: Vec<Vec<Point3<f64>>> = (0..=rows)
        .map(|i| {
            let z = height * f64::from(i) / f64::from(rows);
            let from_top = ((height - seal - z) / (0.62 * height)).clamp(0.0, 1.0);
            let from_foot = if stands { 1.0 } else { ((z - seal) / (0.62 * height)).clamp(0.0, 1.0) };
            let round = |t: f64| (t * (2.0 - t)).sqrt();
            let half = thin + 0.5 * depth * round(from_top) * round(from_foot);
            // The film does not stretch: where it is thick it is narrow.
            let narrow = 0.5 * width - 0.42 * half * half / (0.5 * width);
            flat_ring(narrow, half, z, 40)
        })
        .collect();
    let folds = Crumple::draw(&mut draw.form.child("folds"), 7, [0.02, 0.07], 0.0022);
    let sway = Crumple::draw(&mut draw.form.child("sway"), 3, [0.12, 0.3], 0.004);
    let shape = loft(&rings, SlotMapping::fit(0), 4).bent(|p| {
        let flat = Point3::new(p.x, 0.0, p.z);
        // The base of a standing pouch stays level.
        let free = if stands { (p.z / (0.1 * height)).min(1.0) } else { 1.0 };
        // Folds move both faces outwards or inwards, and vanish where the faces meet.
        let fold = folds.at(flat).x * (p.y.abs() / (0.2 * depth)).min(1.0) * p.y.signum();
        p + Vector3::new(0.0, free * (sway.at(flat).y + fold), 0.0)
    });
    let mass = shape.volume() * draw.uniform(180.0, 650.0);
    let print = wrapped(&mut draw.appearance, WrapKind::Film, &[width, width], height, draw.photographs);
    let materials = vec![draw.sheet(&print)];
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}

pub fn carrier_bag(draw: &mut FamilyContext) -> HouseholdModel {
    let width = draw.uniform(0.18, 0.32);
    let depth = width * draw.uniform(0.3, 0.5);
    let height = width * draw.uniform(0.95, 1.35);
    let wall = 0.0016;
    let tuck = draw.uniform(0.1, 0.75);
    // Half of the points of each side.
    let half = 5;
    let rows = 10;
    let ring = |z: f64, inset: f64| -> Vec<Point3<f64>> {
        let t = z / height;
        let (a, full) = (0.5 * width - inset, 0.5 * depth);
        // The sides fold inwards towards the mouth.
        let b = full * (1.0 - 0.55 * tuck * t * t) - inset;
        let fold = 0.3 * tuck * depth * t;
        let sides = [[-a, -b, a, -b], [a, -b, a, b], [a, b, -a, b], [-a, b, -a, -b]];
        let side = |(number, [x0, y0, x1, y1]): (usize, &[f64; 4])| {
            let (x0, y0, x1, y1) = (*x0, *y0, *x1, *y1);
            (0..2 * half).map(move |i| {
                let s = i as f64 / f64::from(2 * half as u32);
                let inward = if number % 2 == 1 { fold * (1.0 - (2.0 * s - 1.0).abs()) } else { 0.0 };
                let x = x0 + s * (x1 - x0);
                Point3::new(x - x.signum() * inward, y0 + s * (y1 - y0), z)
            })
        };
        sides.iter().enumerate().flat_map(side).collect()
    };
    let level = |i: usize| height * i as f64 / rows as f64;
    let outer: Vec<_> = (0..=rows).map(|i| ring(level(i), 0.0)).collect();
    let inner: Vec<_> = (0..=rows).map(|i| ring(level(i).max(wall), wall)).collect();
    let total = 2.0 * (width + depth);
    let mut around: Vec<f64> = Vec::new();
    for (start, edge) in [(0.0, width), (width, depth), (width + depth, width), (2.0 * width + depth, depth)] {
        around.extend((0..2 * half).map(|i| (start + edge * i as f64 / (2 * half) as f64) / total));
    }
    around.push(1.0);
    let mut shape = vessel(&outer, &inner, &around, [SlotMapping::fit(0), SlotMapping::tile(1, 0.2)]);
    let floor = [outer[0].clone(), inner[0].clone()].concat();
    shape = shape.with_part(floor);
    let count = outer[0].len();
    for band in [0..4, 4..7, 7..rows] {
        for block in (0..count).step_by(half) {
            let columns: Vec<usize> = (block..=block + half).map(|j| j % count).collect();
            let points = (band.start..=band.end).flat_map(|i| {
                let (outer, inner) = (&outer[i], &inner[i]);
                columns.iter().flat_map(move |&j| [outer[j], inner[j]]).collect::<Vec<_>>()
            });
            shape = shape.with_part(points.collect());
        }
    }
    let crumple = Crumple::draw(&mut draw.form.child("crumple"), 9, [0.05, 0.16], draw.uniform(0.003, 0.009));
    let shape = shape.and(handles(draw, [width, depth * (1.0 - 0.55 * tuck), height])).bent(|p| {
        // The bottom stays level.
        p + crumple.at(p) * (p.z / (0.25 * height)).clamp(0.0, 1.0)
    });
    let mass = shape.volume() * draw.uniform(70.0, 160.0);
    let print =
        wrapped(&mut draw.appearance, WrapKind::CarrierBag, &[width, depth, width, depth], height, draw.photographs);
    let materials = bag_materials(draw, &print);
    HouseholdModel::new(shape, materials, mass).friction(0.4)
}

/// Two handles of cord or film over the long edges.
fn handles(draw: &mut FamilyContext, [width, depth, height]: [f64; 3]) -> SolidShape {
    let (reach, rise) = (0.22 * width, draw.uniform(0.05, 0.1));
    let flop = draw.uniform(-0.5, 0.5);
    let thick = draw.uniform(0.0018, 0.003);
    [-1.0, 1.0].into_iter().fold(SolidShape::default(), |shape, side| {
        let path: Vec<Point3<f64>> = (0..=12)
            .map(|i| {
                let (sin, cos) = libm::sincos(PI * f64::from(i) / 12.0);
                Point3::new(reach * cos, 0.0, rise * libm::pow(sin.max(0.0), 0.7) - 0.012)
            })
            .collect();
        let cord =
            sweep(&SweepPath::along(&path, Vector3::y()), &ellipse(thick, thick, 8), SlotMapping::tile(2, 0.05), 4);
        shape.and(cord.rotated(0, flop * 60.0 * side).translated(0.0, side * 0.5 * depth, height))
    })
}

/// The print, the inside, and the cord.
fn bag_materials(draw: &mut FamilyContext, print: &PrintedSheet) -> Vec<Arc<Material>> {
    let color = print.edge_color();
    let paper = draw.material(MaterialFamily::Paper);
    let inside = SurfaceFinish::plain(shade(color, 0.92), 0.85, 0.0).detailed(&paper).named("inside");
    let cord = shade(color, draw.appearance.uniform(0.5, 1.1) as f32);
    vec![draw.sheet(print), Arc::new(inside), draw.plain("cord", cord, 0.8)]
}
