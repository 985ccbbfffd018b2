//! Bounding boxes of placed meshes.

use syntable_model::geometry::{Aabb, Point3, UnitQuaternion};
use syntable_model::scene::Mesh;

/// Axis-aligned bounding box of the vertices of a rotated mesh.
pub fn rotated_bounds(mesh: &Mesh, rotation: &UnitQuaternion<f64>) -> Aabb {
    if rotation.angle() == 0.0 {
        return mesh.bounds();
    }
    let data = mesh.data();
    Aabb::of(data.triangles.iter().flatten().map(|&index| {
        let [x, y, z] = data.positions[index as usize].map(f64::from);
        rotation * Point3::new(x, y, z)
    }))
}
