//! Formats of another crate, read by `mesh_folder`, textures, material folders and `check --asset`.

use std::path::Path;
use std::sync::Arc;
use syntable_assets as _;
use syntable_mesh::Model;
use syntable_mesh::format::{ImageDecoder, ImageFormat, ImageFormats, MeshFormat, MeshFormats};
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_mesh::material::default_material;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::{Collected, Log};
use syntable_model::error::{Error, Result};
use syntable_model::inspect::inspect;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{AssetClass, MeshData, Object};
use syntable_model::stage::AssetSource;
use tempfile::TempDir;

/// A text of three edge lengths.
fn read_cuboid(root: &AssetRoot, file: &Path, _: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let text = String::from_utf8_lossy(&root.read(&path)?).into_owned();
    let sizes: Vec<f32> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let [x, y, z] = sizes[..] else {
        return Err(Error::new(format!("{} edge lengths instead of 3", sizes.len())).in_file(path));
    };
    let corner = |i: u32| [(i & 1) as f32 * x, (i >> 1 & 1) as f32 * y, (i >> 2 & 1) as f32 * z];
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mesh = MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    };
    Ok(Model { mesh, materials: vec![default_material(false)] })
}

/// One pixel: `FLAT` and its color.
fn decode_flat(bytes: &[u8], _: &Budget) -> Result<DecodedImage> {
    match bytes {
        [b'F', b'L', b'A', b'T', r, g, b] => {
            Ok(DecodedImage { width: 1, height: 1, texels: vec![*r, *g, *b, 255], kind: "Flat".into() })
        }
        _ => Err(Error::new("not a valid Flat image")),
    }
}

syntable_mesh::register_mesh_format!(MeshFormat::new("Cuboid", &["cuboid", "cub"], read_cuboid));
syntable_mesh::register_image_format!(ImageFormat::new(
    "Flat",
    &["flat"],
    |bytes| bytes.starts_with(b"FLAT"),
    ImageDecoder::Texture(decode_flat)
));

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = TempDir::new().expect("temp folder");
    for (path, bytes) in files {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
        std::fs::write(path, bytes).expect("file");
    }
    folder
}

fn source(kind: &str, root: &Path, more: &str) -> Box<dyn AssetSource> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Assets, kind).expect(kind);
    match entry.construct_str(&format!("root = {:?}\n{more}", root.display().to_string())).expect("builds").stage {
        Stage::Assets(source) => source,
        _ => panic!("{kind} is not an asset source"),
    }
}

fn object(source: &dyn AssetSource, name: &str) -> Arc<Object> {
    source.load(name, &Collected::default()).expect(name).into_object().expect("an object")
}

#[test]
fn mesh_folder_reads_a_foreign_mesh_format() {
    let stl =
        b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid";
    let folder = folder(&[
        ("box.cuboid", b"0.1 0.2 0.3"),
        ("sub/a.CUB", b"0.1 0.2 0.4"),
        ("sub/b.stl", stl),
        ("sub/b.cuboid", b"1 1 1"),
        ("bad.cub", b"0.1 0.2"),
    ]);
    let (meshes, log) = (source("mesh_folder", folder.path(), ""), Collected::default());
    let catalog = meshes.catalog(&log).expect("a catalog");
    let names: Vec<&str> = catalog.entries.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["bad", "box", "sub/a", "sub/b"]);
    // STL has a higher preference than the foreign format.
    assert!(log.warnings()[0].to_string().contains("b.cuboid: `sub/b` has several files; using `sub/b.stl`"));

    let size = |object: &Object| <[f64; 3]>::from(object.mesh.bounds().size()).map(|x| (x * 1e3).round());
    let found = object(&*meshes, "box");
    assert_eq!((size(&found), found.mesh.data().triangles.len()), ([100.0, 200.0, 300.0], 12));
    // 6 liters of 400 kg/m³.
    assert!((found.mass.kg - 2.4).abs() < 1e-6, "{}", found.mass.kg);
    assert_eq!(size(&object(&*meshes, "sub/a")), [100.0, 200.0, 400.0]);
    let error = meshes.load("bad", &Collected::default()).expect_err("two lengths").to_string();
    assert!(error.contains("bad.cub: 2 edge lengths"), "{error}");
    // The format does not state its axes, so `up` applies.
    let y_up = source("mesh_folder", folder.path(), "up = \"y\"");
    assert_eq!(size(&object(&*y_up, "box")), [100.0, 300.0, 200.0]);
}

#[test]
fn textures_and_material_folders_read_a_foreign_image_format() {
    let obj = b"mtllib m.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\n\
        f 1/1 3/1 2/1\nf 1/1 2/1 4/1\nf 2/1 3/1 4/1\nf 3/1 1/1 4/1\n";
    let folder = folder(&[
        ("meshes/x.obj", obj),
        ("meshes/m.mtl", b"newmtl red\nmap_Kd skin.flat\n"),
        ("meshes/skin.flat", b"FLAT\xc8\x10\x20"),
        ("surfaces/Rust01/Rust01_1K_Color.flat", b"FLAT\x60\x30\x10"),
    ]);
    let meshes = source("mesh_folder", &folder.path().join("meshes"), "");
    let name = meshes.catalog(&Collected::default()).expect("a catalog").entries[0].name.clone();
    let texture = object(&*meshes, &name).materials[0].base_color.texture.clone().expect("a texture");
    assert_eq!(texture.texture.texels, [0xc8, 0x10, 0x20, 255]);

    let surfaces = source("pbr_folder", &folder.path().join("surfaces"), "");
    assert_eq!(surfaces.class(), AssetClass::Material);
    let material = surfaces.load("Rust01", &Collected::default()).expect("loads").into_material().expect("a material");
    assert_eq!(material.base_color.texture.as_ref().expect("a texture").texture.texels, [0x60, 0x30, 0x10, 255]);
}

#[test]
fn check_asset_and_messages_know_foreign_formats() {
    let folder =
        folder(&[("box.cuboid", b"0.1 0.2 0.3"), ("x.flat", b"FLAT123"), ("x.unknown", b"?"), ("t.png", b"?")]);
    let look = |name: &str| inspect(&folder.path().join(name), &Collected::default());
    let (name, found) = look("box.cuboid").expect("sound");
    assert_eq!(name, "Cuboid");
    assert!(found.facts.contains(&("size".into(), "0.1000 x 0.2000 x 0.3000 m".into())), "{found:?}");
    assert!(found.facts.contains(&("unit".into(), "meter".into())), "{found:?}");
    assert_eq!(look("x.flat").expect("sound").0, "Flat");
    let error = look("x.unknown").expect_err("unknown").to_string();
    assert!(error.contains("Cuboid") && error.contains("OBJ") && error.contains("Flat"), "{error}");
    let error = look("t.png").expect_err("no image").to_string();
    assert!(
        error.contains(
            "t.png: not an image of a known format (texture formats are PNG, JPEG, WebP, BMP, TIFF, GIF, KTX2, Flat and TGA)"
        ),
        "{error}"
    );

    let formats = MeshFormats::linked().expect("no clash");
    assert_eq!(formats.extensions(), ["urdf", "glb", "gltf", "obj", "dae", "ply", "stl", "cuboid", "cub"]);
    let own = formats.of_file(Path::new("a/B.Cub")).expect("known");
    assert_eq!((own.name, own.crate_name), ("Cuboid", "syntable-assets"));
    let root = AssetRoot::open(folder.path()).expect("opens");
    let error = formats.read(&root, Path::new("x.unknown"), &Collected::default()).expect_err("unknown").to_string();
    assert!(error.contains("x.unknown: `.unknown` is not a mesh format (the mesh formats are URDF, glTF, OBJ, COLLADA, PLY, STL and Cuboid)"));
    let images = ImageFormats::linked().expect("no clash");
    assert_eq!(
        images.texture_extensions(),
        ["png", "jpg", "jpeg", "webp", "bmp", "tif", "tiff", "gif", "ktx2", "flat", "tga"]
    );
    assert_eq!(images.radiance_extensions(), ["exr", "hdr"]);
}

#[test]
fn an_extension_of_two_formats_is_refused() {
    let linked = MeshFormats::linked().expect("no clash");
    let foreign = MeshFormat::new("Other OBJ", &["obj"], read_cuboid).registered_by("other-crate");
    let error = MeshFormats::new(linked.iter().copied().chain([foreign])).expect_err("a clash").to_string();
    assert!(error.contains("`.obj`: syntable-assets for OBJ and other-crate for Other OBJ"), "{error}");
}
