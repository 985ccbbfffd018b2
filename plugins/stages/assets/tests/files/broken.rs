//! The collection of bad and unusual inputs: each behaves as its name says, for the reason in its index.

use crate::common::{fact, fixtures, look, peak};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use tempfile::TempDir;

/// Text that the error or a warning must contain, by the name of the input.
const SAYS: [(&str, &str); 76] = [
    ("reject_accessor_count_bomb.gltf", "400000000 elements need 800000000 bytes, but the buffer view has 72"),
    ("reject_buffer_beyond_file.gltf", "declares 1000000000 bytes, but `short.bin` has 168"),
    ("reject_buffer_path_traversal.gltf", "leaves the asset's folder"),
    ("reject_bufferview_beyond_buffer.gltf", "over 99999 bytes, but buffer 0 has 168"),
    ("reject_chunk_length_bomb.glb", "not a valid GLB: a chunk has"),
    ("reject_cyclic_nodes.gltf", "cycle"),
    ("reject_deep_json.gltf", "nested more than"),
    ("reject_dimension_bomb.hdr", "400000 x 200000 pixels are more than the limit"),
    ("reject_empty.exr", "empty"),
    ("reject_empty.glb", "empty"),
    ("reject_empty.gltf", "empty"),
    ("reject_empty.hdr", "empty"),
    ("reject_empty.json", "empty"),
    ("reject_empty.obj", "empty"),
    ("reject_empty.ply", "empty"),
    ("reject_empty.png", "empty"),
    ("reject_face_index_out_of_range.ply", ":18: face 0 has index 300, but the mesh has 8 vertices"),
    ("reject_face_with_two_vertices", "model.obj:77: faces with fewer than three corners are left out: 1"),
    ("reject_flat_planar", "one plane"),
    ("reject_garbage.glb", "not a valid GLB"),
    ("reject_garbage.hdr", "not an environment map"),
    ("reject_garbage.obj", "not text"),
    ("reject_garbage.ply", "not a PLY file"),
    ("reject_huge_coordinates", "object extent 1.000e29 m is outside the allowed range"),
    ("reject_index_negative_out_of_range", "model.obj:135: vertex index -"),
    ("reject_index_out_of_range", "model.obj:135: vertex index"),
    ("reject_index_out_of_range.gltf", "index 60000, but only 8 vertices"),
    ("reject_index_zero", "model.obj:135: vertex index 0"),
    ("reject_inf_vertices", "model.obj:14: non-finite vertex: `inf`"),
    ("reject_list_count_bomb.ply", "a list has 4294967295 items"),
    ("reject_malformed.gltf", "line 32 column"),
    ("reject_material_without_albedo", "no color map"),
    (
        "reject_millimeters",
        "object extent 221.908 m is outside the allowed range of 0.0005 m to 10 m (`units = \"mm\"` makes it 22.2 cm)",
    ),
    ("reject_missing_buffer_file.gltf", "buffer 0 refers to the missing file `not_there.bin`"),
    ("reject_models_info_malformed", "models_info.json:1: invalid JSON"),
    ("reject_models_info_missing_model", "obj_000077.ply"),
    ("reject_nan_vertices", "model.obj:14: non-finite vertex: `nan`"),
    ("reject_negative_count.ply", "`-8` is not a number of rows"),
    ("reject_negative_dims.hdr", "`-Y -5 +X 10` is not a resolution"),
    ("reject_no_end_header.ply", "end_header"),
    ("reject_no_faces", "no faces"),
    ("reject_no_vertices", "vertex index 1 in `1`, but only 0"),
    ("reject_not_a_number_token", "model.obj:77: `"),
    ("reject_png_bad_crc", "texture.png: not a valid PNG"),
    ("reject_png_decompression_bomb", "texture.png: 65000 x 65000 pixels are more than the limit"),
    ("reject_png_zero_size", "texture.png"),
    ("reject_remote_buffer.gltf", "is a network address, which is never opened"),
    ("reject_required_extension.gltf", "`EXT_not_real`"),
    ("reject_texture_backslash_traversal", "model.mtl:2: `..\\..\\..\\x.png` leaves the asset's folder"),
    ("reject_texture_is_directory", "texture.png: is a directory"),
    ("reject_texture_is_text", "texture.png: not an image"),
    ("reject_texture_path_traversal", "model.mtl:2: `../../../x.png` leaves the asset's folder"),
    ("reject_tiny_object", "object extent 1.000e-7 m is outside"),
    ("reject_truncated.exr", "not a valid OpenEXR"),
    ("reject_truncated.glb", "the header states 952 bytes, but the file has 892"),
    ("reject_truncated.hdr", "row 18 of 32"),
    ("reject_truncated_binary.ply", "need at least 1088 bytes, but 1051 are left"),
    ("reject_truncated_obj_mid_face", "model.obj:92: `10/` is not a face corner"),
    ("reject_truncated_obj_mid_vertices", "model.obj:19: a vertex has 2 coordinates"),
    ("reject_truncated_png", "texture.png: not a valid PNG"),
    ("reject_uv_index_out_of_range", "model.obj:135: texture coordinate index"),
    ("reject_version_1.gltf", "glTF version `1.0`"),
    ("reject_vertex_count_bomb.ply", "4000000000 rows of element `vertex`"),
    ("reject_zero_area_faces_only", "faces has area"),
    ("warn_duplicate_faces", "64 of 128 faces are duplicates"),
    ("warn_inverted_winding", "inwards"),
    ("warn_material_sizes_differ", "64 x 64, roughness 32 x 32, normal (OpenGL) 48 x 16"),
    ("warn_missing_mtl", "material library `model.mtl` is missing"),
    ("warn_missing_texture", "model.mtl:4: texture `texture.png` is missing"),
    ("warn_no_uv", "no texture coordinates"),
    ("warn_non_manifold", "1 edges of more than two faces"),
    ("warn_open_mesh", "open, with 8 boundary edges"),
    ("warn_some_zero_area_faces", "4 of 68 "),
    ("warn_texture_missing.ply", "texture `not_there.png` is missing"),
    ("warn_three_instances_in_one_model", "3 separate parts"),
    ("warn_unknown_material_name", "no material `does_not_exist`"),
];

/// No input of this collection is larger than half a megabyte; a mesh and its textures take a few times that.
const MOST_BYTES: usize = 24 << 20;

/// Inputs in millimeters, which only files with names of BOP are.
const MILLIMETERS: [&str; 3] = ["accept_big_endian.ply", "accept_extra_properties.ply", "warn_texture_missing.ply"];

/// The path of an input; a copy with a name of BOP if it is in millimeters.
fn path_of(name: &str, copies: &TempDir) -> PathBuf {
    let path = fixtures().join("broken").join(name);
    if !MILLIMETERS.contains(&name) {
        return path;
    }
    let copy = copies.path().join(name).join("obj_000001.ply");
    std::fs::create_dir_all(copy.parent().expect("a folder")).expect("a folder");
    std::fs::copy(path, &copy).expect("a copy");
    copy
}

#[test]
fn every_input_behaves_as_its_name_says() {
    let folder = fixtures().join("broken");
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"))
        .filter(|name| ["reject_", "warn_", "accept_"].iter().any(|word| name.starts_with(word)))
        .collect();
    names.sort();
    assert_eq!(names.len(), 99, "{names:?}");
    let copies = TempDir::new().expect("temp folder");
    let mut wrong = Vec::new();
    for name in &names {
        let path = path_of(name, &copies);
        let (outcome, bytes) = peak(|| catch_unwind(AssertUnwindSafe(|| look(&path))));
        let Ok((found, warnings)) = outcome else {
            wrong.push(format!("{name}: PANIC"));
            continue;
        };
        let (word, _) = name.split_once('_').expect("a word");
        // The mesh can do without such a face.
        let word = if name == "reject_face_with_two_vertices" { "warn" } else { word };
        let said = match &found {
            Ok(_) => format!("accepted with {warnings:?}"),
            Err(error) => error.to_string(),
        };
        let must_say = SAYS.iter().find(|(known, _)| known == name).map(|(_, says)| *says);
        let good = match (word, &found) {
            // The error is one line, and names the asset or a file in it.
            ("reject", Err(_)) => {
                !said.contains('\n') && said.contains(name) && must_say.is_some_and(|says| said.contains(says))
            }
            ("warn", Ok(_)) => {
                warnings.iter().all(|warning| warning.contains(name))
                    && warnings.iter().any(|warning| must_say.is_some_and(|says| warning.contains(says)))
            }
            ("accept", Ok(_)) => warnings.is_empty(),
            _ => false,
        };
        if !good || bytes > MOST_BYTES {
            wrong.push(format!("{name} ({bytes} bytes): {said}, wanted {must_say:?}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {} are wrong:\n{}", wrong.len(), names.len(), wrong.join("\n"));
}

#[test]
fn odd_inputs_load_as_what_they_are() {
    let copies = TempDir::new().expect("temp folder");
    let look = |name: &str| look(&path_of(name, &copies)).0.expect(name);
    // The plate in four variants; the box in five formats, with z up in all of them.
    for name in ["accept_bom_crlf", "accept_negative_indices", "warn_duplicate_faces", "warn_inverted_winding"] {
        assert_eq!(fact(&look(name), "triangles"), "64", "{name}");
        // The sum of the signed tetrahedra, computed from the positions outside of this program: 0.141693.
        assert_eq!(fact(&look(name), "volume"), "0.1417 liter", "{name}");
    }
    for name in ["accept_box.glb", "accept_embedded_box.gltf"] {
        assert_eq!(fact(&look(name), "size"), "0.0600 x 0.1000 x 0.0800 m", "{name}");
    }
    for name in
        ["accept_big_endian.ply", "accept_extra_properties.ply", "accept_quads_and_ngons", "accept_line_continuation"]
    {
        assert_eq!(fact(&look(name), "size"), "0.0600 x 0.0800 x 0.1000 m", "{name}");
        assert_eq!(fact(&look(name), "volume"), "0.4800 liter", "{name}");
        assert_eq!(fact(&look(name), "closed"), "yes", "{name}");
    }
    for name in ["accept_extra_properties.ply", "accept_obj_vertex_colors"] {
        assert_eq!(fact(&look(name), "vertex colors"), "yes", "{name}");
    }
    assert_eq!(fact(&look("warn_non_manifold"), "volume"), "0.4800 liter");
    // The extra texture is found only if the name with spaces was parsed correctly.
    assert_eq!(fact(&look("accept_texture_name_with_spaces"), "textures"), "1");
    assert_eq!(fact(&look("warn_missing_texture"), "textures"), "0");
}

#[test]
fn odd_images_have_the_right_colors() {
    use syntable_mesh::image::DecodedImage;
    use syntable_mesh::root::AssetRoot;
    let folder = fixtures().join("broken");
    let mean = |name: &str| {
        let image = DecodedImage::read(
            &AssetRoot::open(&folder).expect("opens"),
            &folder.join(name).join("materials/textures/texture.png"),
        )
        .expect(name);
        image.mean().map(|x| x * 255.0)
    };
    // Means computed with Pillow 11, CMYK converted by its `convert("RGB")`.
    for (name, want) in [
        ("accept_jpeg_cmyk", [53.82, 70.96, 72.42, 255.0]),
        ("accept_png_palette_alpha", [52.89, 70.73, 72.23, 246.28]),
    ] {
        let got = mean(name);
        assert!(got.iter().zip(want).all(|(got, want)| (got - want).abs() < 1.5), "{name}: {got:?}, Pillow {want:?}");
    }
}
