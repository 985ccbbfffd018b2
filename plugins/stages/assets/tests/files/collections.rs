//! Sources: material folders, BOP datasets, environment maps, digests, wrong roots.

use crate::common::{fact, look, source_of};
use crate::inputs::*;
use image::{DynamicImage, ImageFormat, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use syntable_model::context::Collected;
use tempfile::TempDir;

#[test]
fn digests_follow_the_content() {
    let folder = TempDir::new().expect("temp folder");
    gso(folder.path(), "a");
    gso(folder.path(), "b");
    let source = source_of("google_scanned_objects", folder.path(), "");
    let digest = |name: &str| source.load(name, &Collected::default()).expect(name).digest();
    let before = digest("a");
    assert_eq!(before, digest("b"));
    let mut seen = vec![before];
    for (path, bytes) in [
        ("a/materials/textures/texture.png", encode(RgbImage::new(8, 8).into(), ImageFormat::Png)),
        ("a/meshes/model.mtl", MTL.replace("Kd 1 1 1", "Kd 1 1 0.5").into_bytes()),
        ("a/meshes/model.mtl", MTL.replace("map_Kd", "map_Kd -s 2 2").into_bytes()),
        ("a/meshes/model.obj", obj(1.1).into_bytes()),
        ("a/meshes/model.obj", obj(1.0).replace("vt 1 1", "vt 1 0.5").into_bytes()),
    ] {
        write(folder.path(), path, bytes);
        let digest = digest("a");
        assert!(!seen.contains(&digest), "{path}");
        seen.push(digest);
    }
}

#[test]
fn keypoints_are_read_beside_the_mesh() {
    let folder = TempDir::new().expect("temp folder");
    gso(folder.path(), "gso/a");
    write(folder.path(), "meshes/mug.obj", obj(1.0));
    write(folder.path(), "ycb/b/google_16k/textured.obj", obj(1.0));
    let millimeters = ply_ascii().replace("0.03", "30").replace("0.04", "40").replace("0.1", "100");
    write(folder.path(), "bop/set/models/obj_000001.ply", millimeters);
    let none = |kind: &str, root: &str, name: &str| {
        let asset = source_of(kind, &folder.path().join(root), "").load(name, &Collected::default()).expect(name);
        asset.into_object().expect("an object")
    };
    let text =
        r#"{"keypoints": [{"name": "tip", "point": [0.01, 0.02, 0.03]}, {"name": "base", "point": [0, 0, -1e-3]}]}"#;
    for (kind, root, name, file) in [
        ("google_scanned_objects", "gso", "a", "gso/a/meshes/model.keypoints.json"),
        ("mesh_folder", "meshes", "mug", "meshes/mug.keypoints.json"),
        ("ycb", "ycb", "b", "ycb/b/google_16k/textured.keypoints.json"),
        ("bop_models", "bop", "set/obj_000001", "bop/set/models/obj_000001.keypoints.json"),
    ] {
        let before = none(kind, root, name);
        assert!(before.keypoints.is_empty(), "{kind}");
        write(folder.path(), file, text);
        let after = none(kind, root, name);
        let found: Vec<(&str, [f64; 3])> = after.keypoints.iter().map(|it| (&*it.name, it.point.into())).collect();
        assert_eq!(found, [("tip", [0.01, 0.02, 0.03]), ("base", [0.0, 0.0, -0.001])], "{kind}");
        assert_ne!(before.digest, after.digest, "{kind}");
        write(folder.path(), file, text.replace("0.03", "0.04"));
        assert_ne!(none(kind, root, name).digest, after.digest, "{kind}");
    }
}

#[test]
fn meshes_that_are_not_named_as_in_bop_are_counted() {
    let folder = TempDir::new().expect("temp folder");
    let catalog = |root: &str| {
        let log = Collected::default();
        let found = source_of("bop_models", &folder.path().join(root), "").catalog(&log).expect("models");
        let names: Vec<String> = found.entries.into_iter().map(|entry| entry.name).collect();
        (names, log.warnings().iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    write(folder.path(), "set/models/obj_000001.ply", ply_ascii());
    // The same object in another format, its texture, and text files cause no warning.
    for name in ["obj_000001.obj", "obj_000001.png", "notes.txt"] {
        write(folder.path(), &format!("set/models/{name}"), "");
    }
    let only = vec!["set/obj_000001".to_owned()];
    assert_eq!(catalog(""), (only.clone(), vec![]));
    write(folder.path(), "set/models/obj_2.ply", "");
    let (names, said) = catalog("set/models");
    assert_eq!((names, said.len()), (only.clone(), 1), "{said:?}");
    assert!(said[0].contains("1 mesh file is not named `obj_NNNNNN.ply` and skipped: `obj_2.ply`"), "{said:?}");
    for name in ["obj_000003.glb", "cup.obj", "mug.stl"] {
        write(folder.path(), &format!("set/models/{name}"), "");
    }
    write(folder.path(), "other/models/obj_000001.glb", "");
    let (names, said) = catalog("");
    assert_eq!((names, said.len()), (only, 2), "{said:?}");
    assert!(said[0].contains("1 mesh file is") && said[0].contains("other/models"), "{said:?}");
    assert!(
        said[1].contains("4 mesh files are") && said[1].contains("`cup.obj`, `mug.stl`, `obj_000003.glb`, …"),
        "{said:?}"
    );
}

#[test]
fn bad_keypoints_are_refused_by_key() {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "mug.obj", obj(1.0));
    let source = source_of("mesh_folder", folder.path(), "");
    for (text, says) in [
        ("{", "invalid JSON"),
        ("[]", "`the file` = [] is not a table"),
        ("{}", "`the file` has no `keypoints`"),
        (r#"{"keypoints": 3}"#, "`keypoints` = 3 is not a list of points"),
        (r#"{"keypoints": [], "skeleton": []}"#, "unknown field `skeleton`"),
        (r#"{"keypoints": [{"name": "a", "point": [0, 0]}]}"#, "`keypoints[0].point` = [0,0] is not a point"),
        (r#"{"keypoints": [{"name": "a", "point": [0, 0, "z"]}]}"#, "`keypoints[0].point` = "),
        (
            r#"{"keypoints": [{"name": "a", "point": [0, 0, 90]}]}"#,
            "`keypoints[0].point` = [0,0,90] is far from the object",
        ),
        (r#"{"keypoints": [{"name": "a", "point": [0, 0, 1e400]}]}"#, "mug.keypoints.json"),
        (r#"{"keypoints": [{"point": [0, 0, 0]}]}"#, "`keypoints[0]` has no `name`"),
        (r#"{"keypoints": [{"name": "", "point": [0, 0, 0]}]}"#, "`keypoints[0].name` = \"\" is not a name"),
        (r#"{"keypoints": [{"name": "a", "point": [0, 0, 0], "seen": 1}]}"#, "unknown field `seen`"),
        (
            r#"{"keypoints": [{"name": "a", "point": [0, 0, 0]}, {"name": "a", "point": [0, 0, 0]}]}"#,
            "`keypoints[1].name`: two points have the name `a`",
        ),
    ] {
        write(folder.path(), "mug.keypoints.json", text);
        let error = source.load("mug", &Collected::default()).expect_err(text).to_string();
        assert!(error.contains(says) && error.contains("mug.keypoints.json"), "{text}: {error}");
    }
}

#[test]
fn environment_maps() {
    let hdr = |resolution: &str, body: &[u8]| {
        [format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n").as_bytes(), body].concat()
    };
    check_file("x.hdr", hdr("-Y 4 +X 8", &[128; 128]), "flat", Accept);
    check_file("x.hdr", hdr("-Y 4 +X 8", &[128; 100]), "cut short", Reject("x.hdr at byte"));
    check_file("x.hdr", hdr("-Y 4 +X 8", &[128; 100]), "cut short", Reject("row 3 of 4 ends with the file"));
    check_file("x.hdr", hdr("-Y 30000 +X 4000", &[128; 100]), "rows bomb", Reject("row 0 of 30000"));
    check_file("x.hdr", hdr("-Y 400000 +X 200000", &[128; 100]), "pixel bomb", Reject("more than the limit"));
    check_file("x.hdr", hdr("-Y -5 +X 10", &[]), "negative", Reject("is not a resolution"));
    check_file("x.hdr", "", "empty", Reject("empty"));
    check_file("x.exr", "", "empty", Reject("empty"));
    check_file("x.hdr", [7; 99], "garbage", Reject("not an environment map"));

    let folder = TempDir::new().expect("temp folder");
    let path = folder.path().join("x.exr");
    exr::prelude::write_rgb_file(&path, 64, 32, |x, y| (x as f32, y as f32, 0.25_f32)).expect("writes");
    let (found, _) = look(&path);
    let found = found.expect("sound");
    assert_eq!((fact(&found, "size"), fact(&found, "largest radiance")), ("64 x 32", "63.0"));
    // Means of 0…63, 0…31 and one quarter.
    assert_eq!(fact(&found, "mean radiance"), format!("{:.3}", (31.5 + 15.5 + 0.25) / 3.0));
    let bytes = fs::read(&path).expect("reads");
    check_file("x.exr", &bytes[..bytes.len() / 2], "cut short", Reject("not a valid OpenEXR"));
    exr::prelude::write_rgb_file(&path, 4, 2, |x, _| (f32::INFINITY * x as f32, 0.0, 0.0)).expect("writes");
    check(folder.path(), "x.exr", "not finite", &Reject("non-finite radiance"));
}

#[test]
fn environment_folders() {
    let folder = TempDir::new().expect("temp folder");
    let hdr = |value: u8| {
        let body: Vec<u8> = [value, value, value, 129].repeat(8);
        [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n", body.as_slice()].concat()
    };
    write(folder.path(), "studio.hdr", hdr(64));
    write(folder.path(), "out/field.hdr", hdr(128));
    exr::prelude::write_rgb_file(folder.path().join("out/field.exr"), 4, 2, |_, _| (2.0_f32, 3.0_f32, 4.0_f32))
        .expect("writes");
    write(folder.path(), "out/bad.hdr", "no map");
    write(folder.path(), "notes.txt", "x");
    let source = source_of("environment_folder", folder.path(), "");
    let log = Collected::default();
    let entries = source.catalog(&log).expect("a catalog").entries;
    let names: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["out/bad", "out/field", "studio"]);
    assert_eq!(entries[1].category, "out");
    assert!(log.warnings()[0].to_string().contains("field.hdr: `out/field` has several files"), "{:?}", log.warnings());
    let load = |name: &str| source.load(name, &log).map(|asset| asset.into_environment().expect("a map"));
    let field = load("out/field").expect("loads");
    assert_eq!(field.name, "out/field");
    assert_eq!((field.width(), field.height(), field.texels()[0]), (4, 2, [2.0, 3.0, 4.0]));
    assert_eq!(load("studio").expect("loads").texels()[3], [0.5; 3]);
    assert!(load("out/bad").expect_err("garbage").to_string().contains("bad.hdr: not an environment map"));
    assert!(load("none").expect_err("unknown").to_string().contains("no environment map `none`"));
}

#[test]
fn radiance_files_agree_with_the_image_library() {
    use image::codecs::hdr::{HdrDecoder, HdrEncoder};
    let (width, height) = (37, 9);
    let pixels: Vec<image::Rgb<f32>> = (0..width * height)
        .map(|i| image::Rgb([i as f32 * 0.01, if i % 5 < 3 { 2.0 } else { 1e-3 }, (i % 7) as f32 * 1e4]))
        .collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes).encode(&pixels, width, height).expect("encodes");
    let ours = syntable_mesh::environment::decode(&bytes, &Default::default()).expect("sound");
    let decoder = HdrDecoder::new(Cursor::new(&bytes)).expect("sound");
    let theirs = DynamicImage::from_decoder(decoder).expect("sound").into_rgb32f();
    for (ours, theirs) in ours.texels().iter().zip(theirs.pixels()) {
        for (a, b) in ours.iter().zip(theirs.0) {
            assert!((a - b).abs() <= 1e-6 * b.abs(), "{ours:?} {theirs:?}");
        }
    }
}

#[test]
fn material_folders() {
    let image = |side: u32| encode(RgbImage::new(side, side).into(), ImageFormat::Jpeg);
    let folder = TempDir::new().expect("temp folder");
    let root = folder.path();
    write(root, "Only/Only_1K-JPG_Color.jpg", image(8));
    write(root, "Mix/Mix_1K-JPG_Color.jpg", image(8));
    write(root, "Mix/Mix_1K-JPG_Roughness.jpg", image(4));
    write(root, "Bare/Bare_1K-JPG_Roughness.jpg", image(4));
    write(root, "packed/textures/packed_diff_1k.jpg", image(8));
    write(root, "packed/textures/packed_arm_1k.jpg", image(8));
    let dx = RgbImage::from_pixel(8, 8, image::Rgb([128, 200, 255]));
    write(root, "packed/textures/packed_nor_dx_1k.png", encode(dx.into(), ImageFormat::Png));
    check(root, "Only", "color alone", &Accept);
    check(root, "Mix", "two sizes", &Warn("color 8 x 8, roughness 4 x 4"));
    check(root, "Bare", "no color", &Reject("Bare: no color map, only: roughness"));
    check(root, "packed", "packed", &Accept);
    let source = source_of("pbr_folder", root, "tile_m = 0.7");
    let names: Vec<String> =
        source.catalog(&Collected::default()).expect("a catalog").entries.into_iter().map(|e| e.name).collect();
    assert_eq!(names, ["Bare", "Mix", "Only", "packed"]);
    let load = |name: &str| source.load(name, &Collected::default()).expect(name).into_material().expect("a material");
    let only = load("Only");
    assert!(
        only.roughness.texture.is_none() && only.normal.is_none() && only.roughness.factor == 0.5 && only.tile_m == 0.7
    );
    let packed = load("packed");
    let channels =
        [&packed.roughness, &packed.metallic].map(|scalar| scalar.texture.as_ref().map(|(_, channel)| *channel));
    assert_eq!(channels, [Some(1), Some(2)]);
    // DirectX's green points down: 200 becomes 55.
    assert_eq!(packed.normal.as_ref().expect("a map").map.texture.texels[..4], [128, 55, 255, 255]);
}

#[test]
fn bop_folders() {
    let info = |id: u32, size: f32| {
        format!(
            r#"{{"{id}": {{"diameter": 141.4, "min_x": -30, "min_y": -40, "min_z": 0, "size_x": 60, "size_y": 80, "size_z": {size}}}}}"#
        )
    };
    let millimeters = ply_ascii().replace("0.03", "30").replace("0.04", "40").replace("0.1", "100");
    let folder = TempDir::new().expect("temp folder");
    let models = folder.path().join("set/models");
    write(&models, "obj_000001.ply", &millimeters);
    write(&models, "models_info.json", info(1, 100.0));
    check(folder.path(), "set", "a dataset", &Accept);
    check(&models, "models_info.json", "the file", &Accept);
    let source = source_of("bop_models", folder.path(), "");
    let log = Collected::default();
    let entry = source.catalog(&log).expect("a catalog").entries.remove(0);
    assert_eq!((entry.name.as_str(), entry.obj_id), ("set/obj_000001", Some(1)));
    let object = source.load("set/obj_000001", &log).expect("loads").into_object().expect("an object");
    assert!((object.mesh.bounds().size() - syntable_model::geometry::Vector3::new(0.06, 0.08, 0.1)).norm() < 1e-6);
    assert!(log.warnings().is_empty(), "{:?}", log.warnings());
    assert!(source.load("set/../set/obj_000001", &log).is_err() && source.load("other/obj_000001", &log).is_err());

    let with =
        |symmetries: &str| info(1, 100.0).replace(r#""size_z": 100}"#, &format!(r#""size_z": 100, {symmetries}}}"#));
    write(
        &models,
        "models_info.json",
        with(
            r#""symmetries_continuous": [{"axis": [0, 0, 1], "offset": [5, 0, 0]}], "symmetries_discrete": [[-1,0,0,2, 0,-1,0,0, 0,0,1,0, 0,0,0,1]]"#,
        ),
    );
    let object = source.load("set/obj_000001", &log).expect("loads").into_object().expect("an object");
    let symmetries = &object.model.symmetries;
    assert_eq!(
        (symmetries.continuous[0].offset_m, symmetries.discrete[0][0]),
        ([0.005, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.002])
    );
    write(&models, "models_info.json", with(r#""symmetries_discrete": [[1, 2]]"#));
    check(folder.path(), "set", "a matrix of two", &Warn("the symmetries of obj_000001 are ignored: invalid length 2"));
    write(&models, "models_info.json", info(1, 0.1));
    check(
        folder.path(),
        "set",
        "another size",
        &Warn("the mesh is 60.0 x 80.0 x 100.0 mm, but models_info.json states 60.0 x 80.0 x 0.1 mm"),
    );
    write(&models, "models_info.json", info(77, 100.0));
    check(folder.path(), "set", "no such model", &Reject("obj_000077.ply"));
    source.catalog(&log).expect("a catalog");
    assert!(log.warnings().iter().any(|warning| warning.to_string().contains("obj_000077.ply")));
    for (text, says) in [
        (r#"{"1": {"diameter": 172.06, "min_x":"#, "models_info.json:1: invalid JSON"),
        ("[]", "not a table of objects"),
        (r#"{"one": {}}"#, "`one` is not an object's number"),
        (r#"{"1": {"diameter": "wide"}}"#, "object 1 has no number `diameter`"),
        ("", "empty"),
    ] {
        write(&models, "models_info.json", text);
        check(folder.path(), "set", text, &Reject(says));
        assert!(source.catalog(&log).is_err(), "{text}");
    }
}

#[test]
fn roots_that_are_wrong_say_so() {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "file", "x");
    for kind in ["google_scanned_objects", "ycb", "bop_models", "mesh_folder", "pbr_folder", "environment_folder"] {
        let error = |path: &Path| source_of(kind, path, "").catalog(&Collected::default()).expect_err(kind);
        assert!(
            error(&folder.path().join("none")).to_string().contains("none: no such folder (check `root`"),
            "{kind}"
        );
        assert!(error(&folder.path().join("file")).to_string().contains("not a folder"), "{kind}");
        let empty = error(folder.path()).to_string();
        assert!(empty.contains("in this folder (check `root`)"), "{kind}: {empty}");
    }
    assert!(crate::common::source("bop_models", "root = \"x\"\nmodels_folder = \"../models\"").is_err());
    assert!(crate::common::source("mesh_folder", "root = \"x\"\nup = \"x\"").is_err());
    assert!(crate::common::source("ycb", "").is_err(), "a root is needed");
}

#[test]
fn examples_build() {
    let registry = syntable_model::registry::Registry::linked().expect("unique kinds");
    for kind in ["google_scanned_objects", "ycb", "bop_models", "mesh_folder", "pbr_folder", "environment_folder"] {
        let entry = registry.find(syntable_model::registry::Slot::Assets, kind).expect(kind);
        assert!(entry.construct_str(entry.example).is_ok(), "{kind}");
        crate::common::source(kind, entry.example).expect(kind);
    }
}
