//! Convex hulls that never fail on finite input.

use crate::polytope::{GridPoint, GridPolytope, HullFace, directions, dot};
use parry3d::math::Vector;
use parry3d::shape::ConvexPolyhedron;
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Grid coordinates stay below this many steps; larger inputs get a coarser grid.
const MAX_STEPS: f32 = (1 << 20) as f32;

/// Accuracy of hulls. Lengths are in the unit of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HullOptions {
    /// Minimum thickness. Thinner inputs are extruded to it, half to either side.
    pub min_thickness: f32,
    /// Maximum distance of an input point outside the hull.
    pub tolerance: f32,
    /// Maximum number of vertices. When it is reached, points may be farther outside than `tolerance`.
    pub max_vertices: usize,
    /// Grid pitch. A power of two keeps grid points exact in f32.
    pub grid: f32,
    /// Factor from the unit of the points to the unit of the physics engine. If a hull does not close up as a
    /// [`ConvexPolyhedron`] at this scale, its bounding box replaces it.
    pub engine_scale: f32,
}

impl HullOptions {
    /// For household objects in meters: 1 mm thick, 0.3 mm tolerance, 192 vertices, a grid of 8 µm.
    pub const METERS: Self =
        Self { min_thickness: 0.001, tolerance: 0.0003, max_vertices: 192, grid: 1.0 / 131_072.0, engine_scale: 1.0 };
}

/// A convex polyhedron with triangular faces.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexHull {
    /// Vertices.
    pub points: Vec<[f32; 3]>,
    /// Vertex indices of the triangles, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl ConvexHull {
    /// Computes the convex hull of the finite points, simplified and thickened according to the options. Returns `None`
    /// if no point is finite.
    pub fn new(points: &[[f32; 3]], options: &HullOptions) -> Option<Self> {
        let finite: Vec<[f32; 3]> = points.iter().copied().filter(|p| p.iter().all(|x| x.is_finite())).collect();
        let first = finite.first()?;
        let frame = ChordFrame::new(&finite, Vector::from(*first));
        let thick = frame.thicken(finite, options.min_thickness);
        Self::of_solid(&thick, options).or_else(|| Self::of_solid(&frame.bounding_box(&thick), options))
    }

    /// Scales the hull and converts it to a parry shape. Returns `None` if parry rejects the triangles.
    pub fn polyhedron(&self, scale: f32) -> Option<ConvexPolyhedron> {
        let points = self.points.iter().map(|&p| Vector::from(p) * scale).collect();
        catch_unwind(AssertUnwindSafe(|| ConvexPolyhedron::from_convex_mesh(points, &self.triangles))).ok().flatten()
    }

    /// Enclosed volume.
    pub fn volume(&self) -> f32 {
        let at = |i: u32| Vector::from(self.points[i as usize]) - Vector::from(self.points[0]);
        self.triangles.iter().map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2])))).sum::<f32>() / 6.0
    }

    /// Largest signed distance of a point from the planes of the faces: positive outside, negative inside.
    pub fn max_plane_distance(&self, point: [f32; 3]) -> f32 {
        let vector = |p: [f32; 3]| nalgebra::Vector3::from(p.map(f64::from));
        let distance = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vector(self.points[i as usize]));
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
            Some(normal.dot(&(vector(point) - a)))
        };
        self.triangles.iter().filter_map(distance).fold(f64::NEG_INFINITY, f64::max) as f32
    }

    /// The hull of points that span a volume. It starts with the extreme points along some directions, and then
    /// repeatedly adds the point that is farthest outside (Quickhull, stopped early; Barber, Dobkin and Huhdanpaa, ACM
    /// TOMS 22, 1996).
    fn of_solid(points: &[[f32; 3]], options: &HullOptions) -> Option<Self> {
        let largest = points.iter().flatten().fold(0.0_f32, |largest, x| largest.max(x.abs()));
        let pitch = if largest < options.grid * MAX_STEPS {
            options.grid
        } else {
            libm::exp2f(libm::log2f(largest / MAX_STEPS).ceil())
        };
        // Sorted and unique, so that the order of points and duplicates do not matter.
        let cells: BTreeSet<GridPoint> = points.iter().map(|p| p.map(|x| (x / pitch).round() as i64)).collect();
        let cells: Vec<GridPoint> = cells.into_iter().collect();
        let mut polytope = GridPolytope::new(&cells)?;
        for direction in directions() {
            polytope.insert(*cells.iter().max_by_key(|p| dot(direction, **p))?);
        }
        let tolerance = f64::from(options.tolerance / pitch);
        // Each outside point belongs to the face that it is farthest from, until that face is removed.
        let assign = |cell: GridPoint, faces: &mut [HullFace]| {
            let distance = |face: &HullFace| face.distance(cell);
            let farthest = faces.iter_mut().max_by(|a, b| distance(a).total_cmp(&distance(b)));
            if let Some(face) = farthest.filter(|face| distance(face) > tolerance) {
                face.outside.push(cell);
            }
        };
        cells.iter().for_each(|&cell| assign(cell, &mut polytope.faces));
        while polytope.points.len() < options.max_vertices {
            let outside =
                polytope.faces.iter().flat_map(|face| face.outside.iter().map(|&cell| (face.distance(cell), cell)));
            let Some((_, next)) = outside.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let Some((removed, first_new)) = polytope.insert(next) else { break };
            for cell in removed.into_iter().flat_map(|face| face.outside) {
                assign(cell, &mut polytope.faces[first_new..]);
            }
        }
        let used: BTreeSet<usize> = polytope.faces.iter().flat_map(|face| face.vertices).collect();
        let used: Vec<usize> = used.into_iter().collect();
        let index = |i: usize| used.binary_search(&i).unwrap_or_default() as u32;
        let hull = Self {
            points: used.iter().map(|&i| polytope.points[i].map(|x| x as f32 * pitch)).collect(),
            triangles: polytope.faces.iter().map(|face| face.vertices.map(index)).collect(),
        };
        (hull.volume() > 0.0 && hull.polyhedron(options.engine_scale).is_some()).then_some(hull)
    }
}

/// Orthonormal axes of a point cloud: approximately its longest chord, the widest direction across it, and the rest.
struct ChordFrame {
    origin: Vector,
    axes: [Vector; 3],
}

impl ChordFrame {
    fn new(points: &[[f32; 3]], origin: Vector) -> Self {
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

    fn thicken(&self, mut points: Vec<[f32; 3]>, min_thickness: f32) -> Vec<[f32; 3]> {
        for (axis, (low, high)) in self.axes.into_iter().zip(self.ranges(&points)) {
            let missing = min_thickness - (high - low);
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

    const OPTIONS: HullOptions = HullOptions::METERS;

    fn cube(size: [f32; 3]) -> Vec<[f32; 3]> {
        (0..8).map(|i| std::array::from_fn(|axis| size[axis] * if i >> axis & 1 == 0 { -0.5 } else { 0.5 })).collect()
    }

    #[test]
    fn a_cube_keeps_its_vertices_and_drops_points_inside() {
        let mut points = cube([0.1, 0.2, 0.3]);
        points.extend([[0.01, 0.02, 0.03], [0.0, 0.0, 0.15], [f32::NAN, 0.0, 0.0]]);
        points.extend(cube([0.1, 0.2, 0.3]));
        let hull = ConvexHull::new(&points, &OPTIONS).expect("a hull");
        assert_eq!((hull.points.len(), hull.triangles.len()), (8, 12));
        assert!((hull.volume() / 0.006 - 1.0).abs() < 2e-4, "{}", hull.volume());
        assert!(
            (hull.max_plane_distance([0.0, 0.0, 0.16]) - 0.01).abs() < OPTIONS.grid
                && hull.max_plane_distance([0.0; 3]) < 0.0
        );
    }

    #[test]
    fn no_point_is_outside_by_more_than_the_tolerance() {
        let mut stream = Stream::root(1);
        for (count, radius) in [(5, 0.1), (30, 0.1), (400, 0.02), (3000, 0.02), (3000, 0.2)] {
            let points: Vec<[f32; 3]> =
                (0..count).map(|_| <[f64; 3]>::from(stream.direction()).map(|x| radius * x as f32)).collect();
            let hull = ConvexHull::new(&points, &OPTIONS).expect("a hull");
            let worst = points.iter().map(|&p| hull.max_plane_distance(p)).fold(0.0, f32::max);
            assert!(hull.points.len() <= OPTIONS.max_vertices);
            let is_near = |p: &[f32; 3], q: &[f32; 3]| (0..3).all(|i| (p[i] - q[i]).abs() <= 0.51 * OPTIONS.grid);
            assert!(hull.points.iter().all(|p| points.iter().any(|q| is_near(p, q))), "every vertex is an input point");
            // A sphere that needs more than the maximum number of vertices is cut deeper: r (1 - cos), 128 vertices.
            let limit = if hull.points.len() < OPTIONS.max_vertices { OPTIONS.tolerance } else { 0.04 * radius };
            assert!(worst <= limit + OPTIONS.grid, "{count} points on {radius} m: {worst} m outside");
        }
    }

    #[test]
    fn flat_thin_and_tiny_inputs_are_thickened() {
        let check = |points: &[[f32; 3]], volume: f32| {
            let hull = ConvexHull::new(points, &OPTIONS).expect("a hull");
            assert!((hull.volume() / volume - 1.0).abs() < 0.04, "{} m³, not {volume}", hull.volume());
            hull.polyhedron(1.0).expect("closed");
        };
        let t = OPTIONS.min_thickness;
        check(&cube([0.1, 0.2, 0.0]), 0.1 * 0.2 * t);
        check(&cube([0.1, 0.2, 1e-5]), 0.1 * 0.2 * t);
        check(&cube([0.1, 0.0, 0.0]), 0.1 * t * t);
        check(&cube([1e-6; 3]), t * t * t);
        check(&[[0.3, 0.1, 0.2]], t * t * t);
        check(&[[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], 0.005 * t);
        assert_eq!(ConvexHull::new(&[], &OPTIONS), None);
        assert_eq!(ConvexHull::new(&[[f32::INFINITY, 0.0, 0.0]], &OPTIONS), None);
    }
}
