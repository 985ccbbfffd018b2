//! Bad and unusual objects in OBJ that the tests create.

use crate::common::source_of;
use crate::inputs::*;
use image::{DynamicImage, GrayImage, ImageFormat, RgbImage};
use std::fs;
use std::path::Path;
use syntable_model::context::Collected;
use tempfile::TempDir;

#[test]
fn obj_text() {
    let text =
        |change: &'static dyn Fn(String) -> String| move |it: &Path| write(it, "meshes/model.obj", change(obj(1.0)));
    check_objects(&[
        ("plain", &|_| (), Accept),
        ("byte-order mark and CRLF", &text(&|t| format!("\u{feff}{}", t.replace('\n', "\r\n"))), Accept),
        (
            "comments and blanks",
            &text(&|t| {
                t.replace("\n", "  # c\n\n\t ")
                    .replace("usemtl skin  # c", "usemtl skin ")
                    .replace("mtllib model.mtl  # c", "mtllib model.mtl")
            }),
            Accept,
        ),
        ("continuation", &text(&|t| t.replace(" 2/2", " \\\n 2/2")), Accept),
        ("negative indices", &text(&|t| t.replace("f 1/1 2/2 4/3", "f -8/-4 -7/-3 -5/-2")), Accept),
        ("exponents", &text(&|t| t.replace("0.03", "3.0000e-02")), Accept),
        ("points, lines and groups", &text(&|t| t + "o x\ng a b\ns 1\nl 1 2\np 3\nvp 0.1\ncall x.obj\n"), Accept),
        ("an unused vertex far away", &text(&|t| t + "v 99 99 99\n"), Accept),
        ("coordinates outside the image", &text(&|t| t.replace("vt 1 1", "vt -3 7.5 0")), Accept),
        (
            "vertex colors without a library",
            &|it| {
                let colored = obj(1.0)
                    .lines()
                    .map(|l| if l.starts_with("v ") { format!("{l} 0.8 0.2 0.1\n") } else { format!("{l}\n") })
                    .collect::<String>();
                write(it, "meshes/model.obj", colored);
                fs::remove_file(it.join("meshes/model.mtl")).expect("removes");
            },
            Accept,
        ),
        ("empty", &text(&|_| String::new()), Reject("model.obj: the file is empty")),
        (
            "no faces",
            &text(&|t| t.lines().filter(|l| !l.starts_with('f')).map(|l| format!("{l}\n")).collect()),
            Reject("no faces"),
        ),
        ("no vertices", &text(&|_| "f 1 2 3\n".into()), Reject("model.obj:1: vertex index 1 in `1`, but only 0")),
        ("nothing", &text(&|_| "# a comment\n".into()), Reject("no vertices and no faces")),
        (
            "garbage",
            &|it| write(it, "meshes/model.obj", [200_u8, 3, 0, 255, 17, 10, 1, 2, 3]),
            Reject("model.obj:1: not text"),
        ),
        ("cut in a face", &text(&|t| t.trim_end().trim_end_matches('3').to_owned()), Reject("/` is not a face corner")),
        (
            "cut in a vertex",
            &text(&|t| t[..t.find("v 0.03").expect("a vertex")].to_owned() + "v 0.03 0.1"),
            Reject("a vertex has 2 coordinates"),
        ),
        (
            "not a number",
            &text(&|t| t.replace("v 0.03 0.04 0\n", "v 0.03 x 0\n")),
            Reject("model.obj:9: `x` is not a number"),
        ),
        ("not an index", &text(&|t| t + "f 1/1 2/x 3/3\n"), Reject("model.obj:27: `2/x` is not a face corner")),
        (
            "nan",
            &text(&|t| t.replace("v 0.03 0.04 0\n", "v 0.03 NaN 0\n")),
            Reject("model.obj:9: non-finite vertex: `NaN`"),
        ),
        ("infinity", &text(&|t| t.replace("v 0.03 0.04 0\n", "v 0.03 -inf 0\n")), Reject("non-finite vertex: `-inf`")),
        (
            "overflow",
            &text(&|t| t.replace("v 0.03 0.04 0\n", "v 0.03 1e400 0\n")),
            Reject("non-finite vertex: `1e400`"),
        ),
        ("index zero", &text(&|t| t + "f 0 1 2\n"), Reject("model.obj:27: vertex index 0 in `0`, but only 8")),
        ("index too large", &text(&|t| t + "f 1 2 9\n"), Reject("vertex index 9")),
        ("index enormous", &text(&|t| t + "f 1 2 99999999999999999999\n"), Reject("is not a face corner")),
        ("index too negative", &text(&|t| t + "f 1 2 -9\n"), Reject("vertex index -9")),
        ("least index", &text(&|t| t + "f 1 2 -9223372036854775808\n"), Reject("vertex index -9223372036854775808")),
        ("texture index too large", &text(&|t| t + "f 1/1 2/5 3/1\n"), Reject("texture coordinate index 5")),
        ("two corners", &text(&|t| t + "f 1/1 2/2\n"), Warn("faces with fewer than three corners are left out: 1")),
        (
            "no texture coordinates",
            &text(&|t| t.lines().filter(|line| !line.starts_with("vt")).map(|line| format!("{line}\n")).collect()),
            Warn("corners refer to texture coordinates, but the file has none"),
        ),
        (
            "normals that are not finite",
            &text(&|t| t.replace("vt 0 0\n", "vt 0 0\nvn nan nan nan\n").replace("4/3", "4/3/1")),
            Accept,
        ),
        ("missing normals", &text(&|t| t.replace("4/3", "4/3/7")), Warn("corners refer to missing normals")),
        ("flat", &text(&|t| t.replace(" 0.1\n", " 0\n")), Reject("one plane")),
        (
            "one point",
            &text(&|t| t.replace("0.03", "0").replace("0.04", "0").replace("0.1", "0")),
            Reject("none of the 12 faces has area"),
        ),
        (
            "millimeters",
            &|it| write(it, "meshes/model.obj", obj(1000.0)),
            Reject(
                "object extent 100.000 m is outside the allowed range of 0.0005 m to 10 m (`units = \"mm\"` makes it 10.0 cm)",
            ),
        ),
        ("huge", &|it| write(it, "meshes/model.obj", obj(1e30)), Reject("object extent 1.000e29 m")),
        ("tiny", &|it| write(it, "meshes/model.obj", obj(1e-6)), Reject("object extent 1.000e-7 m")),
        ("degenerate faces", &text(&|t| t + "f 1/1 1/1 2/2\nf 3/1 4/1 3/2\n"), Warn("2 of 14 faces have no area")),
        ("duplicate faces", &text(&|t| t + "f 2/1 4/2 1/3\n"), Warn("1 of 13 faces are duplicates")),
        (
            "open",
            &text(&|t| t[..t.trim_end().rfind('\n').expect("a line")].to_owned()),
            Warn("open, with 3 boundary edges"),
        ),
        ("not manifold", &text(&|t| t + "v 0 0 0.2\nf 1/1 2/2 9/3\n"), Warn("1 edges of more than two faces")),
        (
            "inverted",
            &|it| {
                let turned = obj(1.0)
                    .lines()
                    .map(|l| match l.split(' ').collect::<Vec<_>>()[..] {
                        ["f", a, b, c] => format!("f {a} {c} {b}\n"),
                        _ => format!("{l}\n"),
                    })
                    .collect::<String>();
                write(it, "meshes/model.obj", turned);
            },
            Warn("orientation was flipped"),
        ),
        (
            "one face turned",
            &text(&|t| t.replace("f 1/1 2/2 4/3", "f 2/1 1/2 4/3")),
            Warn("neighboring faces are oriented inconsistently at 3 edges"),
        ),
        (
            "three boxes",
            &|it| {
                let vertices =
                    |i: usize| CORNERS.map(|[x, y, z]| format!("v {} {y} {z}\n", x + i as f32 * 0.1)).concat();
                let faces = |i: usize| {
                    triangles()
                        .iter()
                        .map(|t| {
                            format!(
                                "f {} {} {}\n",
                                t[0] as usize + 1 + 8 * i,
                                t[1] as usize + 1 + 8 * i,
                                t[2] as usize + 1 + 8 * i
                            )
                        })
                        .collect::<String>()
                };
                write(it, "meshes/model.obj", (0..3).map(|i| vertices(i) + &faces(i)).collect::<String>());
            },
            Warn("3 separate parts"),
        ),
    ]);
}

#[test]
fn materials_and_textures() {
    let mtl = |text: &'static str| move |it: &Path| write(it, "meshes/model.mtl", text);
    let image = |bytes: Vec<u8>| move |it: &Path| write(it, "materials/textures/texture.png", &bytes);
    let gray = DynamicImage::from(GrayImage::from_pixel(3, 5, image::Luma([80])));
    let cut = |bytes: &[u8]| bytes[..bytes.len() * 3 / 5].to_vec();
    let flipped = |mut bytes: Vec<u8>, at: usize| {
        bytes[at] ^= 0x10;
        bytes
    };
    let noise = RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y) as u8, (x * 7) as u8, (y * 13) as u8]));
    let jpeg = encode(noise.into(), ImageFormat::Jpeg);
    let data = png().windows(4).position(|word| word == b"IDAT").expect("data") + 8;
    check_objects(&[
        (
            "options",
            &mtl("newmtl skin\nmap_Kd -s 2 2 1 -clamp on texture.png\nnewmtl unused\nmap_Kd nothing.png\n"),
            Accept,
        ),
        (
            "an unused material that leads out",
            &mtl("newmtl skin\nmap_Kd texture.png\nnewmtl unused\nmap_Kd /etc/passwd\n"),
            Accept,
        ),
        (
            "a name with blanks",
            &|it| {
                write(it, "meshes/model.mtl", "newmtl skin\nmap_Kd my täxture 1.png\n");
                write(it, "materials/textures/my täxture 1.png", png());
            },
            Accept,
        ),
        (
            "all maps",
            &|it| {
                write(
                    it,
                    "meshes/model.mtl",
                    "newmtl skin\nmap_Kd texture.png\nmap_Pr r.png\nmap_Pm r.png\nnorm n.png\nmap_Ke texture.png\n",
                );
                write(
                    it,
                    "meshes/r.png",
                    encode(DynamicImage::from(GrayImage::from_pixel(2, 2, image::Luma([9]))), ImageFormat::Png),
                );
                write(
                    it,
                    "meshes/n.png",
                    encode(RgbImage::from_pixel(2, 2, image::Rgb([128, 128, 255])).into(), ImageFormat::Png),
                );
            },
            Accept,
        ),
        ("a name within the object", &mtl("newmtl skin\nmap_Kd ../materials/textures/texture.png\n"), Accept),
        (
            "leading out",
            &mtl("newmtl skin\nmap_Kd ../../../x.png\n"),
            Reject("model.mtl:2: `../../../x.png` leaves the asset's folder"),
        ),
        (
            "absolute",
            &mtl("newmtl skin\nmap_Kd /etc/passwd\n"),
            Warn("model.mtl:2: texture `/etc/passwd` is missing; using a constant color"),
        ),
        (
            "backslashes",
            &mtl("newmtl skin\nmap_Kd ..\\..\\x.png\n"),
            Reject("model.mtl:2: `..\\..\\x.png` leaves the asset's folder"),
        ),
        ("an address", &mtl("newmtl skin\nmap_Kd http://example.invalid/x.png\n"), Reject("is a network address")),
        (
            "a library that leads out",
            &|it| write(it, "meshes/model.obj", obj(1.0).replace("model.mtl", "../../x.mtl")),
            Reject("model.obj:1: `../../x.mtl` leaves"),
        ),
        ("a height map", &mtl("newmtl skin\nmap_Kd texture.png\nbump texture.png\n"), Warn("is a height map")),
        ("no image", &mtl("newmtl skin\nmap_Kd none.png\n"), Warn("model.mtl:2: texture `none.png` is missing")),
        (
            "no library",
            &|it| fs::remove_file(it.join("meshes/model.mtl")).expect("removes"),
            Warn("model.obj:1: material library `model.mtl` is missing"),
        ),
        ("unknown material", &mtl("newmtl other\n"), Warn("model.obj:2: the library has no material `skin`")),
        (
            "no texture coordinates",
            &|it| write(it, "meshes/model.obj", obj(1.0).replace("/1", "").replace("/2", "").replace("/3", "")),
            Warn("12 faces have no texture coordinates"),
        ),
        ("a broken library", &mtl("newmtl skin\nKd 1 nan 1\n"), Reject("model.mtl:2: non-finite color: `nan`")),
        ("one pixel", &image(encode(RgbImage::new(1, 1).into(), ImageFormat::Png)), Accept),
        ("odd size", &image(encode(RgbImage::new(61, 37).into(), ImageFormat::Png)), Accept),
        ("gray", &image(encode(gray.clone(), ImageFormat::Png)), Accept),
        ("16 bits", &image(encode(gray.into_luma16().into(), ImageFormat::Png)), Accept),
        ("a JPEG named PNG", &image(jpeg.clone()), Accept),
        ("a JPEG cut short", &image(cut(&jpeg)), Reject("texture.png: the JPEG is cut short")),
        ("cut short", &image(cut(&png())), Reject("texture.png: not a valid PNG")),
        ("a wrong checksum", &image(flipped(png(), data)), Reject("texture.png: not a valid PNG")),
        (
            "65000 pixels a side",
            &image(png_of_size(65_000, 65_000)),
            Reject("texture.png: 65000 x 65000 pixels are more than the limit"),
        ),
        ("no pixels", &image(png_of_size(0, 0)), Reject("texture.png")),
        ("text", &image(b"this is no image".to_vec()), Reject("texture.png: not an image")),
        ("empty", &image(Vec::new()), Reject("texture.png: the file is empty")),
        (
            "a folder",
            &|it| {
                fs::remove_file(it.join("materials/textures/texture.png")).expect("removes");
                fs::create_dir(it.join("materials/textures/texture.png")).expect("folder");
            },
            Reject("texture.png: is a directory"),
        ),
        (
            "another format",
            &image(b"GIF89a\x01\x00\x01\x00\x00\x00\x00;".to_vec()),
            Reject("texture.png: not a valid GIF"),
        ),
    ]);
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_out() {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "secret.png", png());
    write(folder.path(), "secret.obj", obj(1.0));
    write(folder.path(), "secret.bin", [0; 168]);
    let root = folder.path().join("root");
    gso(&root, "texture");
    fs::remove_file(root.join("texture/materials/textures/texture.png")).expect("removes");
    std::os::unix::fs::symlink("../../../../secret.png", root.join("texture/materials/textures/texture.png"))
        .expect("link");
    gso(&root, "mesh");
    fs::remove_file(root.join("mesh/meshes/model.obj")).expect("removes");
    std::os::unix::fs::symlink("../../../secret.obj", root.join("mesh/meshes/model.obj")).expect("link");
    gso(&root, "inside");
    fs::rename(root.join("inside/materials/textures/texture.png"), root.join("inside/other.png")).expect("renames");
    std::os::unix::fs::symlink("../../other.png", root.join("inside/materials/textures/texture.png")).expect("link");
    std::os::unix::fs::symlink("../secret.bin", root.join("box.bin")).expect("link");
    write(&root, "box.gltf", gltf("box.bin"));

    check(&root, "texture", "a linked image", &Reject("model.mtl:3: `texture.png` leads out of the asset's folder"));
    check(&root, "mesh", "a linked mesh", &Reject("leads out of the asset's folder"));
    check(&root, "inside", "a link inside", &Accept);
    check(&root, "box.gltf", "a linked buffer", &Reject("`box.bin` leads out of the asset's folder"));
    // The same for sources: whole objects that are links.
    std::os::unix::fs::symlink("..", root.join("up")).expect("link");
    let source = source_of("google_scanned_objects", &root, "");
    let log = Collected::default();
    let names: Vec<String> = source.catalog(&log).expect("a catalog").entries.into_iter().map(|e| e.name).collect();
    assert_eq!(names, ["inside", "mesh", "texture"]);
    for (name, sound) in
        [("inside", true), ("texture", false), ("mesh", false), ("up", false), ("../root/inside", false)]
    {
        assert_eq!(source.load(name, &log).is_ok(), sound, "{name}");
    }
}
