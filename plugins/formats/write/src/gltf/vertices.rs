//! Vertex values in glTF's form, and the parts of a mesh by slot.

use super::document::Index;
use super::glb::Glb;
use std::collections::BTreeMap;
use syntable_model::geometry::Vector3;
use syntable_model::scene::{Mesh, UvTransform};

/// Slot of every triangle; all zero without `by_slot`.
pub(super) fn slots(mesh: &Mesh, by_slot: bool) -> Vec<usize> {
    (0..mesh.data().triangles.len()).map(|t| if by_slot { mesh.slot(t) } else { 0 }).collect()
}

/// Writes the triangles of each slot. Returns the slots with their indices.
pub(super) fn write_parts(
    glb: &mut Glb,
    triangles: &[[u32; 3]],
    slots: &[usize],
    vertices: usize,
) -> Vec<(usize, Index)> {
    let mut parts: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
    for (&triangle, &slot) in triangles.iter().zip(slots) {
        parts.entry(slot).or_default().push(triangle);
    }
    parts.iter().map(|(&slot, part)| (slot, glb.indices(part, vertices))).collect()
}

/// Texture coordinates with v measured from the top of the image, as in glTF.
pub(super) fn v_down([u, v]: [f32; 2]) -> [f32; 2] {
    [u, 1.0 - v]
}

/// `rotate(uv · scale, rotation) + offset`
pub(super) fn apply(transform: &UvTransform, [u, v]: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = libm::sincos(f64::from(transform.rotation));
    let [x, y] = [u * transform.scale[0], v * transform.scale[1]].map(f64::from);
    [(cos * x - sin * y) as f32 + transform.offset[0], (sin * x + cos * y) as f32 + transform.offset[1]]
}

/// A unit vector, as the standard requires; +z if the vector has no direction.
pub(super) fn unit(normal: [f32; 3]) -> [f32; 3] {
    let normal = Vector3::from(normal.map(f64::from)).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
    normal.unwrap_or_else(Vector3::z).map(|x| x as f32).into()
}

pub(super) fn color(color: [f32; 3]) -> [f32; 3] {
    color.map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 })
}
