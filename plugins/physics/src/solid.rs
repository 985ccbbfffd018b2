//! Convex polyhedra over whole numbers: no rounding can turn a face or lose a point.

use std::collections::BTreeSet;

/// A point on a grid. Coordinates stay below 2²¹, so that volumes fit.
pub type Cell = [i64; 3];

/// A convex polyhedron of grid points that grows point by point (the incremental algorithm).
pub struct Solid {
    /// All points that were ever taken in; the later hull need not use the early ones.
    pub points: Vec<Cell>,
    /// Its faces.
    pub faces: Vec<Face>,
}

/// A triangle of a [`Solid`].
pub struct Face {
    /// Its corners, counter-clockwise seen from outside.
    pub corners: [usize; 3],
    /// Points that are known to lie beyond it.
    pub waiting: Vec<Cell>,
    normal: [f64; 3],
    offset: f64,
}

impl Face {
    fn new(corners: [usize; 3], points: &[Cell]) -> Self {
        let [a, b, c] = corners.map(|i| points[i]);
        let across = cross(minus(b, a), minus(c, a)).map(|x| x as f64);
        let length = across.iter().map(|x| x * x).sum::<f64>().sqrt();
        let normal = across.map(|x| x / length);
        let offset = (0..3).map(|i| normal[i] * a[i] as f64).sum();
        Self { corners, waiting: Vec::new(), normal, offset }
    }

    /// Outward unit normal.
    pub fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// How far a point lies beyond the face's plane, in steps of the grid.
    pub fn above(&self, p: Cell) -> f64 {
        (0..3).map(|i| self.normal[i] * p[i] as f64).sum::<f64>() - self.offset
    }
}

impl Solid {
    /// A tetrahedron of some of the points, as large as is easily found; none if they lie in a plane.
    pub fn new(points: &[Cell]) -> Option<Self> {
        let a = *points.first()?;
        let b = *points.iter().max_by_key(|p| dot(minus(**p, a), minus(**p, a)))?;
        let area = |p: &&Cell| {
            let across = cross(minus(b, a), minus(**p, a)).map(i128::from);
            across.iter().map(|x| x * x).sum::<i128>()
        };
        let c = *points.iter().max_by_key(area)?;
        let d = *points.iter().max_by_key(|p| volume([a, b, c], **p).abs())?;
        let faces = match volume([a, b, c], d).signum() {
            0 => return None,
            1 => [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            _ => [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]],
        };
        let points = vec![a, b, c, d];
        Some(Self { faces: faces.map(|face| Face::new(face, &points)).into(), points })
    }

    /// Takes in a point, if it is outside. Gives the faces that had to go; the new ones are the last of all faces,
    /// from the index that is given.
    pub fn insert(&mut self, p: Cell) -> Option<(Vec<Face>, usize)> {
        let sight = |face: &Face| volume(face.corners.map(|i| self.points[i]), p);
        let sights: Vec<i128> = self.faces.iter().map(sight).collect();
        if sights.iter().all(|&sight| sight <= 0) {
            return None;
        }
        // Faces in whose plane the point lies are replaced too: thus no face is ever without area.
        let mut sights = sights.into_iter();
        let (seen, kept): (Vec<Face>, Vec<Face>) =
            std::mem::take(&mut self.faces).into_iter().partition(|_| sights.next().is_some_and(|sight| sight >= 0));
        let edges: BTreeSet<(usize, usize)> =
            seen.iter().flat_map(|face| [0, 1, 2].map(|i| (face.corners[i], face.corners[(i + 1) % 3]))).collect();
        self.points.push(p);
        self.faces = kept;
        let (first, top) = (self.faces.len(), self.points.len() - 1);
        for &(a, b) in edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a))) {
            self.faces.push(Face::new([a, b, top], &self.points));
        }
        Some((seen, first))
    }
}

fn minus(p: Cell, q: Cell) -> Cell {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// Scalar product.
pub fn dot(p: Cell, q: Cell) -> i64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: Cell, q: Cell) -> Cell {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}

/// Six times the volume between a triangle and a point; positive where the point sees the triangle counter-clockwise.
fn volume([a, b, c]: [Cell; 3], p: Cell) -> i128 {
    let (normal, to) = (cross(minus(b, a), minus(c, a)), minus(p, a));
    (0..3).map(|i| i128::from(normal[i]) * i128::from(to[i])).sum()
}

/// The 26 directions to the neighbours of a cell.
pub fn directions() -> impl Iterator<Item = Cell> {
    (0..27_i64).filter(|&i| i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn every_point_is_inside_and_edges_pair_up() {
        let mut stream = Stream::root(1);
        // Coarse grids make many points coplanar and collinear.
        for size in [1, 2, 3, 5, 30, 1000, 1 << 19] {
            let points: Vec<Cell> = (0..200).map(|_| [0; 3].map(|_| stream.integer(-size, size))).collect();
            let mut solid = Solid::new(&points).expect("a solid");
            points.iter().for_each(|&p| drop(solid.insert(p)));
            let sees = |face: &Face, p: Cell| volume(face.corners.map(|i| solid.points[i]), p);
            for face in &solid.faces {
                assert!(points.iter().all(|&p| sees(face, p) <= 0), "{size}: a point is outside");
                assert!(points.iter().all(|&p| face.above(p) < 1e-6), "{size}: a point is above");
            }
            let edges: Vec<(usize, usize)> = solid
                .faces
                .iter()
                .flat_map(|face| [0, 1, 2].map(|i| (face.corners[i], face.corners[(i + 1) % 3])))
                .collect();
            for (a, b) in &edges {
                assert_eq!(edges.iter().filter(|edge| **edge == (*b, *a)).count(), 1, "{size}");
            }
            let six_volumes: i128 = solid.faces.iter().map(|face| -sees(face, points[0])).sum();
            assert!(six_volumes > 0);
            if size == 1 {
                assert_eq!(six_volumes, 6 * 8, "200 of 27 cells: the whole cube");
            }
        }
    }

    #[test]
    fn flat_points_make_no_solid() {
        let flat: Vec<Cell> = (0..50).map(|i| [i, i * i % 17, 3 * i + 2]).map(|[x, y, _]| [x, y, x + 2 * y]).collect();
        assert!(Solid::new(&flat).is_none());
        assert!(Solid::new(&[]).is_none());
        assert!(Solid::new(&[[1, 2, 3]; 5]).is_none());
    }
}
