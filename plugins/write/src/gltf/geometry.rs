//! Meshes as vertex arrays, each kept once, however many bodies and materials use it.

use super::document::{Attributes, Index};
use super::glb::Glb;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::geometry::Vector3;
use syntable_model::scene::{Mesh, TextureMapping, UvTransform};

/// Arrays of a mesh and the triangles of every material slot.
#[derive(Debug, Clone)]
pub struct Geometry {
    pub attributes: Attributes,
    /// Slot and indices; one slot if a material covers the whole mesh.
    pub parts: Vec<(usize, Index)>,
    /// Digest of what it was made from.
    pub digest: Digest,
}

/// How a body wants its mesh.
#[derive(Debug, Clone, Copy)]
pub enum Laid {
    /// With the mesh's own slots and texture coordinates.
    Own,
    /// One material over all; `tile_m` is the size of its tiles.
    Over { mapping: TextureMapping, tile_m: f32 },
}

/// All meshes of a file.
#[derive(Debug, Clone, Default)]
pub struct Geometries {
    /// Digests by address; the meshes are held, so that no address comes twice.
    known: BTreeMap<usize, (Arc<Mesh>, Digest)>,
    geometries: BTreeMap<Digest, Geometry>,
    arrays: BTreeMap<Digest, Attributes>,
    /// Indices by mesh and whether they are parted by slots.
    parts: BTreeMap<(Digest, bool), Vec<(usize, Index)>>,
}

impl Geometries {
    /// The arrays of a mesh, written when they are first asked for. `textured` says whether a material looks at the
    /// texture coordinates.
    pub fn get(&mut self, glb: &mut Glb, mesh: &Arc<Mesh>, laid: Laid, textured: bool) -> Geometry {
        let content = self.digest(mesh);
        let key = match laid {
            Laid::Own => Hasher::new("own").digest(content).bytes(&[textured.into()]),
            // Without textures it does not matter how they are laid.
            Laid::Over { .. } if !textured => Hasher::new("over").digest(content),
            Laid::Over { mapping: TextureMapping::Uv(UvTransform { scale, rotation, offset }), .. } => {
                let numbers = [scale[0], scale[1], rotation, offset[0], offset[1]];
                Hasher::new("uv").digest(content).floats(numbers.into_iter())
            }
            Laid::Over { mapping: TextureMapping::Box { rotation, offset }, tile_m } => {
                let numbers = [rotation, offset[0], offset[1], tile_m];
                Hasher::new("box").digest(content).floats(numbers.into_iter())
            }
        }
        .finish();
        if let Some(geometry) = self.geometries.get(&key) {
            return geometry.clone();
        }
        let (attributes, parts) = match laid {
            Laid::Over { mapping: TextureMapping::Box { rotation, offset }, tile_m } if textured => {
                let boxed = Boxed::new(mesh, rotation, offset, tile_m);
                let attributes = Attributes {
                    position: glb.vectors(&boxed.positions, true),
                    normal: (!boxed.normals.is_empty()).then(|| glb.vectors(&boxed.normals, false)),
                    texcoord: Some(glb.vectors(&boxed.uvs, false)),
                    color: (!boxed.colors.is_empty()).then(|| glb.vectors(&boxed.colors, false)),
                };
                (attributes, vec![(0, glb.indices(&boxed.triangles, boxed.positions.len()))])
            }
            _ => {
                let mut attributes = self.arrays(glb, mesh, content);
                attributes.texcoord = texcoords(glb, mesh, laid, textured);
                (attributes, self.parts(glb, mesh, content, matches!(laid, Laid::Own)))
            }
        };
        let geometry = Geometry { attributes, parts, digest: key };
        self.geometries.insert(key, geometry.clone());
        geometry
    }

    /// Positions, normals and colours, shared by all ways to lay textures.
    fn arrays(&mut self, glb: &mut Glb, mesh: &Mesh, content: Digest) -> Attributes {
        let write = || {
            let data = mesh.data();
            Attributes {
                position: glb.vectors(&data.positions, true),
                normal: (!data.normals.is_empty()).then(|| {
                    let normals: Vec<_> = data.normals.iter().map(|&n| unit(n)).collect();
                    glb.vectors(&normals, false)
                }),
                texcoord: None,
                color: (!data.colors.is_empty()).then(|| {
                    let colors: Vec<_> = data.colors.iter().map(|&c| color(c)).collect();
                    glb.vectors(&colors, false)
                }),
            }
        };
        self.arrays.entry(content).or_insert_with(write).clone()
    }

    /// Indices of all triangles, parted by material slots or not.
    fn parts(&mut self, glb: &mut Glb, mesh: &Mesh, content: Digest, by_slot: bool) -> Vec<(usize, Index)> {
        let write = || {
            let data = mesh.data();
            let mut triangles: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
            for (t, &triangle) in data.triangles.iter().enumerate() {
                let slot = if by_slot { mesh.slot(t) } else { 0 };
                triangles.entry(slot).or_default().push(triangle);
            }
            let indices = |(&slot, part): (&usize, &Vec<[u32; 3]>)| (slot, glb.indices(part, data.positions.len()));
            triangles.iter().map(indices).collect()
        };
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

/// The mesh's own texture coordinates, moved if they are to be. A texture on a mesh without any shows one texel.
fn texcoords(glb: &mut Glb, mesh: &Mesh, laid: Laid, textured: bool) -> Option<Index> {
    let data = mesh.data();
    let moved: Vec<[f32; 2]> = match laid {
        _ if data.uvs.is_empty() && textured => vec![v_down([0.0; 2]); data.positions.len()],
        Laid::Over { mapping: TextureMapping::Uv(transform), .. } if textured => {
            data.uvs.iter().map(|&uv| v_down(apply(&transform, uv))).collect()
        }
        _ => data.uvs.iter().map(|&uv| v_down(uv)).collect(),
    };
    (!moved.is_empty()).then(|| glb.vectors(&moved, false))
}

/// glTF counts v downwards from the top of the picture.
fn v_down([u, v]: [f32; 2]) -> [f32; 2] {
    [u, 1.0 - v]
}

/// `rotate(uv · scale, rotation) + offset`
fn apply(transform: &UvTransform, [u, v]: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = f64::from(transform.rotation).sin_cos();
    let [x, y] = [u * transform.scale[0], v * transform.scale[1]].map(f64::from);
    [(cos * x - sin * y) as f32 + transform.offset[0], (sin * x + cos * y) as f32 + transform.offset[1]]
}

/// A unit vector, as the standard demands; upwards if there is no direction.
fn unit(normal: [f32; 3]) -> [f32; 3] {
    let normal = Vector3::from(normal.map(f64::from)).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
    normal.unwrap_or_else(Vector3::z).map(|x| x as f32).into()
}

fn color(color: [f32; 3]) -> [f32; 3] {
    color.map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 })
}

/// Arrays with texture coordinates by the body's axes: where faces that look another way meet, vertices are doubled.
struct Boxed {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Boxed {
    fn new(mesh: &Mesh, rotation: f32, offset: [f32; 2], tile_m: f32) -> Self {
        let data = mesh.data();
        let tile = if tile_m > 1e-6 && tile_m.is_finite() { f64::from(tile_m) } else { 1.0 };
        let laid = UvTransform { scale: [1.0; 2], rotation, offset };
        let mut boxed = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            colors: Vec::new(),
            triangles: Vec::with_capacity(data.triangles.len()),
        };
        // New numbers of a vertex by the side that its face looks to.
        let mut numbers = vec![[u32::MAX; 6]; data.positions.len()];
        for (t, triangle) in data.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(t);
            let (side, along_u, along_v) = box_axes((b - a).cross(&(c - a)));
            boxed.triangles.push(triangle.map(|old| {
                let i = old as usize;
                let number = &mut numbers[i][side];
                if *number == u32::MAX {
                    *number = boxed.positions.len() as u32;
                    let p = Vector3::from(data.positions[i].map(f64::from));
                    let uv = [along_u, along_v].map(|axis| (p.dot(&axis) / tile) as f32);
                    boxed.positions.push(data.positions[i]);
                    boxed.uvs.push(v_down(apply(&laid, uv)));
                    boxed.normals.extend(data.normals.get(i).map(|&n| unit(n)));
                    boxed.colors.extend(data.colors.get(i).map(|&c| color(c)));
                }
                *number
            }));
        }
        boxed
    }
}

/// Which of six sides a face looks to, and the axes along u and v there, so that a picture is never mirrored seen from
/// outside.
fn box_axes(normal: Vector3<f64>) -> (usize, Vector3<f64>, Vector3<f64>) {
    let a = normal.abs();
    let (axis, up) = if a.z >= a.x && a.z >= a.y {
        (2, Vector3::y())
    } else if a.x >= a.y {
        (0, Vector3::z())
    } else {
        (1, Vector3::z())
    };
    let outwards = Vector3::ith(axis, 1.0_f64.copysign(normal[axis]));
    (2 * axis + usize::from(normal[axis].is_sign_negative()), up.cross(&outwards), up)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::MeshData;

    #[test]
    fn a_picture_on_a_box_is_upright_and_not_mirrored() {
        // Seen from outside, u goes right and v up: on the sides v is z.
        for (normal, u, v) in [
            ([0.0, 0.1, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            ([0.0, 0.1, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            ([1.0, 0.2, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ([-1.0, 0.2, 0.1], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.1, 1.0, 0.2], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.1, -1.0, 0.2], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ] {
            let (_, along_u, along_v) = box_axes(Vector3::from(normal));
            assert_eq!((along_u, along_v), (Vector3::from(u), Vector3::from(v)), "{normal:?}");
        }
    }

    #[test]
    fn vertices_are_doubled_only_where_sides_meet() {
        let data = MeshData {
            positions: vec![[0.0; 3], [0.5, 0.0, 0.0], [0.5, 0.25, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.5]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 1, 4]],
            ..Default::default()
        };
        let mesh = Mesh::new(data).expect("sound");
        let boxed = Boxed::new(&mesh, std::f32::consts::FRAC_PI_2, [0.125, 0.0], 0.25);
        // Four of the top face, three of the one that looks along -y.
        assert_eq!(boxed.positions.len(), 7);
        // (0.5, 0.25) m are (2, 1) tiles; a quarter turn makes (-1, 2), shifted by an eighth; v downwards.
        let at = boxed.triangles[0][2] as usize;
        assert_eq!(boxed.positions[at], [0.5, 0.25, 0.0]);
        let [u, v] = boxed.uvs[at];
        assert!((u + 0.875).abs() < 1e-6 && (v + 1.0).abs() < 1e-6, "{u} {v}");
    }
}
