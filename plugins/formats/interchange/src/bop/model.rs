//! Meshes of assets in BOP's form.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::io::Write;
use std::ops::Range;
use syntable_model::prelude::*;
use syntable_model::product::ObjectModel;
use syntable_model::scene::Symmetries;

use super::record::BopModelInfo;
use super::surface::{ModelSurface, shown};

/// Names of the arrays of a model.
const VERTICES: &str = "vertices";
const FACES: &str = "faces";
const COLORS: &str = "colors";
const UVS: &str = "uvs";
/// Name of the texture of a model.
pub const TEXTURE: &str = "texture";

/// A mesh in millimeters, in the frame of the asset's file, without vertices that no face uses.
#[derive(Debug, Clone, PartialEq)]
pub struct BopModel {
    /// Positions of the vertices, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of vertices, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Colors or texture of its surface.
    pub surface: ModelSurface,
    /// Its symmetries.
    pub symmetries: Symmetries,
}

impl BopModel {
    pub fn of(model: &ObjectModel) -> Result<Self> {
        let (vertices, faces, surface) = shown(model)?;
        Ok(Self { vertices, faces, surface, symmetries: model.source.symmetries.clone() })
    }

    /// Its arrays as little-endian bytes by name, and its texture.
    pub fn parts(&self) -> Vec<(&'static str, Vec<u8>)> {
        let floats = |numbers: &[f32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let faces = self.faces.as_flattened().iter().flat_map(|index| index.to_le_bytes()).collect();
        let mut parts = vec![(VERTICES, floats(self.vertices.as_flattened())), (FACES, faces)];
        match &self.surface {
            ModelSurface::Plain => {}
            ModelSurface::Colors(colors) => parts.push((COLORS, colors.as_flattened().to_vec())),
            ModelSurface::Texture { uvs, png } => {
                parts.push((UVS, floats(uvs.as_flattened())));
                parts.push((TEXTURE, png.clone()));
            }
        }
        parts
    }

    /// The model from its [`parts`](Self::parts); none if the bytes do not form a model.
    pub fn from_parts(parts: &mut BTreeMap<String, Vec<u8>>, symmetries: Symmetries) -> Option<Self> {
        fn groups<T: Copy, const N: usize>(bytes: &[u8], read: impl Fn([u8; 4]) -> T) -> Option<Vec<[T; N]>> {
            let (numbers, rest) = bytes.as_chunks::<4>();
            let (groups, odd) = numbers.as_chunks::<N>();
            (rest.is_empty() && odd.is_empty()).then(|| groups.iter().map(|group| group.map(&read)).collect())
        }
        let vertices: Vec<[f32; 3]> = groups(parts.get(VERTICES)?, f32::from_le_bytes)?;
        let faces: Vec<[u32; 3]> = groups(parts.get(FACES)?, u32::from_le_bytes)?;
        let count = vertices.len();
        let surface = if let Some(colors) = parts.get(COLORS) {
            let (colors, rest) = colors.as_chunks::<3>();
            (rest.is_empty() && colors.len() == count).then(|| ModelSurface::Colors(colors.to_vec()))?
        } else if let Some(uvs) = parts.get(UVS) {
            let uvs: Vec<[f32; 2]> = groups(uvs, f32::from_le_bytes)?;
            let png = parts.remove(TEXTURE).filter(|_| uvs.len() == count)?;
            ModelSurface::Texture { uvs, png }
        } else {
            ModelSurface::Plain
        };
        let sound = faces.iter().flatten().all(|&index| (index as usize) < count);
        sound.then_some(Self { vertices, faces, surface, symmetries })
    }

    /// Writes an ASCII PLY file, which names its texture.
    pub fn write(&self, texture: &str, out: &mut dyn Write) -> std::io::Result<()> {
        writeln!(out, "ply\nformat ascii 1.0\ncomment millimeters")?;
        if let ModelSurface::Texture { .. } = self.surface {
            writeln!(out, "comment TextureFile {texture}")?;
        }
        writeln!(out, "element vertex {}", self.vertices.len())?;
        writeln!(out, "property float x\nproperty float y\nproperty float z")?;
        match self.surface {
            ModelSurface::Plain => {}
            ModelSurface::Colors(_) => writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?,
            ModelSurface::Texture { .. } => writeln!(out, "property float texture_u\nproperty float texture_v")?,
        }
        writeln!(out, "element face {}", self.faces.len())?;
        writeln!(out, "property list uchar int vertex_indices\nend_header")?;
        let vertices = self.vertices.iter().enumerate();
        vertices.into_iter().try_for_each(|(number, [x, y, z])| match &self.surface {
            ModelSurface::Plain => writeln!(out, "{x} {y} {z}"),
            ModelSurface::Colors(colors) => {
                let [red, green, blue] = colors[number];
                writeln!(out, "{x} {y} {z} {red} {green} {blue}")
            }
            ModelSurface::Texture { uvs, .. } => writeln!(out, "{x} {y} {z} {} {}", uvs[number][0], uvs[number][1]),
        })?;
        self.faces.iter().try_for_each(|[a, b, c]| writeln!(out, "3 {a} {b} {c}"))
    }

    /// Its entry of `models_info.json`.
    pub fn info(&self) -> BopModelInfo<f64, Symmetries> {
        let axis = |axis: usize| self.vertices.iter().map(move |vertex| f64::from(vertex[axis]));
        let min: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::INFINITY, f64::min));
        let size: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::NEG_INFINITY, f64::max) - min[i]);
        let ([min_x, min_y, min_z], [size_x, size_y, size_z]) = (min, size);
        let (diameter, symmetries) = (self.diameter(min, size), self.symmetries.clone());
        BopModelInfo { diameter, min_x, min_y, min_z, size_x, size_y, size_z, symmetries }
    }

    /// The largest distance between two vertices, mm. `min` and `size` describe their bounding box.
    fn diameter(&self, min: [f64; 3], size: [f64; 3]) -> f64 {
        let centered = |v: &[f32; 3]| -> [f64; 3] { std::array::from_fn(|i| f64::from(v[i]) - min[i] - size[i] / 2.0) };
        let mut points: Vec<[f64; 3]> = self.vertices.iter().map(centered).collect();
        let mut groups = Vec::new();
        if !points.is_empty() {
            Group::divide(&mut points, 0, &mut groups);
        }
        let mut largest = 0.0;
        // Pairs of groups, in descending order of the largest distance that they can contain.
        let mut pending = BinaryHeap::new();
        let pair = |a: usize, b: usize| GroupPair { reach: Group::reach(&groups[a], &groups[b]), groups: [a, b] };
        pending.extend(groups.first().map(|_| pair(0, 0)));
        while let Some(GroupPair { reach, groups: [a, b] }) = pending.pop() {
            if reach <= largest {
                break;
            }
            if a != b && Group::reach_along(&groups[a], &groups[b], &points) <= largest {
                continue;
            }
            // Divides the larger group. Two groups that cannot be divided are compared point by point.
            let [wide, other] = if groups[a].points.len() >= groups[b].points.len() { [a, b] } else { [b, a] };
            match groups[wide].parts {
                // A group paired with itself yields three pairs of its parts.
                Some([left, right]) if a == b => {
                    pending.extend([pair(left, left), pair(left, right), pair(right, right)]);
                }
                Some([left, right]) => pending.extend([pair(left, other), pair(right, other)]),
                None => {
                    let (a, b) = (&points[groups[a].points.clone()], &points[groups[b].points.clone()]);
                    let distances = a.iter().flat_map(|p| b.iter().map(move |q| distance(p, q)));
                    largest = distances.fold(largest, f64::max);
                }
            }
        }
        largest
    }
}

fn distance(p: &[f64; 3], q: &[f64; 3]) -> f64 {
    let [x, y, z] = std::array::from_fn(|axis| p[axis] - q[axis]);
    (x * x + y * y + z * z).sqrt()
}

/// Points near each other: a node of a binary tree, stored before its children.
struct Group {
    points: Range<usize>,
    lo: [f64; 3],
    hi: [f64; 3],
    /// Largest distance of a point from the origin.
    radius: f64,
    parts: Option<[usize; 2]>,
}

impl Group {
    /// Maximum number of points of a group that is not divided.
    const FEW: usize = 8;
    /// Maximum number of points of a group whose points are projected onto the line between two groups.
    const MANY: usize = 256;

    /// Divides points at the middle of their longest axis. The first point has the index `first`. Returns the index of
    /// the group.
    fn divide(points: &mut [[f64; 3]], first: usize, groups: &mut Vec<Self>) -> usize {
        let axis = |axis: usize| points.iter().map(move |point| point[axis]);
        let lo: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::INFINITY, f64::min));
        let hi: [f64; 3] = std::array::from_fn(|i| axis(i).fold(f64::NEG_INFINITY, f64::max));
        let radius = points.iter().map(|point| distance(point, &[0.0; 3])).fold(0.0, f64::max);
        let number = groups.len();
        groups.push(Self { points: first..first + points.len(), lo, hi, radius, parts: None });
        if points.len() > Self::FEW {
            let longest = (1..3).fold(0, |best, i| if hi[i] - lo[i] > hi[best] - lo[best] { i } else { best });
            let middle = points.len() / 2;
            points.select_nth_unstable_by(middle, |p, q| p[longest].total_cmp(&q[longest]));
            let (left, right) = points.split_at_mut(middle);
            let parts = [Self::divide(left, first, groups), Self::divide(right, first + middle, groups)];
            groups[number].parts = Some(parts);
        }
        number
    }

    /// Upper bound of the distance between points of two groups, rounded up: the distance between the far corners of
    /// their boxes, or the sum of their distances from the origin, whichever is smaller.
    fn reach(a: &Self, b: &Self) -> f64 {
        let along = |axis: usize| (a.hi[axis] - b.lo[axis]).max(b.hi[axis] - a.lo[axis]);
        distance(&std::array::from_fn(along), &[0.0; 3]).min(a.radius + b.radius) * (1.0 + 4.0 * f64::EPSILON)
    }

    /// A tighter bound for small groups, from the projections of their points onto the line between the centers of
    /// their boxes: the points of a rounded surface project to nearly the same position.
    fn reach_along(a: &Self, b: &Self, points: &[[f64; 3]]) -> f64 {
        if a.points.len().max(b.points.len()) > Self::MANY {
            return f64::INFINITY;
        }
        let [from, to] = [a, b].map(|group| -> [f64; 3] { std::array::from_fn(|i| (group.lo[i] + group.hi[i]) / 2.0) });
        let apart = distance(&from, &to);
        if apart == 0.0 {
            return f64::INFINITY;
        }
        let line: [f64; 3] = std::array::from_fn(|i| (to[i] - from[i]) / apart);
        let [[a_min, a_max], [b_min, b_max]] = [a, b].map(|group| {
            let places = points[group.points.clone()].iter().map(|p| p[0] * line[0] + p[1] * line[1] + p[2] * line[2]);
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], at| [lo.min(at), hi.max(at)])
        });
        let along = (b_max - a_min).max(a_max - b_min);
        let across = (distance(&a.lo, &a.hi) + distance(&b.lo, &b.hi)) / 2.0;
        (along * along + across * across).sqrt() * (1.0 + 1e-12)
    }
}

/// Two groups, ordered by the upper bound of their distance.
struct GroupPair {
    reach: f64,
    groups: [usize; 2],
}

impl Ord for GroupPair {
    fn cmp(&self, other: &Self) -> Ordering {
        self.reach.total_cmp(&other.reach).then_with(|| self.groups.cmp(&other.groups))
    }
}

impl PartialOrd for GroupPair {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for GroupPair {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for GroupPair {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use syntable_model::scene::{Mesh, MeshData, SourceModel, SymmetryAxis};

    fn points_of(vertices: Vec<[f32; 3]>) -> BopModel {
        BopModel { vertices, faces: Vec::new(), surface: ModelSurface::Plain, symmetries: Symmetries::default() }
    }

    fn random(stream: &mut Stream, vertices: usize, flat: bool) -> BopModel {
        let mut point = || [1.0, 1.0, if flat { 0.01 } else { 1.0 }].map(|w| (stream.uniform(-w, w) * 200.0) as f32);
        points_of((0..vertices).map(|_| point()).collect())
    }

    #[test]
    fn the_diameter_matches_all_pairs() {
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

    /// The worst case: every vertex of a sphere is on its hull, and nearly all opposite pairs have the same distance.
    #[test]
    fn the_diameter_of_a_sphere_of_many_vertices() {
        let mut stream = Stream::root(12);
        let mut vertex = || {
            let point = [(); 3].map(|()| stream.normal());
            let norm = point.iter().map(|x| x * x).sum::<f64>().sqrt();
            point.map(|x| (100.0 * x / norm) as f32)
        };
        let model = points_of((0..8000).map(|_| vertex()).collect());
        let points: Vec<[f64; 3]> = model.vertices.iter().map(|v| v.map(f64::from)).collect();
        let pairs = points.iter().enumerate().flat_map(|(i, p)| points[i..].iter().map(move |q| distance(p, q)));
        let want = pairs.fold(0.0, f64::max);
        assert!((model.info().diameter - want).abs() <= 1e-10 * want);
    }

    #[test]
    fn only_vertices_of_faces_are_kept_and_bytes_are_read_back() {
        let data = MeshData {
            positions: vec![[9.0; 3], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.3], [8.0; 3]],
            triangles: vec![[3, 1, 2], [1, 3, 2]],
            ..MeshData::default()
        };
        let axis = SymmetryAxis { axis: [0.0, 0.0, 1.0], offset_m: [0.0; 3] };
        let symmetries = Symmetries { continuous: vec![axis], ..Symmetries::default() };
        let source = SourceModel { symmetries, ..SourceModel::default() };
        let mesh = Arc::new(Mesh::new(data).expect("sound"));
        let model = BopModel::of(&ObjectModel { mesh, materials: Vec::new(), source }).expect("shown");
        assert_eq!(model.vertices, [[0.0, 0.0, 300.0], [100.0, 0.0, 0.0], [0.0, 200.0, 0.0]]);
        assert_eq!(model.faces, [[0, 1, 2], [1, 0, 2]]);
        let uvs = vec![[0.5, 0.25]; 3];
        for surface in [
            ModelSurface::Plain,
            ModelSurface::Colors(vec![[1, 2, 3], [4, 5, 6], [7, 8, 9]]),
            ModelSurface::Texture { uvs, png: b"PNG".to_vec() },
        ] {
            let model = BopModel { surface, ..model.clone() };
            let parts = || model.parts().into_iter().map(|(name, bytes)| (name.to_owned(), bytes));
            let read =
                |mut parts: BTreeMap<String, Vec<u8>>| BopModel::from_parts(&mut parts, model.symmetries.clone());
            assert_eq!(read(parts().collect()).as_ref(), Some(&model));
            // Any array that is one byte short is refused; a texture may be any bytes.
            for (cut, _) in parts().filter(|(name, _)| name != "texture") {
                let less = parts().map(|(name, mut bytes)| {
                    bytes.truncate(bytes.len() - usize::from(name == cut));
                    (name, bytes)
                });
                assert_eq!(read(less.collect()), None, "{cut}");
            }
        }
    }
}
