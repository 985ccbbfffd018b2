//! Convex hulls that never fail: flat, thin and tiny inputs are thickened, and a panic of the hull code is caught.

use parry3d::math::Vector;
use parry3d::shape::ConvexPolyhedron;
use parry3d::transformation::try_convex_hull;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Least thickness of a convex part, metres. Thinner ones are thickened to this, half on either side.
pub const MIN_THICKNESS_M: f32 = 0.001;

/// A hull may leave out points that stick out of it by less than this, metres.
pub const TOLERANCE_M: f32 = 0.0003;

/// A hull has at most this many vertices.
pub const MAX_VERTICES: usize = 128;

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
        let points = distinct(points);
        if points.is_empty() {
            return None;
        }
        let frame = Frame::of(&points);
        let points = frame.thicken(points);
        match exact(&points) {
            Some(hull) => Some(hull.simplified().unwrap_or(hull)),
            None => exact(&frame.bounding_box(&points)),
        }
    }

    /// The shape that collides; none if the triangles do not close up.
    pub fn polyhedron(&self) -> Option<ConvexPolyhedron> {
        let points = self.points.iter().map(|&p| Vector::from(p)).collect();
        catch_unwind(AssertUnwindSafe(|| ConvexPolyhedron::from_convex_mesh(points, &self.triangles))).ok().flatten()
    }

    /// Enclosed volume, m³.
    pub fn volume(&self) -> f32 {
        let at = |i: u32| Vector::from(self.points[i as usize]) - Vector::from(self.points[0]);
        self.triangles.iter().map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2])))).sum::<f32>() / 6.0
    }

    /// How far a point lies beyond the outermost of the faces, metres; negative inside.
    pub fn outside(&self, point: [f32; 3]) -> f32 {
        self.planes().map(|(normal, offset)| normal.dot(Vector::from(point)) - offset).fold(f32::NEG_INFINITY, f32::max)
    }

    fn planes(&self) -> impl Iterator<Item = (Vector, f32)> + '_ {
        self.triangles.iter().filter_map(|t| {
            let [a, b, c] = t.map(|i| Vector::from(self.points[i as usize]));
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((normal, normal.dot(a)))
        })
    }

    /// The hull of a few of the vertices: the extreme ones along the axes, then always the one that sticks out most.
    fn simplified(&self) -> Option<Self> {
        if self.points.len() <= 8 {
            return None;
        }
        let mut chosen: Vec<usize> = Vec::new();
        for direction in [-1, 0, 1]
            .into_iter()
            .flat_map(|x| [-1, 0, 1].map(|y| (x, y)))
            .flat_map(|(x, y)| [-1, 0, 1].map(|z| Vector::new(x as f32, y as f32, z as f32)))
        {
            let along = |i: &usize| direction.dot(Vector::from(self.points[*i]));
            let extreme = (0..self.points.len()).max_by(|a, b| along(a).total_cmp(&along(b)))?;
            if !chosen.contains(&extreme) {
                chosen.push(extreme);
            }
        }
        loop {
            let points: Vec<[f32; 3]> = chosen.iter().map(|&i| self.points[i]).collect();
            let Some(hull) = exact(&points) else {
                // Too flat a choice: take in one more vertex.
                let next = (0..self.points.len()).find(|i| !chosen.contains(i))?;
                chosen.push(next);
                continue;
            };
            let planes: Vec<(Vector, f32)> = hull.planes().collect();
            let outside = |i: usize| {
                let p = Vector::from(self.points[i]);
                planes.iter().map(|(normal, offset)| normal.dot(p) - offset).fold(f32::NEG_INFINITY, f32::max)
            };
            let (worst, by) = (0..self.points.len()).map(|i| (i, outside(i))).max_by(|a, b| a.1.total_cmp(&b.1))?;
            if by <= TOLERANCE_M || chosen.len() >= MAX_VERTICES || chosen.contains(&worst) {
                return Some(hull);
            }
            chosen.push(worst);
        }
    }
}

/// The finite points, each once, in a fixed order.
fn distinct(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut points: Vec<[f32; 3]> =
        points.iter().filter(|p| p.iter().all(|x| x.is_finite())).map(|p| p.map(|x| x + 0.0)).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2])));
    points.dedup();
    points
}

/// The hull of all points as it is; none if it is flat or the hull code gives up.
fn exact(points: &[[f32; 3]]) -> Option<Hull> {
    let points: Vec<Vector> = points.iter().map(|&p| Vector::from(p)).collect();
    let (points, triangles) = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&points))).ok()?.ok()?;
    let hull = Hull { points: points.iter().map(|p| p.to_array()).collect(), triangles };
    (hull.volume() > 0.0 && hull.polyhedron().is_some()).then_some(hull)
}

/// Axes of a point cloud: its longest chord, roughly; then what is widest across; then what is left.
struct Frame {
    origin: Vector,
    axes: [Vector; 3],
}

impl Frame {
    fn of(points: &[[f32; 3]]) -> Self {
        let all = || points.iter().map(|&p| Vector::from(p));
        let origin = Vector::from(points[0]);
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
        assert!((hull.volume() - 0.006).abs() < 1e-8);
        assert!((hull.outside([0.0, 0.0, 0.16]) - 0.01).abs() < 1e-6 && hull.outside([0.0; 3]) < 0.0);
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
            assert!(hull.points.iter().all(|p| points.contains(p)), "a hull invents no vertex");
            // On a ball that needs more vertices than there may be, faces lie deeper: r (1 - cos), 128 vertices.
            let limit = if hull.points.len() < MAX_VERTICES { TOLERANCE_M } else { 0.04 * radius };
            assert!(worst <= limit + 1e-6, "{count} points on {radius} m: {worst} m outside");
        }
    }

    #[test]
    fn flat_thin_and_tiny_inputs_become_solid() {
        let check = |points: &[[f32; 3]], volume: f32| {
            let hull = Hull::around(points).expect("a hull");
            assert!((hull.volume() / volume - 1.0).abs() < 0.01, "{} m³, not {volume}", hull.volume());
            hull.polyhedron().expect("closed");
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
