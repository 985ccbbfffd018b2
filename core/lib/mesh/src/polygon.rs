//! Triangulation of faces with more than three corners.

use nalgebra::Vector3;
use syntable_model::error::{Error, Result};

/// Maximum number of corners of a concave face: ear clipping takes quadratic time.
pub const MAX_CONCAVE_CORNERS: usize = 1024;

/// Triangles of a polygon as indices into its corners, with the winding of the polygon.
///
/// Convex polygons become fans around corner 0, so quads split as in other programs. Concave polygons lose their ears
/// one by one. Corners need not lie in one plane exactly: they are projected along the polygon's mean normal (Newell).
/// A polygon without area becomes a fan.
pub fn triangulate(corners: &[[f32; 3]]) -> Result<Vec<[usize; 3]>> {
    let n = corners.len();
    let fan = || (2..n).map(|i| [0, i - 1, i]).collect();
    if n <= 3 {
        return Ok(fan());
    }
    let points: Vec<Vector3<f64>> =
        corners.iter().map(|p| Vector3::from(p.map(f64::from)) - Vector3::from(corners[0].map(f64::from))).collect();
    let normal: Vector3<f64> = (0..n).map(|i| points[i].cross(&points[(i + 1) % n])).sum();
    let Some(normal) = normal.try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite())) else {
        return Ok(fan());
    };
    // Coordinates in the plane, counter-clockwise.
    let axis = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = axis.cross(&normal).normalize();
    let v = normal.cross(&u);
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [p.dot(&u), p.dot(&v)]).collect();

    let reflex = |i: usize| turn(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]) < 0.0;
    if !(0..n).any(reflex) {
        return Ok(fan());
    }
    if n > MAX_CONCAVE_CORNERS {
        return Err(Error::new(format!(
            "a concave face has {n} corners, more than the limit of {MAX_CONCAVE_CORNERS}"
        ))
        .help("triangulate the mesh before use"));
    }
    Ok(cut_ears(&flat))
}

fn cut_ears(flat: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    let mut at = 0;
    let mut tried = 0;
    while left.len() > 3 {
        let k = left.len();
        let [a, b, c] = [left[(at + k - 1) % k], left[at % k], left[(at + 1) % k]];
        // A self-intersecting polygon may have no ear; the current corner is then cut.
        if tried >= k || is_ear(flat, &left, [a, b, c]) {
            triangles.push([a, b, c]);
            left.remove(at % k);
            at = (at % k + k - 2) % (k - 1);
            tried = 0;
        } else {
            at = (at + 1) % k;
            tried += 1;
        }
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

fn is_ear(flat: &[[f64; 2]], left: &[usize], [a, b, c]: [usize; 3]) -> bool {
    let [p, q, r] = [a, b, c].map(|i| flat[i]);
    if turn(p, q, r) <= 0.0 {
        return false;
    }
    left.iter().all(|&i| {
        let x = flat[i];
        x == p || x == q || x == r || !(turn(p, q, x) >= 0.0 && turn(q, r, x) >= 0.0 && turn(r, p, x) >= 0.0)
    })
}

/// Twice the signed area of a triangle: positive for a left turn at `b`.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f32; 3]], [a, b, c]: [usize; 3]) -> Vector3<f64> {
        let [a, b, c] = [a, b, c].map(|i| Vector3::from(corners[i].map(f64::from)));
        (b - a).cross(&(c - a)) / 2.0
    }

    /// All triangles must have the polygon's orientation, and their areas must sum to its area: then they tile it.
    fn check(corners: &[[f32; 3]], normal: Vector3<f64>) {
        let triangles = triangulate(corners).expect("triangulates");
        assert_eq!(triangles.len(), corners.len() - 2);
        let mut sum = 0.0;
        for triangle in triangles {
            let part = area(corners, triangle).dot(&normal);
            assert!(part >= -1e-9, "{triangle:?} is turned over: {part}");
            sum += part;
        }
        let whole: Vector3<f64> = (1..corners.len() - 1).map(|i| area(corners, [0, i, i + 1])).sum();
        assert!((sum - whole.dot(&normal)).abs() < 1e-6 * sum, "{sum} for {whole}");
    }

    #[test]
    fn quads_are_fans() {
        let quad = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(triangulate(&quad).expect("convex"), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_shapes_are_tiled_in_any_plane() {
        // An L, an arrow whose corner 0 sees nothing, and a star.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let arrow = [[1.0, 1.0], [0.0, 2.0], [0.0, 0.0], [4.0, 1.0], [0.0, 1.9]];
        let star: Vec<[f32; 2]> = (0..20)
            .map(|i| {
                let (angle, radius) = (i as f32 * 0.314_159_27, if i % 2 == 0 { 1.0 } else { 0.3 });
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        for shape in [l.as_slice(), &arrow[1..], &star] {
            let lift = |f: fn([f32; 2]) -> [f32; 3]| shape.iter().map(|&p| f(p)).collect::<Vec<_>>();
            check(&lift(|[x, y]| [x, y, 5.0]), Vector3::z());
            check(&lift(|[x, y]| [7.0, x, y]), Vector3::x());
            check(&lift(|[x, y]| [y, x, 0.0]), -Vector3::z());
            check(&lift(|[x, y]| [x, y, x + y]), Vector3::new(-1.0, -1.0, 1.0).normalize());
        }
    }

    #[test]
    fn shapes_without_area_and_huge_ones_end() {
        assert_eq!(triangulate(&[[1.0; 3]; 9]).expect("a fan").len(), 7);
        let huge: Vec<[f32; 3]> =
            [[0.0, 0.0], [1e29, 0.0], [3e28, 3e28], [0.0, 1e29]].map(|[x, y]| [x, y, -1e29]).into();
        check(&huge, Vector3::z());
        let crossing = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, -3.0]].map(|[x, y]| [x, y, 0.0]);
        assert_eq!(triangulate(&crossing).expect("ends").len(), 3);
    }

    #[test]
    fn a_huge_concave_face_is_refused() {
        let comb: Vec<[f32; 3]> =
            (0..4000).map(|i| [i as f32, (i % 2) as f32, 0.0]).chain([[2000.0, -10.0, 0.0]]).collect();
        assert!(triangulate(&comb).is_err());
    }
}
