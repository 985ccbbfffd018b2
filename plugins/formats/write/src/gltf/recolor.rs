//! Vertex colors of bodies whose colors a placer changed.

use super::vertices::color;
use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::scene::{Material, Mesh, MeshData};

/// The mesh of a body with the vertex colors that it shows. A renderer changes the product of factor, texture and vertex color, and
/// glTF multiplies after the change. Faces without a texture therefore have the whole product as vertex color, and their material
/// has a white factor. Vertices between faces of several materials are duplicated. Where a texture varies the base color, the texture
/// has the change instead.
pub fn vertex_colored(mesh: &Arc<Mesh>, materials: &[Arc<Material>]) -> Result<Arc<Mesh>> {
    let data = mesh.data();
    if data.colors.is_empty() || !materials.iter().any(|material| is_in_vertex_colors(material)) {
        return Ok(Arc::clone(mesh));
    }
    let last = materials.len() - 1;
    let corners_of = |t: usize| data.triangles[t].map(|vertex| (vertex, mesh.slot(t).min(last)));
    let faces = 0..data.triangles.len();
    let corners = Vec::from_iter(BTreeSet::from_iter(faces.clone().flat_map(corners_of)));
    let number = |corner| corners.partition_point(|other| *other < corner) as u32;
    let shown = |&(vertex, slot): &(u32, usize)| {
        let (own, material) = (color(data.colors[vertex as usize]), &materials[slot]);
        match &material.recolor {
            Some(matrix) if is_in_vertex_colors(material) => {
                let factor = color(material.base_color.factor);
                matrix.apply([0, 1, 2].map(|channel| factor[channel] * own[channel]))
            }
            _ => own,
        }
    };
    fn pick<T: Copy>(items: &[T], corners: &[(u32, usize)]) -> Vec<T> {
        corners.iter().filter_map(|&(vertex, _)| items.get(vertex as usize).copied()).collect()
    }
    Mesh::new(MeshData {
        positions: pick(&data.positions, &corners),
        normals: pick(&data.normals, &corners),
        uvs: pick(&data.uvs, &corners),
        colors: corners.iter().map(shown).collect(),
        triangles: faces.map(|t| corners_of(t).map(number)).collect(),
        slots: data.slots.clone(),
    })
    .map(Arc::new)
}

/// Whether the vertex colors have the whole base color of a material. Its color is changed per vertex or per texel, so without a
/// texture, per vertex.
pub fn is_in_vertex_colors(material: &Material) -> bool {
    material.recolor.is_some() && material.base_color.texture.is_none()
}
