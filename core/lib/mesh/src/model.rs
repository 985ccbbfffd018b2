//! The intermediate model that readers produce.

use crate::limits::Budget;
use crate::placement::Placement;
use syntable_model::error::{Error, Result};
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

    /// Moves the mesh. A mirrored mesh keeps its outside.
    pub fn placed(mut self, placement: &Placement) -> Self {
        for p in &mut self.mesh.positions {
            *p = placement.point(*p);
        }
        for n in &mut self.mesh.normals {
            *n = placement.normal(*n);
        }
        if placement.determinant() < 0.0 {
            self.mesh.triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
        }
        self
    }

    /// Adds the mesh and the materials of another model. `budget` limits the triangles of both.
    pub fn with(mut self, other: Self, budget: &Budget) -> Result<Self> {
        let (mesh, added) = (&mut self.mesh, other.mesh);
        let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
        let total = vertices + added.positions.len();
        budget.triangles(triangles + added.triangles.len())?;
        budget.vertices(total)?;
        let (Ok(base), Ok(slots)) = (u32::try_from(vertices), u16::try_from(self.materials.len())) else {
            return Err(Error::new("more than 65535 materials in one object"));
        };
        u16::try_from(self.materials.len() + other.materials.len())
            .map_err(|_| Error::new("more than 65535 materials in one object"))?;
        // The repair computes missing normals, which are zero, from the faces.
        extend(&mut mesh.normals, added.normals, vertices, total, [0.0; 3]);
        extend(&mut mesh.uvs, added.uvs, vertices, total, [0.0; 2]);
        extend(&mut mesh.colors, added.colors, vertices, total, [1.0; 3]);
        mesh.slots.resize(triangles, 0);
        mesh.slots.extend(added.slots.iter().map(|slot| slot.saturating_add(slots)));
        mesh.positions.extend(added.positions);
        mesh.triangles.extend(added.triangles.iter().map(|corners| corners.map(|corner| corner.saturating_add(base))));
        mesh.slots.resize(mesh.triangles.len(), slots);
        self.materials.extend(other.materials);
        Ok(self)
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

/// Appends an array by vertex. Vertices without a value get `missing`, unless no vertex has one.
fn extend<T: Clone>(array: &mut Vec<T>, added: Vec<T>, vertices: usize, total: usize, missing: T) {
    if !array.is_empty() || !added.is_empty() {
        array.resize(vertices, missing.clone());
        array.extend(added);
        array.resize(total, missing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::default_material;
    use nalgebra::{Matrix4, Vector3};
    use syntable_model::stage::AssetLimits;

    fn triangle(x: f32) -> Model {
        let positions = vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
        Model {
            mesh: MeshData { positions, triangles: vec![[0, 1, 2]], ..MeshData::default() },
            materials: vec![default_material(false)],
        }
    }

    #[test]
    fn joined_models_keep_their_arrays_apart() {
        let mut first = triangle(0.0);
        first.mesh.uvs = vec![[0.5; 2]; 3];
        first.materials.push(default_material(true));
        first.mesh.slots = vec![1];
        let mut second = triangle(5.0);
        second.mesh.normals = vec![[0.0, 0.0, 1.0]; 3];
        let joined = first.with(second, &Budget::default()).expect("small");
        let mesh = &joined.mesh;
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(mesh.positions[mesh.triangles[1][1] as usize], [6.0, 0.0, 0.0]);
        assert_eq!((mesh.slots.as_slice(), joined.materials.len()), (&[1, 2][..], 3));
        assert_eq!((mesh.uvs[2], mesh.uvs[3]), ([0.5; 2], [0.0; 2]));
        assert_eq!((mesh.normals[2], mesh.normals[5]), ([0.0; 3], [0.0, 0.0, 1.0]));
        assert!(mesh.colors.is_empty());
        let budget = Budget::new(AssetLimits { triangles: 1, ..AssetLimits::default() });
        let error = triangle(0.0).with(triangle(1.0), &budget).expect_err("two triangles").to_string();
        assert!(error.contains("limit of 1 triangles"), "{error}");
    }

    #[test]
    fn mirrored_meshes_keep_their_outside() {
        let mirror = Matrix4::new_nonuniform_scaling(&Vector3::new(-2.0, 1.0, 1.0));
        let Model { mesh, .. } = triangle(0.0).placed(&Placement::new(mirror));
        assert_eq!(mesh.positions, [[0.0; 3], [-2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        // Counter-clockwise seen from +z, as before.
        let [a, b, c] = mesh.triangles[0].map(|i| Vector3::from(mesh.positions[i as usize]));
        assert!((b - a).cross(&(c - a)).z > 0.0);
    }
}
