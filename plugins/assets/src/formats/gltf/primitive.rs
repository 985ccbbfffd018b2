//! Primitives: the arrays of one mesh part.

use super::accessor::{indices, vectors, width};
use super::buffers::Buffers;
use super::materials::Materials;
use gltf::json::Root;
use gltf::json::mesh::{Mode, Primitive as JsonPrimitive, Semantic};
use gltf::json::validation::Checked;
use syntable_mesh::limits::check_triangles;
use syntable_model::error::{Error, Result};

/// Arrays in the mesh's own frame. Empty ones are absent.
pub struct Primitive {
    /// Positions `[V]`.
    pub positions: Vec<[f32; 3]>,
    /// Normals `[V]`.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates `[V]`, v upwards.
    pub uvs: Vec<[f32; 2]>,
    /// Linear colors `[V]`.
    pub colors: Vec<[f32; 3]>,
    /// Triangles `[T]`.
    pub triangles: Vec<[u32; 3]>,
    /// Material slot.
    pub slot: u16,
}

impl Primitive {
    /// Reads a primitive; none if it has points or lines.
    pub fn read(
        document: &Root,
        buffers: &mut Buffers<'_>,
        primitive: &JsonPrimitive,
        materials: &mut Materials<'_>,
    ) -> Result<Option<Self>> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => return Ok(None),
            Checked::Invalid => return Err(Error::new("an unknown drawing mode")),
        };
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(position) = attribute(Semantic::Positions) else {
            return Err(Error::new("no vertex positions"));
        };
        let positions = vectors::<3>(document, buffers, position, "positions")?;
        if let Some((i, p)) = positions.iter().enumerate().find(|(_, p)| !p.iter().all(|x| x.is_finite())) {
            return Err(Error::new(format!("non-finite vertex {i}: {p:?}")));
        }
        let count = positions.len();
        let same = |length: usize, what: &str| match length == count {
            true => Ok(()),
            false => Err(Error::new(format!("{length} {what} for {count} vertices"))),
        };
        let normals = match attribute(Semantic::Normals) {
            Some(index) => vectors::<3>(document, buffers, index, "normals")?,
            None => Vec::new(),
        };
        let set = materials.uv_set(primitive.material)?;
        let mut uvs = match set.and_then(|set| attribute(Semantic::TexCoords(set))) {
            Some(index) => vectors::<2>(document, buffers, index, "texture coordinates")?,
            None => Vec::new(),
        };
        // glTF counts v downwards from the top of the image.
        uvs.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
        let colors: Vec<[f32; 3]> = match attribute(Semantic::Colors(0)) {
            Some(index) if width(document, index)? == 4 => {
                vectors::<4>(document, buffers, index, "colors")?.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
            }
            Some(index) => vectors::<3>(document, buffers, index, "colors")?,
            None => Vec::new(),
        };
        let colors = colors.into_iter().map(|c| c.map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 })).collect::<Vec<_>>();
        for (length, what) in [(normals.len(), "normals"), (uvs.len(), "texture coordinates"), (colors.len(), "colors")]
        {
            if length != 0 {
                same(length, what)?;
            }
        }
        let corners = match primitive.indices {
            Some(index) => indices(document, buffers, index)?,
            None => (0..count as u32).collect(),
        };
        if let Some(index) = corners.iter().find(|&&index| index as usize >= count) {
            return Err(Error::new(format!("index {index}, but there are {count} vertices")));
        }
        let triangles = assemble(mode, &corners)?;
        if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
            materials.warn("morph targets are not read; the mesh stays in its rest pose");
        }
        let slot = materials.slot(primitive.material, !uvs.is_empty(), triangles.len())?;
        Ok(Some(Self { positions, normals, uvs, colors, triangles, slot }))
    }
}

fn assemble(mode: Mode, corners: &[u32]) -> Result<Vec<[u32; 3]>> {
    if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
        return Err(Error::new(format!("{} corners are no whole number of triangles", corners.len())));
    }
    let triangles: Vec<[u32; 3]> = match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, c)| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[1], c[0], c[2]] })
            .collect(),
        Mode::TriangleFan => corners.windows(2).skip(1).map(|c| [corners[0], c[0], c[1]]).collect(),
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    };
    check_triangles(triangles.len())?;
    Ok(triangles)
}
