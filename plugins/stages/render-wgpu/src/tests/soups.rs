//! Scenes of random triangles, with holes and panes.

use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Pose, Translation3};
use syntable_model::prelude::*;
use syntable_model::scene::{
    Alpha, Color, Encoding, Material, Mesh, MeshData, Role, Scalar, SettleReport, Texture, Transmission, Wrap,
};
use syntable_testing::scenes;

/// A soup of triangles in a cube around the origin.
pub fn soup(random: &mut Stream, triangles: u32, size: f64) -> MeshData {
    let mut data = MeshData::default();
    for number in 0..triangles {
        let center: [f64; 3] = std::array::from_fn(|_| random.uniform(-size, size));
        // Small ones, and slivers across the cube.
        let reach = [0.1, 0.1, 0.3, 2.0][number as usize % 4] * size;
        for _ in 0..3 {
            data.positions.push(center.map(|x| (x + random.uniform(-reach, reach)) as f32));
            data.uvs.push([random.uniform(0.0, 3.0) as f32, random.uniform(0.0, 3.0) as f32]);
        }
        data.triangles.push([3 * number, 3 * number + 1, 3 * number + 2]);
    }
    data
}

/// The mirrored, larger mesh.
fn mirrored(data: &MeshData) -> MeshData {
    let mut other = data.clone();
    other.positions.iter_mut().for_each(|[x, y, z]| (*x, *y, *z) = (-1.7 * *x, 1.7 * *y, 1.7 * *z));
    other.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    other
}

/// Holes and half-covered parts.
pub fn lattice() -> Arc<Texture> {
    let alpha = |x: u32, y: u32| [0, 90, 170, 255][((x / 3 + y / 5) % 4) as usize];
    let texels = (0..32 * 32).flat_map(|i| [200, 120, 60, alpha(i % 32, i / 32)]).collect();
    let digest = Digest::of(b"lattice");
    Arc::new(Texture { width: 32, height: 32, texels, encoding: Encoding::Srgb, wrap: [Wrap::Repeat; 2], digest })
}

/// Soups and their mirror images: the same meshes several times, turned, with and without holes and panes.
pub fn scene(number: u64, special: bool) -> Scene {
    let mut random = Stream::root(40 + number);
    let mut builder = scenes::table();
    let plain = soup(&mut random, 200, 0.2);
    let meshes = [mirrored(&plain), plain, soup(&mut random, 1, 0.5), soup(&mut random, 37, 0.4)];
    let cover = |alpha| Material { base_color: Color::texture(lattice()), alpha, ..Material::plain("", [1.0; 3], 0.5) };
    let glass = Transmission { fraction: Scalar::constant(0.9), volume: None };
    let pane = Material { transmission: Some(glass), ..Material::plain("", [0.9, 0.7, 0.5], 0.0) };
    let looks = [
        Material::plain("", [0.5; 3], 0.5),
        cover(Alpha::Mask { cutoff: 0.5 }),
        cover(Alpha::Blend { factor: 0.8 }),
        pane,
    ];
    for (shape, data) in meshes.iter().enumerate() {
        for (look, material) in looks.iter().enumerate().take(if special { looks.len() } else { 1 }) {
            let mut object = (*scenes::object(
                &format!("{number} {shape} {look}"),
                Mesh::new(data.clone()).expect("sound"),
                [0.5; 3],
            ))
            .clone();
            object.materials = vec![Arc::new(material.clone())];
            let object = Arc::new(object);
            for _ in 0..2 {
                let mut body = scenes::body(object.clone(), [0.0; 3], Role::Object);
                let [x, y, z] = std::array::from_fn(|_| random.uniform(-0.8, 0.8));
                body.world_from_body = Pose::from_parts(Translation3::new(x, y, z), random.rotation());
                builder.add(body);
            }
        }
    }
    builder.freeze(SettleReport::default()).expect("sound")
}
