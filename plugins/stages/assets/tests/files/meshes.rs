//! Bad and unusual PLY, glTF and GLB files, and one box in all formats.

use crate::common::source_of;
use crate::inputs::*;
use syntable_mesh::size::{self, StatedLengths};
use syntable_model::context::Collected;
use syntable_model::geometry::Point3;
use syntable_model::scene::Object;
use tempfile::TempDir;

#[test]
fn ply_files() {
    let binary = ply_binary(false);
    let body = |text: &str| ply_ascii().replace("end_header\n", text);
    let check = |bytes: &[u8], case: &str, want: Want<'_>| check_file("x.ply", bytes, case, want);
    check(ply_ascii().as_bytes(), "text", Accept);
    check(ply_ascii().replace('\n', "\r\n").as_bytes(), "CRLF", Accept);
    check(&binary, "little-endian", Accept);
    check(&ply_binary(true), "big-endian", Accept);
    let extra = ply_ascii()
        .replace("property float z\n", "property float z\nproperty double quality\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement camera 0\nproperty float fx\n")
        .lines()
        .map(|l| if l.split(' ').count() == 3 && l.contains('.') && !l.starts_with('f') { format!("{l} 0.5 200 100 50\n") } else { format!("{l}\n") })
        .collect::<String>();
    check(extra.as_bytes(), "extra properties", Accept);
    check(
        body("comment TextureFile none.png\nend_header\n").as_bytes(),
        "no image",
        Warn("texture `none.png` is missing"),
    );
    check(
        body("comment TextureFile ../../x.png\nend_header\n").as_bytes(),
        "an image outside",
        Reject("leaves the asset's folder"),
    );
    check(b"", "empty", Reject("empty"));
    check(b"\x00\x01garbage\n\n", "garbage", Reject("not a PLY file"));
    check(&binary[..binary.len() / 2], "cut in half", Reject("bytes"));
    check(&binary[..binary.len() - 4], "cut in the last face", Reject("bytes"));
    let ascii = ply_ascii();
    check(&ascii.as_bytes()[..ascii.len() - 20], "text cut short", Reject("a list has 4 items"));
    check(body("").as_bytes(), "no end of the header", Reject("end_header"));
    check(&ply_ascii().as_bytes()[..60], "only a header", Reject("no `end_header`"));
    check(
        ply_ascii().replace("vertex 8", "vertex 4000000000").as_bytes(),
        "vertex bomb",
        Reject("4000000000 rows of element `vertex` need"),
    );
    check(
        ply_ascii().replace("face 6", "face 99999999999999999999").as_bytes(),
        "face bomb",
        Reject("is not a number of rows"),
    );
    check(
        ply_ascii().replace("vertex 8", "vertex -8").as_bytes(),
        "negative count",
        Reject("`-8` is not a number of rows"),
    );
    check(
        ply_ascii().replace("4 0 1 3 2", "4 0 1 3 300").as_bytes(),
        "index",
        Reject("x.ply:19: face 0 has index 300, but the mesh has 8 vertices"),
    );
    check(ply_ascii().replace("4 0 1 3 2", "4 0 1 3 -1").as_bytes(), "negative index", Reject("face 0 has index -1"));
    check(
        ply_ascii().replace("4 0 1 3 2", "2 0 1").as_bytes(),
        "two corners",
        Warn("faces with fewer than three corners are left out: 1"),
    );
    check(
        ply_ascii().replace("4 0 1 3 2", "4294967295 0 1").as_bytes(),
        "text list bomb",
        Reject("a list has 4294967295 items"),
    );
    check(ply_ascii().replace("-0.03 -0.04 0\n", "-0.03 nan 0\n").as_bytes(), "nan", Reject("non-finite vertex 0"));
    let bomb = [ply_header("binary_little_endian", "0", "1").replace("list uchar", "list uint").as_bytes(), &[255; 40]]
        .concat();
    check(&bomb, "list bomb", Reject("a list has 4294967295 items"));
    let nothing = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nend_header\n";
    check(nothing.as_bytes(), "rows of nothing", Reject("4000000000 rows"));
    check(ply_ascii().replace("ascii", "ebcdic").as_bytes(), "format", Reject("`ebcdic` is not a format"));
    check(
        ply_ascii().replace("property float y\n", "property float w\n").as_bytes(),
        "no y",
        Reject("no property `y`"),
    );
}

#[test]
fn gltf_files() {
    let sound = embedded();
    let check = |from: &str, to: &str, case: &str, want: Want<'_>| {
        assert!(from.is_empty() || sound.contains(from), "{case} changes nothing");
        check_file("x.gltf", sound.replacen(from, to, usize::from(!from.is_empty())), case, want);
    };
    check("", "", "plain", Accept);
    check(r#""version": "2.0""#, r#""version": "1.0""#, "version 1", Reject("glTF version `1.0`"));
    check(r#""scene": 0"#, r#""scene": 7"#, "scene", Reject("the file refers to scene 7, but has 1"));
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 3 }]"#,
        "mesh",
        Reject("the file refers to mesh 3, but has 1"),
    );
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 0, "children": [1] }, { "children": [0] }]"#,
        "cycle",
        Reject("node 0 is reached twice"),
    );
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 0, "children": [0] }]"#,
        "its own child",
        Reject("node 0 is reached twice"),
    );
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 0, "scale": [1e38, 1e38, 1e38], "children": [1] }, { "mesh": 0, "scale": [1e38, 1, 1] }]"#,
        "overflow",
        Reject("gives a non-finite vertex"),
    );
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 0, "scale": [0, 0, 0] }]"#,
        "no scale",
        Reject("faces has area"),
    );
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 0, "scale": [1000, 1000, 1000] }]"#,
        "large",
        Reject("object extent 100.000 m"),
    );
    check(r#""nodes": [{ "mesh": 0 }]"#, r#""nodes": [{ "scale": [1, 1, 1] }]"#, "no mesh", Reject("no faces"));
    check(
        r#""byteLength": 168"#,
        r#""byteLength": 1000000000"#,
        "buffer",
        Reject("buffer 0 declares 1000000000 bytes"),
    );
    check(
        r#""byteOffset": 96, "byteLength": 72"#,
        r#""byteOffset": 96, "byteLength": 99999"#,
        "view",
        Reject("over 99999 bytes, but buffer 0 has 168"),
    );
    check(
        r#""byteOffset": 96, "byteLength": 72"#,
        r#""byteOffset": 18446744073709551615, "byteLength": 72"#,
        "offset overflow",
        Reject("buffer view 1 reaches"),
    );
    check(
        r#""count": 36"#,
        r#""count": 400000000"#,
        "accessor",
        Reject("400000000 elements need 800000000 bytes, but the buffer view has 72"),
    );
    check(r#""count": 36"#, r#""count": 18446744073709551615"#, "count overflow", Reject("elements need"));
    check(r#""count": 36"#, r#""count": 35"#, "a broken triangle", Reject("not a multiple of three"));
    check(
        r#""bufferView": 1, "componentType": 5123, "count": 36"#,
        r#""componentType": 5123, "count": 300000000"#,
        "no data",
        Reject("300000000 elements without data"),
    );
    check(
        r#""count": 8, "type": "VEC3""#,
        r#""count": 7, "type": "VEC3""#,
        "index",
        Reject("index 7, but only 7 vertices"),
    );
    check(r#""componentType": 5126"#, r#""componentType": 99"#, "type of number", Reject("an unknown type of number"));
    check(r#""type": "SCALAR""#, r#""type": "VEC2""#, "width", Reject("2 numbers per element instead of 1"));
    check(
        r#""scene": 0"#,
        r#""scene": 0, "extensionsRequired": ["EXT_not_real"]"#,
        "required extension",
        Reject("`EXT_not_real`"),
    );
    check(
        r#""scene": 0"#,
        r#""scene": 0, "extensionsUsed": ["EXT_not_real"]"#,
        "optional extension",
        Warn("EXT_not_real"),
    );
    check(r#""scene": 0"#, r#""scene": 0, "extensionsRequired": ["KHR_mesh_quantization"]"#, "quantized", Accept);
    check("] }", "", "cut JSON", Reject("invalid glTF JSON"));
    check(";base64,", ",", "another coding", Reject("not encoded in base64"));
    check(";base64,", ";base64,?", "wrong base64", Reject("not valid base64"));
    let deep = format!(r#"{{"asset":{{"version":"2.0"}},"extras":{}{}}}"#, "[".repeat(20_000), "]".repeat(20_000));
    check_file("x.gltf", deep, "deep", Reject("nested more than"));
    check_file("x.gltf", "", "empty", Reject("empty"));
    check_file("x.gltf", "{}", "no asset", Reject("`asset` is missing"));
    for (uri, want) in [
        ("none.bin", "buffer 0 refers to the missing file `none.bin`"),
        ("../../secret.bin", "leaves the asset's folder"),
        ("%2e%2e/secret.bin", "leaves the asset's folder"),
        ("/etc/passwd", "buffer 0 refers to the missing file `/etc/passwd`"),
        ("http://example.invalid/box.bin", "is a network address"),
        ("file:///etc/passwd", "is a network address"),
        ("..\\\\secret.bin", "leaves the asset's folder"),
    ] {
        check_file("x.gltf", gltf(uri), uri, Reject(want));
    }
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "my box.bin", gltf_bytes());
    write(folder.path(), "x.gltf", gltf("my%20box.bin"));
    crate::inputs::check(folder.path(), "x.gltf", "a file", &Accept);
    write(folder.path(), "my box.bin", [0; 100]);
    crate::inputs::check(
        folder.path(),
        "x.gltf",
        "a short file",
        &Reject("declares 168 bytes, but `my%20box.bin` has 100"),
    );
}

#[test]
fn glb_files() {
    let sound = glb();
    let check = |bytes: &[u8], case: &str, want: Want<'_>| check_file("x.glb", bytes, case, want);
    check(&sound, "plain", Accept);
    check(&sound[..sound.len() - 60], "cut short", Reject("not a valid GLB: the header states"));
    check(&sound[..10], "a stump", Reject("the file ends after 10 bytes"));
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = sound.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        changed
    };
    check(&with(12, &[255; 4]), "chunk bomb", Reject("a chunk has 4294967295 bytes"));
    check(&with(4, &[1, 0, 0, 0]), "version 1", Reject("glTF version `1`"));
    check(&with(4, &[9, 9, 9, 9]), "garbage", Reject("not a valid GLB"));
    check(&with(16, b"WHAT"), "first chunk", Reject("not JSON"));
    let bin = sound.windows(4).position(|word| word == b"BIN\0").expect("a chunk");
    check(&with(bin, b"WHAT"), "no data", Reject("neither a file nor a binary chunk"));
}

#[test]
fn instances_are_counted_out_with_their_transforms() {
    // A parent at twice the size holds a plain child, and a child that is mirrored, rotated and moved.
    let nodes = r#""nodes": [{ "scale": [2, 2, 2], "children": [1, 2] }, { "mesh": 0 },
        { "mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0.70710678, 0, 0.70710678], "scale": [-1, 1, 1] }]"#;
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "x.gltf", embedded().replace(r#""nodes": [{ "mesh": 0 }]"#, nodes));
    let object = load(folder.path(), "x");
    assert_eq!((object.mesh.data().triangles.len(), object.mesh.data().positions.len()), (24, 16));
    // A quarter turn about y swaps the widths; all sizes double; the mirrored box is not inside out.
    assert!((object.mesh.signed_volume() - 2.0 * 8.0 * 0.000_48).abs() < 1e-7, "{}", object.mesh.signed_volume());
    let bounds = object.mesh.bounds();
    let (min, max) = ([-0.06, -0.08, 0.0], [2.08, 0.08, 0.2]);
    let apart = (bounds.min - Point3::from(min)).norm().max((bounds.max - Point3::from(max)).norm());
    assert!(apart < 1e-6, "{bounds:?}");
    // A small file must not place millions of triangles.
    let many = (0..2_000_000 / 12).map(|_| r#"{"mesh":0}"#).collect::<Vec<_>>();
    let nodes = format!(r#""nodes": [{}]"#, many.join(","));
    let scene = format!(r#""nodes": [{}]"#, (0..many.len()).map(|i| i.to_string()).collect::<Vec<_>>().join(","));
    let huge = embedded().replace(r#""nodes": [{ "mesh": 0 }]"#, &nodes).replace(r#""nodes": [0]"#, &scene);
    let sixteenfold =
        huge.replace(r#""indices": 1 }"#, &[r#""indices": 1 }"#; 9].join(r#", { "attributes": { "POSITION": 0 }, "#));
    write(folder.path(), "y.gltf", sixteenfold);
    let error = source_of("mesh_folder", folder.path(), "").load("y", &Collected::default()).expect_err("too many");
    assert!(error.to_string().contains("exceed the limit of 4000000 triangles"), "{error}");
}

/// Triangles as triples of positions, each starting at its smallest corner, sorted: the shape without its numbering.
fn shape(object: &Object) -> Vec<[[i64; 3]; 3]> {
    let corner = |p: [f32; 3]| p.map(|x| (f64::from(x) * 1e6).round() as i64);
    let data = object.mesh.data();
    let mut shape: Vec<_> = data
        .triangles
        .iter()
        .map(|triangle| {
            let mut corners = triangle.map(|index| corner(data.positions[index as usize]));
            let first = (0..3).min_by_key(|&i| corners[i]).expect("three");
            corners.rotate_left(first);
            corners
        })
        .collect();
    shape.sort_unstable();
    shape
}

#[test]
fn one_box_is_the_same_in_all_formats() {
    let folder = TempDir::new().expect("temp folder");
    let root = folder.path();
    write(root, "reference.obj", obj(1.0).replace("mtllib model.mtl\nusemtl skin\n", ""));
    let reference = load(root, "reference");
    assert_eq!(reference.mesh.data().triangles.len(), 12);
    assert!((reference.mesh.signed_volume() - 0.000_48).abs() < 1e-9);
    assert!((reference.mass.kg - 0.000_48 * 400.0).abs() < 1e-6);
    let mut quads = String::new();
    CORNERS.iter().for_each(|[x, y, z]| quads += &format!("v {x} {y} {z}\n"));
    QUADS.iter().for_each(|[a, b, c, d]| quads += &format!("f {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1));
    for (name, bytes) in [
        ("quads.obj", quads.into_bytes()),
        ("text.ply", ply_ascii().into_bytes()),
        ("little.ply", ply_binary(false)),
        ("big.ply", ply_binary(true)),
        ("text.gltf", embedded().into_bytes()),
        ("binary.glb", glb()),
        ("text.stl", stl(true)),
        ("binary.stl", stl(false)),
    ] {
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), name, bytes);
        let object = load(folder.path(), name.split('.').next().expect("a stem"));
        assert_eq!(shape(&object), shape(&reference), "{name}");
        assert_eq!(object.mesh.data().positions.len(), 8, "{name}");
    }
    // With y up the box lies on its back: (x, y, z) becomes (x, -z, y).
    let source = source_of("mesh_folder", root, "up = \"y\"");
    let lying = source.load("reference", &Collected::default()).expect("loads").into_object().expect("an object");
    let size = lying.mesh.bounds().size();
    assert!((size - syntable_model::geometry::Vector3::new(0.06, 0.1, 0.08)).norm() < 1e-6, "{size}");
    assert!(lying.mesh.signed_volume() > 0.0);
}

#[test]
fn a_pool_may_scale_what_the_extent_check_refuses() {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "mm.stl", {
        let mut b = stl(true);
        b = String::from_utf8(b)
            .expect("text")
            .replace("0.03", "30")
            .replace("0.04", "40")
            .replace("0.1", "100")
            .into_bytes();
        b
    });
    let mut object = load(folder.path(), "mm");
    let check = |object: &Object| size::check(object.mesh.bounds().size().max(), StatedLengths::default());
    assert!(check(&object).is_err());
    object.mesh = std::sync::Arc::new(object.mesh.transformed(Default::default(), 0.001).expect("sound"));
    check(&object).expect("ten centimeters");
    assert!((object.mesh.signed_volume() - 0.000_48).abs() < 1e-9);
}
