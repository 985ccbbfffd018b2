//! Convex hulls that never fail: points are snapped to a fine grid and judged with whole numbers, so that no rounding
//! can turn a face; flat, thin and tiny inputs are thickened; hulls of many points are simplified.

use crate::solid::{Cell, Face, Solid, directions, dot};
use crate::units;
use parry3d::math::Vector;
use parry3d::shape::ConvexPolyhedron;
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Least thickness of a convex part, metres. Thinner ones are thickened to this, half on either side.
pub const MIN_THICKNESS_M: f32 = 0.001;

/// A hull may leave out points that stick out of it by less than this, metres.
pub const TOLERANCE_M: f32 = 0.0003;

/// A hull has at most this many vertices.
pub const MAX_VERTICES: usize = 192;

/// Pitch of the grid, metres: a power of two, so that grid points are exact in f32.
pub const GRID_M: f32 = 1.0 / 131_072.0;

/// Coordinates stay below this many steps of the grid; the grid of a larger thing is coarser.
const STEPS: f32 = (1 << 20) as f32;

/// A convex polyhedron: its vertices and its triangles, counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    /// Vertices, body frame, metres.
    pub points: Vec<[f32; 3]>,
    /// Triangles over the vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl Hull {
    /// The hull of some points, simplified to [`TOLERANCE_M`] or [`MAX_VERTICES`], whichever comes first, and at least
    /// [`MIN_THICKNESS_M`] thick. None if there is no finite point.
    pub fn around(points: &[[f32; 3]]) -> Option<Self> {
        let finite: Vec<[f32; 3]> = points.iter().copied().filter(|p| p.iter().all(|x| x.is_finite())).collect();
        let first = finite.first()?;
        let frame = Frame::of(&finite, Vector::from(*first));
        let thick = frame.thicken(finite);
        Self::of_solid(&thick).or_else(|| Self::of_solid(&frame.bounding_box(&thick)))
    }

    /// The shape that collides, scaled; none if the triangles do not close up.
    pub fn polyhedron(&self, scale: f32) -> Option<ConvexPolyhedron> {
        let points = self.points.iter().map(|&p| Vector::from(p) * scale).collect();
        catch_unwind(AssertUnwindSafe(|| ConvexPolyhedron::from_convex_mesh(points, &self.triangles))).ok().flatten()
    }

    /// Enclosed volume, m³.
    pub fn volume(&self) -> f32 {
        let at = |i: u32| Vector::from(self.points[i as usize]) - Vector::from(self.points[0]);
        self.triangles.iter().map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2])))).sum::<f32>() / 6.0
    }

    /// How far a point lies beyond the outermost of the faces, metres; negative inside.
    pub fn outside(&self, point: [f32; 3]) -> f32 {
        let vector = |p: [f32; 3]| nalgebra::Vector3::from(p.map(f64::from));
        let beyond = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vector(self.points[i as usize]));
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
            Some(normal.dot(&(vector(point) - a)))
        };
        self.triangles.iter().filter_map(beyond).fold(f64::NEG_INFINITY, f64::max) as f32
    }

    /// The hull of points that span some volume: of the extreme ones along some directions, then always of one more,
    /// the one that sticks out most (Quickhull, stopped early; Barber, Dobkin and Huhdanpaa, ACM TOMS 22, 1996).
    fn of_solid(points: &[[f32; 3]]) -> Option<Self> {
        let largest = points.iter().flatten().fold(0.0_f32, |largest, x| largest.max(x.abs()));
        let pitch = if largest < GRID_M * STEPS { GRID_M } else { (largest / STEPS).log2().ceil().exp2() };
        // In order and each once, so that neither the order nor the number of equal points matters.
        let cells: BTreeSet<Cell> = points.iter().map(|p| p.map(|x| (x / pitch).round() as i64)).collect();
        let cells: Vec<Cell> = cells.into_iter().collect();
        let mut solid = Solid::new(&cells)?;
        for direction in directions() {
            solid.insert(*cells.iter().max_by_key(|p| dot(direction, **p))?);
        }
        let tolerance = f64::from(TOLERANCE_M / pitch);
        // A point waits at the face that it sticks out of most, until that face goes.
        let place = |cell: Cell, faces: &mut [Face]| {
            let above = |face: &Face| face.above(cell);
            let best = faces.iter_mut().max_by(|a, b| above(a).total_cmp(&above(b)));
            if let Some(face) = best.filter(|face| above(face) > tolerance) {
                face.waiting.push(cell);
            }
        };
        cells.iter().for_each(|&cell| place(cell, &mut solid.faces));
        while solid.points.len() < MAX_VERTICES {
            let waiting = solid.faces.iter().flat_map(|face| face.waiting.iter().map(|&cell| (face.above(cell), cell)));
            let Some((_, next)) = waiting.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let Some((gone, first)) = solid.insert(next) else { break };
            for cell in gone.into_iter().flat_map(|face| face.waiting) {
                place(cell, &mut solid.faces[first..]);
            }
        }
        let used: BTreeSet<usize> = solid.faces.iter().flat_map(|face| face.corners).collect();
        let used: Vec<usize> = used.into_iter().collect();
        let index = |i: usize| used.binary_search(&i).unwrap_or_default() as u32;
        let hull = Self {
            points: used.iter().map(|&i| solid.points[i].map(|x| x as f32 * pitch)).collect(),
            triangles: solid.faces.iter().map(|face| face.corners.map(index)).collect(),
        };
        (hull.volume() > 0.0 && hull.polyhedron(units::PER_METRE).is_some()).then_some(hull)
    }
}

/// Axes of a point cloud: its longest chord, roughly; then what is widest across; then what is left.
struct Frame {
    origin: Vector,
    axes: [Vector; 3],
}

impl Frame {
    fn of(points: &[[f32; 3]], origin: Vector) -> Self {
        let all = || points.iter().map(|&p| Vector::from(p));
        let farthest = |measure: &dyn Fn(Vector) -> f32| {
            all().max_by(|a, b| measure(*a).total_cmp(&measure(*b))).unwrap_or(origin)
        };
        let far = farthest(&|p| (p - origin).length_squared());
        let other = farthest(&|p| (p - far).length_squared());
        let x = (other - far).try_normalize().unwrap_or(Vector::X);
        let across = |p: Vector| (p - far) - x * x.dot(p - far);
        let wide = farthest(&|p| across(p).length_squared());
        let y = across(wide).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
        let z = x.cross(y).normalize();
        Self { origin: far, axes: [x, y, z] }
    }

    /// Smallest and largest coordinate along each axis.
    fn ranges(&self, points: &[[f32; 3]]) -> [(f32, f32); 3] {
        self.axes.map(|axis| {
            points
                .iter()
                .map(|&p| axis.dot(Vector::from(p) - self.origin))
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)))
        })
    }

    fn thicken(&self, mut points: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
        for (axis, (low, high)) in self.axes.into_iter().zip(self.ranges(&points)) {
            let missing = MIN_THICKNESS_M - (high - low);
            if missing > 0.0 {
                let shift = axis * (missing / 2.0);
                points = points
                    .iter()
                    .flat_map(|&p| [Vector::from(p) - shift, Vector::from(p) + shift])
                    .map(|p| p.to_array())
                    .collect();
            }
        }
        points
    }

    fn bounding_box(&self, points: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let ranges = self.ranges(points);
        (0..8)
            .map(|corner| {
                let pick = |i: usize| if corner >> i & 1 == 0 { ranges[i].0 } else { ranges[i].1 };
                let [x, y, z] = self.axes;
                (self.origin + x * pick(0) + y * pick(1) + z * pick(2)).to_array()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    fn cube(size: [f32; 3]) -> Vec<[f32; 3]> {
        (0..8).map(|i| std::array::from_fn(|axis| size[axis] * if i >> axis & 1 == 0 { -0.5 } else { 0.5 })).collect()
    }

    #[test]
    fn a_cube_keeps_its_corners_and_loses_what_is_inside() {
        let mut points = cube([0.1, 0.2, 0.3]);
        points.extend([[0.01, 0.02, 0.03], [0.0, 0.0, 0.15], [f32::NAN, 0.0, 0.0]]);
        points.extend(cube([0.1, 0.2, 0.3]));
        let hull = Hull::around(&points).expect("a hull");
        assert_eq!((hull.points.len(), hull.triangles.len()), (8, 12));
        assert!((hull.volume() / 0.006 - 1.0).abs() < 2e-4, "{}", hull.volume());
        assert!((hull.outside([0.0, 0.0, 0.16]) - 0.01).abs() < GRID_M && hull.outside([0.0; 3]) < 0.0);
    }

    #[test]
    fn no_point_sticks_out_by_more_than_the_tolerance() {
        let mut stream = Stream::root(1);
        for (count, radius) in [(5, 0.1), (30, 0.1), (400, 0.02), (3000, 0.02), (3000, 0.2)] {
            let points: Vec<[f32; 3]> =
                (0..count).map(|_| <[f64; 3]>::from(stream.direction()).map(|x| radius * x as f32)).collect();
            let hull = Hull::around(&points).expect("a hull");
            let worst = points.iter().map(|&p| hull.outside(p)).fold(0.0, f32::max);
            assert!(hull.points.len() <= MAX_VERTICES);
            let near = |p: &[f32; 3], q: &[f32; 3]| (0..3).all(|i| (p[i] - q[i]).abs() <= 0.51 * GRID_M);
            assert!(hull.points.iter().all(|p| points.iter().any(|q| near(p, q))), "a hull invents no vertex");
            // On a ball that needs more vertices than there may be, faces lie deeper: r (1 - cos), 128 vertices.
            let limit = if hull.points.len() < MAX_VERTICES { TOLERANCE_M } else { 0.04 * radius };
            assert!(worst <= limit + GRID_M, "{count} points on {radius} m: {worst} m outside");
        }
    }

    #[test]
    fn flat_thin_and_tiny_inputs_become_solid() {
        let check = |points: &[[f32; 3]], volume: f32| {
            let hull = Hull::around(points).expect("a hull");
            assert!((hull.volume() / volume - 1.0).abs() < 0.04, "{} m³, not {volume}", hull.volume());
            hull.polyhedron(1.0).expect("closed");
        };
        let t = MIN_THICKNESS_M;
        check(&cube([0.1, 0.2, 0.0]), 0.1 * 0.2 * t);
        check(&cube([0.1, 0.2, 1e-5]), 0.1 * 0.2 * t);
        check(&cube([0.1, 0.0, 0.0]), 0.1 * t * t);
        check(&cube([1e-6; 3]), t * t * t);
        check(&[[0.3, 0.1, 0.2]], t * t * t);
        check(&[[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], 0.005 * t);
        assert_eq!(Hull::around(&[]), None);
        assert_eq!(Hull::around(&[[f32::INFINITY, 0.0, 0.0]]), None);
    }
}
