//! Triangle meshes.

use crate::error::{Error, Result};
use crate::geometry::{Aabb, Point3, Vector3};

/// The arrays of a mesh, before they are checked.
#[derive(Debug, Clone, Default)]
pub struct MeshData {
    /// Vertex positions `[V]`, meters, body frame.
    pub positions: Vec<[f32; 3]>,
    /// Shading normals `[V]`, unit length, or empty: then faces are flat.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates `[V]`, v upwards (row 0 of an image is at v = 1), or empty.
    pub uvs: Vec<[f32; 2]>,
    /// Vertex colors `[V]`, linear Rec. 709, multiplied into the base color, or empty.
    pub colors: Vec<[f32; 3]>,
    /// Vertex indices of every triangle `[T]`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Material slot of every triangle `[T]`, or empty: then all use slot 0.
    pub slots: Vec<u16>,
}

/// A triangle mesh that is sound: finite, indices in range, at least one triangle, arrays of equal length.
#[derive(Debug, Clone)]
pub struct Mesh {
    data: MeshData,
    bounds: Aabb,
}

impl Mesh {
    /// Checks the arrays. The error names the fault and its place.
    pub fn new(data: MeshData) -> Result<Self> {
        let vertices = data.positions.len();
        if data.triangles.is_empty() {
            return Err(Error::new("no faces"));
        }
        if let Some(i) = data.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(Error::new(format!("non-finite vertex {i}: {:?}", data.positions[i])));
        }
        for (name, length) in [("normals", data.normals.len()), ("uvs", data.uvs.len()), ("colors", data.colors.len())]
        {
            if length != 0 && length != vertices {
                return Err(Error::new(format!("{length} {name} for {vertices} vertices")));
            }
        }
        if !data.slots.is_empty() && data.slots.len() != data.triangles.len() {
            return Err(Error::new(format!("{} slots for {} triangles", data.slots.len(), data.triangles.len())));
        }
        if let Some(index) = data.triangles.iter().flatten().find(|&&index| index as usize >= vertices) {
            return Err(Error::new(format!("face index {index} but only {vertices} vertices")));
        }
        // Vertices that no face uses do not count towards the bounds.
        let bounds = Aabb::of(data.triangles.iter().flatten().map(|&index| {
            let [x, y, z] = data.positions[index as usize].map(f64::from);
            Point3::new(x, y, z)
        }));
        Ok(Self { data, bounds })
    }

    /// The arrays.
    pub fn data(&self) -> &MeshData {
        &self.data
    }

    /// Takes the arrays out, to change them and check them again.
    pub fn into_data(self) -> MeshData {
        self.data
    }

    /// Bounding box of the vertices in use, body frame, meters.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The three corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Point3<f64>; 3] {
        self.data.triangles[triangle].map(|index| {
            let [x, y, z] = self.data.positions[index as usize].map(f64::from);
            Point3::new(x, y, z)
        })
    }

    /// Material slot of a triangle.
    pub fn slot(&self, triangle: usize) -> usize {
        self.data.slots.get(triangle).map_or(0, |&slot| usize::from(slot))
    }

    /// Surface area, m².
    pub fn area(&self) -> f64 {
        (0..self.data.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (b - a).cross(&(c - a)).norm() / 2.0
            })
            .sum()
    }

    /// Enclosed volume by the divergence theorem, m³; negative if the faces point inwards, meaningless if open.
    pub fn signed_volume(&self) -> f64 {
        let origin = self.bounds.center();
        (0..self.data.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// The mesh moved and scaled: `p ↦ (p + offset) · factor`. Normals, uvs and faces stay.
    pub fn transformed(&self, offset: Vector3<f64>, factor: f64) -> Result<Self> {
        let mut data = self.data.clone();
        for p in &mut data.positions {
            *p = std::array::from_fn(|i| ((f64::from(p[i]) + offset[i]) * factor) as f32);
        }
        Self::new(data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> MeshData {
        MeshData {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [9.0, 9.0, 9.0]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
            ..Default::default()
        }
    }

    #[test]
    fn measures_and_ignores_unused_vertices() {
        let mesh = Mesh::new(tetrahedron()).expect("sound");
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-7);
        assert!((mesh.area() - (1.5 + 0.75_f64.sqrt())).abs() < 1e-6);
        assert_eq!(mesh.bounds().max, Point3::new(1.0, 1.0, 1.0));
        let moved = mesh.transformed(Vector3::new(1.0, 0.0, 0.0), 2.0).expect("sound");
        assert_eq!(moved.bounds().min, Point3::new(2.0, 0.0, 0.0));
        assert!((moved.signed_volume() - 8.0 / 6.0).abs() < 1e-6);
    }

    #[test]
    fn unsound_arrays_are_refused() {
        let check = |change: fn(&mut MeshData), want: &str| {
            let mut data = tetrahedron();
            change(&mut data);
            let error = Mesh::new(data).expect_err(want).to_string();
            assert!(error.contains(want), "{error}");
        };
        check(|m| m.positions[1][2] = f32::NAN, "non-finite vertex 1");
        check(|m| m.triangles[0][0] = 5, "face index 5 but only 5 vertices");
        check(|m| m.triangles.clear(), "no faces");
        check(|m| m.uvs.push([0.0; 2]), "1 uvs for 5 vertices");
    }
}
