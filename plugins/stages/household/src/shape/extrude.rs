//! Polygons extruded along z, with an exact convex decomposition.

use super::outline::arc;
use super::{Point3, SlotMapping, SolidShape, Uv};

type PlanePoint = [f64; 2];

/// A simple polygon, counter-clockwise, between heights `[bottom, top]`, with edges beveled by `bevel` meters.
/// Collision parts are the polygon's triangles, merged while they stay convex (Hertel and Mehlhorn).
pub fn extrude(
    outline: &[PlanePoint],
    [bottom, top]: [f64; 2],
    bevel: f64,
    caps: SlotMapping,
    sides: SlotMapping,
) -> SolidShape {
    let n = outline.len();
    let mut shape = SolidShape::default();
    let soft = inset(outline, 0.3 * bevel);
    let narrow = inset(outline, bevel);
    let levels: Vec<(&[PlanePoint], f64)> = if bevel > 0.0 {
        vec![
            (&narrow, bottom),
            (&soft, bottom + 0.3 * bevel),
            (outline, bottom + bevel),
            (outline, top - bevel),
            (&soft, top - 0.3 * bevel),
            (&narrow, top),
        ]
    } else {
        vec![(outline, bottom), (outline, top)]
    };
    let rings: Vec<Vec<u32>> = levels
        .iter()
        .map(|(ring, z)| ring.iter().map(|p| shape.point(Point3::new(p[0], p[1], *z))).collect())
        .collect();
    let size = outline.iter().flatten().fold(1e-9_f64, |size, x| size.max(2.0 * x.abs()));
    let scale = match caps.uv {
        Uv::Tile(meters) | Uv::Planar(meters) => meters,
        Uv::Fit => size,
    };
    let flat = |i: usize| [0.5 + outline[i][0] / scale, 0.5 + outline[i][1] / scale];
    let triangles = triangulate(outline);
    let (low, high) = (&rings[0], &rings[rings.len() - 1]);
    for &[a, b, c] in &triangles {
        shape.triangle([high[a], high[b], high[c]], [flat(a), flat(b), flat(c)], caps.slot);
        shape.triangle([low[a], low[c], low[b]], [flat(a), flat(c), flat(b)], caps.slot);
    }
    let length = |i: usize| {
        let (a, b) = (outline[i], outline[(i + 1) % n]);
        libm::hypot(b[0] - a[0], b[1] - a[1])
    };
    let total: f64 = (0..n).map(length).sum();
    for (below, above) in (0..levels.len() - 1).map(|i| (i, i + 1)) {
        let mut along = 0.0;
        for i in 0..n {
            let k = (i + 1) % n;
            let (scale_u, scale_v) = match sides.uv {
                Uv::Tile(tile) => (tile, tile),
                _ => (total, top - bottom),
            };
            let [u0, u1] = [along / scale_u, (along + length(i)) / scale_u];
            let [v0, v1] = [levels[below].1, levels[above].1].map(|z| (z - bottom) / scale_v);
            shape.quad(
                [rings[below][i], rings[below][k], rings[above][k], rings[above][i]],
                [[u0, v0], [u1, v0], [u1, v1], [u0, v1]],
                sides.slot,
            );
            along += length(i);
        }
    }
    for piece in convex_pieces(outline, triangles) {
        let corners = piece.into_iter().map(|i| outline[i]);
        shape.parts.push(corners.flat_map(|p| [bottom, top].map(|z| Point3::new(p[0], p[1], z))).collect());
    }
    shape
}

/// A polygon with rounded corners.
pub fn rounded_polygon(outline: &[PlanePoint], radius: f64) -> Vec<PlanePoint> {
    let n = outline.len();
    (0..n).flat_map(|i| arc(outline[(i + n - 1) % n], outline[i], outline[(i + 1) % n], radius)).collect()
}

/// Moves every edge inwards; for distances small against the edges.
fn inset(outline: &[PlanePoint], distance: f64) -> Vec<PlanePoint> {
    let n = outline.len();
    (0..n)
        .map(|i| {
            let normal = |a: PlanePoint, b: PlanePoint| {
                let length = libm::hypot(b[0] - a[0], b[1] - a[1]).max(1e-12);
                [-(b[1] - a[1]) / length, (b[0] - a[0]) / length]
            };
            let (before, after) =
                (normal(outline[(i + n - 1) % n], outline[i]), normal(outline[i], outline[(i + 1) % n]));
            let sum = [before[0] + after[0], before[1] + after[1]];
            // The miter, limited in length to avoid spikes.
            let scale = 2.0 / (sum[0] * sum[0] + sum[1] * sum[1]).max(0.5);
            std::array::from_fn(|k| outline[i][k] + distance * scale * sum[k])
        })
        .collect()
}

/// A star or rosette with `tips` tips between two radii.
pub fn star(tips: usize, inner: f64, outer: f64) -> Vec<PlanePoint> {
    (0..2 * tips)
        .map(|i| {
            let r = if i % 2 == 0 { outer } else { inner };
            let angle = std::f64::consts::PI * (i as f64 / tips as f64 + 0.5);
            [r * libm::cos(angle), r * libm::sin(angle)]
        })
        .collect()
}

fn turn(a: PlanePoint, b: PlanePoint, c: PlanePoint) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Ear clipping; quadratic, for outlines of a few dozen corners.
fn triangulate(outline: &[PlanePoint]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::new();
    while left.len() > 3 {
        let n = left.len();
        let ears = (0..n).filter_map(|i| {
            let ear @ [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let [pa, pb, pc] = ear.map(|i| outline[i]);
            let covers = |p: PlanePoint| turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0;
            let area = turn(pa, pb, pc);
            let free = left.iter().filter(|&&k| k != a && k != b && k != c).all(|&k| !covers(outline[k]));
            // The roundest ear first: area over squared length of the cut.
            let cut = (pc[0] - pa[0]).powi(2) + (pc[1] - pa[1]).powi(2);
            (area > 1e-14 && free).then_some((i, ear, area / cut.max(1e-18)))
        });
        let Some((i, ear, _)) = ears.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
        triangles.push(ear);
        left.remove(i);
    }
    if let [a, b, c] = left[..] {
        triangles.push([a, b, c]);
    }
    triangles
}

/// Merges neighbors while the union stays convex.
fn convex_pieces(outline: &[PlanePoint], triangles: Vec<[usize; 3]>) -> Vec<Vec<usize>> {
    let mut pieces: Vec<Vec<usize>> = triangles.into_iter().map(|t| t.to_vec()).collect();
    'again: loop {
        for i in 0..pieces.len() {
            for k in i + 1..pieces.len() {
                if let Some(joined) = join(outline, &pieces[i], &pieces[k]) {
                    pieces[i] = joined;
                    pieces.remove(k);
                    continue 'again;
                }
            }
        }
        return pieces;
    }
}

/// The union of two counter-clockwise polygons that share an edge, if it is convex.
fn join(outline: &[PlanePoint], a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    let edge = |polygon: &[usize], i: usize| (polygon[i], polygon[(i + 1) % polygon.len()]);
    for i in 0..a.len() {
        let (from, to) = edge(a, i);
        let Some(k) = (0..b.len()).find(|&k| edge(b, k) == (to, from)) else { continue };
        let mut joined: Vec<usize> = (1..=a.len()).map(|s| a[(i + s) % a.len()]).collect();
        joined.extend((2..b.len()).map(|s| b[(k + s) % b.len()]));
        let n = joined.len();
        let at = |s: usize| outline[joined[s % n]];
        return (0..n).all(|s| turn(at(s), at(s + 1), at(s + 2)) > -1e-12).then_some(joined);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(outline: &[PlanePoint], polygon: &[usize]) -> f64 {
        (1..polygon.len() - 1)
            .map(|i| turn(outline[polygon[0]], outline[polygon[i]], outline[polygon[i + 1]]) / 2.0)
            .sum()
    }

    #[test]
    fn pieces_are_convex_and_fill_the_polygon() {
        for (outline, most) in [(star(5, 0.4, 1.0), 6), (star(8, 0.7, 1.0), 10)] {
            let n = outline.len();
            let triangles = triangulate(&outline);
            assert_eq!(triangles.len(), n - 2);
            let pieces = convex_pieces(&outline, triangles);
            assert!(pieces.len() <= most, "{pieces:?}");
            let whole = area(&outline, &(0..n).collect::<Vec<_>>());
            let sum: f64 = pieces.iter().map(|piece| area(&outline, piece)).sum();
            assert!((sum - whole).abs() < 1e-12, "{sum} {whole}");
            for piece in &pieces {
                let at = |s: usize| outline[piece[s % piece.len()]];
                assert!((0..piece.len()).all(|s| turn(at(s), at(s + 1), at(s + 2)) > -1e-12), "{piece:?}");
            }
        }
    }
}
