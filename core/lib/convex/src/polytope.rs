//! Convex polytopes over integers: no rounding can flip a face or lose a point.

use std::collections::BTreeSet;

/// A point on an integer grid. Coordinates stay below 2²¹ in magnitude, so that orientation tests cannot overflow.
pub type GridPoint = [i64; 3];

/// A convex polytope with vertices on a grid that grows point by point (incremental convex hull).
pub struct GridPolytope {
    /// All points inserted so far. Early ones may be inside the current polytope.
    pub points: Vec<GridPoint>,
    /// Triangular faces.
    pub faces: Vec<HullFace>,
}

/// A triangle of a [`GridPolytope`].
pub struct HullFace {
    /// Indices of its vertices, counterclockwise seen from outside.
    pub vertices: [usize; 3],
    /// Points assigned to this face that are known to be outside its plane.
    pub outside: Vec<GridPoint>,
    normal: [f64; 3],
    offset: f64,
}

impl HullFace {
    fn new(vertices: [usize; 3], points: &[GridPoint]) -> Self {
        let [a, b, c] = vertices.map(|i| points[i]);
        let cross = cross(sub(b, a), sub(c, a)).map(|x| x as f64);
        let length = cross.iter().map(|x| x * x).sum::<f64>().sqrt();
        let normal = cross.map(|x| x / length);
        let offset = (0..3).map(|i| normal[i] * a[i] as f64).sum();
        Self { vertices, outside: Vec::new(), normal, offset }
    }

    /// Outward unit normal.
    pub fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// Signed distance of a point from the face's plane, grid steps; positive outside.
    pub fn distance(&self, p: GridPoint) -> f64 {
        (0..3).map(|i| self.normal[i] * p[i] as f64).sum::<f64>() - self.offset
    }
}

impl GridPolytope {
    /// A tetrahedron of four of the points, chosen greedily to be large. None if all points are coplanar.
    pub fn new(points: &[GridPoint]) -> Option<Self> {
        let a = *points.first()?;
        let b = *points.iter().max_by_key(|p| dot(sub(**p, a), sub(**p, a)))?;
        let area = |p: &&GridPoint| {
            let cross = cross(sub(b, a), sub(**p, a)).map(i128::from);
            cross.iter().map(|x| x * x).sum::<i128>()
        };
        let c = *points.iter().max_by_key(area)?;
        let d = *points.iter().max_by_key(|p| orient3d([a, b, c], **p).abs())?;
        let faces = match orient3d([a, b, c], d).signum() {
            0 => return None,
            1 => [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            _ => [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]],
        };
        let points = vec![a, b, c, d];
        Some(Self { faces: faces.map(|face| HullFace::new(face, &points)).into(), points })
    }

    /// Inserts a point if it is outside. Returns the faces that were removed and the index of the first new face; all
    /// faces from there on are new. None if the point is not outside.
    pub fn insert(&mut self, p: GridPoint) -> Option<(Vec<HullFace>, usize)> {
        let orientation = |face: &HullFace| orient3d(face.vertices.map(|i| self.points[i]), p);
        let orientations: Vec<i128> = self.faces.iter().map(orientation).collect();
        if orientations.iter().all(|&orientation| orientation <= 0) {
            return None;
        }
        // Faces coplanar with the point are replaced too, so that no face ever has zero area.
        let mut orientations = orientations.into_iter();
        let (visible, kept): (Vec<HullFace>, Vec<HullFace>) = std::mem::take(&mut self.faces)
            .into_iter()
            .partition(|_| orientations.next().is_some_and(|orientation| orientation >= 0));
        let edges: BTreeSet<(usize, usize)> =
            visible.iter().flat_map(|face| [0, 1, 2].map(|i| (face.vertices[i], face.vertices[(i + 1) % 3]))).collect();
        self.points.push(p);
        self.faces = kept;
        let (first_new, apex) = (self.faces.len(), self.points.len() - 1);
        for &(a, b) in edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a))) {
            self.faces.push(HullFace::new([a, b, apex], &self.points));
        }
        Some((visible, first_new))
    }
}

fn sub(p: GridPoint, q: GridPoint) -> GridPoint {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// Dot product.
pub fn dot(p: GridPoint, q: GridPoint) -> i64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: GridPoint, q: GridPoint) -> GridPoint {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}

/// Six times the signed volume of a tetrahedron; positive where `p` sees the triangle counterclockwise.
fn orient3d([a, b, c]: [GridPoint; 3], p: GridPoint) -> i128 {
    let (normal, to) = (cross(sub(b, a), sub(c, a)), sub(p, a));
    (0..3).map(|i| i128::from(normal[i]) * i128::from(to[i])).sum()
}

/// The 26 directions from a grid point to its neighbors.
pub fn directions() -> impl Iterator<Item = GridPoint> {
    (0..27_i64).filter(|&i| i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn every_point_is_inside_and_every_edge_has_two_faces() {
        let mut stream = Stream::root(1);
        // Coarse grids make many points coplanar and collinear.
        for size in [1, 2, 3, 5, 30, 1000, 1 << 19] {
            let points: Vec<GridPoint> = (0..200).map(|_| [0; 3].map(|_| stream.integer(-size, size))).collect();
            let mut polytope = GridPolytope::new(&points).expect("a polytope");
            points.iter().for_each(|&p| drop(polytope.insert(p)));
            let orientation = |face: &HullFace, p: GridPoint| orient3d(face.vertices.map(|i| polytope.points[i]), p);
            for face in &polytope.faces {
                assert!(points.iter().all(|&p| orientation(face, p) <= 0), "{size}: a point is outside");
                assert!(points.iter().all(|&p| face.distance(p) < 1e-6), "{size}: a point is outside the plane");
            }
            let edges: Vec<(usize, usize)> = polytope
                .faces
                .iter()
                .flat_map(|face| [0, 1, 2].map(|i| (face.vertices[i], face.vertices[(i + 1) % 3])))
                .collect();
            for (a, b) in &edges {
                assert_eq!(edges.iter().filter(|edge| **edge == (*b, *a)).count(), 1, "{size}");
            }
            let six_volumes: i128 = polytope.faces.iter().map(|face| -orientation(face, points[0])).sum();
            assert!(six_volumes > 0);
            if size == 1 {
                assert_eq!(six_volumes, 6 * 8, "200 draws from 27 grid points: the whole cube");
            }
        }
    }

    #[test]
    fn coplanar_points_make_no_polytope() {
        let flat: Vec<GridPoint> =
            (0..50).map(|i| [i, i * i % 17, 3 * i + 2]).map(|[x, y, _]| [x, y, x + 2 * y]).collect();
        assert!(GridPolytope::new(&flat).is_none());
        assert!(GridPolytope::new(&[]).is_none());
        assert!(GridPolytope::new(&[[1, 2, 3]; 5]).is_none());
    }
}
