//! Lofts over rings of points, and sections swept along curves.

use super::{Point3, SlotMapping, SolidShape, Uv, Vector3};

/// A closed loft over rings of equally many points. Every ring runs counter-clockwise seen from the next one's side.
/// The ends are closed by fans around their centroids. Collision parts are the hulls of `per_part + 1` neighboring
/// rings.
pub fn loft(rings: &[Vec<Point3<f64>>], mapping: SlotMapping, per_part: usize) -> SolidShape {
    let mut shape = SolidShape::default();
    let indices: Vec<Vec<u32>> = rings.iter().map(|ring| ring.iter().map(|&p| shape.point(p)).collect()).collect();
    let around = lengths(&rings[rings.len() / 2], true);
    let spine: Vec<Point3<f64>> = rings.iter().map(|ring| centroid(ring)).collect();
    let along = lengths(&spine, false);
    let n = around.len() - 1;
    let uv = |i: usize, j: usize| match mapping.uv {
        Uv::Tile(tile) => {
            let repeats = (around[n] / tile).round().max(1.0);
            [repeats * around[j] / around[n], along[i] / tile]
        }
        _ => [around[j] / around[n], along[i] / along[along.len() - 1].max(1e-12)],
    };
    for i in 0..rings.len() - 1 {
        for j in 0..n {
            let k = (j + 1) % n;
            shape.quad(
                [indices[i][j], indices[i][k], indices[i + 1][k], indices[i + 1][j]],
                [uv(i, j), uv(i, j + 1), uv(i + 1, j + 1), uv(i + 1, j)],
                mapping.slot,
            );
        }
    }
    for (end, first) in [(0, true), (rings.len() - 1, false)] {
        let middle = shape.point(spine[end]);
        for j in 0..n {
            let (a, b) = if first { ((j + 1) % n, j) } else { (j, (j + 1) % n) };
            shape.triangle(
                [middle, indices[end][a], indices[end][b]],
                [uv(end, 0), uv(end, a), uv(end, b)],
                mapping.slot,
            );
        }
    }
    let mut start = 0;
    while start + 1 < rings.len() {
        let end = (start + per_part).min(rings.len() - 1);
        shape.parts.push(rings[start..=end].concat());
        start = end;
    }
    shape
}

/// A planar curve with a scale of the section at each of its points.
pub struct SweepPath {
    path: Vec<Point3<f64>>,
    scale: Vec<[f64; 2]>,
    normal: Vector3<f64>,
}

impl SweepPath {
    /// A path along a curve in a plane with unit `normal`. A straight path takes any perpendicular normal.
    pub fn along(path: &[Point3<f64>], normal: Vector3<f64>) -> Self {
        Self { path: path.to_vec(), scale: vec![[1.0; 2]; path.len()], normal }
    }

    /// Scales the section: `scale(t)` returns factors in the plane and along its normal, with `t` in [0, 1] by number.
    pub fn scaled(mut self, scale: impl Fn(f64) -> [f64; 2]) -> Self {
        let last = (self.path.len() - 1).max(1) as f64;
        self.scale = (0..self.path.len()).map(|i| scale(i as f64 / last)).collect();
        self
    }
}

/// A section swept along a curve. The section's first coordinate is in the curve's plane, to the right of `normal ×
/// tangent`; its second is along the plane's normal. The section runs counterclockwise.
pub fn sweep(sweep: &SweepPath, section: &[[f64; 2]], mapping: SlotMapping, per_part: usize) -> SolidShape {
    let last = sweep.path.len() - 1;
    let rings: Vec<Vec<Point3<f64>>> = (0..=last)
        .map(|i| {
            let step = |a: usize, b: usize| (sweep.path[b] - sweep.path[a]).try_normalize(1e-12).unwrap_or_default();
            let tangent = match i {
                0 => step(0, 1),
                _ if i == last => step(last - 1, last),
                _ => step(i - 1, i) + step(i, i + 1),
            };
            let tangent = tangent.try_normalize(1e-9).unwrap_or_else(Vector3::z);
            let side = sweep.normal.cross(&tangent);
            let [a, b] = sweep.scale[i];
            section.iter().map(|p| sweep.path[i] + side * (a * p[0]) + sweep.normal * (b * p[1])).collect()
        })
        .collect();
    loft(&rings, mapping, per_part)
}

fn centroid(ring: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = ring.iter().map(|p| p.coords).sum();
    Point3::from(sum / ring.len() as f64)
}

/// Cumulative distances along a polyline, from 0; if `around`, back to the first point.
fn lengths(points: &[Point3<f64>], around: bool) -> Vec<f64> {
    let n = points.len();
    let mut lengths = vec![0.0];
    for i in 1..if around { n + 1 } else { n } {
        lengths.push(lengths[i - 1] + (points[i % n] - points[i - 1]).norm());
    }
    lengths
}
