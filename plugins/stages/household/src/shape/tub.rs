//! Open containers: a profile swept around a rectangle with rounded corners.

use super::{Point3, SolidShape};
use std::f64::consts::FRAC_PI_2;

/// Pieces of each quarter circle at the corners.
const STEPS: usize = 3;

/// Bevel of the edges of the rim and of the bottom, meters.
const BEVEL_M: f64 = 0.0012;

/// An open container with a level floor, meters. Its outer bottom is at height 0.
#[derive(Debug, Clone, Copy)]
pub struct Tub {
    /// Extents of the inner floor along x and y.
    pub floor: [f64; 2],
    /// Height of the rim above the inner floor.
    pub depth: f64,
    /// Thickness of the walls and the floor.
    pub wall: f64,
    /// Distance by which the walls lean outwards from the floor to the rim.
    pub draft: f64,
    /// Radius of the corners of the inner floor.
    pub corner: f64,
    /// Width of the flange around the rim; 0 for none.
    pub rim: f64,
    /// Height of the flange.
    pub rim_height: f64,
}

impl Tub {
    /// The container. All faces have the slot 0; its floor and the pieces of its walls are its collision parts.
    pub fn solid(&self) -> SolidShape {
        let Self { depth, wall, draft, rim, rim_height, .. } = *self;
        let top = wall + depth;
        let bevel = BEVEL_M.min(0.3 * wall);
        // Offsets from the inner floor and heights, from the outer bottom over the rim to the inner floor.
        let mut profile = vec![[wall - bevel, 0.0], [wall, bevel]];
        if rim > 0.0 {
            let under = top - rim_height;
            let at_rim = wall + draft * (under - wall) / depth;
            profile.extend([[at_rim, under], [wall + draft + rim, under]]);
        }
        let out = wall + draft + rim;
        profile.extend([
            [out, top - bevel],
            [out - bevel, top],
            [draft + bevel, top],
            [draft, top - bevel],
            [0.0, wall],
        ]);
        let rings: Vec<Vec<Point3<f64>>> = profile.iter().map(|[offset, z]| self.ring(*offset, *z)).collect();
        let mut shape = SolidShape::default();
        let indices: Vec<Vec<u32>> = rings.iter().map(|ring| ring.iter().map(|p| shape.point(*p)).collect()).collect();
        let n = rings[0].len();
        for pair in indices.windows(2) {
            for j in 0..n {
                let k = (j + 1) % n;
                shape.quad([pair[0][j], pair[0][k], pair[1][k], pair[1][j]], [[0.0; 2]; 4], 0);
            }
        }
        let last = indices.len() - 1;
        for (ring, z, is_bottom) in [(0, 0.0, true), (last, wall, false)] {
            let middle = shape.point(Point3::new(0.0, 0.0, z));
            for j in 0..n {
                let (a, b) = if is_bottom { ((j + 1) % n, j) } else { (j, (j + 1) % n) };
                shape.triangle([middle, indices[ring][a], indices[ring][b]], [[0.0; 2]; 3], 0);
            }
        }
        let ring = |offset: f64, z: f64| self.ring(offset, z);
        shape.parts.push([ring(wall, 0.0), ring(wall, wall)].concat());
        // Around the wall, and around the flange.
        let mut around = |low: [f64; 3], high: [f64; 3]| {
            let levels = [low, high].map(|[inner, outer, z]| [ring(inner, z), ring(outer, z)]);
            for j in 0..n {
                let k = (j + 1) % n;
                shape.parts.push(levels.iter().flatten().flat_map(|ring| [ring[j], ring[k]]).collect());
            }
        };
        around([0.0, wall, wall], [draft, wall + draft, top]);
        if rim > 0.0 {
            around([draft, out, top - rim_height], [draft, out, top]);
        }
        shape
    }

    /// The rectangle of the inner floor, grown by an offset, at a height; counterclockwise from above.
    fn ring(&self, offset: f64, z: f64) -> Vec<Point3<f64>> {
        let [a, b] = self.floor.map(|edge| edge / 2.0);
        let inset = self.corner.min(a).min(b);
        let radius = inset + offset;
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let corner = |(number, (x, y)): (usize, &(f64, f64))| {
            let center = [x * (a - inset), y * (b - inset)];
            (0..=STEPS).map(move |step| {
                let angle = FRAC_PI_2 * (number as f64 + step as f64 / STEPS as f64);
                Point3::new(center[0] + radius * libm::cos(angle), center[1] + radius * libm::sin(angle), z)
            })
        };
        corners.iter().enumerate().flat_map(corner).collect()
    }
}
