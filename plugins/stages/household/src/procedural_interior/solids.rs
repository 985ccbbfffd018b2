//! Solids that several furnishings share: bars, tubes, soft boxes, cushions and hanging cloth.

use crate::shape::{SlotMapping, SolidShape, loft, rounded_box, thick_sheet};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use syntable_model::geometry::{Point3, Vector3};

/// A box between two corners with round edges.
pub fn rounded(low: [f64; 3], high: [f64; 3], round: f64, mapping: impl Fn(usize) -> SlotMapping) -> SolidShape {
    let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
    let thin = size.into_iter().fold(f64::INFINITY, f64::min);
    let round = round.min(0.35 * thin);
    let steps = if round > 0.008 { 2 } else { 1 };
    rounded_box(size, round, steps, mapping).translated(middle[0], middle[1], middle[2])
}

/// The solid with its bounding box as the only collision part.
pub fn boxed(solid: SolidShape) -> SolidShape {
    let corners = solid.bounds().corners().to_vec();
    solid.without_parts().with_part(corners)
}

/// Two unit vectors at right angles to a direction, so that their cross product is the direction.
fn across(direction: Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if direction.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let first = helper.cross(&direction).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    [first, direction.cross(&first)]
}

/// A round bar between two points with a radius at each.
pub fn bar(mapping: SlotMapping, from: Point3<f64>, to: Point3<f64>, radii: [f64; 2]) -> SolidShape {
    let direction = (to - from).try_normalize(1e-9).unwrap_or_else(Vector3::z);
    let bevel = 0.3 * radii[0].min(radii[1]).min(0.5 * (to - from).norm());
    let [a, b] = across(direction);
    let count = if radii[0].max(radii[1]) > 0.012 { 14 } else { 8 };
    let ring = |p: Point3<f64>, radius: f64| circle(p, a * radius, b * radius, count);
    let rings = [
        ring(from, radii[0] - bevel),
        ring(from + direction * bevel, radii[0]),
        ring(to - direction * bevel, radii[1]),
        ring(to, radii[1] - bevel),
    ];
    loft(&rings, mapping, 3)
}

/// Points around a center, from one half axis over the other.
pub fn circle(center: Point3<f64>, a: Vector3<f64>, b: Vector3<f64>, count: usize) -> Vec<Point3<f64>> {
    (0..count)
        .map(|i| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / count as f64);
            center + a * cos + b * sin
        })
        .collect()
}

/// A tube along a curve in space. `radius` takes the position on the curve in [0, 1].
pub fn tube(
    mapping: SlotMapping,
    path: &[Point3<f64>],
    count: usize,
    per_part: usize,
    radius: impl Fn(f64) -> f64,
) -> SolidShape {
    let last = path.len() - 1;
    let tangent = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        (path[b] - path[a]).try_normalize(1e-12).unwrap_or_else(Vector3::z)
    };
    let [mut first, _] = across(tangent(0));
    let rings: Vec<Vec<Point3<f64>>> = (0..=last)
        .map(|i| {
            let along = tangent(i);
            // The frame follows the curve without twisting.
            first = (first - along * first.dot(&along)).try_normalize(1e-9).unwrap_or_else(|| across(along)[0]);
            let radius = radius(i as f64 / last as f64);
            circle(path[i], first * radius, along.cross(&first) * radius, count)
        })
        .collect();
    loft(&rings, mapping, per_part)
}

/// A rectangle with round corners, counterclockwise, with points on its edges too.
fn rounded_ring([a, b]: [f64; 2], corner: f64, z: f64, bow: f64) -> Vec<Point3<f64>> {
    const CORNER: usize = 4;
    const EDGE: usize = 5;
    let corner = corner.min(0.95 * a).min(0.95 * b);
    let mut ring = Vec::new();
    for (number, [sx, sy]) in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter().enumerate() {
        let center = [sx * (a - corner), sy * (b - corner)];
        for i in 0..=CORNER {
            let angle = FRAC_PI_2 * (number as f64 + i as f64 / CORNER as f64);
            ring.push([center[0] + corner * libm::cos(angle), center[1] + corner * libm::sin(angle)]);
        }
        let (from, [nx, ny]) = (ring[ring.len() - 1], [[-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0]][number]);
        let angle = FRAC_PI_2 * (number as f64 + 1.0);
        let to = [nx * (a - corner) + corner * libm::cos(angle), ny * (b - corner) + corner * libm::sin(angle)];
        for i in 1..EDGE {
            let t = i as f64 / EDGE as f64;
            ring.push([from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])]);
        }
    }
    ring.iter()
        .map(|&[x, y]| {
            let (u, v) = (x / a, y / b);
            Point3::new(x + bow * u * (1.0 - v * v), y + bow * v * (1.0 - u * u), z)
        })
        .collect()
}

/// The radii of a soft box, meters.
#[derive(Debug, Clone, Copy)]
pub struct Softness {
    /// Of its corners, seen from above.
    pub corner: f64,
    /// Of its upper and lower edges.
    pub edge: f64,
    /// How far its top and bottom rise in the middle.
    pub bulge: f64,
    /// How far its sides bow outwards.
    pub bow: f64,
}

impl Softness {
    /// A cushion with some roundness.
    pub fn of(round: f64) -> Self {
        Self { corner: 1.3 * round, edge: round, bulge: 0.5 * round, bow: 0.25 * round }
    }
}

/// A padded box of outer `size` around the origin.
pub fn soft_box(slot: u16, size: [f64; 3], soft: Softness) -> SolidShape {
    let [a, b, h] = size.map(|x| 0.5 * x);
    let edge = soft.edge.min(0.9 * h).min(0.8 * a).min(0.8 * b);
    let [a, b] = [a - soft.bow, b - soft.bow];
    let level = |inset: f64, z: f64| {
        let half = [a - inset, b - inset];
        rounded_ring(half, (soft.corner - inset).max(0.25 * soft.corner), z, soft.bow * (1.0 - inset / a.min(b)))
    };
    let arc = |i: usize| {
        let (sin, cos) = libm::sincos(FRAC_PI_2 * i as f64 / 4.0);
        (edge * (1.0 - sin), h - edge * (1.0 - cos))
    };
    // From the middle of the top outwards, and down to the middle of the height.
    let mut upper: Vec<(f64, f64)> = Vec::new();
    let room = a.min(b) - edge;
    for t in [0.12, 0.35, 0.6, 0.82] {
        upper.push((edge + room * (1.0 - t), h + soft.bulge * (1.0 - t * t)));
    }
    upper.extend((0..=4).map(arc));
    let lower = upper.iter().map(|&(inset, z)| level(inset, -z));
    let rings: Vec<_> = lower.chain(upper.iter().rev().map(|&(inset, z)| level(inset, z))).collect();
    loft(&rings, SlotMapping::fit(slot), rings.len()).hulled()
}

/// A pillow of width, height and thickness in the x-z plane: four pointed corners, puffed in the middle.
pub fn pillow(mapping: SlotMapping, [width, height, thick]: [f64; 3]) -> SolidShape {
    let at = |[u, v]: [f64; 2]| {
        let (p, q) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        let puff = libm::pow((1.0 - p.abs().powi(3)) * (1.0 - q.abs().powi(3)), 0.55);
        let half = 0.003 + 0.5 * thick * puff;
        let x = 0.5 * width * p * (1.0 - 0.09 * (1.0 - q * q));
        let z = 0.5 * height * q * (1.0 - 0.09 * (1.0 - p * p));
        [Point3::new(x, -half, z), Point3::new(x, half, z)]
    };
    thick_sheet([14, 14], [14, 14], [mapping; 3], at).hulled()
}

/// A curve of points through corners, smooth: Catmull and Rom's spline.
pub fn spline(corners: &[Point3<f64>], steps: usize) -> Vec<Point3<f64>> {
    let last = corners.len() - 1;
    let mut points = Vec::new();
    for i in 0..last {
        let p: [Vector3<f64>; 4] = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(|k| corners[k].coords);
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            let sum = p[1] * 2.0
                + (p[2] - p[0]) * t
                + (p[0] * 2.0 - p[1] * 5.0 + p[2] * 4.0 - p[3]) * (t * t)
                + (p[1] * 3.0 - p[0] - p[2] * 3.0 + p[3]) * (t * t * t);
            points.push(Point3::from(sum * 0.5));
        }
    }
    points.push(corners[last]);
    points
}

/// The points of an arc in the plane of two half axes, from angle to angle, radians.
pub fn arc(center: Point3<f64>, a: Vector3<f64>, b: Vector3<f64>, angles: [f64; 2], steps: usize) -> Vec<Point3<f64>> {
    (0..=steps)
        .map(|i| {
            let angle = angles[0] + (angles[1] - angles[0]) * i as f64 / steps as f64;
            let (sin, cos) = libm::sincos(angle);
            center + a * cos + b * sin
        })
        .collect()
}

/// A ball.
pub fn ball(mapping: SlotMapping, center: Point3<f64>, radius: f64) -> SolidShape {
    let rings: Vec<Vec<Point3<f64>>> = (1..8)
        .map(|i| {
            let (sin, cos) = libm::sincos(PI * f64::from(i) / 8.0);
            let middle = center - Vector3::z() * (radius * cos);
            circle(middle, Vector3::x() * (radius * sin), Vector3::y() * (radius * sin), 12)
        })
        .collect();
    loft(&rings, mapping, 8)
}
