//! Meshes as vertex arrays, each kept once, however many bodies and materials use it.

use super::document::{Attributes, Index};
use super::glb::Glb;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::geometry::{Point3, Vector3};
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

/// What a body's materials look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wants {
    /// Texture coordinates.
    pub uvs: bool,
    /// Tangents, for normal maps.
    pub tangents: bool,
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
    /// The arrays of a mesh, written when they are first asked for.
    pub fn get(&mut self, glb: &mut Glb, mesh: &Arc<Mesh>, laid: Laid, wants: Wants) -> Geometry {
        let content = self.digest(mesh);
        let key = match laid {
            Laid::Own => Hasher::new("own"),
            // Without textures it does not matter how they are laid.
            Laid::Over { .. } if !wants.uvs => Hasher::new("over"),
            Laid::Over { mapping: TextureMapping::Uv(UvTransform { scale, rotation, offset }), .. } => {
                Hasher::new("uv").floats([scale[0], scale[1], rotation, offset[0], offset[1]].into_iter())
            }
            Laid::Over { mapping: TextureMapping::Box { rotation, offset }, tile_m } => {
                Hasher::new("box").floats([rotation, offset[0], offset[1], tile_m].into_iter())
            }
        };
        let key = key.digest(content).bytes(&[wants.uvs.into(), wants.tangents.into()]).finish();
        if let Some(geometry) = self.geometries.get(&key) {
            return geometry.clone();
        }
        let by_slot = matches!(laid, Laid::Own);
        let split = match laid {
            Laid::Over { mapping: TextureMapping::Box { rotation, offset }, tile_m } if wants.uvs => {
                Some(Arrays::boxed(mesh, rotation, offset, tile_m))
            }
            _ if wants.tangents => Some(Arrays::own(mesh, texcoords(mesh, laid, wants.uvs), by_slot)),
            _ => None,
        };
        let (attributes, parts) = match split {
            Some(arrays) => arrays.write(glb, wants.tangents),
            None => {
                let mut attributes = self.arrays(glb, mesh, content);
                let uvs = texcoords(mesh, laid, wants.uvs);
                attributes.texcoord = (!uvs.is_empty()).then(|| glb.vectors(&uvs, false));
                (attributes, self.parts(glb, mesh, content, by_slot))
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
                color: (!data.colors.is_empty()).then(|| {
                    let colors: Vec<_> = data.colors.iter().map(|&c| color(c)).collect();
                    glb.vectors(&colors, false)
                }),
                ..Attributes::default()
            }
        };
        self.arrays.entry(content).or_insert_with(write).clone()
    }

    /// Indices of all triangles, parted by material slots or not.
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

/// Slot of every triangle, or all zero.
fn slots(mesh: &Mesh, by_slot: bool) -> Vec<usize> {
    (0..mesh.data().triangles.len()).map(|t| if by_slot { mesh.slot(t) } else { 0 }).collect()
}

fn write_parts(glb: &mut Glb, triangles: &[[u32; 3]], slots: &[usize], vertices: usize) -> Vec<(usize, Index)> {
    let mut parts: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
    for (&triangle, &slot) in triangles.iter().zip(slots) {
        parts.entry(slot).or_default().push(triangle);
    }
    parts.iter().map(|(&slot, part)| (slot, glb.indices(part, vertices))).collect()
}

/// The mesh's own texture coordinates, v downwards, moved if they are to be. A texture on a mesh without any shows one
/// texel.
fn texcoords(mesh: &Mesh, laid: Laid, wanted: bool) -> Vec<[f32; 2]> {
    let data = mesh.data();
    match laid {
        _ if data.uvs.is_empty() && wanted => vec![v_down([0.0; 2]); data.positions.len()],
        Laid::Over { mapping: TextureMapping::Uv(transform), .. } if wanted => {
            data.uvs.iter().map(|&uv| v_down(apply(&transform, uv))).collect()
        }
        _ => data.uvs.iter().map(|&uv| v_down(uv)).collect(),
    }
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

/// Arrays of a mesh that is not written as it is: vertices are doubled where faces do not agree on them.
struct Arrays {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    slots: Vec<usize>,
}

impl Arrays {
    /// The mesh with the texture coordinates given.
    fn own(mesh: &Mesh, uvs: Vec<[f32; 2]>, by_slot: bool) -> Self {
        let data = mesh.data();
        Self {
            positions: data.positions.clone(),
            normals: data.normals.iter().map(|&n| unit(n)).collect(),
            uvs,
            colors: data.colors.iter().map(|&c| color(c)).collect(),
            triangles: data.triangles.clone(),
            slots: slots(mesh, by_slot),
        }
    }

    /// The mesh with texture coordinates by the body's axes.
    fn boxed(mesh: &Mesh, rotation: f32, offset: [f32; 2], tile_m: f32) -> Self {
        let tile = if tile_m > 1e-6 && tile_m.is_finite() { f64::from(tile_m) } else { 1.0 };
        let laid = UvTransform { scale: [1.0; 2], rotation, offset };
        let sides: Vec<usize> = (0..mesh.data().triangles.len()).map(|t| box_axes(face(mesh.corners(t))).0).collect();
        let (mut arrays, old) = Self::own(mesh, Vec::new(), false).split(&sides, 6);
        // All faces at a vertex look to one side now.
        arrays.uvs = vec![[0.0; 2]; arrays.positions.len()];
        for (t, triangle) in arrays.triangles.iter().enumerate() {
            let (_, along_u, along_v) = box_axes(face(mesh.corners(t)));
            for &i in triangle {
                let p = Vector3::from(mesh.data().positions[old[i as usize]].map(f64::from));
                let uv = [along_u, along_v].map(|axis| (p.dot(&axis) / tile) as f32);
                arrays.uvs[i as usize] = v_down(apply(&laid, uv));
            }
        }
        arrays
    }

    /// Doubles vertices whose faces are of several classes; also gives the old number of every new vertex.
    fn split(self, class: &[usize], classes: usize) -> (Self, Vec<usize>) {
        let mut old = Vec::with_capacity(self.positions.len());
        let mut numbers = vec![u32::MAX; self.positions.len() * classes];
        let mut renumber = |(triangle, class): (&[u32; 3], &usize)| {
            triangle.map(|i| {
                let number = &mut numbers[i as usize * classes + class];
                if *number == u32::MAX {
                    *number = old.len() as u32;
                    old.push(i as usize);
                }
                *number
            })
        };
        let triangles = self.triangles.iter().zip(class).map(&mut renumber).collect();
        fn pick<T: Copy>(items: &[T], old: &[usize]) -> Vec<T> {
            old.iter().filter_map(|&i| items.get(i).copied()).collect()
        }
        let arrays = Self {
            positions: pick(&self.positions, &old),
            normals: pick(&self.normals, &old),
            uvs: pick(&self.uvs, &old),
            colors: pick(&self.colors, &old),
            triangles,
            slots: self.slots,
        };
        (arrays, old)
    }

    /// Corners of a triangle.
    fn corners(&self, triangle: [u32; 3]) -> [Point3<f64>; 3] {
        triangle.map(|i| Point3::from(self.positions[i as usize].map(f64::from)))
    }

    /// Flat faces with normals of their own: three vertices each.
    fn flat(self) -> Self {
        let each: Vec<usize> = self.triangles.as_flattened().iter().map(|&i| i as usize).collect();
        let normals = self.triangles.iter().flat_map(|&t| [unit(face(self.corners(t)).map(|x| x as f32).into()); 3]);
        Self {
            normals: normals.collect(),
            positions: each.iter().map(|&i| self.positions[i]).collect(),
            uvs: each.iter().filter_map(|&i| self.uvs.get(i).copied()).collect(),
            colors: each.iter().filter_map(|&i| self.colors.get(i).copied()).collect(),
            triangles: (0..self.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            slots: self.slots,
        }
    }

    /// Tangents `[x, y, z, w]` along u: the faces' ones by area, at right angles to the normal; the bitangent
    /// `w · normal × tangent` goes up the picture. Vertices are doubled where mirrored faces meet others.
    fn with_tangents(self) -> (Self, Vec<[f32; 4]>) {
        let smooth = if self.normals.is_empty() { self.flat() } else { self };
        let slope = |arrays: &Self, triangle: [u32; 3]| {
            let [a, b, c] = arrays.corners(triangle);
            let [p, q, r] = triangle.map(|i| arrays.uvs[i as usize].map(f64::from));
            let ([du1, dv1], [du2, dv2]) = ([q[0] - p[0], p[1] - q[1]], [r[0] - p[0], p[1] - r[1]]);
            let determinant = du1 * dv2 - du2 * dv1;
            let along = ((b - a) * dv2 - (c - a) * dv1) * determinant.signum();
            let weight = face([a, b, c]).norm();
            (determinant, along.try_normalize(0.0).unwrap_or_default() * weight)
        };
        let mirrored: Vec<usize> = smooth.triangles.iter().map(|&t| usize::from(slope(&smooth, t).0 < 0.0)).collect();
        let (split, _) = smooth.split(&mirrored, 2);
        let mut sums = vec![(Vector3::zeros(), 1.0); split.positions.len()];
        for (&triangle, &mirrored) in split.triangles.iter().zip(&mirrored) {
            let (_, along) = slope(&split, triangle);
            for i in triangle {
                let (sum, hand) = &mut sums[i as usize];
                *sum += along;
                *hand = if mirrored == 1 { -1.0 } else { 1.0 };
            }
        }
        let tangents = sums.iter().zip(&split.normals).map(|((along, hand), normal)| {
            let n = Vector3::from(normal.map(f64::from));
            let level = |v: Vector3<f64>| (v - n * n.dot(&v)).try_normalize(1e-12);
            let t = level(*along).or_else(|| level(Vector3::x())).or_else(|| level(Vector3::y())).unwrap_or_default();
            [t.x as f32, t.y as f32, t.z as f32, *hand]
        });
        let tangents = tangents.collect();
        (split, tangents)
    }

    fn write(self, glb: &mut Glb, tangents: bool) -> (Attributes, Vec<(usize, Index)>) {
        let (arrays, tangents) = if tangents { self.with_tangents() } else { (self, Vec::new()) };
        let vectors = |glb: &mut Glb, vectors: &[[f32; 3]]| (!vectors.is_empty()).then(|| glb.vectors(vectors, false));
        let attributes = Attributes {
            position: glb.vectors(&arrays.positions, true),
            normal: vectors(glb, &arrays.normals),
            tangent: (!tangents.is_empty()).then(|| glb.vectors(&tangents, false)),
            texcoord: Some(glb.vectors(&arrays.uvs, false)),
            color: vectors(glb, &arrays.colors),
        };
        (attributes, write_parts(glb, &arrays.triangles, &arrays.slots, arrays.positions.len()))
    }
}

/// Normal of a triangle, twice as long as its area.
fn face([a, b, c]: [Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
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
        let boxed = Arrays::boxed(&mesh, std::f32::consts::FRAC_PI_2, [0.125, 0.0], 0.25);
        // Four of the top face, three of the one that looks along -y.
        assert_eq!(boxed.positions.len(), 7);
        // (0.5, 0.25) m are (2, 1) tiles; a quarter turn makes (-1, 2), shifted by an eighth; v downwards.
        let at = boxed.triangles[0][2] as usize;
        assert_eq!(boxed.positions[at], [0.5, 0.25, 0.0]);
        let [u, v] = boxed.uvs[at];
        assert!((u + 0.875).abs() < 1e-6 && (v + 1.0).abs() < 1e-6, "{u} {v}");
    }

    #[test]
    fn tangents_go_along_the_picture_and_mirrors_are_told() {
        // Two triangles of a square; the second shows the picture mirrored, sharing two vertices and their coordinates.
        let data = MeshData {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            uvs: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            ..Default::default()
        };
        let normals = vec![[0.0, 0.0, 1.0]; 4];
        for data in [data.clone(), MeshData { normals, ..data }] {
            let flat = data.normals.is_empty();
            let mesh = Mesh::new(data).expect("sound");
            let uvs = texcoords(&mesh, Laid::Own, true);
            let (arrays, tangents) = Arrays::own(&mesh, uvs, true).with_tangents();
            // Both middle vertices are doubled either way.
            assert_eq!((arrays.positions.len(), flat), (6, flat));
            for &i in &arrays.triangles[0] {
                assert_eq!(tangents[i as usize], [1.0, 0.0, 0.0, 1.0]);
            }
            for &i in &arrays.triangles[1] {
                // From (1, 1) to (1, 0) u grows: along -y; v grows from there to (0, 1): along -x.
                assert_eq!(tangents[i as usize], [0.0, -1.0, 0.0, -1.0]);
            }
        }
    }
}
