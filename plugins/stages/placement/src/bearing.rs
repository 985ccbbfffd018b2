//! The surface below a footprint.

use crate::footprint::Footprint;
use syntable_convex::{convex_outline, outline_area};
use syntable_model::geometry::{Aabb, Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{Region, Role, Support};

/// Faces up to this distance below the height of a support carry objects, meters: supports of meshes have recesses and rims.
const BELOW_M: f64 = 0.03;

/// Faces up to this distance above the height of a support carry objects, meters.
const ABOVE_M: f64 = 0.002;

/// A face carries objects if the vertical component of its unit normal is at least this.
const MIN_UP: f64 = 0.7;

/// A footprint is carried if the outline of the faces below it has at least this fraction of its area. The faces may have gaps, as the
/// slats of a crate have.
const MIN_OUTLINE: f64 = 0.99;

/// A footprint is carried if faces are below at least this fraction of its area.
const MIN_COVERAGE: f64 = 0.5;

/// Edges of boards are rounded: a footprint may be this far beyond the faces, meters.
const ROUND_M: f64 = 0.003;

/// Cells along each edge of a support, for the search of faces.
const CELLS: usize = 32;

/// The faces that carry objects on a support.
pub struct Bearing {
    region: Region,
    faces: Vec<[Point3<f64>; 3]>,
    /// Faces by cell, as indices in order.
    cells: Vec<Vec<u32>>,
}

impl Bearing {
    /// The faces of furniture and room at the surface of a support.
    pub fn of(support: &Support, scene: &SceneBuilder) -> Self {
        let region = support.surface;
        let mut bearing = Self { region, faces: Vec::new(), cells: vec![Vec::new(); CELLS * CELLS] };
        let [low, high] = [region.height() - BELOW_M, region.height() + ABOVE_M];
        let furniture = scene.bodies().map(|(_, body)| body).filter(|body| !body.role.is_foreground());
        for body in furniture.filter(|body| matches!(body.role, Role::Support | Role::Room | Role::Fixture)) {
            let bounds = body.world_bounds();
            if bounds.max.z < low || bounds.min.z > high {
                continue;
            }
            for triangle in 0..body.object.mesh.data().triangles.len() {
                let corners = body.object.mesh.corners(triangle).map(|p| body.world_from_body * p);
                let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
                if normal.z >= MIN_UP * normal.norm() && corners.iter().any(|p| (low..=high).contains(&p.z)) {
                    bearing.add(corners);
                }
            }
        }
        bearing
    }

    fn add(&mut self, corners: [Point3<f64>; 3]) {
        let number = self.faces.len() as u32;
        let Some([columns, rows]) = self.cells_of(&Footprint::of(corners.into_iter())) else { return };
        for row in rows {
            for column in columns.clone() {
                self.cells[row * CELLS + column].push(number);
            }
        }
        self.faces.push(corners);
    }

    /// Ranges of the columns and rows of cells that a footprint may touch; none if it is beside the region.
    fn cells_of(&self, footprint: &Footprint) -> Option<[std::ops::RangeInclusive<usize>; 2]> {
        let [x, y] = footprint.extent(&self.region);
        let range = |[low, high]: [f64; 2], edge: usize| {
            let cell = |x: f64| (x / self.region.edges()[edge] + 0.5) * CELLS as f64;
            let (low, high) = (cell(low).floor(), cell(high).floor());
            (high >= 0.0 && low < CELLS as f64).then(|| low.max(0.0) as usize..=(high as usize).min(CELLS - 1))
        };
        Some([range(x, 0)?, range(y, 1)?])
    }

    /// Height of the highest carrying face below a footprint, meters. None if a part of the footprint is beyond the edge of the
    /// surface.
    pub fn height(&self, footprint: &Footprint) -> Option<f64> {
        let footprint = &footprint.inset(ROUND_M);
        let [columns, rows] = self.cells_of(footprint)?;
        let mut numbers: Vec<u32> = Vec::new();
        for row in rows {
            columns.clone().for_each(|column| numbers.extend(&self.cells[row * CELLS + column]));
        }
        numbers.sort_unstable();
        numbers.dedup();
        let (mut covered, mut highest, mut corners) = (0.0, f64::NEG_INFINITY, Vec::new());
        for number in numbers {
            let part = footprint.clip(self.faces[number as usize]);
            if part.len() > 2 {
                let flat: Vec<[f64; 2]> = part.iter().map(|p| [p.x, p.y]).collect();
                covered += outline_area(&flat).abs();
                corners.extend(flat);
                highest = part.iter().map(|p| p.z).fold(highest, f64::max);
            }
        }
        let (whole, carried) = (outline_area(&footprint.outline), outline_area(&convex_outline(corners)));
        (carried >= MIN_OUTLINE * whole && covered >= MIN_COVERAGE * whole && highest.is_finite()).then_some(highest)
    }
}

/// Whether the support is part of furniture with a bounding box. Such furniture blocks no place on the support.
pub fn holds(bounds: &Aabb, support: &Support) -> bool {
    let center = support.center() - Vector3::z() * 1e-4;
    (0..3).all(|axis| (bounds.min[axis]..=bounds.max[axis]).contains(&center[axis]))
}
