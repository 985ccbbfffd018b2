//! Damaged files, and a large one.

use crate::common::{fact, look, peak};
use crate::inputs::*;
use image::{ImageFormat, RgbImage};
use std::fs;
use std::io::Write;
use syntable_model::random::Stream;
use tempfile::TempDir;

/// Files with random damage must be read or refused: no panic, no hang, no large allocation.
#[test]
fn random_damage_is_survived() {
    let folder = TempDir::new().expect("temp folder");
    let exr_path = folder.path().join("small.exr");
    exr::prelude::write_rgb_file(&exr_path, 16, 8, |x, y| (x as f32, y as f32, 0.25_f32)).expect("writes");
    let noise = RgbImage::from_fn(16, 16, |x, y| image::Rgb([(x * y) as u8, (x * 7) as u8, (y * 13) as u8]));
    let hdr = [
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec(),
        [2, 2, 0, 8, 136, 7, 136, 7, 136, 7, 136, 129].repeat(4),
    ]
    .concat();
    let box_obj = obj(1.0).replace("mtllib model.mtl\n", "");
    let files: [(&str, Vec<u8>); 11] = [
        ("x.obj", box_obj.into_bytes()),
        ("x.ply", ply_ascii().into_bytes()),
        ("y.ply", ply_binary(true)),
        ("x.gltf", embedded().into_bytes()),
        ("x.glb", glb()),
        ("x.stl", stl(false)),
        ("y.stl", stl(true)),
        ("x.png", png()),
        ("x.jpg", encode(noise.into(), ImageFormat::Jpeg)),
        ("x.hdr", hdr),
        ("x.exr", fs::read(&exr_path).expect("reads")),
    ];
    let mut stream = Stream::root(11);
    let (mut read, mut refused) = (0, 0);
    for (name, sound) in files {
        let path = folder.path().join(name);
        fs::write(&path, &sound).expect("writes");
        assert!(look(&path).0.is_ok(), "{name}: {:?}", look(&path));
        for round in 0..150 {
            let mut bytes = sound.clone();
            for _ in 0..=stream.below(4) {
                let at = stream.below(bytes.len() as u64) as usize;
                match stream.below(4) {
                    0 => bytes[at] ^= 1 << stream.below(8),
                    1 => bytes[at] = [0, 255, b'9', b'-', b' ', 127][stream.below(6) as usize],
                    2 => bytes.truncate(at.max(1)),
                    _ => bytes.insert(at, b'9'),
                }
            }
            fs::write(&path, &bytes).expect("writes");
            let started = std::time::Instant::now();
            let ((found, _), most) = peak(|| look(&path));
            assert!(most < 256 << 20, "{name}, round {round}: {most} bytes");
            assert!(started.elapsed().as_secs() < 20, "{name}, round {round}");
            if found.is_ok() { read += 1 } else { refused += 1 }
        }
    }
    assert!(read > 50 && refused > 200, "{read} read, {refused} refused: the damage is too weak or too strong");
}

/// A UV sphere of 180 000 triangles loads whole, in a few times the memory of its file.
#[test]
fn a_large_mesh_loads_in_memory_of_the_order_of_its_file() {
    let (rings, sectors, radius) = (300_usize, 300_usize, 0.1_f64);
    let positions = (0..=rings).flat_map(|i| {
        (0..sectors).map(move |j| {
            let (theta, phi) =
                (std::f64::consts::PI * i as f64 / rings as f64, std::f64::consts::TAU * j as f64 / sectors as f64);
            // sin π is not quite zero, but the poles are single points.
            let sine = if i == 0 || i == rings { 0.0 } else { theta.sin() };
            [sine * phi.cos(), sine * phi.sin(), theta.cos()].map(|x| (radius * x) as f32)
        })
    });
    let triangles = (0..rings).flat_map(|i| {
        (0..sectors).flat_map(move |j| {
            let at = |i: usize, j: usize| (i * sectors + j % sectors) as u32;
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
    });
    let counts = [(rings + 1) * sectors, rings * sectors * 2].map(|count| count.to_string());
    let mut ply = ply_header("binary_little_endian", &counts[0], &counts[1]).into_bytes();
    let mut obj = Vec::new();
    for p in positions {
        ply.extend(p.iter().flat_map(|x| x.to_le_bytes()));
        writeln!(obj, "v {:.9} {:.9} {:.9}", p[0], p[1], p[2]).expect("writes");
    }
    for t in triangles {
        ply.push(3);
        ply.extend(t.iter().flat_map(|index| index.to_le_bytes()));
        writeln!(obj, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).expect("writes");
    }
    let folder = TempDir::new().expect("temp folder");
    for (name, bytes) in [("sphere.ply", ply), ("sphere.obj", obj)] {
        write(folder.path(), name, &bytes);
        let size = bytes.len();
        drop(bytes);
        let ((found, _), most) = peak(|| look(&folder.path().join(name)));
        let found = found.expect("loads");
        assert!(most < 8 * size, "{name}: {most} bytes for a file of {size}");
        // The degenerate triangles at the poles are removed.
        assert_eq!(fact(&found, "triangles"), (2 * sectors * (rings - 1)).to_string());
        assert_eq!(fact(&found, "closed"), "yes");
        // 4/3 π r³ is 4.1888; flat triangles inside the sphere have a little less.
        assert_eq!(fact(&found, "volume"), "4.1884 liter");
    }
}
