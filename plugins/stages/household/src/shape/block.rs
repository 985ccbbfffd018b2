//! Boxes with rounded edges.

use super::{Point3, SlotMapping, SolidShape, Uv, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// A box of outer `size` around the origin with edges of `radius`, each in `steps` pieces of a quarter circle's half.
///
/// `mapping` returns the mapping of each side: 0, 1 for -x, +x; 2, 3 for -y, +y; 4, 5 for -z, +z. With [`Uv::Fit`], the
/// side's texture is upright, seen from outside (z up on the four walls, y up on bottom and top).
pub fn rounded_box(size: [f64; 3], radius: f64, steps: usize, mapping: impl Fn(usize) -> SlotMapping) -> SolidShape {
    let half = size.map(|s| s / 2.0);
    let radius = radius.min(half[0]).min(half[1]).min(half[2]);
    let steps = if radius > 0.0 { steps } else { 0 };
    let last = 2 * steps + 1;
    let mut shape = SolidShape::default();
    let mut known: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    for side in 0..6 {
        let (axis, up) = (side / 2, side % 2 == 1);
        // Axes of the side's texture, so that u × v points outwards.
        let (u_axis, v_axis, u_flip) = match side {
            0 => (1, 2, true),
            1 => (1, 2, false),
            2 => (0, 2, false),
            3 => (0, 2, true),
            4 => (0, 1, true),
            _ => (0, 1, false),
        };
        let mapping = mapping(side);
        let mut corner = |shape: &mut SolidShape, i: usize, j: usize| -> (u32, [f64; 2]) {
            let mut grid = [0; 3];
            grid[axis] = if up { last } else { 0 };
            grid[u_axis] = if u_flip { last - i } else { i };
            grid[v_axis] = j;
            let p = point(grid, half, radius, steps);
            // Where two rounded edges meet, their ends are one point.
            let key =
                std::array::from_fn(
                    |k| if half[k] - radius < 1e-12 && grid[k] > steps { grid[k] - 1 } else { grid[k] },
                );
            let index = *known.entry(key).or_insert_with(|| shape.point(p));
            let sign = if u_flip { -1.0 } else { 1.0 };
            let uv = match mapping.uv {
                Uv::Fit => [0.5 + sign * p[u_axis] / size[u_axis], 0.5 + p[v_axis] / size[v_axis]],
                Uv::Tile(tile) | Uv::Planar(tile) => [sign * p[u_axis] / tile, p[v_axis] / tile],
            };
            (index, uv)
        };
        for j in 0..last {
            for i in 0..last {
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| corner(&mut shape, i, j));
                shape.quad(corners.map(|c| c.0), corners.map(|c| c.1), mapping.slot);
            }
        }
    }
    shape.hulled()
}

/// A grid point of the surface: inner corner plus `radius` towards a point of the cube.
fn point(grid: [usize; 3], half: [f64; 3], radius: f64, steps: usize) -> Point3<f64> {
    let direction = Vector3::from_fn(|axis, _| {
        let i = grid[axis];
        if steps == 0 {
            return if i == 0 { -1.0 } else { 1.0 };
        }
        let (sign, from_edge) = if i <= steps { (-1.0, i) } else { (1.0, 2 * steps + 1 - i) };
        sign * libm::tan((steps - from_edge) as f64 / steps as f64 * FRAC_PI_4)
    });
    let inner = Vector3::from_fn(|axis, _| {
        let sign = if 2 * grid[axis] <= 2 * steps { -1.0 } else { 1.0 };
        sign * (half[axis] - radius)
    });
    let offset = if radius > 0.0 { direction.normalize() * radius } else { Vector3::zeros() };
    Point3::from(inner + offset)
}
