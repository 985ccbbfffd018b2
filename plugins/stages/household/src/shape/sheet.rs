//! Thin bodies: sheets with two faces, and vessels with thin walls.

use super::{Point3, SlotMapping, SolidShape, Uv};

/// Number of cells of a sheet along one edge of its collision parts, and along the other.
pub type PartCells = [usize; 2];

/// A closed sheet of `cells` across and along. `at` maps a position in [0, 1] × [0, 1] to a point of the upper face and
/// a point of the lower one. The slots are the upper face's, the lower face's and the rim's. Collision parts are the
/// hulls of blocks of `part` cells.
pub fn thick_sheet(
    cells: [usize; 2],
    part: PartCells,
    slots: [SlotMapping; 3],
    at: impl Fn([f64; 2]) -> [Point3<f64>; 2],
) -> SolidShape {
    let [columns, rows] = cells;
    let mut shape = SolidShape::default();
    let place = |i: usize, j: usize| [i as f64 / columns as f64, j as f64 / rows as f64];
    let grid: Vec<[Point3<f64>; 2]> =
        (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j))).map(|(i, j)| at(place(i, j))).collect();
    let index = |i: usize, j: usize| j * (columns + 1) + i;
    let corner = |i: usize, j: usize, face: usize| (2 * index(i, j) + face) as u32;
    for [upper, lower] in &grid {
        shape.point(*upper);
        shape.point(*lower);
    }
    let extent = |a: usize, b: usize| (grid[b][0] - grid[a][0]).norm();
    let size = [extent(0, columns), extent(0, index(0, rows))];
    let uv = |i: usize, j: usize, face: usize| {
        let [u, v] = place(i, j);
        // Seen from below, left and right are exchanged.
        let u = if face == 1 { 1.0 - u } else { u };
        match slots[face].uv {
            Uv::Fit => [u, v],
            Uv::Tile(meters) | Uv::Planar(meters) => [u * size[0] / meters, v * size[1] / meters],
        }
    };
    for j in 0..rows {
        for i in 0..columns {
            let ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            shape.quad(ring.map(|(i, j)| corner(i, j, 0)), ring.map(|(i, j)| uv(i, j, 0)), slots[0].slot);
            let ring = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)];
            shape.quad(ring.map(|(i, j)| corner(i, j, 1)), ring.map(|(i, j)| uv(i, j, 1)), slots[1].slot);
        }
    }
    // Around the rim, counterclockwise from above.
    let rim: Vec<(usize, usize)> = (0..columns)
        .map(|i| (i, 0))
        .chain((0..rows).map(|j| (columns, j)))
        .chain((0..columns).map(|i| (columns - i, rows)))
        .chain((0..rows).map(|j| (0, rows - j)))
        .collect();
    for (number, &(i, j)) in rim.iter().enumerate() {
        let (k, l) = rim[(number + 1) % rim.len()];
        let u = |step: usize| (number + step) as f64 / rim.len() as f64 * 8.0;
        shape.quad(
            [corner(i, j, 1), corner(k, l, 1), corner(k, l, 0), corner(i, j, 0)],
            [[u(0), 0.0], [u(1), 0.0], [u(1), 0.1], [u(0), 0.1]],
            slots[2].slot,
        );
    }
    for j in (0..rows).step_by(part[1]) {
        for i in (0..columns).step_by(part[0]) {
            let block = (j..=(j + part[1]).min(rows)).flat_map(|l| {
                let grid = &grid;
                (i..=(i + part[0]).min(columns)).flat_map(move |k| grid[index(k, l)])
            });
            shape.parts.push(block.collect());
        }
    }
    shape
}

/// A vessel, open at the top: rings of its outside from the bottom up, and of its inside from the floor up. All rings
/// have equally many points, counterclockwise from above. `around` holds u at every point of a ring and at its end. The
/// outside shows the texture of its slot once, the inside tiles. Without rings of an inside the body is solid. It has no
/// collision parts.
pub fn vessel(
    outer: &[Vec<Point3<f64>>],
    inner: &[Vec<Point3<f64>>],
    around: &[f64],
    [outside, inside]: [SlotMapping; 2],
) -> SolidShape {
    let mut shape = SolidShape::default();
    let n = around.len() - 1;
    let rings: Vec<(&Vec<Point3<f64>>, bool)> =
        outer.iter().map(|ring| (ring, true)).chain(inner.iter().rev().map(|ring| (ring, false))).collect();
    let indices: Vec<Vec<u32>> = rings.iter().map(|(ring, _)| ring.iter().map(|p| shape.point(*p)).collect()).collect();
    let (low, high) = (outer[0][0].z, outer[outer.len() - 1][0].z);
    let tile = match inside.uv {
        Uv::Tile(meters) | Uv::Planar(meters) => meters,
        Uv::Fit => high - low,
    };
    for i in 0..rings.len() - 1 {
        let is_outside = rings[i + 1].1;
        let v = |step: usize| match is_outside {
            true => (i + step) as f64 / (outer.len() - 1) as f64,
            false => rings[i + step].0[0].z / tile,
        };
        for j in 0..n {
            let k = (j + 1) % n;
            let u = [around[j], around[j + 1]].map(|u| if is_outside { u } else { 4.0 * u });
            shape.quad(
                [indices[i][j], indices[i][k], indices[i + 1][k], indices[i + 1][j]],
                [[u[0], v(0)], [u[1], v(0)], [u[1], v(1)], [u[0], v(1)]],
                if is_outside { outside.slot } else { inside.slot },
            );
        }
    }
    for (end, is_bottom) in [(0, true), (rings.len() - 1, false)] {
        let ring = rings[end].0;
        let sum = ring.iter().fold(nalgebra::Vector3::zeros(), |sum, p| sum + p.coords);
        let center = Point3::from(sum / n as f64);
        let middle = shape.point(center);
        let uv = |p: &Point3<f64>| [p.x / tile, p.y / tile];
        for j in 0..n {
            let (a, b) = if is_bottom { ((j + 1) % n, j) } else { (j, (j + 1) % n) };
            shape.triangle(
                [middle, indices[end][a], indices[end][b]],
                [uv(&center), uv(&ring[a]), uv(&ring[b])],
                inside.slot,
            );
        }
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_encloses_its_area_times_its_thickness() {
        let mapping = SlotMapping::fit(0);
        let sheet = thick_sheet([8, 5], [4, 5], [mapping; 3], |[u, v]| {
            let z = 0.3 * u * v;
            [Point3::new(2.0 * u, 3.0 * v, z + 0.1), Point3::new(2.0 * u, 3.0 * v, z)]
        });
        assert!((sheet.volume() - 0.6).abs() < 1e-9, "{}", sheet.volume());
        assert_eq!(sheet.parts.len(), 2);
    }

    #[test]
    fn a_vessel_encloses_its_walls_and_its_floor() {
        let square = |half: f64, z: f64| {
            vec![
                Point3::new(-half, -half, z),
                Point3::new(half, -half, z),
                Point3::new(half, half, z),
                Point3::new(-half, half, z),
            ]
        };
        let mappings = [SlotMapping::fit(0), SlotMapping::tile(1, 0.1)];
        let around = [0.0, 0.25, 0.5, 0.75, 1.0];
        let shape =
            vessel(&[square(1.0, 0.0), square(1.0, 2.0)], &[square(0.9, 0.1), square(0.9, 2.0)], &around, mappings);
        let expected = 8.0 - 1.8 * 1.8 * 1.9;
        assert!((shape.volume() - expected).abs() < 1e-9, "{} {expected}", shape.volume());
    }
}
