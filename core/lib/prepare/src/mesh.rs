//! Shading data of a mesh, grouped by triangle so that a hit reads one cache line; and tangents.

use syntable_model::scene::Mesh;
use syntable_simd::{Vec3, vec3};

/// A mesh with shading data, shared by all bodies of the same asset. Its tables are indexed by triangle.
#[derive(Debug)]
pub struct ShadingMesh {
    /// Triangles, in the order of the mesh.
    pub triangles: Vec<ShadingTriangle>,
    /// Directions of increasing u at the corners, [packed](pack_unit); empty if the mesh has no texture coordinates.
    pub tangents: Vec<[u32; 3]>,
    /// Vertex colors at the corners, 16 bits per channel; empty if the mesh has none.
    pub colors: Vec<[[u16; 3]; 3]>,
}

/// One triangle, body frame: a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct ShadingTriangle {
    /// Unit normal by the right-hand rule; zero if the triangle has no area.
    pub normal: Vec3,
    /// `normal · p` for every point p of the triangle.
    pub plane: f32,
    /// Normals at the corners, [packed](pack_unit).
    pub normals: [u32; 3],
    /// Texture coordinates at the corners.
    pub uvs: [[f32; 2]; 3],
    /// Length in (u, v) of one meter on the surface: square root of the ratio of areas.
    pub uv_per_m: f32,
    /// Material slot.
    pub slot: u16,
    /// Whether the corners' normals differ from `normal`.
    pub smooth: bool,
    /// Whether the texture is mirrored on the triangle: (u, v, normal) is left-handed.
    pub mirrored: bool,
}

const _: () = assert!(size_of::<ShadingTriangle>() == 64);

impl ShadingMesh {
    /// Gathers the triangles and computes normals and tangents.
    pub fn new(mesh: &Mesh) -> Self {
        let data = mesh.data();
        let triangles: Vec<ShadingTriangle> = (0..data.triangles.len()).map(|t| triangle(mesh, t)).collect();
        let colors = match data.colors.is_empty() {
            true => Vec::new(),
            false => data.triangles.iter().map(|t| t.map(|i| data.colors[i as usize].map(unorm16))).collect(),
        };
        Self { tangents: tangents(mesh), triangles, colors }
    }

    /// Size, bytes.
    pub fn size(&self) -> usize {
        size_of_val(&self.triangles[..]) + size_of_val(&self.tangents[..]) + size_of_val(&self.colors[..])
    }
}

/// The two edges from the first corner.
fn edges(positions: &[[f32; 3]], corners: [u32; 3]) -> [[f64; 3]; 2] {
    let [a, b, c] = corners.map(|i| positions[i as usize].map(f64::from));
    [b, c].map(|p| std::array::from_fn(|i| p[i] - a[i]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn uv(mesh: &Mesh, index: u32) -> [f32; 2] {
    finite_uv(mesh.data().uvs.get(index as usize).copied().unwrap_or_default())
}

fn finite_uv(uv: [f32; 2]) -> [f32; 2] {
    if uv.iter().all(|x| x.is_finite()) { uv } else { [0.0; 2] }
}

fn triangle(mesh: &Mesh, t: usize) -> ShadingTriangle {
    let data = mesh.data();
    let corners = data.triangles[t];
    let [e1, e2] = edges(&data.positions, corners);
    let scaled = cross(e1, e2);
    let area = dot(scaled, scaled).sqrt();
    let normal = if area > 0.0 { scaled.map(|x| x / area) } else { [0.0; 3] };
    let plane = dot(normal, data.positions[corners[0] as usize].map(f64::from)) as f32;
    let normal = Vec3::from(normal.map(|x| x as f32));
    let uvs = corners.map(|i| uv(mesh, i));
    let uv_area = signed_uv_area(uvs);
    let normals = corners.map(|i| {
        let own = data.normals.get(i as usize).map_or(normal, |&n| Vec3::from(n).normalized_or(normal));
        // A corner's normal points to the same side as the face, whatever the file's winding order is.
        pack_unit(if own.dot(normal) < 0.0 { -own } else { own })
    });
    let flat = pack_unit(normal);
    ShadingTriangle {
        normal,
        plane,
        normals,
        uvs,
        uv_per_m: if area > 0.0 { (uv_area.abs() / area).sqrt() as f32 } else { 0.0 },
        slot: data.slots.get(t).copied().unwrap_or(0),
        smooth: normals.iter().any(|&n| n != flat),
        mirrored: uv_area < 0.0,
    }
}

/// Twice the area in the (u, v) plane, positive if counter-clockwise.
fn signed_uv_area([a, b, c]: [[f32; 2]; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

/// Whether a texture is mirrored on a triangle with these texture coordinates, v upwards.
pub fn is_mirrored(uvs: [[f32; 2]; 3]) -> bool {
    signed_uv_area(uvs) < 0.0
}

/// Area-weighted sums of the directions of increasing u over the faces around every vertex: one sum for faces that show
/// the texture upright, one for faces that mirror it.
pub struct VertexTangents(Vec<[[f64; 3]; 2]>);

impl VertexTangents {
    /// Sums up the faces of a mesh. Texture coordinates have v upwards. Vertices are split where texture coordinates
    /// are, so seams stay sharp. Faces without area, on the surface or in (u, v), have no weight.
    ///
    /// # Panics
    /// If an index is out of range of the positions or the texture coordinates.
    pub fn new(positions: &[[f32; 3]], uvs: &[[f32; 2]], triangles: &[[u32; 3]]) -> Self {
        let mut sums = vec![[[0.0_f64; 3]; 2]; positions.len()];
        for &triangle in triangles {
            let uvs = triangle.map(|i| finite_uv(uvs[i as usize]));
            let signed = signed_uv_area(uvs);
            let [e1, e2] = edges(positions, triangle);
            let [a, b, c] = uvs.map(|p| f64::from(p[1]));
            // ∂p/∂u up to a positive factor, with a length proportional to the face's area.
            let along: [f64; 3] = std::array::from_fn(|i| (e1[i] * (c - a) - e2[i] * (b - a)) * signed.signum());
            let length = dot(along, along).sqrt();
            let normal = cross(e1, e2);
            let area = dot(normal, normal).sqrt();
            if length > 0.0 && signed != 0.0 {
                for index in triangle {
                    let sum = &mut sums[index as usize][usize::from(signed < 0.0)];
                    *sum = std::array::from_fn(|i| sum[i] + along[i] / length * area);
                }
            }
        }
        Self(sums)
    }

    /// Direction of increasing u at a vertex, of any length, for its faces of one handedness; the null vector without
    /// such faces.
    pub fn at(&self, vertex: u32, mirrored: bool) -> [f64; 3] {
        self.0[vertex as usize][usize::from(mirrored)]
    }
}

/// Packed unit tangents at the corners of every triangle; x where the direction is undefined.
fn tangents(mesh: &Mesh) -> Vec<[u32; 3]> {
    let data = mesh.data();
    if data.uvs.is_empty() {
        return Vec::new();
    }
    let sums = VertexTangents::new(&data.positions, &data.uvs, &data.triangles);
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        vec3((v[0] / length) as f32, (v[1] / length) as f32, (v[2] / length) as f32).normalized_or(vec3(1.0, 0.0, 0.0))
    };
    let corners = |&corners: &[u32; 3]| {
        let mirrored = is_mirrored(corners.map(|i| uv(mesh, i)));
        corners.map(|index| pack_unit(unit(sums.at(index, mirrored))))
    };
    data.triangles.iter().map(corners).collect()
}

fn unorm16(x: f32) -> u16 {
    (x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16
}

/// A unit vector as two signed 16-bit octahedral coordinates.
pub fn pack_unit(v: Vec3) -> u32 {
    let sum = v.x.abs() + v.y.abs() + v.z.abs();
    if sum == 0.0 {
        return 0;
    }
    let (x, y) = (v.x / sum, v.y / sum);
    let (x, y) = if v.z >= 0.0 { (x, y) } else { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) };
    let code = |a: f32| (a * 32767.0 + 0.5_f32.copysign(a)) as i16 as u16 as u32;
    code(x) | code(y) << 16
}

/// The unit vector of [`pack_unit`].
#[inline(always)]
pub fn unpack_unit(code: u32) -> Vec3 {
    let x = f32::from(code as u16 as i16) * (1.0 / 32767.0);
    let y = f32::from((code >> 16) as u16 as i16) * (1.0 / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = if z < 0.0 { z } else { 0.0 };
    vec3(x + fold.copysign(-x), y + fold.copysign(-y), z).normalized()
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;
    use syntable_model::scene::MeshData;

    #[test]
    fn directions_survive_packing() {
        let mut stream = Stream::root(1);
        for i in 0..1000 {
            let d = stream.direction();
            let mut v = vec3(d.x as f32, d.y as f32, d.z as f32);
            if i < 6 {
                v = Vec3::ZERO;
                let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
                *[&mut v.x, &mut v.y, &mut v.z][i / 2] = sign;
            }
            let back = unpack_unit(pack_unit(v));
            assert!((back - v).length() < 1e-4, "{v:?} {back:?}");
        }
    }

    #[test]
    fn gathers_planes_densities_and_tangents() {
        // A 2 m × 1 m rectangle at z = 3 with the texture rotated: u runs along −y, v along x.
        let mesh = Mesh::new(MeshData {
            positions: vec![[0.0, 0.0, 3.0], [2.0, 0.0, 3.0], [2.0, 1.0, 3.0], [0.0, 1.0, 3.0]],
            uvs: vec![[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..MeshData::default()
        });
        let traced = ShadingMesh::new(&mesh.expect("sound"));
        for (triangle, tangents) in traced.triangles.iter().zip(&traced.tangents) {
            assert_eq!((triangle.normal, triangle.plane), (vec3(0.0, 0.0, 1.0), 3.0));
            assert!((triangle.uv_per_m - 0.5_f32.sqrt()).abs() < 1e-6);
            assert!(!triangle.smooth && !triangle.mirrored);
            for &t in tangents {
                assert!((unpack_unit(t) - vec3(0.0, -1.0, 0.0)).length() < 1e-4, "{:?}", unpack_unit(t));
            }
        }
    }

    #[test]
    fn normals_follow_the_face_and_zero_area_is_harmless() {
        let mesh = Mesh::new(MeshData {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            normals: vec![[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.3, 0.0, 1.0], [0.0, 0.0, 1.0]],
            uvs: vec![[0.0, f32::NAN]; 4],
            triangles: vec![[0, 1, 2], [1, 1, 3]],
            ..MeshData::default()
        });
        let traced = ShadingMesh::new(&mesh.expect("sound"));
        let corners = traced.triangles[0].normals.map(unpack_unit);
        assert!((corners[0] - vec3(0.0, 0.0, 1.0)).length() < 1e-4);
        assert!((corners[1] - vec3(0.0, 0.0, 1.0)).length() < 1e-4);
        assert!((corners[2] - vec3(0.3, 0.0, 1.0).normalized()).length() < 1e-4);
        assert_eq!(traced.triangles[1].normal, Vec3::ZERO);
        assert!(traced.triangles.iter().all(|t| t.uvs.iter().flatten().all(|x| x.is_finite())));
    }
}
