//! Meshes as vertex arrays. Each mesh is written once, for all bodies and materials that use it.

use super::arrays::MeshArrays;
use super::document::{GltfAttributes, Index};
use super::glb::Glb;
use super::vertices::{apply, color, slots, unit, v_down, write_parts};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::scene::{Mesh, TextureMapping, UvTransform};

/// Arrays of a mesh and the triangles of every material slot.
#[derive(Debug, Clone)]
pub struct Geometry {
    pub attributes: GltfAttributes,
    /// Slot and indices; one slot if a material covers the whole mesh.
    pub parts: Vec<(usize, Index)>,
    /// Digest of the mesh, its texture mapping and its needs.
    pub digest: Digest,
}

/// Source of a body's texture coordinates.
#[derive(Debug, Clone, Copy)]
pub enum UvSource {
    /// The mesh, with its own material slots.
    Mesh,
    /// A mapping of one material that covers the whole mesh; `tile_m` is the size of its tiles.
    Override { mapping: TextureMapping, tile_m: f32 },
}

/// Vertex attributes that a body's materials need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Texture coordinates.
    pub uvs: bool,
    /// Tangents, for normal maps.
    pub tangents: bool,
}

/// All meshes of a file.
#[derive(Debug, Clone, Default)]
pub struct Geometries {
    /// Digests by address. The meshes are kept alive so that no address is reused.
    known: BTreeMap<usize, (Arc<Mesh>, Digest)>,
    geometries: BTreeMap<Digest, Geometry>,
    arrays: BTreeMap<Digest, GltfAttributes>,
    /// Indices by mesh, either split by material slot or not.
    parts: BTreeMap<(Digest, bool), Vec<(usize, Index)>>,
}

impl Geometries {
    /// The arrays of a mesh, written on first use.
    pub fn get(&mut self, glb: &mut Glb, mesh: &Arc<Mesh>, source: UvSource, needs: Needs) -> Geometry {
        let content = self.digest(mesh);
        let key = match source {
            UvSource::Mesh => Hasher::new("own"),
            // Without textures, the mapping does not matter.
            UvSource::Override { .. } if !needs.uvs => Hasher::new("over"),
            UvSource::Override { mapping: TextureMapping::Uv(UvTransform { scale, rotation, offset }), .. } => {
                Hasher::new("uv").floats([scale[0], scale[1], rotation, offset[0], offset[1]].into_iter())
            }
            UvSource::Override { mapping: TextureMapping::Box { rotation, offset }, tile_m } => {
                Hasher::new("box").floats([rotation, offset[0], offset[1], tile_m].into_iter())
            }
        };
        let key = key.digest(content).bytes(&[needs.uvs.into(), needs.tangents.into()]).finish();
        if let Some(geometry) = self.geometries.get(&key) {
            return geometry.clone();
        }
        let by_slot = matches!(source, UvSource::Mesh);
        let split = match source {
            UvSource::Override { mapping: TextureMapping::Box { rotation, offset }, tile_m } if needs.uvs => {
                Some(MeshArrays::boxed(mesh, rotation, offset, tile_m))
            }
            _ if needs.tangents => Some(MeshArrays::own(mesh, texcoords(mesh, source, needs.uvs), by_slot)),
            _ => None,
        };
        let (attributes, parts) = match split {
            Some(arrays) => arrays.write(glb, needs.tangents),
            None => {
                let mut attributes = self.arrays(glb, mesh, content);
                let uvs = texcoords(mesh, source, needs.uvs);
                attributes.texcoord = (!uvs.is_empty()).then(|| glb.vectors(&uvs, false));
                (attributes, self.parts(glb, mesh, content, by_slot))
            }
        };
        let geometry = Geometry { attributes, parts, digest: key };
        self.geometries.insert(key, geometry.clone());
        geometry
    }

    /// Positions, normals and colors, shared by all texture mappings.
    fn arrays(&mut self, glb: &mut Glb, mesh: &Mesh, content: Digest) -> GltfAttributes {
        let write = || {
            let data = mesh.data();
            GltfAttributes {
                position: glb.vectors(&data.positions, true),
                normal: (!data.normals.is_empty()).then(|| {
                    let normals: Vec<_> = data.normals.iter().map(|&n| unit(n)).collect();
                    glb.vectors(&normals, false)
                }),
                color: (!data.colors.is_empty()).then(|| {
                    let colors: Vec<_> = data.colors.iter().map(|&c| color(c)).collect();
                    glb.vectors(&colors, false)
                }),
                ..GltfAttributes::default()
            }
        };
        self.arrays.entry(content).or_insert_with(write).clone()
    }

    /// Indices of all triangles, either split by material slot or not.
    fn parts(&mut self, glb: &mut Glb, mesh: &Mesh, content: Digest, by_slot: bool) -> Vec<(usize, Index)> {
        let (data, slots) = (mesh.data(), slots(mesh, by_slot));
        let write = || write_parts(glb, &data.triangles, &slots, data.positions.len());
        self.parts.entry((content, by_slot)).or_insert_with(write).clone()
    }

    fn digest(&mut self, mesh: &Arc<Mesh>) -> Digest {
        let write = || {
            let data = mesh.data();
            let numbers = |numbers: &[u32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
            let slots: Vec<u32> = data.slots.iter().map(|&slot| slot.into()).collect();
            let digest = Hasher::new("mesh")
                .floats(data.positions.as_flattened().iter().copied())
                .floats(data.normals.as_flattened().iter().copied())
                .floats(data.uvs.as_flattened().iter().copied())
                .floats(data.colors.as_flattened().iter().copied())
                .bytes(&numbers(data.triangles.as_flattened()))
                .bytes(&numbers(&slots))
                .finish();
            (mesh.clone(), digest)
        };
        self.known.entry(Arc::as_ptr(mesh).addr()).or_insert_with(write).1
    }
}

/// The mesh's own texture coordinates, transformed, with v pointing down. A texture on a mesh without coordinates shows
/// one texel.
pub(super) fn texcoords(mesh: &Mesh, source: UvSource, wanted: bool) -> Vec<[f32; 2]> {
    let data = mesh.data();
    match source {
        _ if data.uvs.is_empty() && wanted => vec![v_down([0.0; 2]); data.positions.len()],
        UvSource::Override { mapping: TextureMapping::Uv(transform), .. } if wanted => {
            data.uvs.iter().map(|&uv| v_down(apply(&transform, uv))).collect()
        }
        _ => data.uvs.iter().map(|&uv| v_down(uv)).collect(),
    }
}
