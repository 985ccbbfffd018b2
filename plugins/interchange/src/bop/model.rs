//! Meshes of assets as BOP has them.

use std::io::Write;
use syntable_model::prelude::*;
use syntable_model::scene::Mesh;

use super::record::MM;

/// A mesh in millimeters, object frame, without vertices that no face uses.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Positions of the vertices, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of vertices, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

/// An entry of `models_info.json`, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ModelInfo {
    diameter: f64,
    min_x: f64,
    min_y: f64,
    min_z: f64,
    size_x: f64,
    size_y: f64,
    size_z: f64,
}

impl Model {
    pub fn of(mesh: &Mesh) -> Self {
        let data = mesh.data();
        let mut used = vec![None; data.positions.len()];
        let mut vertices = Vec::new();
        let mut index_of = |vertex: u32| {
            *used[vertex as usize].get_or_insert_with(|| {
                vertices.push(data.positions[vertex as usize].map(|x| (f64::from(x) * MM) as f32));
                vertices.len() as u32 - 1
            })
        };
        let faces = data.triangles.iter().map(|triangle| triangle.map(&mut index_of)).collect();
        Self { vertices, faces }
    }

    /// The vertices and the faces as little-endian bytes.
    pub fn to_bytes(&self) -> [Vec<u8>; 2] {
        [
            self.vertices.iter().flatten().flat_map(|number| number.to_le_bytes()).collect(),
            self.faces.iter().flatten().flat_map(|index| index.to_le_bytes()).collect(),
        ]
    }

    /// What [`to_bytes`](Self::to_bytes) gave; none if the bytes are no mesh.
    pub fn from_bytes([vertices, faces]: [&[u8]; 2]) -> Option<Self> {
        fn triples<T: Copy>(bytes: &[u8], read: impl Fn([u8; 4]) -> T) -> Option<Vec<[T; 3]>> {
            let (numbers, rest) = bytes.as_chunks::<4>();
            let (triples, odd) = numbers.as_chunks::<3>();
            (rest.is_empty() && odd.is_empty()).then(|| triples.iter().map(|triple| triple.map(&read)).collect())
        }
        let vertices = triples(vertices, f32::from_le_bytes)?;
        let faces = triples(faces, u32::from_le_bytes)?;
        let sound = faces.iter().flatten().all(|&index| (index as usize) < vertices.len());
        sound.then_some(Self { vertices, faces })
    }

    /// Writes an ASCII PLY file.
    pub fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        writeln!(out, "ply\nformat ascii 1.0\ncomment millimeters, object frame")?;
        writeln!(out, "element vertex {}", self.vertices.len())?;
        writeln!(out, "property float x\nproperty float y\nproperty float z")?;
        writeln!(out, "element face {}", self.faces.len())?;
        writeln!(out, "property list uchar int vertex_indices\nend_header")?;
        self.vertices.iter().try_for_each(|[x, y, z]| writeln!(out, "{x} {y} {z}"))?;
        self.faces.iter().try_for_each(|[a, b, c]| writeln!(out, "3 {a} {b} {c}"))
    }

    pub fn info(&self) -> ModelInfo {
        let axis = |axis: usize| self.vertices.iter().map(move |vertex| f64::from(vertex[axis]));
        let min: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::INFINITY, f64::min));
        let size: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::NEG_INFINITY, f64::max) - min[i]);
        let ([min_x, min_y, min_z], [size_x, size_y, size_z]) = (min, size);
        ModelInfo { diameter: self.diameter(min, size), min_x, min_y, min_z, size_x, size_y, size_z }
    }

    /// The largest distance of two vertices, mm. `min` and `size` are those of the box around them.
    ///
    /// Vertices are taken from the farthest from the center of the box inwards: a pair cannot be farther apart than its
    /// distances from the center together, so that few pairs are looked at.
    fn diameter(&self, min: [f64; 3], size: [f64; 3]) -> f64 {
        let norm = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let centered = |v: &[f32; 3]| -> [f64; 3] { std::array::from_fn(|i| f64::from(v[i]) - min[i] - size[i] / 2.0) };
        let mut points: Vec<([f64; 3], f64)> =
            self.vertices.iter().map(centered).map(|point| (point, norm(point))).collect();
        points.sort_unstable_by(|(p, a), (q, b)| b.total_cmp(a).then_with(|| p[0].total_cmp(&q[0])));
        let mut largest = 0.0_f64;
        for (i, (p, radius)) in points.iter().enumerate() {
            if 2.0 * radius <= largest {
                break;
            }
            for (q, other) in &points[i + 1..] {
                if radius + other <= largest {
                    break;
                }
                largest = largest.max(norm(std::array::from_fn(|axis| p[axis] - q[axis])));
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::MeshData;

    fn random(stream: &mut Stream, vertices: usize, flat: bool) -> Model {
        let mut point = || [1.0, 1.0, if flat { 0.01 } else { 1.0 }].map(|w| (stream.uniform(-w, w) * 200.0) as f32);
        Model { vertices: (0..vertices).map(|_| point()).collect(), faces: Vec::new() }
    }

    #[test]
    fn the_diameter_is_that_of_all_pairs() {
        let mut stream = Stream::root(11);
        for i in 0..200 {
            let model = random(&mut stream, 1 + i, i % 2 == 0);
            let pairs = model.vertices.iter().flat_map(|p| model.vertices.iter().map(move |q| (p, q)));
            let distance = |(p, q): (&[f32; 3], &[f32; 3])| {
                (0..3).map(|axis| (f64::from(p[axis]) - f64::from(q[axis])).powi(2)).sum::<f64>().sqrt()
            };
            let want = pairs.map(distance).fold(0.0, f64::max);
            let got = model.info().diameter;
            assert!((got - want).abs() <= 1e-10 * want, "{i}: {got} {want}");
        }
    }

    #[test]
    fn only_vertices_of_faces_are_kept_and_bytes_are_read_back() {
        let data = MeshData {
            positions: vec![[9.0; 3], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.3], [8.0; 3]],
            triangles: vec![[3, 1, 2], [1, 3, 2]],
            ..MeshData::default()
        };
        let model = Model::of(&Mesh::new(data).expect("sound"));
        assert_eq!(model.vertices, [[0.0, 0.0, 300.0], [100.0, 0.0, 0.0], [0.0, 200.0, 0.0]]);
        assert_eq!(model.faces, [[0, 1, 2], [1, 0, 2]]);
        let [vertices, faces] = model.to_bytes();
        assert_eq!(Model::from_bytes([&vertices, &faces]), Some(model));
        assert_eq!(Model::from_bytes([&vertices[..24], &faces]), None);
        assert_eq!(Model::from_bytes([&vertices[1..], &faces]), None);
    }
}
