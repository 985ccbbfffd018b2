//! Valid inputs that the tests create, and helpers to check changed ones.

use crate::common::{look, peak, source_of};
use image::{DynamicImage, ImageFormat, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use syntable_model::context::Collected;
use syntable_model::scene::Object;
use tempfile::TempDir;

/// Corners of a box of 60 × 80 × 100 mm, in meters, and its faces, counter-clockwise from outside.
pub const CORNERS: [[f32; 3]; 8] = [
    [-0.03, -0.04, 0.0],
    [-0.03, -0.04, 0.1],
    [-0.03, 0.04, 0.0],
    [-0.03, 0.04, 0.1],
    [0.03, -0.04, 0.0],
    [0.03, -0.04, 0.1],
    [0.03, 0.04, 0.0],
    [0.03, 0.04, 0.1],
];
pub const QUADS: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];

pub fn triangles() -> Vec<[u32; 3]> {
    QUADS.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

pub fn obj(scale: f32) -> String {
    let mut text = String::from("mtllib model.mtl\nusemtl skin\n");
    for [x, y, z] in CORNERS {
        text += &format!("v {} {} {}\n", x * scale, y * scale, z * scale);
    }
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for [a, b, c] in triangles() {
        text += &format!("f {}/1 {}/2 {}/3\n", a + 1, b + 1, c + 1);
    }
    text
}

pub const MTL: &str = "newmtl skin\nKd 1 1 1\nmap_Kd texture.png\n";

pub fn encode(image: DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("encodes");
    bytes.into_inner()
}

pub fn png() -> Vec<u8> {
    encode(RgbImage::from_fn(8, 8, |x, y| image::Rgb([x as u8 * 30, y as u8 * 30, 90])).into(), ImageFormat::Png)
}

/// A chunk of a PNG with its checksum.
pub fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [kind, data].concat();
    let crc = !body.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    [&(data.len() as u32).to_be_bytes()[..], &body, &crc.to_be_bytes()].concat()
}

/// A PNG that declares a size but holds little data.
pub fn png_of_size(width: u32, height: u32) -> Vec<u8> {
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 6, 0, 0, 0]].concat();
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]),
        chunk(b"IEND", &[]),
    ]
    .concat()
}

pub fn write(folder: &Path, path: &str, bytes: impl AsRef<[u8]>) {
    let path = folder.join(path);
    fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
    fs::write(path, bytes).expect("file");
}

/// A valid object in the layout of Google Scanned Objects.
pub fn gso(folder: &Path, name: &str) {
    write(folder, &format!("{name}/meshes/model.obj"), obj(1.0));
    write(folder, &format!("{name}/meshes/model.mtl"), MTL);
    write(folder, &format!("{name}/materials/textures/texture.png"), png());
}

/// Required outcome of a case.
pub enum Want<'a> {
    Reject(&'a str),
    Warn(&'a str),
    Accept,
}
pub use Want::{Accept, Reject, Warn};

/// Inspects a path of a folder. In every case, it must need little memory.
pub fn check(folder: &Path, path: &str, case: &str, want: &Want<'_>) {
    let ((found, warnings), bytes) = peak(|| look(&folder.join(path)));
    assert!(bytes < 16 << 20, "{case}: {bytes} bytes at once");
    match (want, found) {
        (Reject(says), Err(error)) => {
            let error = error.to_string();
            assert!(error.contains(says), "{case}: {error:?} does not say {says:?}");
            assert!(!error.contains('\n') && error.contains(folder.to_str().expect("UTF-8")), "{case}: {error:?}");
        }
        (Warn(says), Ok(_)) => {
            assert!(warnings.iter().any(|warning| warning.contains(says)), "{case}: {warnings:?} do not say {says:?}");
        }
        (Accept, Ok(_)) => assert!(warnings.is_empty(), "{case}: {warnings:?}"),
        (Reject(says), Ok(_)) => panic!("{case}: accepted with {warnings:?}, but must be rejected: {says}"),
        (Warn(_) | Accept, Err(error)) => panic!("{case}: {error}"),
    }
}

/// A name, a change of a valid object's folder, and the required outcome.
pub type Case<'a> = (&'a str, &'a dyn Fn(&Path), Want<'a>);

/// Cases of one object: every change is applied to a fresh valid one.
pub fn check_objects(cases: &[Case<'_>]) {
    for (case, change, want) in cases {
        let folder = TempDir::new().expect("temp folder");
        gso(folder.path(), "it");
        change(&folder.path().join("it"));
        check(folder.path(), "it", case, want);
    }
}

pub fn ply_header(format: &str, vertices: &str, faces: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made here\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty \
         float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

pub fn ply_ascii() -> String {
    let mut text = ply_header("ascii", "8", "6");
    CORNERS.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    QUADS.iter().for_each(|[a, b, c, d]| text += &format!("4 {a} {b} {c} {d} \n"));
    text
}

pub fn ply_binary(big: bool) -> Vec<u8> {
    let name = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = ply_header(name, "8", "12").into_bytes();
    let word = |bits: u32| if big { bits.to_be_bytes() } else { bits.to_le_bytes() };
    CORNERS.iter().flatten().for_each(|x| bytes.extend(word(x.to_bits())));
    for triangle in triangles() {
        bytes.push(3);
        triangle.iter().for_each(|&index| bytes.extend(word(index)));
    }
    bytes
}

pub fn check_file(name: &str, bytes: impl AsRef<[u8]>, case: &str, want: Want<'_>) {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), name, bytes);
    check(folder.path(), name, case, &want);
}

/// Base64 as RFC 4648 defines it.
pub fn base64(bytes: &[u8]) -> String {
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for part in bytes.chunks(3) {
        let word = part.iter().fold(0_u32, |word, &byte| word << 8 | u32::from(byte)) << (8 * (3 - part.len()));
        for i in 0..4 {
            text.push(if i <= part.len() { char::from(letters[(word >> (18 - 6 * i) & 63) as usize]) } else { '=' });
        }
    }
    text
}

/// The box as a glTF buffer, y up: (x, y, z) of ours is (x, z, -y) there.
pub fn gltf_bytes() -> Vec<u8> {
    let mut bytes = Vec::new();
    CORNERS.iter().for_each(|&[x, y, z]| [x, z, -y].iter().for_each(|v| bytes.extend(v.to_le_bytes())));
    triangles().iter().flatten().for_each(|&index| bytes.extend((index as u16).to_le_bytes()));
    bytes
}

pub fn gltf(uri: &str) -> String {
    let uri = if uri.is_empty() { String::new() } else { format!(r#", "uri": "{uri}""#) };
    format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "scene": 0, "scenes": [{{ "nodes": [0] }}], "nodes": [{{ "mesh": 0 }}],
 "meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0 }}, "indices": 1 }}] }}],
 "buffers": [{{ "byteLength": 168{uri} }}],
 "bufferViews": [{{ "buffer": 0, "byteLength": 96 }}, {{ "buffer": 0, "byteOffset": 96, "byteLength": 72 }}],
 "accessors": [{{ "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] }},
  {{ "bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR" }}] }}"#
    )
}

pub fn embedded() -> String {
    gltf(&format!("data:application/octet-stream;base64,{}", base64(&gltf_bytes())))
}

pub fn glb() -> Vec<u8> {
    let mut json = gltf("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let data = gltf_bytes();
    let length = 12 + 8 + json.len() + 8 + data.len();
    let word = |x: usize| (x as u32).to_le_bytes();
    [b"glTF", &word(2)[..], &word(length), &word(json.len()), b"JSON", &json, &word(data.len()), b"BIN\0", &data]
        .concat()
}

pub fn load(root: &Path, name: &str) -> Object {
    let log = Collected::default();
    let asset = source_of("mesh_folder", root, "").load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(log.warnings().is_empty(), "{name}: {:?}", log.warnings());
    std::sync::Arc::unwrap_or_clone(asset.into_object().expect("an object"))
}

pub fn stl(ascii: bool) -> Vec<u8> {
    let corners = |t: &[u32; 3]| t.map(|index| CORNERS[index as usize]);
    if ascii {
        let vertex = |[x, y, z]: [f32; 3]| format!("vertex {x} {y} {z}\n");
        let facet = |t: &[u32; 3]| {
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners(t).map(vertex).concat())
        };
        return format!("solid x\n{}endsolid x\n", triangles().iter().map(facet).collect::<String>()).into_bytes();
    }
    let mut bytes = vec![b' '; 80];
    bytes.extend(12_u32.to_le_bytes());
    for triangle in triangles() {
        bytes.extend([0; 12]);
        corners(&triangle).iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}
