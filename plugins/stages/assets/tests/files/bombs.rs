//! Small files that expand to large data, and files that once took long. The program counts the memory of an asset
//! before it allocates it, and the limit is an option.

use crate::common::{peak, source_of};
use crate::inputs::*;
use image::{ImageFormat, RgbImage};
use serde_json::json;
use std::path::Path;
use std::time::{Duration, Instant};
use syntable_model::context::Collected;
use syntable_model::error::Result;
use syntable_model::scene::Asset;
use syntable_model::stage::AssetLimits;
use tempfile::TempDir;

/// Loads the asset `x` of a folder within limits; also returns the peak memory in bytes, and the warnings.
fn load_within(kind: &str, root: &Path, limits: AssetLimits) -> (Result<Asset>, usize, Vec<String>) {
    let log = Collected::default();
    let mut source = source_of(kind, root, "");
    source.limit(limits);
    let (loaded, bytes) = peak(|| source.load("x", &log));
    (loaded, bytes, log.merged().iter().map(ToString::to_string).collect())
}

fn refused(kind: &str, root: &Path, limits: AssetLimits, says: &str, most_bytes: usize) {
    let (loaded, bytes, _) = load_within(kind, root, limits);
    let error = loaded.err().unwrap_or_else(|| panic!("accepted: {says}")).to_string();
    assert!(error.contains(says), "{error} lacks {says}");
    assert!(bytes < most_bytes, "{says}: {bytes} bytes at once");
}

/// A GLB of a table and a chunk of bytes.
fn glb_of(document: &serde_json::Value, data: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |x: usize| (x as u32).to_le_bytes();
    let length = 12 + 8 + json.len() + 8 + data.len();
    [b"glTF", &word(2)[..], &word(length), &word(json.len()), b"JSON", &json, &word(data.len()), b"BIN\0", data]
        .concat()
}

#[test]
fn many_primitives_on_one_accessor_count_by_what_they_use() {
    let folder = TempDir::new().expect("temp folder");
    // A million vertices in 12 MB; 400 primitives would make 133 million triangles.
    let count = 999_999;
    let mut data: Vec<u8> = Vec::new();
    for i in 0..count {
        let angle = i as f32 * 0.1;
        [angle.sin() * 0.1, angle.cos() * 0.1, i as f32 * 1e-7].iter().for_each(|x| data.extend(x.to_le_bytes()));
    }
    let document =
        |primitives: Vec<serde_json::Value>, views: serde_json::Value, accessors: serde_json::Value, bytes: usize| {
            json!({ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": primitives }], "buffers": [{ "byteLength": bytes }], "bufferViews": views,
            "accessors": accessors })
        };
    let positions = json!({ "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3" });
    let whole = json!({ "buffer": 0, "byteLength": data.len() });
    let bomb =
        document(vec![json!({ "attributes": { "POSITION": 0 } }); 400], json!([whole]), json!([positions]), data.len());
    write(folder.path(), "x.glb", glb_of(&bomb, &data));
    let limit = "exceed the limit of 4000000 triangles (raise the pool's `limits = { triangles = 4000000 }`";
    refused("mesh_folder", folder.path(), AssetLimits::default(), limit, 400 << 20);
    let little = AssetLimits { megabytes: 10, ..AssetLimits::default() };
    refused("mesh_folder", folder.path(), little, "exceed the limit of 10 megabytes", 1 << 20);

    // Four hundred small parts of one long array are not a bomb: exporters often write them.
    let at = data.len();
    let parts = 400;
    for part in 0..parts {
        let first = part * 7_u32;
        [first, first + 1, first + 2, first, first + 2, first + 3].iter().for_each(|i| data.extend(i.to_le_bytes()));
    }
    let part = |i: u32| json!({ "attributes": { "POSITION": 0 }, "indices": 1 + i });
    let indices =
        |i: u32| json!({ "bufferView": 1, "byteOffset": i * 24, "componentType": 5125, "count": 6, "type": "SCALAR" });
    let accessors: Vec<_> = std::iter::once(positions).chain((0..parts).map(indices)).collect();
    let views = json!([whole, { "buffer": 0, "byteOffset": at, "byteLength": data.len() - at }]);
    let shared = document((0..parts).map(part).collect(), views, json!(accessors), data.len());
    write(folder.path(), "x.glb", glb_of(&shared, &data));
    let (loaded, bytes, _) = load_within("mesh_folder", folder.path(), AssetLimits::default());
    let object = loaded.expect("sound").into_object().expect("an object");
    assert_eq!((object.mesh.data().triangles.len(), object.mesh.data().positions.len()), (800, 1600));
    // The file itself, and little more.
    assert!(bytes < 20 << 20, "{bytes} bytes at once");
}

#[test]
fn the_pixels_of_all_textures_count_together() {
    let folder = TempDir::new().expect("temp folder");
    let (mut text, mut library) = (obj(1.0), String::new());
    let faces: Vec<String> = text.lines().filter(|line| line.starts_with("f ")).map(str::to_owned).collect();
    for i in 0..24 {
        text += &format!("usemtl m{i}\n{}\n", faces[i % faces.len()]);
        library += &format!("newmtl m{i}\nmap_Kd {i}.png\n");
        let image = RgbImage::from_pixel(256, 256, image::Rgb([i as u8, 0, 0]));
        write(folder.path(), &format!("{i}.png"), encode(image.into(), ImageFormat::Png));
    }
    write(folder.path(), "x.obj", text);
    write(folder.path(), "model.mtl", format!("newmtl skin\n{library}"));
    let limits = |megapixels| AssetLimits { megapixels, ..AssetLimits::default() };
    let says =
        "0.png: the asset is too large: with 256 x 256 pixels, its images would exceed the limit of 1 megapixels";
    refused("mesh_folder", folder.path(), limits(1), says.trim_start_matches("0.png: "), 6 << 20);
    assert!(
        load_within("mesh_folder", folder.path(), limits(2)).0.is_ok(),
        "24 x 65536 pixels are less than two million"
    );
}

#[test]
fn channels_of_an_environment_map_that_mean_nothing_take_no_memory() {
    use exr::prelude::*;
    let folder = TempDir::new().expect("temp folder");
    let (width, height) = (512, 256);
    let flat =
        |name: &str| AnyChannel::new(name, FlatSamples::F32(vec![if name == "R" { 2.0 } else { 0.5 }; width * height]));
    // Memory beside the file itself, without and with other channels.
    let taken = |others: usize| {
        let names = ["R", "G", "B"].map(str::to_owned).into_iter().chain((0..others).map(|i| format!("layer.{i}")));
        let channels = AnyChannels::sort(names.map(|name| flat(&name)).collect());
        let layer = Layer::new((width, height), LayerAttributes::named("all"), Encoding::FAST_LOSSLESS, channels);
        let path = folder.path().join("x.exr");
        Image::from_layer(layer).write().to_file(&path).expect("writes");
        let (loaded, bytes, _) = load_within("environment_folder", folder.path(), AssetLimits::default());
        let map = loaded.expect("sound").into_environment().expect("a map");
        assert_eq!((map.width(), map.texels()[7]), (512, [2.0, 0.5, 0.5]));
        bytes - std::fs::metadata(&path).expect("a file").len() as usize
    };
    let (few, many) = (taken(0), taken(29));
    // All channels would take 29 x 4 bytes per pixel; only one block is unpacked at a time.
    assert!(many < few + 29 * 4 * width * height / 4, "{few} and {many} bytes at once");
}

#[test]
fn a_face_of_very_many_corners_is_refused_as_it_is_read() {
    let folder = TempDir::new().expect("temp folder");
    let limits = AssetLimits { triangles: 1000, ..AssetLimits::default() };
    let corners = 300_000;
    let vertices = CORNERS.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let text = format!("{vertices}f{}\n", " 1 2 4 3".repeat(corners / 4));
    write(folder.path(), "x.obj", &text);
    refused("mesh_folder", folder.path(), limits, "x.obj:9: the asset is too large", text.len() + (1 << 20));
    std::fs::remove_file(folder.path().join("x.obj")).expect("removes");
    let header = ply_header("binary_little_endian", "8", "1").replace("list uchar int", "list uint uchar");
    let mut bytes = header.into_bytes();
    CORNERS.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes.extend((corners as u32).to_le_bytes());
    bytes.extend(std::iter::repeat_n(1, corners));
    write(folder.path(), "x.ply", &bytes);
    refused(
        "mesh_folder",
        folder.path(),
        limits,
        "a list of 300000 items exceeds the limit of 1002",
        bytes.len() + (1 << 20),
    );
}

#[test]
fn repetitions_take_no_time_and_are_told_once() {
    let folder = TempDir::new().expect("temp folder");
    let timed = |says: &str, warnings: usize| {
        let start = Instant::now();
        let (loaded, _, told) = load_within("mesh_folder", folder.path(), AssetLimits::default());
        loaded.unwrap_or_else(|error| panic!("{says}: {error}"));
        assert!(start.elapsed() < Duration::from_secs(5), "{says}: {:?}", start.elapsed());
        assert_eq!(told.len(), warnings, "{says}: {told:?}");
    };
    // 20,000 statements of one library of half a megabyte, which the program once read each time.
    let sound = obj(1.0);
    let library = format!("{MTL}{}", "# a comment\n".repeat(40_000));
    write(folder.path(), "model.mtl", library);
    write(folder.path(), "texture.png", png());
    write(folder.path(), "x.obj", format!("{}{sound}", "mtllib model.mtl\n".repeat(20_000)));
    timed("mtllib", 0);
    // 60,000 materials that the library lacks.
    let mut text = sound.clone();
    let face = sound.lines().find(|line| line.starts_with("f ")).expect("a face").to_owned();
    (0..60_000).for_each(|i| text += &format!("usemtl m{i}\n{face}\n"));
    write(folder.path(), "x.obj", text);
    // One warning for the materials, one for the duplicate faces.
    timed("usemtl", 2);
    std::fs::remove_file(folder.path().join("x.obj")).expect("removes");
    // 30,000 elements without properties, each with as many rows as the file has bytes.
    let mut bytes = ply_binary(false);
    let end = bytes.windows(11).position(|word| word == b"end_header\n").expect("a header");
    let elements: Vec<u8> = (0..30_000).flat_map(|i| format!("element e{i} 500000\n").into_bytes()).collect();
    let first = bytes.windows(8).position(|word| word == b"element ").expect("an element");
    bytes.splice(first..first, elements);
    assert!(end > first);
    bytes.resize(bytes.len() + 1_000_000, 0);
    write(folder.path(), "x.ply", bytes);
    timed("PLY", 0);
}
