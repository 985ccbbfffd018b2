//! Files as other programs export and repackage them: names from other machines, scans with collision parts, valid but
//! rare details, and extensions of glTF.

use crate::common::{look, source_of};
use crate::details::{Builder, FACES, POSITIONS, object};
use crate::inputs::*;
use serde_json::{Value, json};
use std::path::Path;
use syntable_assets::formats::gltf;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::Collected;
use syntable_model::scene::{Alpha, Object};
use syntable_model::stage::AssetLimits;
use tempfile::TempDir;

/// Loads an asset; also returns the warnings.
fn load_with_warnings(kind: &str, root: &Path, name: &str) -> (Object, Vec<String>) {
    let log = Collected::default();
    let asset = source_of(kind, root, "").load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    let object = std::sync::Arc::unwrap_or_clone(asset.into_object().expect("an object"));
    (object, log.warnings().iter().map(ToString::to_string).collect())
}

/// Width of the color texture of an object; `None` without one.
fn texture_width(object: &Object) -> Option<u32> {
    object.materials[0].base_color.texture.as_ref().map(|used| used.texture.width)
}

#[test]
fn names_of_other_machines_find_the_image_beside_the_model() {
    for (name, found) in [
        (r"C:\Users\me\project\texture.png", true),
        (r"tex\texture.png", true),
        ("/home/me/texture.png", true),
        ("TEXTURE.PNG", true),
        (r"..\..\..\texture.png", true),
        (r"C:\Users\me\other.png", false),
    ] {
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), "it/model.obj", obj(1.0));
        write(folder.path(), "it/model.mtl", format!("newmtl skin\nKd 1 1 1\nmap_Kd {name}\n"));
        write(folder.path(), "it/texture.png", png());
        // An image of the same name outside the asset's folder is never read.
        write(folder.path(), "other.png", png());
        let (object, warnings) = load_with_warnings("google_scanned_objects", folder.path(), "it");
        assert_eq!(texture_width(&object), found.then_some(8), "{name}");
        assert_eq!(warnings.len(), 1, "{name}: {warnings:?}");
        let says = if found { "reading `texture.png`" } else { "is missing" };
        assert!(warnings[0].contains(says) && warnings[0].contains("model.mtl:3"), "{name}: {warnings:?}");
    }
}

#[test]
fn repackaged_scans_are_textured_and_their_collision_parts_left_out() {
    let folder = TempDir::new().expect("temp folder");
    let root = folder.path();
    for (name, text) in [
        // With a library that was not packed, without any library, and with textures in their old folder.
        ("a", obj(1.0)),
        ("b", obj(1.0).replace("mtllib model.mtl\n", "")),
        ("c", obj(1.0).replace("model.mtl", "material.mtl")),
    ] {
        write(root, &format!("{name}/model.obj"), text);
        write(root, &format!("{name}/texture.png"), png());
        for part in ["model_collision_0.obj", "model_collision_1.obj", "model_vhacd.obj", "coarse-col.obj"] {
            write(root, &format!("{name}/{part}"), obj(0.9));
        }
    }
    write(root, "c/material.mtl", "newmtl skin\nmap_Kd ../materials/textures/texture.png\n");
    for kind in ["google_scanned_objects", "mesh_folder"] {
        let log = Collected::default();
        let entries = source_of(kind, root, "").catalog(&log).expect("a catalog").entries;
        assert_eq!(entries.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>(), ["a", "b", "c"], "{kind}");
        let left_out =
            log.warnings().iter().filter(|warning| warning.message().contains("skipped 12 collision meshes")).count();
        assert_eq!(left_out, usize::from(kind == "mesh_folder"), "{:?}", log.warnings());
        for name in ["a", "b", "c"] {
            let (object, _) = load_with_warnings(kind, root, name);
            assert_eq!(texture_width(&object), Some(8), "{kind} {name}");
            let size = object.mesh.bounds().size();
            assert!((size.z - 0.1).abs() < 1e-6, "{kind} {name}: the model, not a part: {size}");
        }
    }
    assert!(look(&root.join("a")).0.is_ok());
}

#[test]
fn simplified_ycb_objects_are_read() {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "003_cracker_box/textured_simple_reoriented.obj", obj(1.0));
    write(folder.path(), "003_cracker_box/model.mtl", MTL);
    write(folder.path(), "003_cracker_box/texture.png", png());
    write(folder.path(), "025_mug/google_16k/textured_simple.obj", obj(1.0));
    write(folder.path(), "025_mug/google_16k/model.mtl", MTL);
    write(folder.path(), "025_mug/google_16k/texture.png", png());
    let source = source_of("ycb", folder.path(), "");
    let entries = source.catalog(&Collected::default()).expect("a catalog").entries;
    assert_eq!(entries.iter().map(|entry| entry.category.as_str()).collect::<Vec<_>>(), ["cracker_box", "mug"]);
    for entry in entries {
        let (object, warnings) = load_with_warnings("ycb", folder.path(), &entry.name);
        assert_eq!((texture_width(&object), warnings.len()), (Some(8), 0), "{}: {warnings:?}", entry.name);
    }
}

#[test]
fn valid_details_that_few_files_have() {
    // OBJ: corners that omit values after their slashes.
    let folder = TempDir::new().expect("temp folder");
    let plain = obj(1.0).replace("mtllib model.mtl\n", "");
    for (name, corner) in [("none", "/$1//"), ("uv", "/$1/")] {
        let slashed: String = plain
            .lines()
            .map(|line| match line.strip_prefix("f ") {
                Some(corners) => {
                    let corners: Vec<String> = corners
                        .split(' ')
                        .map(|corner_text| match (corner_text.split_once('/'), corner) {
                            (Some((v, _)), "/$1//") => format!("{v}//"),
                            _ => format!("{corner_text}/"),
                        })
                        .collect();
                    format!("f {}\n", corners.join(" "))
                }
                None => format!("{line}\n"),
            })
            .collect();
        write(folder.path(), &format!("{name}.obj"), slashed);
        let (object, _) = load_with_warnings("mesh_folder", folder.path(), name);
        assert_eq!((object.mesh.data().triangles.len(), object.mesh.data().uvs.is_empty()), (12, name == "none"));
    }
    // PLY: rows with more numbers than the header declares.
    let text =
        ply_ascii().replace("0 1 3 2 \n", "0 1 3 2  7 8.5\n").replace("-0.03 -0.04 0\n", "-0.03 -0.04 0 255 3\n");
    check_file("x.ply", &text, "longer rows", Warn("x.ply:11: 2 rows have more numbers than the header declares"));
    check_file("x.ply", text.replace("255 3\n", "255 x\n"), "no number", Reject("excess `x`"));
    // glTF: extras of any type, a scene without nodes next to the displayed one, and animations by pointers.
    for extras in [json!("text"), json!(7), json!([1, [2]]), json!(null), json!({ "a": { "b": 1 } })] {
        let mut document: Value = serde_json::from_str(&embedded()).expect("sound");
        for at in
            ["", "/scenes/0", "/nodes/0", "/meshes/0", "/meshes/0/primitives/0", "/accessors/0", "/buffers/0", "/asset"]
        {
            document.pointer_mut(at).expect("a table")["extras"] = extras.clone();
        }
        document["scenes"].as_array_mut().expect("a list").push(json!({ "name": "nothing" }));
        write(folder.path(), "extras.gltf", document.to_string());
        assert_eq!(load(folder.path(), "extras").mesh.data().triangles.len(), 12, "{extras}");
    }
    let mut document: Value = serde_json::from_str(&embedded()).expect("sound");
    let pointer = json!({ "pointer": "/materials/0/emissiveFactor" });
    let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": pointer } });
    let channel = json!({ "sampler": 0, "target": target });
    document["animations"] = json!([{ "channels": [channel], "samplers": [{ "input": 0, "output": 0 }] }]);
    document["extensionsUsed"] = json!(["KHR_animation_pointer"]);
    check_file("x.gltf", document.to_string(), "pointers", Warn("animations are not supported"));
    // The error still names the faulty value by its path in the document.
    let wrong = embedded().replace(r#""POSITION": 0"#, r#""POSITION": "none""#);
    check_file(
        "x.gltf",
        wrong,
        "a wrong type",
        Reject("x.gltf: invalid glTF JSON: `meshes[0].primitives[0].attributes"),
    );
}

#[test]
fn instances_of_one_node_are_all_there() {
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    let moves: Vec<[f32; 3]> = (0..9).map(|i| [(i % 3) as f32, 0.0, (i / 3) as f32]).collect();
    let turns: Vec<[f32; 4]> = vec![[0.0, 0.0, 0.0, 1.0]; 9];
    let sizes: Vec<[f32; 3]> = (0..9).map(|i| [if i == 8 { 2.0 } else { 1.0 }; 3]).collect();
    let (moves, turns, sizes) = (builder.floats(&moves), builder.floats(&turns), builder.floats(&sizes));
    let attributes = json!({ "TRANSLATION": moves, "ROTATION": turns, "SCALE": sizes });
    let node = json!({ "mesh": 0, "scale": [0.5, 0.5, 0.5],
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } } });
    let more = json!({ "nodes": [node], "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing"] });
    let object = object(&builder.document(&json!({ "attributes": { "POSITION": position }, "indices": index }), more));
    assert_eq!(object.mesh.data().triangles.len(), 9 * 4);
    // Nine tetrahedra of 1/6 · 0.1³ at half size, one of them twice as large.
    let volume = (8.0 + 8.0) * 0.125 * 0.001 / 6.0;
    assert!((object.mesh.signed_volume() - volume).abs() < 1e-9, "{}", object.mesh.signed_volume());
    // The last one starts at (2, 0, 2)/2 and is 0.1 wide: y up, so that z becomes -y.
    let bounds = object.mesh.bounds();
    assert!((bounds.max.x - 1.1).abs() < 1e-6 && (bounds.min.y + 1.1).abs() < 1e-6, "{bounds:?}");
}

#[test]
fn morph_targets_have_their_default_weights() {
    let with = |mesh_weights: Value, node_weights: Value| {
        let mut builder = Builder::default();
        let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
        let up = builder.floats(&[[0.0, 0.0, 0.0], [0.0; 3], [0.0, 0.1, 0.0], [0.0; 3]]);
        let right = builder.floats(&[[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        let primitive = json!({ "attributes": { "POSITION": position }, "indices": index,
            "targets": [{ "POSITION": up }, { "POSITION": right }] });
        let more = json!({ "meshes": [{ "primitives": [primitive], "weights": mesh_weights }],
            "nodes": [{ "mesh": 0, "weights": node_weights }] });
        let mut document: Value = serde_json::from_str(&builder.document(&primitive, more)).expect("sound");
        for (at, key) in [("/meshes/0", "weights"), ("/nodes/0", "weights")] {
            let table = document.pointer_mut(at).expect("a table").as_object_mut().expect("a table");
            if table[key].is_null() {
                table.remove(key);
            }
        }
        let size = object(&document.to_string()).mesh.bounds().size();
        [size.x, size.z].map(|x| (x * 1e4).round() / 1e4)
    };
    assert_eq!(with(json!(null), json!(null)), [0.1, 0.1]);
    assert_eq!(with(json!([0.5, 0.0]), json!(null)), [0.1, 0.15]);
    assert_eq!(with(json!([0.5, 1.0]), json!(null)), [0.3, 0.15]);
    // The weights of the node replace the weights of the mesh.
    assert_eq!(with(json!([0.5, 1.0]), json!([0.0, 0.25])), [0.15, 0.1]);
}

#[test]
fn skins_have_the_pose_of_their_joints() {
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    // Three corners follow the first joint, the corner at y = 0.1 follows both joints equally.
    let joints = builder.view(&[[0, 1, 0, 0]; 4].concat(), None);
    let joints = builder.accessor(json!({ "componentType": 5121, "count": 4, "type": "VEC4" }), Some(joints));
    let first = [1.0, 0.0, 0.0, 0.0];
    let weights = builder.floats(&[first, first, [0.5, 0.5, 0.0, 0.0], first]);
    let unmoved = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    // The second joint was bound at y = 0.1.
    let bound = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., -0.1, 0., 1.];
    let matrices: Vec<u8> = [unmoved, bound].as_flattened().iter().flat_map(|x: &f32| x.to_le_bytes()).collect();
    let matrices = builder.view(&matrices, None);
    let bind = builder.accessor(json!({ "componentType": 5126, "count": 2, "type": "MAT4" }), Some(matrices));
    let primitive = json!({ "attributes": { "POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights },
        "indices": index });
    // The node of the mesh is moved far away, which has no effect; the joints are below a node that is moved by 1.
    let more = json!({
        "nodes": [{ "mesh": 0, "skin": 0, "translation": [50, 0, 0] }, { "translation": [1, 0, 0], "children": [2] },
            { "children": [3] }, { "translation": [0, 0.5, 0] }],
        "skins": [{ "joints": [2, 3], "inverseBindMatrices": bind }], "scenes": [{ "nodes": [0, 1] }],
    });
    let object = object(&builder.document(&primitive, more));
    let mut got: Vec<[i64; 3]> =
        object.mesh.data().positions.iter().map(|p| p.map(|x| (f64::from(x) * 1e6).round() as i64)).collect();
    got.sort();
    got.dedup();
    // By hand: the second joint moves y = 0.1 to 0.5; half of it gives 0.3. Then (x, y, z) becomes (x, -z, y).
    assert_eq!(got, [[1_000_000, -100_000, 0], [1_000_000, 0, 0], [1_000_000, 0, 300_000], [1_100_000, 0, 0]]);
}

#[test]
fn extensions_of_materials_are_read_as_far_as_they_can_be_shown() {
    let warned = |extensions: Value, more: Value| {
        let mut builder = Builder::default();
        let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
        let used: Vec<&String> = extensions.as_object().expect("a table").keys().collect();
        let mut material = json!({ "extensions": extensions });
        material.as_object_mut().expect("a table").extend(more.as_object().expect("a table").clone());
        let primitive = json!({ "attributes": { "POSITION": position }, "indices": index, "material": 0 });
        let more = json!({ "materials": [material], "extensionsUsed": used });
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), "x.gltf", builder.document(&primitive, more));
        let (object, warnings) = load_with_warnings("mesh_folder", folder.path(), "x");
        (std::sync::Arc::unwrap_or_clone(object.materials[0].clone()), warnings)
    };
    // Half the reflection of index 1.5: 2 % at normal incidence.
    let (half, warnings) = warned(json!({ "KHR_materials_specular": { "specularFactor": 0.5 } }), json!({}));
    let f0 = ((half.ior - 1.0) / (half.ior + 1.0)).powi(2);
    assert!((f0 - 0.02).abs() < 1e-6 && warnings.is_empty(), "{f0} {warnings:?}");
    let (none, _) = warned(json!({ "KHR_materials_specular": { "specularFactor": 0.0 } }), json!({}));
    assert_eq!(none.ior, 1.0);
    let red = json!({ "KHR_materials_specular": { "specularColorFactor": [1.0, 0.0, 0.0] } });
    let (red, warnings) = warned(red, json!({}));
    let f0 = ((red.ior - 1.0) / (red.ior + 1.0)).powi(2);
    assert!((f0 - 0.04 * 0.2126).abs() < 1e-6, "{f0}");
    assert!(warnings[0].contains("KHR_materials_specular"), "{warnings:?}");

    let pbr = json!({ "pbrMetallicRoughness": { "metallicFactor": 1, "roughnessFactor": 0.2, "baseColorFactor": [0.2, 0.4, 0.6, 1] },
        "emissiveFactor": [1, 1, 1] });
    let (unlit, warnings) = warned(json!({ "KHR_materials_unlit": {} }), pbr);
    assert_eq!((unlit.metallic.factor, unlit.roughness.factor, unlit.emission.factor), (0.0, 1.0, [0.0; 3]));
    assert_eq!(unlit.base_color.factor, [0.2, 0.4, 0.6]);
    assert!(warnings[0].contains("unlit materials are lit as matt surfaces"), "{warnings:?}");

    let rough = json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.5 } });
    let (brushed, warnings) =
        warned(json!({ "KHR_materials_anisotropy": { "anisotropyStrength": 1.0 } }), rough.clone());
    // α is 0.25 across and 1 along the brush: as wide as α = 0.5, the square of the roughness.
    assert!((brushed.roughness.factor - 0.5_f32.sqrt()).abs() < 1e-6, "{}", brushed.roughness.factor);
    assert!(warnings[0].contains("stretched highlights"), "{warnings:?}");
    let (round, warnings) = warned(json!({ "KHR_materials_anisotropy": {} }), rough);
    assert_eq!((round.roughness.factor, warnings.len()), (0.5, 0));
}

#[test]
fn thin_glass_of_old_files_is_told_to_be_a_body() {
    let glass = |alpha: f32| {
        let mut builder = Builder::default();
        let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
        let primitive = json!({ "attributes": { "POSITION": position }, "indices": index, "material": 0 });
        let base = json!({ "baseColorFactor": [1, 1, 1, alpha] });
        let material = json!({ "name": "pane", "alphaMode": "BLEND", "pbrMetallicRoughness": base });
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), "x.gltf", builder.document(&primitive, json!({ "materials": [material] })));
        let (object, warnings) = load_with_warnings("mesh_folder", folder.path(), "x");
        (object.materials[0].alpha, warnings.join("; "))
    };
    let (alpha, said) = glass(0.25);
    assert_eq!(alpha, Alpha::Blend { factor: 0.25 });
    assert!(
        said.contains("x.gltf: `pane` covers 25 % of the background behind it, but labels treat it as opaque"),
        "{said}"
    );
    assert_eq!(glass(0.5), (Alpha::Blend { factor: 0.5 }, String::new()));
}

#[test]
fn encodings_that_are_not_read_name_the_command_that_converts() {
    for (extension, says) in [
        ("KHR_meshopt_compression", "gltf-transform copy in.glb out.glb"),
        ("EXT_something", "export it without that extension"),
    ] {
        let mut document: Value = serde_json::from_str(&embedded()).expect("sound");
        document["extensionsUsed"] = json!([extension]);
        document["extensionsRequired"] = json!([extension]);
        check_file("x.gltf", document.to_string(), extension, Reject(says));
    }
    // A file that also has plain meshes is read without a warning.
    for extension in ["KHR_meshopt_compression", "KHR_draco_mesh_compression"] {
        let mut document: Value = serde_json::from_str(&embedded()).expect("sound");
        document["extensionsUsed"] = json!([extension]);
        check_file("x.gltf", document.to_string(), extension, Accept);
    }
}

/// Tori of 120 and of 1008 triangles, encoded by Google's library through DracoPy 2.2.0; the files `-plain` have the arrays
/// that the same library decodes. The names state the encoding and the compression level.
#[test]
fn draco_agrees_with_the_library_of_its_authors() {
    for (name, packed, plain) in [
        (
            "edgebreaker-5",
            &include_bytes!("draco/edgebreaker-5.glb")[..],
            &include_bytes!("draco/edgebreaker-5-plain.glb")[..],
        ),
        (
            "edgebreaker-10",
            include_bytes!("draco/edgebreaker-10.glb"),
            include_bytes!("draco/edgebreaker-10-plain.glb"),
        ),
        ("valence-10", include_bytes!("draco/valence-10.glb"), include_bytes!("draco/valence-10-plain.glb")),
        ("sequential-0", include_bytes!("draco/sequential-0.glb"), include_bytes!("draco/sequential-0-plain.glb")),
        ("sequential-10", include_bytes!("draco/sequential-10.glb"), include_bytes!("draco/sequential-10-plain.glb")),
    ] {
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), "packed.glb", packed);
        write(folder.path(), "plain.glb", plain);
        let root = AssetRoot::open(folder.path()).expect("opens");
        let log = Collected::default();
        let [packed_mesh, plain_mesh] = ["packed.glb", "plain.glb"].map(|file| {
            gltf::read(&root, Path::new(file), &log).unwrap_or_else(|error| panic!("{name}: {error}")).mesh
        });
        assert_eq!(packed_mesh.triangles, plain_mesh.triangles, "{name}");
        assert_eq!(packed_mesh.positions, plain_mesh.positions, "{name}");
        assert_eq!(packed_mesh.normals, plain_mesh.normals, "{name}");
        assert_eq!(packed_mesh.uvs, plain_mesh.uvs, "{name}");
        assert_eq!(packed_mesh.colors, plain_mesh.colors, "{name}");
        assert_eq!(packed_mesh.normals.is_empty(), name == "valence-10");
        assert_eq!(packed_mesh.colors.is_empty(), ["valence-10", "sequential-0"].contains(&name));
        let small = AssetRoot::open(folder.path())
            .expect("opens")
            .within(AssetLimits { triangles: 100, ..AssetLimits::default() });
        let error = gltf::read(&small, Path::new("packed.glb"), &log).expect_err("too many").to_string();
        assert!(error.contains("limit of 100 triangles"), "{error}");
        // Damage in the packed bytes is refused or gives another mesh, but never a panic.
        let at = packed.windows(5).position(|word| word == b"DRACO").expect("Draco");
        for byte in (at..packed.len() - 80).step_by(7) {
            let mut damaged = packed.to_vec();
            damaged[byte] ^= 0x55;
            write(folder.path(), "packed.glb", damaged);
            if let Err(error) = gltf::read(&root, Path::new("packed.glb"), &log) {
                assert!(!error.to_string().contains("panicked"), "{name} {byte}: {error}");
            }
        }
    }
}

/// The Basis textures have 20 x 12 pixels, encoded by the authors' library (`ktx2-encoder` 0.5) from colors that a formula
/// gives; UASTC is also packed with Zstandard. The tolerances bound the loss of the encoder.
#[test]
fn ktx2_textures_are_read() {
    let folder = TempDir::new().expect("temp folder");
    for (file, bytes, most) in
        [("etc1s.ktx2", &include_bytes!("etc1s.ktx2")[..], 40), ("uastc.ktx2", &include_bytes!("uastc.ktx2")[..], 8)]
    {
        let decoded = DecodedImage::decode(bytes, &Budget::default()).expect(file);
        assert_eq!((decoded.width, decoded.height), (20, 12), "{file}");
        for (i, texel) in decoded.texels.chunks_exact(4).enumerate() {
            let (x, y) = (i as u8 % 20, i as u8 / 20);
            let want = [x * 12, y * 20, 128, if x < 10 { 255 } else { 100 }];
            let apart = texel.iter().zip(want).map(|(&a, b)| a.abs_diff(b)).max();
            assert!(apart <= Some(most), "{file} {x} {y}: {texel:?}, not {want:?}");
        }
        write(folder.path(), file, bytes);
        assert!(look(&folder.path().join(file)).0.is_ok());
        for end in 0..bytes.len() {
            let error = DecodedImage::decode(&bytes[..end], &Budget::default()).err();
            assert!(error.is_some(), "{file} of {end} bytes");
        }
    }
    let glb = |image: &[u8], required: bool| {
        let mut builder = Builder::default();
        let position = builder.floats(&POSITIONS);
        let uv = builder.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.25, 0.75]]);
        let index = builder.indices(FACES.as_flattened());
        let image = builder.view(image, None);
        let primitive =
            json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "indices": index, "material": 0 });
        let mut more = json!({
            "images": [{ "bufferView": image, "mimeType": "image/ktx2" }],
            "textures": [{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "extensionsUsed": ["KHR_texture_basisu"],
        });
        if required {
            more["extensionsRequired"] = json!(["KHR_texture_basisu"]);
        }
        builder.document(&primitive, more)
    };
    let plain = |format: u32, scheme: u32, data: &[u8], size: [u32; 2]| ktx2(format, scheme, data, size);
    let rgba: Vec<u8> = (0..24).collect();
    // Zstandard frame of the same 24 bytes in one raw block.
    let zstd = [&[0x28, 0xb5, 0x2f, 0xfd, 0x20, 24, 0xc1, 0, 0][..], &rgba].concat();
    for (data, scheme) in [(&rgba, 0), (&zstd, 2)] {
        write(folder.path(), "x.gltf", glb(&plain(37, scheme, data, [3, 2]), true));
        let object = load(folder.path(), "x");
        let texture = &object.materials[0].base_color.texture.as_ref().expect("a texture").texture;
        assert_eq!((texture.width, texture.height, &texture.texels), (3, 2, &rgba));
    }
    // Half a terabyte according to the index of levels.
    let mut bomb = include_bytes!("uastc.ktx2").to_vec();
    bomb[96..104].copy_from_slice(&(1_u64 << 39).to_le_bytes());
    let error = DecodedImage::decode(&bomb, &Budget::default()).expect_err("too many").to_string();
    assert!(error.contains("549755813888 bytes for 20 x 12 pixels"), "{error}");
    // BGR: 8 bits per channel, without alpha.
    let decoded = DecodedImage::decode(&plain(30, 0, &[1, 2, 3, 4, 5, 6], [2, 1]), &Budget::default()).expect("sound");
    assert_eq!(decoded.texels, [3, 2, 1, 255, 6, 5, 4, 255]);
    // Unsupported kinds cost the texture: BC1, an image of zero height, and a file without an image.
    write(folder.path(), "x.gltf", glb(&plain(131, 0, &[0; 8], [4, 4]), false));
    check(
        folder.path(),
        "x.gltf",
        "BC1",
        &Warn("a KTX2 of an unsupported kind: BC1_RGB_UNORM_BLOCK; using a constant color"),
    );
    check(folder.path(), "x.gltf", "BC1", &Warn("ktx extract in.ktx2 out.png"));
    write(folder.path(), "x.gltf", glb(&plain(37, 0, &rgba[1..], [3, 2]), false));
    check(folder.path(), "x.gltf", "short", &Reject("23 bytes for an image of 24"));
    write(folder.path(), "x.gltf", glb(&plain(37, 0, &rgba, [60_000, 60_000]), false));
    check(folder.path(), "x.gltf", "huge", &Reject("more than the limit"));
    let none = glb(&[0], false).replace("KHR_texture_basisu", "MSFT_texture_dds");
    write(folder.path(), "x.gltf", none);
    check(
        folder.path(),
        "x.gltf",
        "DDS",
        &Warn("texture 0 has no image as PNG, JPEG, WebP or KTX2; using a constant color"),
    );
}

/// A KTX2 file with one level: format of Vulkan, scheme of compression, data and size.
fn ktx2(format: u32, scheme: u32, data: &[u8], [width, height]: [u32; 2]) -> Vec<u8> {
    // The basic descriptor without samples, after its total length.
    let descriptor: Vec<u8> =
        [28_u32, 0, 24 << 16 | 2, 1 << 16 | 1 << 8 | 1, 0, 0, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let level = 104 + descriptor.len() as u64;
    let words = [format, 1, width, height, 0, 0, 1, 1, scheme, 104, descriptor.len() as u32, 0, 0];
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    bytes.extend(words.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend([0_u64, 0, level, data.len() as u64, data.len() as u64].iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(descriptor);
    bytes.extend(data);
    bytes
}

/// A sphere of 5 cm radius around (0.1, 0.2, 0.3), y up, with 24 x 12 quads, packed by `gltf-transform meshopt`:
/// quantized positions, octahedral normals, and triangles.
#[test]
fn packed_meshes_are_unpacked() {
    let folder = TempDir::new().expect("temp folder");
    let packed: &[u8] = include_bytes!("packed_sphere.glb");
    assert!(packed.windows(23).any(|word| word == b"EXT_meshopt_compression"), "it is packed");
    write(folder.path(), "x.glb", packed);
    let object = load(folder.path(), "x");
    let data = object.mesh.data();
    // Two rows of triangles at the poles.
    assert_eq!(data.triangles.len(), 2 * 24 * 11);
    for (p, n) in data.positions.iter().zip(&data.normals) {
        let out: Vec<f32> = p.iter().zip([0.1, -0.3, 0.2]).map(|(p, center)| (p - center) / 0.05).collect();
        let radius = out.iter().map(|x| x * x).sum::<f32>().sqrt();
        let cosine: f32 = out.iter().zip(n).map(|(a, b)| a * b).sum();
        assert!((radius - 1.0).abs() < 1e-3 && cosine > 0.999, "{p:?} {n:?}: {radius} {cosine}");
    }
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
    let volume = object.mesh.signed_volume();
    assert!((0.95..1.0).contains(&(volume / ball)), "{}", volume / ball);
    // A truncated file is refused.
    let at = packed.windows(4).position(|word| word == b"BIN\0").expect("a chunk") + 4;
    let mut damaged = packed.to_vec();
    damaged[at] ^= 0x40;
    write(folder.path(), "x.glb", damaged);
    let error = source_of("mesh_folder", folder.path(), "").load("x", &Collected::default()).expect_err("another kind");
    assert!(error.to_string().contains("EXT_meshopt_compression"), "{error}");
}

#[test]
fn webp_textures_are_read() {
    // A lossless WebP of 2 x 1 texels, red and half-transparent blue, written by libwebp.
    let webp: &[u8] = include_bytes!("two_texels.webp");
    let folder = TempDir::new().expect("temp folder");
    let mut builder = Builder::default();
    let position = builder.floats(&POSITIONS);
    let uv = builder.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.25, 0.75]]);
    let index = builder.indices(FACES.as_flattened());
    let image = builder.view(webp, None);
    let primitive =
        json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "indices": index, "material": 0 });
    let more = json!({
        "images": [{ "bufferView": image, "mimeType": "image/webp" }],
        "textures": [{ "extensions": { "EXT_texture_webp": { "source": 0 } } }],
        "materials": [{ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "extensionsUsed": ["EXT_texture_webp"], "extensionsRequired": ["EXT_texture_webp"],
    });
    write(folder.path(), "x.gltf", builder.document(&primitive, more));
    let object = load(folder.path(), "x");
    let texture = &object.materials[0].base_color.texture.as_ref().expect("a texture").texture;
    assert_eq!((texture.width, texture.height), (2, 1));
    assert_eq!(texture.texels, [255, 0, 0, 255, 0, 0, 255, 128]);
    assert_eq!(object.materials[0].alpha, Alpha::Blend { factor: 1.0 });
    write(folder.path(), "two.webp", webp);
    assert!(look(&folder.path().join("two.webp")).0.is_ok());
    for end in 0..webp.len() {
        check_file("x.webp", &webp[..end], "cut short", Reject("x.webp"));
    }
}
