//! Inputs that the tests make themselves: the rules for bad and odd files, without the files.

use crate::common::{fact, look, peak, source_of};
use image::{DynamicImage, GrayImage, ImageFormat, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use syntable_model::context::Collected;
use syntable_model::random::Stream;
use syntable_model::scene::Object;
use tempfile::TempDir;

/// Corners of a box of 60 × 80 × 100 mm, in metres, and its faces, counter-clockwise from outside.
const CORNERS: [[f32; 3]; 8] = [
    [-0.03, -0.04, 0.0],
    [-0.03, -0.04, 0.1],
    [-0.03, 0.04, 0.0],
    [-0.03, 0.04, 0.1],
    [0.03, -0.04, 0.0],
    [0.03, -0.04, 0.1],
    [0.03, 0.04, 0.0],
    [0.03, 0.04, 0.1],
];
const QUADS: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];

fn triangles() -> Vec<[u32; 3]> {
    QUADS.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

fn obj(scale: f32) -> String {
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

const MTL: &str = "newmtl skin\nKd 1 1 1\nmap_Kd texture.png\n";

fn encode(image: DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("encodes");
    bytes.into_inner()
}

fn png() -> Vec<u8> {
    encode(RgbImage::from_fn(8, 8, |x, y| image::Rgb([x as u8 * 30, y as u8 * 30, 90])).into(), ImageFormat::Png)
}

/// A chunk of a PNG with its checksum.
fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [kind, data].concat();
    let crc = !body.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    [&(data.len() as u32).to_be_bytes()[..], &body, &crc.to_be_bytes()].concat()
}

/// A PNG that declares a size and has little behind it.
fn png_of_size(width: u32, height: u32) -> Vec<u8> {
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 6, 0, 0, 0]].concat();
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]),
        chunk(b"IEND", &[]),
    ]
    .concat()
}

fn write(folder: &Path, path: &str, bytes: impl AsRef<[u8]>) {
    let path = folder.join(path);
    fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
    fs::write(path, bytes).expect("file");
}

/// A sound object in the layout of Google Scanned Objects.
fn gso(folder: &Path, name: &str) {
    write(folder, &format!("{name}/meshes/model.obj"), obj(1.0));
    write(folder, &format!("{name}/meshes/model.mtl"), MTL);
    write(folder, &format!("{name}/materials/textures/texture.png"), png());
}

/// What a case must do.
enum Want<'a> {
    Reject(&'a str),
    Warn(&'a str),
    Accept,
}
use Want::{Accept, Reject, Warn};

/// Looks at a path of a folder. Whatever it is, it must cost little memory.
fn check(folder: &Path, path: &str, case: &str, want: &Want<'_>) {
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

/// Cases of one object: every change is applied to a fresh sound one.
fn check_objects(cases: &[(&str, &dyn Fn(&Path), Want<'_>)]) {
    for (case, change, want) in cases {
        let folder = TempDir::new().expect("temp folder");
        gso(folder.path(), "it");
        change(&folder.path().join("it"));
        check(folder.path(), "it", case, want);
    }
}

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
        ("coordinates outside the picture", &text(&|t| t.replace("vt 1 1", "vt -3 7.5 0")), Accept),
        (
            "vertex colours without a library",
            &|it| {
                let coloured = obj(1.0)
                    .lines()
                    .map(|l| if l.starts_with("v ") { format!("{l} 0.8 0.2 0.1\n") } else { format!("{l}\n") })
                    .collect::<String>();
                write(it, "meshes/model.obj", coloured);
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
        ("no vertices", &text(&|_| "f 1 2 3\n".into()), Reject("model.obj:1: vertex index 1 in `1`, but there are 0")),
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
            Reject("a vertex with 2 coordinates"),
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
        ("index zero", &text(&|t| t + "f 0 1 2\n"), Reject("model.obj:27: vertex index 0 in `0`, but there are 8")),
        ("index too large", &text(&|t| t + "f 1 2 9\n"), Reject("vertex index 9")),
        ("index enormous", &text(&|t| t + "f 1 2 99999999999999999999\n"), Reject("is not a face corner")),
        ("index too negative", &text(&|t| t + "f 1 2 -9\n"), Reject("vertex index -9")),
        ("least index", &text(&|t| t + "f 1 2 -9223372036854775808\n"), Reject("vertex index -9223372036854775808")),
        ("texture index too large", &text(&|t| t + "f 1/1 2/5 3/1\n"), Reject("texture coordinate index 5")),
        ("two corners", &text(&|t| t + "f 1/1 2/2\n"), Reject("a face with 2 corners")),
        (
            "normals that are not finite",
            &text(&|t| t.replace("vt 0 0\n", "vt 0 0\nvn nan nan nan\n").replace("4/3", "4/3/1")),
            Accept,
        ),
        ("missing normals", &text(&|t| t.replace("4/3", "4/3/7")), Warn("corners name normals that are not there")),
        ("flat", &text(&|t| t.replace(" 0.1\n", " 0\n")), Reject("one plane")),
        (
            "one point",
            &text(&|t| t.replace("0.03", "0").replace("0.04", "0").replace("0.1", "0")),
            Reject("no face with area among 12"),
        ),
        (
            "millimetres",
            &|it| write(it, "meshes/model.obj", obj(1000.0)),
            Reject(
                "object extent 100.000 m is outside the allowed range of 0.0005 m to 10 m (set `scale = 0.001` if the file is in millimetres",
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
            Warn("turned inside out"),
        ),
        (
            "one face turned",
            &text(&|t| t.replace("f 1/1 2/2 4/3", "f 2/1 1/2 4/3")),
            Warn("neighbouring faces point to opposite sides at 3 edges"),
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
fn materials_and_pictures() {
    let mtl = |text: &'static str| move |it: &Path| write(it, "meshes/model.mtl", text);
    let picture = |bytes: Vec<u8>| move |it: &Path| write(it, "materials/textures/texture.png", &bytes);
    let grey = DynamicImage::from(GrayImage::from_pixel(3, 5, image::Luma([80])));
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
            Reject("model.mtl:2: `/etc/passwd` is an absolute path"),
        ),
        ("backslashes", &mtl("newmtl skin\nmap_Kd ..\\..\\x.png\n"), Reject("has backslashes")),
        ("an address", &mtl("newmtl skin\nmap_Kd http://example.invalid/x.png\n"), Reject("is an address")),
        (
            "a library that leads out",
            &|it| write(it, "meshes/model.obj", obj(1.0).replace("model.mtl", "../../x.mtl")),
            Reject("model.obj:1: `../../x.mtl` leaves"),
        ),
        ("a height map", &mtl("newmtl skin\nmap_Kd texture.png\nbump texture.png\n"), Warn("is a height map")),
        ("no picture", &mtl("newmtl skin\nmap_Kd none.png\n"), Warn("model.mtl:2: no texture `none.png`")),
        (
            "no library",
            &|it| fs::remove_file(it.join("meshes/model.mtl")).expect("removes"),
            Warn("model.obj:1: no material library `model.mtl`"),
        ),
        ("unknown material", &mtl("newmtl other\n"), Warn("model.obj:2: no material `skin`")),
        (
            "no texture coordinates",
            &|it| write(it, "meshes/model.obj", obj(1.0).replace("/1", "").replace("/2", "").replace("/3", "")),
            Warn("12 faces have no texture coordinates"),
        ),
        ("a broken library", &mtl("newmtl skin\nKd 1 nan 1\n"), Reject("model.mtl:2: non-finite colour: `nan`")),
        ("one pixel", &picture(encode(RgbImage::new(1, 1).into(), ImageFormat::Png)), Accept),
        ("odd size", &picture(encode(RgbImage::new(61, 37).into(), ImageFormat::Png)), Accept),
        ("grey", &picture(encode(grey.clone(), ImageFormat::Png)), Accept),
        ("16 bits", &picture(encode(grey.into_luma16().into(), ImageFormat::Png)), Accept),
        ("a JPEG named PNG", &picture(jpeg.clone()), Accept),
        ("a JPEG cut short", &picture(cut(&jpeg)), Reject("texture.png: the JPEG is cut short")),
        ("cut short", &picture(cut(&png())), Reject("texture.png: not a sound PNG")),
        ("a wrong checksum", &picture(flipped(png(), data)), Reject("texture.png: not a sound PNG")),
        (
            "65000 pixels a side",
            &picture(png_of_size(65_000, 65_000)),
            Reject("texture.png: 65000 x 65000 pixels are more than the limit"),
        ),
        ("no pixels", &picture(png_of_size(0, 0)), Reject("texture.png")),
        ("text", &picture(b"this is no picture".to_vec()), Reject("texture.png: not an image")),
        ("empty", &picture(Vec::new()), Reject("texture.png: the file is empty")),
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
            &picture(b"GIF89a\x01\x00\x01\x00\x00\x00\x00;".to_vec()),
            Reject("Gif pictures are not read"),
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

    check(
        &root,
        "texture",
        "a linked picture",
        &Reject("model.mtl:3: `../materials/textures/texture.png` leads out of the asset's folder"),
    );
    check(&root, "mesh", "a linked mesh", &Reject("leads out of the asset's folder"));
    check(&root, "inside", "a link inside", &Accept);
    check(&root, "box.gltf", "a linked buffer", &Reject("`box.bin` leads out of the asset's folder"));
    // The same through sources: whole objects that are links.
    std::os::unix::fs::symlink("..", root.join("up")).expect("link");
    let source = source_of("google_scanned_objects", &root, "");
    let log = Collected::default();
    let names: Vec<String> = source.catalog(&log).expect("a catalogue").entries.into_iter().map(|e| e.name).collect();
    assert_eq!(names, ["inside", "mesh", "texture"]);
    for (name, sound) in
        [("inside", true), ("texture", false), ("mesh", false), ("up", false), ("../root/inside", false)]
    {
        assert_eq!(source.load(name, &log).is_ok(), sound, "{name}");
    }
}

fn ply_header(format: &str, vertices: &str, faces: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made here\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty \
         float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_ascii() -> String {
    let mut text = ply_header("ascii", "8", "6");
    CORNERS.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    QUADS.iter().for_each(|[a, b, c, d]| text += &format!("4 {a} {b} {c} {d} \n"));
    text
}

fn ply_binary(big: bool) -> Vec<u8> {
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

fn check_file(name: &str, bytes: impl AsRef<[u8]>, case: &str, want: Want<'_>) {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), name, bytes);
    check(folder.path(), name, case, &want);
}

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
    check(body("comment TextureFile none.png\nend_header\n").as_bytes(), "no picture", Warn("no texture `none.png`"));
    check(
        body("comment TextureFile ../../x.png\nend_header\n").as_bytes(),
        "a picture outside",
        Reject("leaves the asset's folder"),
    );
    check(b"", "empty", Reject("empty"));
    check(b"\x00\x01garbage\n\n", "garbage", Reject("not a PLY file"));
    check(&binary[..binary.len() / 2], "cut in half", Reject("bytes"));
    check(&binary[..binary.len() - 4], "cut in the last face", Reject("bytes"));
    let ascii = ply_ascii();
    check(ascii[..ascii.len() - 20].as_bytes(), "text cut short", Reject("a list of 4 items"));
    check(body("").as_bytes(), "no end of the header", Reject("end_header"));
    check(ply_ascii()[..60].as_bytes(), "only a header", Reject("no `end_header`"));
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
        Reject("x.ply:19: face 0 has index 300, but there are 8 vertices"),
    );
    check(ply_ascii().replace("4 0 1 3 2", "4 0 1 3 -1").as_bytes(), "negative index", Reject("face 0 has index -1"));
    check(ply_ascii().replace("4 0 1 3 2", "2 0 1").as_bytes(), "two corners", Reject("face 0 has 2 corners"));
    check(
        ply_ascii().replace("4 0 1 3 2", "4294967295 0 1").as_bytes(),
        "text list bomb",
        Reject("a list of 4294967295 items"),
    );
    check(ply_ascii().replace("-0.03 -0.04 0\n", "-0.03 nan 0\n").as_bytes(), "nan", Reject("non-finite vertex 0"));
    let bomb = [ply_header("binary_little_endian", "0", "1").replace("list uchar", "list uint").as_bytes(), &[255; 40]]
        .concat();
    check(&bomb, "list bomb", Reject("a list of 4294967295 items"));
    let nothing = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nend_header\n";
    check(nothing.as_bytes(), "rows of nothing", Reject("4000000000 rows"));
    check(ply_ascii().replace("ascii", "ebcdic").as_bytes(), "format", Reject("`ebcdic` is not a format"));
    check(
        ply_ascii().replace("property float y\n", "property float w\n").as_bytes(),
        "no y",
        Reject("no property `y`"),
    );
}

/// Base64 as RFC 4648 defines it.
fn base64(bytes: &[u8]) -> String {
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
fn gltf_bytes() -> Vec<u8> {
    let mut bytes = Vec::new();
    CORNERS.iter().for_each(|&[x, y, z]| [x, z, -y].iter().for_each(|v| bytes.extend(v.to_le_bytes())));
    triangles().iter().flatten().for_each(|&index| bytes.extend((index as u16).to_le_bytes()));
    bytes
}

fn gltf(uri: &str) -> String {
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

fn embedded() -> String {
    gltf(&format!("data:application/octet-stream;base64,{}", base64(&gltf_bytes())))
}

fn glb() -> Vec<u8> {
    let mut json = gltf("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let data = gltf_bytes();
    let length = 12 + 8 + json.len() + 8 + data.len();
    let word = |x: usize| (x as u32).to_le_bytes();
    [b"glTF", &word(2)[..], &word(length), &word(json.len()), b"JSON", &json, &word(data.len()), b"BIN\0", &data]
        .concat()
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
    check(r#""scene": 0"#, r#""scene": 7"#, "scene", Reject("scene 7 is named, but there are 1"));
    check(
        r#""nodes": [{ "mesh": 0 }]"#,
        r#""nodes": [{ "mesh": 3 }]"#,
        "mesh",
        Reject("mesh 3 is named, but there are 1"),
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
        Reject("no face with area"),
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
    check(r#""count": 36"#, r#""count": 35"#, "a broken triangle", Reject("no whole number of triangles"));
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
        Reject("index 7, but there are 7 vertices"),
    );
    check(r#""componentType": 5126"#, r#""componentType": 99"#, "type of number", Reject("an unknown type of number"));
    check(r#""type": "SCALAR""#, r#""type": "VEC2""#, "width", Reject("2 numbers an element, but 1 are wanted"));
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
    check("] }", "", "cut JSON", Reject("not sound glTF JSON"));
    check(";base64,", ",", "another coding", Reject("not base64"));
    check(";base64,", ";base64,?", "wrong base64", Reject("letter 0 of the base64 data is wrong"));
    let deep = format!(r#"{{"asset":{{"version":"2.0"}},"extras":{}{}}}"#, "[".repeat(20_000), "]".repeat(20_000));
    check_file("x.gltf", deep, "deep", Reject("nested more than"));
    check_file("x.gltf", "", "empty", Reject("empty"));
    check_file("x.gltf", "{}", "no asset", Reject("no `asset`"));
    for (uri, want) in [
        ("none.bin", "no file `none.bin`"),
        ("../../secret.bin", "leaves the asset's folder"),
        ("%2e%2e/secret.bin", "leaves the asset's folder"),
        ("/etc/passwd", "absolute path"),
        ("http://example.invalid/box.bin", "is an address"),
        ("file:///etc/passwd", "is an address"),
        ("..\\\\secret.bin", "backslashes"),
    ] {
        check_file("x.gltf", gltf(uri), uri, Reject(want));
    }
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "my box.bin", gltf_bytes());
    write(folder.path(), "x.gltf", gltf("my%20box.bin"));
    crate::made::check(folder.path(), "x.gltf", "a file", &Accept);
    write(folder.path(), "my box.bin", [0; 100]);
    crate::made::check(
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
    check(&sound[..sound.len() - 60], "cut short", Reject("not a valid GLB: its header says"));
    check(&sound[..10], "a stump", Reject("it ends after 10 bytes"));
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = sound.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        changed
    };
    check(&with(12, &[255; 4]), "chunk bomb", Reject("a chunk of 4294967295 bytes"));
    check(&with(4, &[1, 0, 0, 0]), "version 1", Reject("glTF version `1`"));
    check(&with(4, &[9, 9, 9, 9]), "garbage", Reject("not a valid GLB"));
    check(&with(16, b"WHAT"), "first chunk", Reject("not JSON"));
    let bin = sound.windows(4).position(|word| word == b"BIN\0").expect("a chunk");
    check(&with(bin, b"WHAT"), "no data", Reject("neither a file nor a binary chunk"));
}

#[test]
fn instances_are_counted_out_with_their_transforms() {
    // A parent at twice the size holds a plain child, and one that is mirrored, turned and moved.
    let nodes = r#""nodes": [{ "scale": [2, 2, 2], "children": [1, 2] }, { "mesh": 0 },
        { "mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0.70710678, 0, 0.70710678], "scale": [-1, 1, 1] }]"#;
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "x.gltf", embedded().replace(r#""nodes": [{ "mesh": 0 }]"#, nodes));
    let object = load(folder.path(), "x");
    assert_eq!((object.mesh.data().triangles.len(), object.mesh.data().positions.len()), (24, 16));
    // A quarter turn about y swaps the widths; all sizes double; the mirrored box is not inside out.
    assert!((object.mesh.signed_volume() - 2.0 * 8.0 * 0.000_48).abs() < 1e-7, "{}", object.mesh.signed_volume());
    let bounds = object.mesh.bounds();
    let want = [[-0.06, -0.08, 0.0], [2.08, 0.08, 0.2]];
    for axis in 0..3 {
        assert!((bounds.min[axis] - want[0][axis]).abs() < 1e-6, "{bounds:?}");
        assert!((bounds.max[axis] - want[1][axis]).abs() < 1e-6, "{bounds:?}");
    }
    // A small file must not place millions of triangles.
    let many = (0..2_000_000 / 12).map(|_| r#"{"mesh":0}"#).collect::<Vec<_>>();
    let nodes = format!(r#""nodes": [{}]"#, many.join(","));
    let scene = format!(r#""nodes": [{}]"#, (0..many.len()).map(|i| i.to_string()).collect::<Vec<_>>().join(","));
    let huge = embedded().replace(r#""nodes": [{ "mesh": 0 }]"#, &nodes).replace(r#""nodes": [0]"#, &scene);
    let sixteenfold =
        huge.replace(r#""indices": 1 }"#, &[r#""indices": 1 }"#; 9].join(r#", { "attributes": { "POSITION": 0 }, "#));
    write(folder.path(), "y.gltf", sixteenfold);
    let error = source_of("mesh_folder", folder.path(), "").load("y", &Collected::default()).expect_err("too many");
    assert!(error.to_string().contains("more than 16000000 triangles"), "{error}");
}

fn load(root: &Path, name: &str) -> Object {
    let log = Collected::default();
    let asset = source_of("mesh_folder", root, "").load(name, &log).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(log.warnings().is_empty(), "{name}: {:?}", log.warnings());
    asset.into_object().expect("an object")
}

/// Triangles as triples of positions, each from its smallest corner on, sorted: the shape without its numbering.
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

fn stl(ascii: bool) -> Vec<u8> {
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

#[test]
fn one_box_is_the_same_in_all_formats() {
    let folder = TempDir::new().expect("temp folder");
    let root = folder.path();
    write(root, "reference.obj", obj(1.0).replace("mtllib model.mtl\nusemtl skin\n", ""));
    let reference = load(root, "reference");
    assert_eq!(reference.mesh.data().triangles.len(), 12);
    assert!((reference.mesh.signed_volume() - 0.000_48).abs() < 1e-9);
    assert!((reference.mass_kg - 0.000_48 * 400.0).abs() < 1e-6);
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
    assert!(object.check_extent().is_err());
    object.mesh = std::sync::Arc::new(object.mesh.transformed(Default::default(), 0.001).expect("sound"));
    object.check_extent().expect("ten centimetres");
    assert!((object.mesh.signed_volume() - 0.000_48).abs() < 1e-9);
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
    check_file("x.exr", &bytes[..bytes.len() / 2], "cut short", Reject("not a sound OpenEXR"));
    exr::prelude::write_rgb_file(&path, 4, 2, |x, _| (f32::INFINITY * x as f32, 0.0, 0.0)).expect("writes");
    check(folder.path(), "x.exr", "not finite", &Reject("non-finite radiance"));
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
    let ours = syntable_assets::files::formats::environment::RadianceMap::decode(&bytes).expect("sound");
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
    let picture = |side: u32| encode(RgbImage::new(side, side).into(), ImageFormat::Jpeg);
    let folder = TempDir::new().expect("temp folder");
    let root = folder.path();
    write(root, "Only/Only_1K-JPG_Color.jpg", picture(8));
    write(root, "Mix/Mix_1K-JPG_Color.jpg", picture(8));
    write(root, "Mix/Mix_1K-JPG_Roughness.jpg", picture(4));
    write(root, "Bare/Bare_1K-JPG_Roughness.jpg", picture(4));
    write(root, "packed/textures/packed_diff_1k.jpg", picture(8));
    write(root, "packed/textures/packed_arm_1k.jpg", picture(8));
    let dx = RgbImage::from_pixel(8, 8, image::Rgb([128, 200, 255]));
    write(root, "packed/textures/packed_nor_dx_1k.png", encode(dx.into(), ImageFormat::Png));
    check(root, "Only", "colour alone", &Accept);
    check(root, "Mix", "two sizes", &Warn("colour 8 x 8, roughness 4 x 4"));
    check(root, "Bare", "no colour", &Reject("Bare: no colour map; there is only: roughness"));
    check(root, "packed", "packed", &Accept);
    let source = source_of("pbr_folder", root, "tile_m = 0.7");
    let names: Vec<String> =
        source.catalog(&Collected::default()).expect("a catalogue").entries.into_iter().map(|e| e.name).collect();
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
    assert_eq!(packed.normal.expect("a map").map.texture.texels[..4], [128, 55, 255, 255]);
}

#[test]
fn bop_folders() {
    let info = |id: u32, size: f32| {
        format!(
            r#"{{"{id}": {{"diameter": 141.4, "min_x": -30, "min_y": -40, "min_z": 0, "size_x": 60, "size_y": 80, "size_z": {size}}}}}"#
        )
    };
    let millimetres = ply_ascii().replace("0.03", "30").replace("0.04", "40").replace("0.1", "100");
    let folder = TempDir::new().expect("temp folder");
    let models = folder.path().join("set/models");
    write(&models, "obj_000001.ply", &millimetres);
    write(&models, "models_info.json", info(1, 100.0));
    check(folder.path(), "set", "a dataset", &Accept);
    check(&models, "models_info.json", "the file", &Accept);
    let source = source_of("bop_models", folder.path(), "");
    let log = Collected::default();
    assert_eq!(source.catalog(&log).expect("a catalogue").entries[0].name, "set/obj_000001");
    let object = source.load("set/obj_000001", &log).expect("loads").into_object().expect("an object");
    assert!((object.mesh.bounds().size() - syntable_model::geometry::Vector3::new(0.06, 0.08, 0.1)).norm() < 1e-6);
    assert!(log.warnings().is_empty(), "{:?}", log.warnings());
    assert!(source.load("set/../set/obj_000001", &log).is_err() && source.load("other/obj_000001", &log).is_err());

    write(&models, "models_info.json", info(1, 0.1));
    check(
        folder.path(),
        "set",
        "another size",
        &Warn("the mesh is 60.0 x 80.0 x 100.0 mm, but models_info.json says 60.0 x 80.0 x 0.1 mm"),
    );
    write(&models, "models_info.json", info(77, 100.0));
    check(folder.path(), "set", "no such model", &Reject("obj_000077.ply"));
    source.catalog(&log).expect("a catalogue");
    assert!(log.warnings().iter().any(|warning| warning.to_string().contains("obj_000077.ply")));
    for (text, says) in [
        (r#"{"1": {"diameter": 172.06, "min_x":"#, "models_info.json:1: not sound JSON"),
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
    for kind in ["google_scanned_objects", "ycb", "bop_models", "mesh_folder", "pbr_folder"] {
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
    for kind in ["google_scanned_objects", "ycb", "bop_models", "mesh_folder", "pbr_folder"] {
        let entry = registry.find(syntable_model::registry::Slot::Assets, kind).expect(kind);
        assert!(entry.construct_str(entry.example).is_ok(), "{kind}");
        crate::common::source(kind, entry.example).expect(kind);
    }
}

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

/// A UV sphere of two million triangles, as the index of bad inputs describes it.
#[test]
#[ignore = "takes seconds and 200 MB; run it by name to see the figures"]
fn two_million_triangles_load() {
    let (rings, sectors, radius) = (1000_usize, 1000_usize, 0.1_f64);
    let mut bytes =
        ply_header("binary_little_endian", &((rings + 1) * sectors).to_string(), &(rings * sectors * 2).to_string())
            .into_bytes();
    for i in 0..=rings {
        for j in 0..sectors {
            let (theta, phi) =
                (std::f64::consts::PI * i as f64 / rings as f64, std::f64::consts::TAU * j as f64 / sectors as f64);
            let p = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
            // sin π is not quite zero; the poles are single points.
            let p = if i == 0 || i == rings { [0.0, 0.0, p[2]] } else { p };
            p.iter().for_each(|x| bytes.extend(((radius * x) as f32).to_le_bytes()));
        }
    }
    for i in 0..rings {
        for j in 0..sectors {
            let at = |i: usize, j: usize| (i * sectors + j % sectors) as u32;
            for triangle in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]] {
                bytes.push(3);
                triangle.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
            }
        }
    }
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "sphere.ply", &bytes);
    let size = bytes.len();
    drop(bytes);
    let started = std::time::Instant::now();
    let ((found, warnings), most) = peak(|| look(&folder.path().join("sphere.ply")));
    let found = found.expect("loads");
    println!(
        "{} MB in {:.2} s, {} MB at most: {found:?} {warnings:?}",
        size >> 20,
        started.elapsed().as_secs_f64(),
        most >> 20
    );
    // The triangles at the poles that are points go.
    assert_eq!(fact(&found, "triangles"), "1998000");
    assert_eq!(fact(&found, "closed"), "yes");
    assert_eq!(fact(&found, "volume"), "4.1888 litre");
}
