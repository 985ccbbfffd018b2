//! Arrays of meshes that need changes for glTF: texture mapping along the body's axes, and tangents.

use super::document::{GltfAttributes, Index};
use super::glb::Glb;
use super::vertices::{apply, color, slots, unit, v_down, write_parts};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::{Mesh, UvTransform};
use syntable_prepare::{BoxSide, VertexTangents, is_mirrored};

/// Arrays of a modified mesh. Vertices are duplicated where faces do not agree on their attributes.
pub struct MeshArrays {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    slots: Vec<usize>,
}

impl MeshArrays {
    /// The mesh with the given texture coordinates.
    pub fn own(mesh: &Mesh, uvs: Vec<[f32; 2]>, by_slot: bool) -> Self {
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

    /// The mesh with texture coordinates along the body's axes.
    pub fn boxed(mesh: &Mesh, rotation: f32, offset: [f32; 2], tile_m: f32) -> Self {
        let tile = if tile_m > 1e-6 && tile_m.is_finite() { f64::from(tile_m) } else { 1.0 };
        let laid = UvTransform { scale: [1.0; 2], rotation, offset };
        let side = |t: usize| BoxSide::of(face(mesh.corners(t)).into());
        let sides: Vec<usize> = (0..mesh.data().triangles.len()).map(|t| side(t).index()).collect();
        let (mut arrays, old) = Self::own(mesh, Vec::new(), false).split(&sides, BoxSide::COUNT);
        // All faces at a vertex now point along the same axis.
        arrays.uvs = vec![[0.0; 2]; arrays.positions.len()];
        for (t, triangle) in arrays.triangles.iter().enumerate() {
            let [along_u, along_v] = side(t).axes().map(Vector3::<f64>::from);
            for &i in triangle {
                let p = Vector3::from(mesh.data().positions[old[i as usize]].map(f64::from));
                let uv = [along_u, along_v].map(|axis| (p.dot(&axis) / tile) as f32);
                arrays.uvs[i as usize] = v_down(apply(&laid, uv));
            }
        }
        arrays
    }

    /// Duplicates vertices whose faces belong to several classes. Also returns the old index of every new vertex.
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

    /// Flat faces with their own normals: three vertices each.
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

    /// Tangents `[x, y, z, w]` along u: the mean of the faces' tangents, weighted by area, perpendicular to the normal.
    /// The bitangent `w · normal × tangent` points up the texture. Vertices are duplicated where mirrored faces meet
    /// other faces.
    fn with_tangents(self) -> (Self, Vec<[f32; 4]>) {
        let smooth = if self.normals.is_empty() { self.flat() } else { self };
        // In glTF, v points down.
        let uvs: Vec<[f32; 2]> = smooth.uvs.iter().map(|&[u, v]| [u, -v]).collect();
        let along = VertexTangents::new(&smooth.positions, &uvs, &smooth.triangles);
        let mirrored = |triangle: &[u32; 3]| is_mirrored(triangle.map(|i| uvs[i as usize]));
        let mirrored: Vec<usize> = smooth.triangles.iter().map(|t| usize::from(mirrored(t))).collect();
        let (split, old) = smooth.split(&mirrored, 2);
        let mut sums = vec![(Vector3::zeros(), 1.0); split.positions.len()];
        for (&triangle, &mirrored) in split.triangles.iter().zip(&mirrored) {
            for i in triangle {
                let mirrored = mirrored == 1;
                let sum = Vector3::from(along.at(old[i as usize] as u32, mirrored));
                sums[i as usize] = (sum, if mirrored { -1.0 } else { 1.0 });
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

    pub fn write(self, glb: &mut Glb, tangents: bool) -> (GltfAttributes, Vec<(usize, Index)>) {
        let (arrays, tangents) = if tangents { self.with_tangents() } else { (self, Vec::new()) };
        let vectors = |glb: &mut Glb, vectors: &[[f32; 3]]| (!vectors.is_empty()).then(|| glb.vectors(vectors, false));
        let attributes = GltfAttributes {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::geometry::{UvSource, texcoords};
    use syntable_model::scene::MeshData;

    #[test]
    fn vertices_are_doubled_only_where_sides_meet() {
        let data = MeshData {
            positions: vec![[0.0; 3], [0.5, 0.0, 0.0], [0.5, 0.25, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.5]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 1, 4]],
            ..Default::default()
        };
        let mesh = Mesh::new(data).expect("sound");
        let boxed = MeshArrays::boxed(&mesh, std::f32::consts::FRAC_PI_2, [0.125, 0.0], 0.25);
        // Four vertices of the top face, three of the face that points along -y.
        assert_eq!(boxed.positions.len(), 7);
        // (0.5, 0.25) m are (2, 1) tiles; a quarter turn gives (-1, 2), shifted by an eighth; v points down.
        let at = boxed.triangles[0][2] as usize;
        assert_eq!(boxed.positions[at], [0.5, 0.25, 0.0]);
        let [u, v] = boxed.uvs[at];
        assert!((u + 0.875).abs() < 1e-6 && (v + 1.0).abs() < 1e-6, "{u} {v}");
    }

    #[test]
    fn tangents_go_along_the_texture_and_mirrors_are_told() {
        // Two triangles of a square; the second shows the texture mirrored. They share two vertices and their
        // coordinates.
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
            let uvs = texcoords(&mesh, UvSource::Mesh, true);
            let (arrays, tangents) = MeshArrays::own(&mesh, uvs, true).with_tangents();
            // Both shared vertices are duplicated in either case.
            assert_eq!((arrays.positions.len(), flat), (6, flat));
            for &i in &arrays.triangles[0] {
                assert_eq!(tangents[i as usize], [1.0, 0.0, 0.0, 1.0]);
            }
            for &i in &arrays.triangles[1] {
                // From (1, 1) to (1, 0), u grows: along -y. From there to (0, 1), v grows: along -x.
                assert_eq!(tangents[i as usize], [0.0, -1.0, 0.0, -1.0]);
            }
        }
    }
}
