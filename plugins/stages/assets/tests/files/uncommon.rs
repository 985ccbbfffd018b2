//! Textures of old formats against Pillow, triangle strips, and files that replace the real ones.

use crate::common::source_of;
use crate::inputs::{Reject, Warn, check, gso, obj, write};
use std::fs;
use std::path::Path;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_model::context::Collected;
use syntable_testing::tools::{own_script, python};
use tempfile::TempDir;

#[test]
fn textures_of_old_formats_match_pillow() {
    let folder = TempDir::new().expect("temp folder");
    let path = folder.path().to_str().expect("UTF-8");
    if !python(&own_script("textures.py"), &[path]) {
        return;
    }
    let mut formats = Vec::new();
    let mut names: Vec<_> =
        fs::read_dir(folder.path()).expect("a folder").map(|it| it.expect("readable").path()).collect();
    names.sort();
    for file in names.iter().filter(|file| file.extension().is_some_and(|end| end != "rgba")) {
        let decoded = DecodedImage::decode(&fs::read(file).expect("a file"), &Budget::default());
        let decoded = decoded.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        // Width, height, and RGBA as Pillow decodes the same file.
        let expected = fs::read(file.with_extension(format!("{}.rgba", file.extension().expect("end").display())));
        let expected = expected.expect("Pillow's pixels");
        assert_eq!([decoded.width, decoded.height], [7, 5], "{}", file.display());
        assert!(decoded.texels == expected, "{}", file.display());
        formats.push(decoded.kind.split(' ').next().expect("a format").to_owned());
    }
    formats.sort();
    formats.dedup();
    assert_eq!(formats, ["BMP", "GIF", "TGA", "TIFF"]);
}

/// A box of two strips, one of them with a restart after a negative index.
#[test]
fn strips_are_the_faces_that_they_describe() {
    let folder = TempDir::new().expect("temp folder");
    let header = |faces: &str| {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n{faces}end_header\n"
        );
        for corner in 0..8 {
            let [x, y, z] = [corner & 1, corner >> 1 & 1, corner >> 2].map(|bit| f64::from(bit) * 0.1);
            text += &format!("{x} {y} {z}\n");
        }
        text
    };
    // Around the box, then its bottom and its top.
    let strips = header(
        "element face 0\nproperty list uchar int vertex_indices\nelement tristrips 2\nproperty list int int vertex_indices\n",
    ) + "10 0 4 1 5 3 7 2 6 0 4\n9 0 1 2 3 -1 4 6 5 7\n";
    let quads = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [2, 3, 1, 0], [4, 5, 7, 6]];
    let faces: String = quads.map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}\n")).concat();
    let faces = header("element face 6\nproperty list uchar int vertex_indices\n") + &faces;
    write(folder.path(), "strips.ply", strips);
    write(folder.path(), "faces.ply", faces);
    let facts = |name: &str| {
        let found = crate::common::look(&folder.path().join(name)).0.unwrap_or_else(|error| panic!("{error}"));
        let fact = |key: &str| found.facts.iter().find(|(name, _)| name == key).expect("a fact").1.clone();
        ["closed", "volume", "mass", "triangles"].map(fact)
    };
    let want = facts("faces.ply");
    assert_eq!((facts("strips.ply"), want[0].as_str()), (want.clone(), "yes"), "{want:?}");
}

#[test]
fn files_in_place_of_the_real_ones_are_named() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n";
    let page = "\u{feff}  <!DOCTYPE html>\n<html><title>Sign in</title></html>";
    for name in ["m.stl", "m.ply", "m.obj", "m.glb", "m.gltf", "t.png", "t.hdr"] {
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), name, pointer);
        check(folder.path(), name, name, &Reject("a pointer of Git LFS, not the file itself (fetch the files"));
        write(folder.path(), name, page);
        check(folder.path(), name, name, &Reject("an HTML page, not the file itself (download the file again"));
    }
    let folder = TempDir::new().expect("temp folder");
    gso(folder.path(), "it");
    write(folder.path(), "it/materials/textures/texture.png", pointer);
    check(folder.path(), "it", "a texture", &Reject("texture.png: a pointer of Git LFS"));
}

#[test]
fn textures_of_unknown_formats_leave_a_constant_color() {
    let folder = TempDir::new().expect("temp folder");
    gso(folder.path(), "it");
    let psd = |it: &Path| {
        write(it, "meshes/model.mtl", "newmtl skin\nmap_Kd texture.psd\n");
        write(it, "materials/textures/texture.psd", "8BPS\0\x01");
    };
    psd(&folder.path().join("it"));
    check(folder.path(), "it", "psd", &Warn("texture.psd: an image of an unknown format; using a constant color"));
    // A TIFF of one pixel that is packed by JPEG 2000: a sound file of a kind that is not read.
    let entries: [[u32; 2]; 9] =
        [[256, 1], [257, 1], [258, 8], [259, 34712], [262, 1], [273, 8], [277, 1], [278, 1], [279, 1]];
    let mut tiff = b"II*\0\x08\0\0\0\x09\0".to_vec();
    for [tag, value] in entries {
        tiff.extend(
            [&(tag as u16).to_le_bytes()[..], &4_u16.to_le_bytes(), &1_u32.to_le_bytes(), &value.to_le_bytes()]
                .concat(),
        );
    }
    tiff.extend([0; 4]);
    write(folder.path(), "it/meshes/model.mtl", "newmtl skin\nmap_Kd texture.tif\n");
    write(folder.path(), "it/materials/textures/texture.tif", &tiff);
    check(folder.path(), "it", "TIFF", &Warn("texture.tif: a TIFF of an unsupported kind"));
    check(folder.path(), "it", "TIFF", &Warn("using a constant color (save the image as PNG"));
    // As the color of a whole material, it is no texture that the material can do without.
    let error = DecodedImage::decode(&tiff, &Budget::default()).expect_err("unsupported");
    assert!(error.is_unsupported() && error.is_permanent(), "{error}");
    // Other content under the name of a known format is damage.
    write(folder.path(), "it/meshes/model.mtl", "newmtl skin\nmap_Kd texture.png\n");
    write(folder.path(), "it/materials/textures/texture.png", "8BPS\0\x01");
    check(folder.path(), "it", "damage", &Reject("texture.png: not an image of a known format"));
}

/// Folders and names that a pool does not search are reported, each with a remedy.
#[cfg(unix)]
#[test]
fn what_a_pool_does_not_search_is_reported() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let folder = TempDir::new().expect("temp folder");
    let pool = folder.path().join("pool");
    write(&pool, "here.obj", obj(1.0));
    write(&pool, "1/2/3/4/5/6/7/8/9/deep.obj", obj(1.0));
    write(folder.path(), "store/there.obj", obj(1.0));
    std::os::unix::fs::symlink("../store", pool.join("linked")).expect("a link");
    fs::write(pool.join(OsStr::from_bytes(b"\xff.obj")), obj(1.0)).expect("a file");
    std::os::unix::fs::symlink("../../store/there.obj", pool.join("1/leak.obj")).expect("a link");
    let log = Collected::default();
    let source = source_of("mesh_folder", &pool, "");
    let names: Vec<String> = source.catalog(&log).expect("found").entries.into_iter().map(|it| it.name).collect();
    assert_eq!(names, ["1", "here"]);
    let said: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
    let said = said.join("\n");
    for part in [
        "linked: folders are not searched, because they are symbolic links: 1",
        "9: folders are not searched, because they are more than 8 levels deep: 1",
        "names that are not UTF-8 are left out: 1",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let error = source.load("1", &log).expect_err("leads out").to_string();
    assert!(error.contains("through a link") && error.contains("contains the files behind links"), "{error}");
}
