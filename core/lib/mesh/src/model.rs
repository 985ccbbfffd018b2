//! The intermediate model that readers produce.

use syntable_model::scene::{Material, MeshData};

/// A mesh and its materials as a file states them: not repaired, weighed or checked.
#[derive(Debug, Clone)]
pub struct Model {
    /// The mesh, z up, in the file's unit.
    pub mesh: MeshData,
    /// Materials by slot; at least one.
    pub materials: Vec<Material>,
}

impl Model {
    /// Multiplies all positions by a factor, such as meters per unit of the file.
    pub fn scaled(mut self, factor: f64) -> Self {
        for p in &mut self.mesh.positions {
            *p = p.map(|x| (f64::from(x) * factor) as f32);
        }
        self
    }

    /// Converts y up to z up: (x, y, z) becomes (x, -z, y).
    pub fn y_up_to_z_up(mut self) -> Self {
        for p in self.mesh.positions.iter_mut().chain(&mut self.mesh.normals) {
            *p = [p[0], -p[2], p[1]];
        }
        self
    }

    /// The longest side of the bounding box, in the file's unit; negative infinity without vertices.
    pub fn extent(&self) -> f64 {
        let side = |axis: usize| {
            let values = || self.mesh.positions.iter().map(|p| f64::from(p[axis]));
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        (0..3).map(side).fold(f64::NEG_INFINITY, f64::max)
    }
}
