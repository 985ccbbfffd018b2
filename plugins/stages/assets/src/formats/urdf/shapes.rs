//! The shapes of URDF as meshes around the origin.

use std::f64::consts::TAU;
use syntable_mesh::Model;
use syntable_mesh::material::default_material;
use syntable_model::scene::MeshData;

/// Segments around a cylinder or a sphere.
const AROUND: usize = 48;
/// Rows of a sphere from pole to pole.
const ROWS: usize = 24;

fn model(mesh: MeshData) -> Model {
    Model { mesh, materials: vec![default_material(false)] }
}

/// A box by its edges.
pub fn cuboid(size: [f64; 3]) -> Model {
    let corner = |i: usize| std::array::from_fn(|axis| ((i >> axis & 1) as f64 * size[axis] - size[axis] / 2.0) as f32);
    let quads: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    model(MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    })
}

/// Points of a circle of radius 1.
fn circle() -> impl Iterator<Item = [f64; 2]> {
    (0..AROUND).map(|i| {
        let (s, c) = libm::sincos(TAU * i as f64 / AROUND as f64);
        [c, s]
    })
}

/// A cylinder along z.
pub fn cylinder(radius: f64, length: f64) -> Model {
    let mut mesh = MeshData::default();
    let half = length / 2.0;
    let around = AROUND as u32;
    for [x, y] in circle() {
        for z in [-half, half] {
            mesh.positions.push([(x * radius) as f32, (y * radius) as f32, z as f32]);
            mesh.normals.push([x as f32, y as f32, 0.0]);
        }
    }
    for i in 0..around {
        let [a, b] = [2 * i, 2 * ((i + 1) % around)];
        mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
    // The ends have vertices of their own, so that their edges stay sharp.
    for (z, up) in [(-half, -1.0), (half, 1.0)] {
        let center = mesh.positions.len() as u32;
        mesh.positions.push([0.0, 0.0, z as f32]);
        mesh.positions.extend(circle().map(|[x, y]| [(x * radius) as f32, (y * radius) as f32, z as f32]));
        mesh.normals.resize(mesh.positions.len(), [0.0, 0.0, up]);
        for i in 0..around {
            let [a, b] = [center + 1 + i, center + 1 + (i + 1) % around];
            mesh.triangles.push(if up > 0.0 { [center, a, b] } else { [center, b, a] });
        }
    }
    model(mesh)
}

/// A sphere.
pub fn sphere(radius: f64) -> Model {
    let mut mesh = MeshData::default();
    let (around, rows) = (AROUND as u32, ROWS as u32);
    let mut add = |normal: [f64; 3]| {
        mesh.positions.push(normal.map(|x| (x * radius) as f32));
        mesh.normals.push(normal.map(|x| x as f32));
    };
    add([0.0, 0.0, -1.0]);
    for row in 1..ROWS {
        let (s, c) = libm::sincos(TAU / 2.0 * row as f64 / ROWS as f64);
        circle().for_each(|[x, y]| add([x * s, y * s, -c]));
    }
    add([0.0, 0.0, 1.0]);
    let at = |row: u32, i: u32| 1 + (row - 1) * around + i % around;
    let top = 1 + (rows - 1) * around;
    for i in 0..around {
        mesh.triangles.push([0, at(1, i + 1), at(1, i)]);
        for row in 1..rows - 1 {
            let [a, b, c, d] = [at(row, i), at(row, i + 1), at(row + 1, i + 1), at(row + 1, i)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([at(rows - 1, i), at(rows - 1, i + 1), top]);
    }
    model(mesh)
}
