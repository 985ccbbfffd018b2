//! All encodings of colors in OBJ with MTL, PLY, STL and glTF, compared with values worked out by hand and with
//! trimesh.

use crate::common::look;
use crate::details::{Builder, FACES, POSITIONS};
use crate::inputs::{base64, encode, write};
use image::{ImageFormat, RgbaImage};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::OnceLock;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::Collected;
use syntable_model::scene::{Alpha, Encoding, Material};
use syntable_testing::tools::python_with;
use tempfile::TempDir;

/// Display colors of the vertices, bytes.
const BY_VERTEX: [[u8; 3]; 4] = [[255, 0, 0], [0, 128, 0], [3, 0, 64], [200, 100, 50]];
/// Display colors of the faces, bytes.
const BY_FACE: [[u8; 3]; 4] = [[250, 40, 40], [40, 200, 0], [60, 60, 220], [120, 0, 90]];
/// Texture coordinates of the vertices, v up: the middles of the four texels of the image.
const UVS: [[f32; 2]; 4] = [[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]];

/// Color and opacity of a corner by face and vertex: linear, in [0, 1].
type Expected = Box<dyn Fn(usize, usize) -> [f64; 4]>;

struct Cases {
    folder: TempDir,
    list: Vec<Value>,
}

/// The transfer function of IEC 61966-2-1, implemented independently.
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn of_bytes(bytes: [u8; 3]) -> [f64; 4] {
    let [r, g, b] = bytes.map(|x| linear(f64::from(x) / 255.0));
    [r, g, b, 1.0]
}

fn by_vertex() -> Expected {
    Box::new(|_, vertex| of_bytes(BY_VERTEX[vertex]))
}

fn by_face() -> Expected {
    Box::new(|face, _| of_bytes(BY_FACE[face]))
}

fn constant(color: [f64; 4]) -> Expected {
    Box::new(move |_, _| color)
}

/// An image of two by two texels, the colors of the vertices.
fn image() -> Vec<u8> {
    let texel = |x: u32, y: u32| BY_VERTEX[(2 * y + x) as usize];
    let image = RgbaImage::from_fn(2, 2, |x, y| {
        let [r, g, b] = texel(x, y);
        image::Rgba([r, g, b, 255])
    });
    encode(image.into(), ImageFormat::Png)
}

/// Color and opacity of a corner from a material and a mesh.
fn color_of(material: &Material, uv: Option<[f32; 2]>, vertex: [f32; 3]) -> [f64; 4] {
    let (mut color, mut alpha) = (material.base_color.factor.map(f64::from), 1.0);
    if let (Some(used), Some([u, v])) = (&material.base_color.texture, uv) {
        let (t, texture) = (used.transform, &used.texture);
        let (s, c) = f64::from(t.rotation).sin_cos();
        let (x, y) = (f64::from(u * t.scale[0]), f64::from(v * t.scale[1]));
        let at = [c * x - s * y + f64::from(t.offset[0]), 1.0 - (s * x + c * y + f64::from(t.offset[1]))];
        let texel = |x: f64, size: u32| ((x.rem_euclid(1.0) * f64::from(size)) as usize).min(size as usize - 1);
        let at = 4 * (texel(at[1], texture.height) * texture.width as usize + texel(at[0], texture.width));
        let decode = |x: u8| match texture.encoding {
            Encoding::Srgb => linear(f64::from(x) / 255.0),
            Encoding::Linear => f64::from(x) / 255.0,
        };
        (0..3).for_each(|k| color[k] *= decode(texture.texels[at + k]));
        alpha = f64::from(texture.texels[at + 3]) / 255.0;
    }
    alpha = if let Alpha::Blend { factor } = material.alpha { alpha * f64::from(factor) } else { 1.0 };
    let [r, g, b] = std::array::from_fn(|k| color[k] * f64::from(vertex[k]));
    [r, g, b, alpha]
}

/// Colors of the corners of a model, by face and vertex of the tetrahedron.
fn corners(model: &Model, y_up: bool) -> Vec<(usize, usize, [f64; 4])> {
    let mesh = &model.mesh;
    let vertex = |index: u32| {
        let p = mesh.positions[index as usize];
        let p = if y_up { [p[0], p[2], -p[1]] } else { p };
        POSITIONS.iter().position(|q| (0..3).all(|k| (p[k] - q[k]).abs() < 1e-6)).expect("a known vertex")
    };
    let mut found = Vec::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let vertices = triangle.map(vertex);
        let same = |face: &[u32; 3]| vertices.iter().all(|&v| face.contains(&(v as u32)));
        let face = FACES.iter().position(same).expect("a known face");
        let material = &model.materials[usize::from(mesh.slots.get(t).copied().unwrap_or(0))];
        for (k, &index) in triangle.iter().enumerate() {
            let i = index as usize;
            let color = mesh.colors.get(i).copied().unwrap_or([1.0; 3]);
            found.push((face, vertices[k], color_of(material, mesh.uvs.get(i).copied(), color)));
        }
    }
    found.sort_by_key(|(face, vertex, _)| (*face, *vertex));
    found
}

impl Cases {
    /// Reads a file of the folder, and compares its colors and the warnings with expected values.
    fn check(&mut self, file: &str, want: Expected, said: &[&str]) {
        let (root, log) = (AssetRoot::open(self.folder.path()).expect("opens"), Collected::default());
        let formats = MeshFormats::linked().expect("no clash");
        let model = formats.read(&root, Path::new(file), &log).unwrap_or_else(|error| panic!("{file}: {error}"));
        let found = corners(&model, file.ends_with("gltf"));
        assert_eq!(found.len(), 12, "{file}");
        for (face, vertex, got) in &found {
            let want = want(*face, *vertex);
            let near = got.iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-5);
            assert!(near, "{file}: face {face}, vertex {vertex}: {got:?}, not {want:?}");
        }
        let warnings: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), said.len(), "{file}: {warnings:?}");
        for (warning, said) in warnings.iter().zip(said) {
            assert!(warning.contains(said) && warning.contains(file.split('.').next().expect("a name")), "{warning}");
        }
        let corner = |(face, vertex, _): &(usize, usize, [f64; 4])| json!({ "face": FACES[*face], "vertex": vertex, "color": want(*face, *vertex) });
        self.list.push(json!({ "file": file, "corners": found.iter().map(corner).collect::<Vec<_>>() }));
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        write(self.folder.path(), name, content);
    }

    /// An OBJ: the text after the coordinates of each vertex, the statement before each face, and its library.
    fn obj(
        &mut self,
        name: &str,
        row: &dyn Fn(usize) -> String,
        before: &dyn Fn(usize) -> String,
        library: &str,
        want: Expected,
        said: &[&str],
    ) {
        let mut text = String::new();
        if !library.is_empty() {
            text += &format!("mtllib {name}.mtl\n");
            self.write(&format!("{name}.mtl"), library);
        }
        for (i, [x, y, z]) in POSITIONS.iter().enumerate() {
            text += &format!("v {x} {y} {z} {}\n", row(i));
        }
        let textured = library.contains("map_");
        if textured {
            text += &UVS.map(|[u, v]| format!("vt {u} {v}\n")).concat();
        }
        for (i, face) in FACES.map(|face| face.map(|index| index + 1)).iter().enumerate() {
            let corners = face.map(|i| if textured { format!(" {i}/{i}") } else { format!(" {i}") });
            text += &format!("{}f{}\n", before(i), corners.concat());
        }
        self.write(&format!("{name}.obj"), text);
        self.check(&format!("{name}.obj"), want, said);
    }

    /// A PLY in text: header lines of vertices and the text after their coordinates, the same for faces, and comments.
    fn ply(
        &mut self,
        name: &str,
        [comments, of_vertex, of_face]: [&str; 3],
        row: &dyn Fn(usize) -> String,
        tail: &dyn Fn(usize) -> String,
        want: Expected,
        said: &[&str],
    ) {
        let mut text = format!(
            "ply\nformat ascii 1.0\n{comments}element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             {of_vertex}element face 4\nproperty list uchar int vertex_indices\n{of_face}end_header\n"
        );
        POSITIONS.iter().enumerate().for_each(|(i, [x, y, z])| text += &format!("{x} {y} {z} {}\n", row(i)));
        FACES.iter().enumerate().for_each(|(i, [a, b, c])| text += &format!("3 {a} {b} {c} {}\n", tail(i)));
        self.write(&format!("{name}.ply"), text);
        self.check(&format!("{name}.ply"), want, said);
    }

    /// A binary STL with a header and attributes of the triangles.
    fn stl(&mut self, name: &str, header: &[u8], attributes: [u16; 4], want: Expected, said: &[&str]) {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(4_u32.to_le_bytes());
        for (face, attribute) in FACES.iter().zip(attributes) {
            bytes.extend([0; 12]);
            bytes.extend(face.iter().flat_map(|&i| POSITIONS[i as usize]).flat_map(f32::to_le_bytes));
            bytes.extend(attribute.to_le_bytes());
        }
        self.write(&format!("{name}.stl"), bytes);
        self.check(&format!("{name}.stl"), want, said);
    }

    /// A glTF with one primitive: its vertex colors (component type, normalized, channels as bytes), its material, and
    /// more.
    fn gltf(
        &mut self,
        name: &str,
        colors: Option<(u32, bool, usize, Vec<u8>)>,
        material: Option<Value>,
        mut more: Value,
        want: Expected,
        said: &[&str],
    ) {
        let mut builder = Builder::default();
        let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
        let mut primitive = json!({ "attributes": { "POSITION": position }, "indices": index });
        if more.get("textures").is_some() {
            // v points down.
            primitive["attributes"]["TEXCOORD_0"] = builder.floats(&UVS.map(|[u, v]| [u, 1.0 - v])).into();
        }
        if let Some((component, normalized, channels, bytes)) = colors {
            // Rows of vertex attributes begin at multiples of four bytes.
            let row = bytes.len() / 4;
            let padded: Vec<u8> = bytes
                .chunks(row)
                .flat_map(|row| [row, &vec![0; row.len().next_multiple_of(4) - row.len()]].concat())
                .collect();
            let view = builder.view(&padded, Some(row.next_multiple_of(4)));
            let kind = if channels == 3 { "VEC3" } else { "VEC4" };
            let accessor = json!({ "componentType": component, "normalized": normalized, "count": 4, "type": kind });
            primitive["attributes"]["COLOR_0"] = builder.accessor(accessor, Some(view)).into();
        }
        if let Some(material) = material {
            primitive["material"] = 0.into();
            more["materials"] = json!([material]);
        }
        self.write(&format!("{name}.gltf"), builder.document(&primitive, more));
        self.check(&format!("{name}.gltf"), want, said);
    }
}

fn none(_: usize) -> String {
    String::new()
}

fn rgb(color: [u8; 3], by: f64) -> String {
    color.map(|x| (f64::from(x) / by).to_string()).join(" ")
}

fn obj_and_mtl(cases: &mut Cases) {
    cases.write("t.png", image());
    let texture = by_vertex;
    let skin = |_: usize| "usemtl m\n".to_owned();
    cases.obj("obj_fractions", &|i| rgb(BY_VERTEX[i], 255.0), &none, "", by_vertex(), &[]);
    cases.obj("obj_bytes", &|i| rgb(BY_VERTEX[i], 1.0), &none, "", by_vertex(), &[]);
    // A vertex without a color is white, also beside bytes.
    let first = |i: usize| if i == 0 { String::new() } else { rgb(BY_VERTEX[i], 1.0) };
    let white_first: Expected = Box::new(|_, v| if v == 0 { [1.0; 4] } else { of_bytes(BY_VERTEX[v]) });
    cases.obj("obj_one_without", &first, &none, "", white_first, &[]);
    let nan = |i: usize| if i == 0 { "nan 0 0".to_owned() } else { rgb(BY_VERTEX[i], 255.0) };
    cases.obj("obj_nan", &nan, &none, "", by_vertex(), &["1 vertex colors are not finite"]);
    let half = |i: usize| rgb(BY_VERTEX[i], 255.0) + " 0.5";
    let blended: Expected = Box::new(|_, v| {
        let [r, g, b, _] = of_bytes(BY_VERTEX[v]);
        [r, g, b, 0.5]
    });
    cases.obj("obj_alpha", &half, &none, "", blended, &[]);
    let paint: String = BY_VERTEX.iter().map(|[r, g, b]| format!("ff{r:02x}{g:02x}{b:02x}")).collect();
    let zbrush = move |i: usize| if i == 3 { format!("\n#MRGB {paint}") } else { String::new() };
    cases.obj("obj_polypaint", &zbrush, &none, "", by_vertex(), &[]);

    let kd = constant([0.1, 0.2, 0.3, 1.0]);
    cases.obj("mtl_kd", &none, &skin, "newmtl m\nKd 0.1 0.2 0.3\nKs 0.5 0.5 0.5\nKa 1 1 1\n", kd, &[]);
    cases.obj("mtl_map_kd", &none, &skin, "newmtl m\nKd 1 1 1\nmap_Kd t.png\n", texture(), &[]);
    cases.obj("mtl_map_alone", &none, &skin, "newmtl m\nmap_Kd t.png\n", texture(), &[]);
    let black = "newmtl m\nKd 0 0 0\nKa 0 0 0\nmap_Kd t.png\n";
    cases.obj("mtl_black_map", &none, &skin, black, texture(), &["`Kd` is black next to `map_Kd`"]);
    let tinted: Expected = Box::new(|_, v| {
        let [r, g, b, _] = of_bytes(BY_VERTEX[v]);
        [0.5 * r, 0.25 * g, b, 1.0]
    });
    cases.obj("mtl_tinted_map", &none, &skin, "newmtl m\nKd 0.5 0.25 1\nmap_Kd t.png\n", tinted, &[]);
    let space = "newmtl m\nKd 1 1 1\nmap_Kd -colorspace linear t.png\n";
    let stored: Expected = Box::new(|_, v| {
        let [r, g, b] = BY_VERTEX[v].map(|x| f64::from(x) / 255.0);
        [r, g, b, 1.0]
    });
    cases.obj("mtl_linear_map", &none, &skin, space, stored, &[]);
    let spectral = "newmtl m\nKd spectral a.rfl\n";
    cases.obj(
        "mtl_spectral",
        &none,
        &skin,
        spectral,
        constant([0.6, 0.6, 0.6, 1.0]),
        &["`Kd spectral a.rfl` is not supported"],
    );
    let bytes = "newmtl m\nKd 255 51 0\n";
    cases.obj(
        "mtl_kd_bytes",
        &none,
        &skin,
        bytes,
        constant([1.0, 0.2, 0.0, 1.0]),
        &["`Kd` of `m` is above 1; its range is taken as 0 to 255"],
    );
    let several = |i: usize| format!("usemtl m{i}\n");
    let library: String =
        BY_FACE.iter().enumerate().map(|(i, &color)| format!("newmtl m{i}\nKd {}\n", rgb(color, 255.0))).collect();
    let kd_by_face: Expected = Box::new(|face, _| {
        let [r, g, b] = BY_FACE[face].map(|x| f64::from(x) / 255.0);
        [r, g, b, 1.0]
    });
    cases.obj("mtl_several", &none, &several, &library, kd_by_face, &[]);
    let only = constant([0.1, 0.2, 0.3, 1.0]);
    cases.obj(
        "mtl_without_usemtl",
        &none,
        &none,
        "newmtl m\nKd 0.1 0.2 0.3\n",
        only,
        &["4 faces have no `usemtl`; they get `m`"],
    );
    let glass = constant([0.1, 0.2, 0.3, 0.5]);
    cases.obj("mtl_dissolve", &none, &skin, "newmtl m\nKd 0.1 0.2 0.3\nd 0.5\n", glass, &[]);
    let gold = "newmtl m\nKd 0.1 0.2 0.3\nKs 1 0.7 0.3\nmap_Ka t.png\n";
    let gold_said = ["`Ks 1 0.7 0.3` is not supported: highlights are white", "`map_Ka t.png` is not supported"];
    cases.obj("mtl_unread", &none, &skin, gold, constant([0.1, 0.2, 0.3, 1.0]), &gold_said);

    // Vertex colors and a library.
    let colored = |i: usize| rgb(BY_VERTEX[i], 255.0);
    cases.obj("mtl_colors", &colored, &skin, "newmtl m\nNs 10\n", by_vertex(), &[]);
    let black = "newmtl m\nKd 0 0 0\n";
    cases.obj(
        "mtl_black_colors",
        &colored,
        &skin,
        black,
        by_vertex(),
        &["`Kd` is black, which would hide the vertex colors"],
    );
    let both = "newmtl m\nKd 1 1 1\nmap_Kd t.png\n";
    let turned = |i: usize| rgb(BY_VERTEX[3 - i], 255.0);
    cases.obj("mtl_map_and_colors", &turned, &skin, both, texture(), &[NO_COLOR]);
}

const UCHAR: &str = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
const NO_COLOR: &str = "a texture hides the colors of vertices or faces";

fn ply(cases: &mut Cases) {
    cases.write("t.png", image());
    let bytes = |i: usize| rgb(BY_VERTEX[i], 1.0);
    let face_bytes = |i: usize| rgb(BY_FACE[i], 1.0);
    cases.ply("ply_uchar", ["", UCHAR, ""], &bytes, &none, by_vertex(), &[]);
    for (name, kind, of) in [
        ("short_names", "uchar", ["r", "g", "b"]),
        ("diffuse", "uchar", ["diffuse_red", "diffuse_green", "diffuse_blue"]),
        ("int", "int", ["red", "green", "blue"]),
        ("float_bytes", "float", ["red", "green", "blue"]),
    ] {
        let header = of.map(|of| format!("property {kind} {of}\n")).concat();
        cases.ply(&format!("ply_{name}"), ["", &header, ""], &bytes, &none, by_vertex(), &[]);
    }
    let floats = UCHAR.replace("uchar", "float");
    cases.ply("ply_float", ["", &floats, ""], &|i| rgb(BY_VERTEX[i], 255.0), &none, by_vertex(), &[]);
    let nan = |i: usize| if i == 0 { "nan 0 0".to_owned() } else { rgb(BY_VERTEX[i], 255.0) };
    cases.ply("ply_nan", ["", &floats, ""], &nan, &none, by_vertex(), &["1 colors of vertices are not finite"]);
    let words = UCHAR.replace("uchar", "ushort");
    // 257 × 255 = 65535.
    cases.ply("ply_ushort", ["", &words, ""], &|i| rgb(BY_VERTEX[i], 1.0 / 257.0), &none, by_vertex(), &[]);
    let signed = UCHAR.replace("uchar", "char");
    let wrapped = |i: usize| BY_VERTEX[i].map(|x| (x as i8).to_string()).join(" ");
    cases.ply("ply_char", ["", &signed, ""], &wrapped, &none, by_vertex(), &[]);
    let alpha = format!("{UCHAR}property uchar alpha\n");
    let blended: Expected = Box::new(|_, v| {
        let [r, g, b, _] = of_bytes(BY_VERTEX[v]);
        [r, g, b, 51.0 / 255.0]
    });
    cases.ply("ply_alpha", ["", &alpha, ""], &|i| bytes(i) + " 51", &none, blended, &[]);
    let unknown = ["all vertex colors have alpha 0"];
    cases.ply("ply_alpha_zero", ["", &alpha, ""], &|i| bytes(i) + " 0", &none, by_vertex(), &unknown);
    let gray = constant([0.6, 0.6, 0.6, 1.0]);
    cases.ply(
        "ply_red_alone",
        ["", "property uchar red\n", ""],
        &|_| "255".into(),
        &none,
        gray,
        &["`red` of element `vertex`"],
    );

    cases.ply("ply_face", ["", "", UCHAR], &none, &face_bytes, by_face(), &[]);
    cases.ply("ply_face_float", ["", "", &floats], &none, &|i| rgb(BY_FACE[i], 255.0), by_face(), &[]);
    let half: Expected = Box::new(|face, _| {
        let [r, g, b, _] = of_bytes(BY_FACE[face]);
        [r, g, b, if face == 1 { 102.0 / 255.0 } else { 1.0 }]
    });
    let one_half = |i: usize| face_bytes(i) + if i == 1 { " 102" } else { " 255" };
    cases.ply("ply_face_alpha", ["", "", &alpha], &none, &one_half, half, &[]);
    let both = ["vertices and faces have colors; using the colors of the vertices"];
    cases.ply("ply_vertex_and_face", ["", UCHAR, UCHAR], &bytes, &face_bytes, by_vertex(), &both);
    let wedge = |face: usize| {
        let colors = FACES[face].map(|vertex| rgb(BY_VERTEX[(vertex as usize + face) % 4], 255.0));
        format!("9 {}", colors.join(" "))
    };
    let turned: Expected = Box::new(|face, vertex| of_bytes(BY_VERTEX[(vertex + face) % 4]));
    cases.ply("ply_wedge", ["", "", "property list uchar float color\n"], &none, &wedge, turned, &[]);

    let image = "comment TextureFile t.png\n";
    let uvs = "property float s\nproperty float t\n";
    let uv = |i: usize| UVS[i].map(|x| x.to_string()).join(" ");
    cases.ply("ply_texture", [image, uvs, ""], &uv, &none, by_vertex(), &[]);
    let corner_uvs = |face: usize| format!("6 {}", FACES[face].map(|i| uv(i as usize)).join(" "));
    let texcoord = "property list uchar float texcoord\n";
    cases.ply("ply_texcoord", [image, "", texcoord], &none, &corner_uvs, by_vertex(), &[]);
    let with_colors = format!("{uvs}{UCHAR}");
    let turned = |i: usize| uv(i) + " " + &rgb(BY_VERTEX[3 - i], 1.0);
    cases.ply("ply_texture_and_colors", [image, &with_colors, ""], &turned, &none, by_vertex(), &[NO_COLOR]);
    // The second image is the first, upside down; a face without an image has its own color.
    let mut flipped = image::load_from_memory(&self::image()).expect("a PNG");
    flipped = flipped.rotate180();
    cases.write("u.png", encode(flipped, ImageFormat::Png));
    let two = "comment TextureFile t.png\ncomment TextureFile u.png\n";
    let numbered = format!("{texcoord}property int texnumber\n{UCHAR}");
    let tail = |face: usize| format!("{} {} {}", corner_uvs(face), [0, 1, 1, -1][face], face_bytes(face));
    let want: Expected = Box::new(|face, vertex| match face {
        0 => of_bytes(BY_VERTEX[vertex]),
        3 => of_bytes(BY_FACE[3]),
        _ => of_bytes(BY_VERTEX[3 - vertex]),
    });
    cases.ply("ply_texnumber", [two, "", &numbered], &none, &tail, want, &[NO_COLOR]);

    // Binary, most significant byte first.
    let mut bytes = format!(
        "ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         {words}element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for (p, color) in POSITIONS.iter().zip(BY_VERTEX) {
        bytes.extend(p.iter().flat_map(|x| x.to_be_bytes()));
        bytes.extend(color.iter().flat_map(|&x| (u16::from(x) * 257).to_be_bytes()));
    }
    for face in FACES {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|x| x.to_be_bytes()));
    }
    cases.write("ply_big_endian.ply", bytes);
    cases.check("ply_big_endian.ply", by_vertex(), &[]);
}

/// Colors that one number packs, as the Point Cloud Library does: 0xAARRGGBB.
fn packed_ply(cases: &mut Cases) {
    let word = |alpha: u32, [r, g, b]: [u8; 3]| alpha << 24 | u32::from(r) << 16 | u32::from(g) << 8 | u32::from(b);
    // 200 << 16 | 100 << 8 | 50, by hand.
    assert_eq!(word(0, BY_VERTEX[3]), 13_132_850);
    let numbers = |alpha| move |i: usize| word(alpha, BY_VERTEX[i]).to_string();
    for kind in ["uint", "double", "float"] {
        let header = format!("property {kind} rgb\n");
        cases.ply(&format!("ply_rgb_{kind}"), ["", &header, ""], &numbers(0), &none, by_vertex(), &[]);
    }
    // The highest byte of `rgb` is unused; signed integers wrap.
    cases.ply("ply_rgb_filled", ["", "property uint rgb\n", ""], &numbers(255), &none, by_vertex(), &[]);
    let signed = |i: usize| (word(255, BY_VERTEX[i]) as i32).to_string();
    cases.ply("ply_rgb_int", ["", "property int RGB\n", ""], &signed, &none, by_vertex(), &[]);
    let bits = |i: usize| f32::from_bits(word(0, BY_VERTEX[i])).to_string();
    cases.ply("ply_rgb_bits", ["", "property float rgb\n", ""], &bits, &none, by_vertex(), &[]);
    let scientific = |i: usize| format!("{:e}", f32::from_bits(word(0, BY_VERTEX[i])));
    cases.ply("ply_rgb_bits_double", ["", "property double rgb\n", ""], &scientific, &none, by_vertex(), &[]);
    let one_nan = |i: usize| if i == 0 { "nan".to_owned() } else { bits(i) };
    let white_first: Expected = Box::new(|_, v| if v == 0 { [1.0; 4] } else { of_bytes(BY_VERTEX[v]) });
    let said = ["1 colors of vertices are not finite"];
    cases.ply("ply_rgb_nan", ["", "property float rgb\n", ""], &one_nan, &none, white_first, &said);
    let blended = || -> Expected {
        Box::new(|_, v| {
            let [r, g, b, _] = of_bytes(BY_VERTEX[v]);
            [r, g, b, 51.0 / 255.0]
        })
    };
    cases.ply("ply_rgba", ["", "property uint rgba\n", ""], &numbers(51), &none, blended(), &[]);
    let of_face = |i: usize| word(0, BY_FACE[i]).to_string();
    cases.ply("ply_rgb_face", ["", "", "property uint rgb\n"], &none, &of_face, by_face(), &[]);
    let twice = format!("{UCHAR}property uint rgb\n");
    let both = |i: usize| format!("{} {}", rgb(BY_VERTEX[i], 1.0), word(0, BY_VERTEX[3 - i]));
    let said = ["unsupported colors of element `vertex`: `rgb`"];
    cases.ply("ply_rgb_twice", ["", &twice, ""], &both, &none, by_vertex(), &said);

    // Binary floats in both byte orders. Bits with an alpha of 255 and a red of 128 or more are NaN as a float: reading
    // them as a float would change some.
    for (order, big) in [("little", false), ("big", true)] {
        for (name, kind, alpha, want) in
            [("rgb", "float", 255, by_vertex()), ("rgb", "uint", 0, by_vertex()), ("rgba", "float", 51, blended())]
        {
            let mut bytes = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                 property float z\nproperty {kind} {name}\nelement face 4\nproperty list uchar int vertex_indices\n\
                 end_header\n"
            )
            .into_bytes();
            let mut put = |mut number: [u8; 4]| {
                if big {
                    number.reverse();
                }
                bytes.extend(number);
            };
            for (p, color) in POSITIONS.iter().zip(BY_VERTEX) {
                p.iter().for_each(|x| put(x.to_le_bytes()));
                put(word(alpha, color).to_le_bytes());
            }
            for face in FACES {
                bytes.push(3);
                bytes.extend(face.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }));
            }
            let file = format!("ply_{name}_{kind}_{order}.ply");
            cases.write(&file, bytes);
            cases.check(&file, want, &[]);
        }
    }
}

fn stl(cases: &mut Cases) {
    /// Channels of five bits.
    const FIVE: [[u16; 3]; 4] = [[31, 0, 0], [0, 16, 0], [1, 2, 31], [8, 9, 10]];
    let five = |color: [u16; 3]| {
        let [r, g, b] = color.map(|x| linear(f64::from(x) / 31.0));
        [r, g, b, 1.0]
    };
    let by_face = || -> Expected { Box::new(move |face, _| five(FIVE[face])) };
    let viscam = FIVE.map(|[r, g, b]| 0x8000 | r << 10 | g << 5 | b);
    let magics = FIVE.map(|[r, g, b]| r | g << 5 | b << 10);
    cases.stl("stl_viscam", b"solid by hand", viscam, by_face(), &[]);
    let without_last = [viscam[0], viscam[1], viscam[2], 0];
    let gray_last: Expected = Box::new(move |face, _| if face == 3 { [0.6, 0.6, 0.6, 1.0] } else { five(FIVE[face]) });
    cases.stl("stl_viscam_without", b"x", without_last, gray_last, &["1 of 4 triangles have no color"]);
    cases.stl("stl_magics", b"COLOR=\x10\x20\x30\xff", magics, by_face(), &[]);
    let part = of_bytes([16, 32, 48]);
    cases.stl("stl_magics_part", b"COLOR=\x10\x20\x30\xff", [0x8000; 4], constant(part), &[]);
    cases.stl("stl_magics_zeros", b"COLOR=\x10\x20\x30\xff", [0; 4], constant(part), &[]);
    let header = b"COLOR=\xff\xff\xff\xff,MATERIAL=\x10\x20\x30\xff\x00\x00\x00\xff\x00\x00\x00\xff";
    cases.stl("stl_magics_material", header, [0x8000; 4], constant(part), &[]);
    let [r, g, b, _] = part;
    cases.stl("stl_magics_alpha", b"COLOR=\x10\x20\x30\x33", [0; 4], constant([r, g, b, 0.2]), &[]);
    let gray = || constant([0.6, 0.6, 0.6, 1.0]);
    cases.stl("stl_plain", b"x", [0; 4], gray(), &[]);
    cases.stl(
        "stl_attributes",
        b"x",
        [7; 4],
        gray(),
        &["the attribute bytes of 4 triangles are not a known color format"],
    );

    let facet = |face: usize, color: &str| {
        let corners =
            FACES[face].map(|i| POSITIONS[i as usize]).map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
        format!("facet normal 0 0 0\n{color}outer loop\n{corners}endloop\nendfacet\n")
    };
    let whole: String = (0..4).map(|face| facet(face, "")).collect();
    cases.write("stl_text_part.stl", format!("solid x\ncolor 16 32 48\n{whole}endsolid x\n"));
    cases.check("stl_text_part.stl", constant(part), &[]);
    let each: String = (0..4).map(|face| facet(face, &format!("color {}\n", rgb(BY_FACE[face], 255.0)))).collect();
    cases.write("stl_text.stl", format!("solid x\n{each}endsolid x\n"));
    cases.check("stl_text.stl", self::by_face(), &[]);
}

fn gltf(cases: &mut Cases) {
    const LINEAR: [[f32; 4]; 4] =
        [[1.0, 0.0, 0.0, 1.0], [0.0, 0.5, 0.0, 1.0], [0.1, 0.2, 0.9, 1.0], [0.6, 0.4, 0.2, 1.0]];
    let floats = |channels: usize| {
        let bytes = LINEAR.iter().flat_map(|color| color[..channels].to_vec()).flat_map(f32::to_le_bytes).collect();
        Some((5126, false, channels, bytes))
    };
    let by_vertex = || -> Expected { Box::new(|_, v| LINEAR[v].map(f64::from)) };
    let white = json!({ "pbrMetallicRoughness": { "metallicFactor": 0 } });
    for channels in [3, 4] {
        cases.gltf(
            &format!("gltf_float{channels}"),
            floats(channels),
            Some(white.clone()),
            json!({}),
            by_vertex(),
            &[],
        );
    }
    cases.gltf("gltf_no_material", floats(3), None, json!({}), by_vertex(), &[]);
    cases.gltf("gltf_nothing", None, None, json!({}), constant([1.0; 4]), &[]);
    // Whole numbers are linear, too.
    let of = |full: f64| -> Expected {
        Box::new(move |_, v| {
            let [r, g, b] = BY_VERTEX[v].map(|x| f64::from(x) / full);
            [r, g, b, 1.0]
        })
    };
    let bytes = BY_VERTEX.map(|[r, g, b]| [r, g, b, 255]).concat();
    cases.gltf("gltf_u8", Some((5121, true, 4, bytes.clone())), None, json!({}), of(255.0), &[]);
    let words = BY_VERTEX.as_flattened().iter().flat_map(|&x| (u16::from(x) * 200).to_le_bytes()).collect();
    cases.gltf("gltf_u16", Some((5123, true, 3, words)), None, json!({}), of(65535.0 / 200.0), &[]);
    cases.gltf(
        "gltf_not_normalized",
        Some((5121, false, 4, bytes)),
        None,
        json!({}),
        of(255.0),
        &["COLOR_0 is not normalized"],
    );

    let tinted = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1.0, 1.0] } });
    cases.gltf("gltf_factor", None, Some(tinted.clone()), json!({}), constant([0.5, 0.25, 1.0, 1.0]), &[]);
    let product: Expected = Box::new(|_, v| {
        let [r, g, b, _] = LINEAR[v].map(f64::from);
        [0.5 * r, 0.25 * g, b, 1.0]
    });
    cases.gltf("gltf_factor_and_colors", floats(3), Some(tinted), json!({}), product, &[]);
    let uri = format!("data:image/png;base64,{}", base64(&image()));
    let images = json!({ "images": [{ "uri": uri }], "textures": [{ "source": 0 }] });
    let textured = |info: Value| json!({ "pbrMetallicRoughness": { "baseColorTexture": info } });
    cases.gltf("gltf_texture", None, Some(textured(json!({ "index": 0 }))), images.clone(), self::by_vertex(), &[]);
    // Half an image to the right.
    let moved = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0.0] } } });
    let mut used = images.clone();
    used["extensionsUsed"] = json!(["KHR_texture_transform"]);
    let moved_want: Expected = Box::new(|_, v| of_bytes(BY_VERTEX[v ^ 1]));
    cases.gltf("gltf_texture_transform", None, Some(textured(moved)), used, moved_want, &[]);
    // By hand: no reflection, so that the base color is D / 0.96.
    let older = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.48, 0.24, 0.0, 1.0], "specularFactor": [0.0, 0.0, 0.0], "glossinessFactor": 0.5 } } });
    let used = json!({ "extensionsUsed": ["KHR_materials_pbrSpecularGlossiness"] });
    cases.gltf("gltf_specular_glossiness", None, Some(older), used, constant([0.5, 0.25, 0.0, 1.0]), &[]);
    let unlit = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1.0, 1.0] },
        "extensions": { "KHR_materials_unlit": {} } });
    let used = json!({ "extensionsUsed": ["KHR_materials_unlit"] });
    cases.gltf("gltf_unlit", None, Some(unlit), used, constant([0.5, 0.25, 1.0, 1.0]), &["unlit materials are lit"]);
    let variants = json!({ "extensionsUsed": ["KHR_materials_variants"], "extensions": { "KHR_materials_variants": { "variants": [{ "name": "red" }] } } });
    cases.gltf("gltf_variants", None, Some(white.clone()), variants, constant([1.0; 4]), &["material variants"]);

    // Opacity of the vertices: blended, and ignored by the standard.
    let half = |alpha: u8| Some((5121, true, 4, BY_VERTEX.map(|[r, g, b]| [r, g, b, alpha]).concat()));
    let blended: Expected = Box::new(move |_, v| {
        let [r, g, b] = BY_VERTEX[v].map(|x| f64::from(x) / 255.0);
        [r, g, b, 0.6]
    });
    let blend = json!({ "alphaMode": "BLEND" });
    cases.gltf("gltf_alpha_blend", half(153), Some(blend), json!({}), blended, &[]);
    let ignored = ["the alpha of COLOR_0 is ignored where `alphaMode` is OPAQUE"];
    cases.gltf("gltf_alpha_opaque", half(153), Some(white), json!({}), of(255.0), &ignored);
}

#[test]
fn colors_match_the_file() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let mut cases = Cases { folder: TempDir::new().expect("temp folder"), list: Vec::new() };
    obj_and_mtl(&mut cases);
    ply(&mut cases);
    packed_ply(&mut cases);
    stl(&mut cases);
    gltf(&mut cases);
    let list = cases.folder.path().join("cases.json");
    std::fs::write(&list, Value::from(cases.list).to_string()).expect("writable");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/check_colors.py");
    python_with("trimesh, PIL", &HERE, &script, &[list.to_str().expect("UTF-8")]);
}

#[test]
fn statements_that_are_not_read_are_named() {
    let mut cases = Cases { folder: TempDir::new().expect("temp folder"), list: Vec::new() };
    cases.write("t.png", image());
    let skin = |_: usize| "usemtl m\n".to_owned();
    let gray = || constant([0.6, 0.6, 0.6, 1.0]);
    let usemap = |i: usize| if i == 0 { "usemtl m\nusemap t\n".to_owned() } else { String::new() };
    cases.obj("usemap", &none, &usemap, "newmtl m\n", gray(), &["`usemap` is not supported"]);
    for (name, library, said) in [
        ("ka", "newmtl m\nKa 1 0 0\n", "`Ka 1 0 0` is not supported: the color is `Kd`"),
        ("tf", "newmtl m\nTf 1 0 0\n", "`Tf 1 0 0` is not supported: transmitted light"),
        ("clearcoat", "newmtl m\nPc 1\n", "`Pc 1` is not supported"),
        ("opacity", "newmtl m\nmap_d t.png\n", "opacity map `t.png` is not supported"),
        ("dark", "newmtl m\nKe 0 0 0\nmap_Ke t.png\n", "`map_Ke t.png` emits nothing"),
    ] {
        cases.obj(name, &none, &skin, library, gray(), &[said]);
    }
    let rescaled = "newmtl m\nmap_Kd -mm 0.1 2 t.png\n";
    cases.obj("rescaled", &none, &skin, rescaled, by_vertex(), &["is not supported: the range of the texture"]);
    // The same image as ambient color, as exporters repeat it, causes no warning.
    cases.obj("repeated", &none, &skin, "newmtl m\nKa 1 1 1\nmap_Kd t.png\nmap_Ka t.png\n", by_vertex(), &[]);

    let header = "element material 1\nproperty uchar diffuse_red\n";
    let mut text = format!(
        "ply\nformat ascii 1.0\n{header}element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n7\n"
    );
    POSITIONS.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    FACES.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    cases.write("material.ply", text);
    cases.check("material.ply", gray(), &["element `material` are not supported"]);

    let ambient = "property uchar ambient_red\nproperty uchar ambient_green\nproperty uchar ambient_blue\n";
    let row = |i: usize| rgb(BY_VERTEX[i], 1.0);
    let unread = ["unsupported colors of element `vertex`: `ambient_red`, `ambient_green`, `ambient_blue`"];
    cases.ply("ambient", ["", ambient, ""], &row, &none, gray(), &unread);
    for (name, header, value) in [
        ("small", "property ushort rgb\n", "7"),
        ("british", "property float colour\n", "7"), // typos: ignore
        ("list", "property list uchar uchar rgb\n", "3 1 2 3"),
    ] {
        let said = format!("`: `{}`", header.trim().rsplit(' ').next().expect("a name"));
        cases.ply(name, ["", header, ""], &|_| value.into(), &none, gray(), &[&said]);
        cases.ply(&format!("{name}_face"), ["", "", header], &none, &|_| value.into(), gray(), &[&said]);
    }
    // Names that end like colors.
    cases.ply("measured", ["", "property float measured\n", ""], &|_| "1".into(), &none, gray(), &[]);

    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    let colors = builder.floats(&[[0.5_f32, 0.25, 1.0]; 4]);
    let attributes = json!({ "POSITION": position, "COLOR_0": colors, "COLOR_1": colors });
    let primitive = json!({ "attributes": attributes, "indices": index });
    cases.write("second.gltf", builder.document(&primitive, json!({})));
    cases.check("second.gltf", constant([0.5, 0.25, 1.0, 1.0]), &["COLOR_1 is ignored"]);
}

#[test]
fn numbers_out_of_range_do_not_change_the_others() {
    let mut cases = Cases { folder: TempDir::new().expect("temp folder"), list: Vec::new() };
    // Slightly below 0 by interpolation; opacity likewise.
    let floats = UCHAR.replace("uchar", "float") + "property float alpha\n";
    let below =
        |i: usize| rgb(BY_VERTEX[i], 255.0).replace("0 ", "-0.000001 ") + if i == 3 { " -0.000001" } else { " 1" };
    assert!(below(0).starts_with("1 -0.000001 0"), "{}", below(0));
    // Faces with vertex 3 have two opaque corners of three.
    let mean: Expected = Box::new(|face, v| {
        let [r, g, b, _] = of_bytes(BY_VERTEX[v]);
        [r, g, b, if FACES[face].contains(&3) { 2.0 / 3.0 } else { 1.0 }]
    });
    cases.ply("below_zero", ["", &floats, ""], &below, &none, mean, &["varies within 3 faces"]);
    // Bytes that were written as signed bytes, in wider integers; but not if other values do not fit into a signed
    // byte.
    let wrapped = |i: usize| BY_VERTEX[i].map(|x| (x as i8).to_string()).join(" ");
    for kind in ["short", "int"] {
        let header = UCHAR.replace("uchar", kind);
        cases.ply(&format!("signed_{kind}"), ["", &header, ""], &wrapped, &none, by_vertex(), &[]);
        let row = |i: usize| if i == 0 { "255 -5 -129".to_owned() } else { rgb(BY_VERTEX[i], 1.0) };
        cases.ply(&format!("negative_{kind}"), ["", &header, ""], &row, &none, by_vertex(), &[]);
    }
    let wedge = |face: usize| {
        let colors = FACES[face].map(|v| BY_VERTEX[v as usize].map(|x| (x as i8).to_string()).join(" "));
        format!("9 {}", colors.join(" "))
    };
    cases.ply("signed_wedge", ["", "", "property list uchar char color\n"], &none, &wedge, by_vertex(), &[]);

    // Floats of glTF: light above white, and bytes.
    let accessor = |colors: [[f32; 4]; 4], channels: usize| {
        let bytes = colors.iter().flat_map(|color| color[..channels].to_vec()).flat_map(f32::to_le_bytes).collect();
        Some((5126, false, channels, bytes))
    };
    let bright = [[2.5, 0.0, 0.25, 1.0], [0.0, 0.5, 300.0, 1.0], [0.1, 0.2, 0.9, 1.0], [1.0005, 0.4, -0.1, 1.0]];
    for channels in [3, 4] {
        let want: Expected = Box::new(move |_, v| bright[v].map(|x| f64::from(x).clamp(0.0, 1.0)));
        let said = ["COLOR_0 has numbers above 1"];
        cases.gltf(&format!("bright{channels}"), accessor(bright, channels), None, json!({}), want, &said);
    }
    let bytes = BY_VERTEX.map(|color| [color[0], color[1], color[2]].map(f32::from)).map(|[r, g, b]| [r, g, b, 0.6]);
    let of_bytes: Expected = Box::new(|_, v| {
        let [r, g, b] = BY_VERTEX[v].map(|x| f64::from(x) / 255.0);
        [r, g, b, 0.6]
    });
    let blend = json!({ "alphaMode": "BLEND" });
    cases.gltf(
        "bytes",
        accessor(bytes, 4),
        Some(blend),
        json!({}),
        of_bytes,
        &["not normalized; its range is taken as 0 to 255"],
    );
}

#[test]
fn faces_below_the_cutoff_are_dropped() {
    let folder = TempDir::new().expect("temp folder");
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    // One of the four faces has no vertex 0. Its mean opacity is 1; the mean of the others is 2/3.
    let colors = builder.floats(&[[1.0, 1.0, 1.0, 0.0], [1.0; 4], [1.0; 4], [1.0; 4]]);
    let primitive =
        json!({ "attributes": { "POSITION": position, "COLOR_0": colors }, "indices": index, "material": 0 });
    let material = json!({ "alphaMode": "MASK", "alphaCutoff": 0.7 });
    write(folder.path(), "x.gltf", builder.document(&primitive, json!({ "materials": [material] })));
    let (_, warnings) = look(&folder.path().join("x.gltf"));
    let said = warnings.join("\n");
    assert!(said.contains("varies within 3 faces") && said.contains("3 faces invisible"), "{said}");

    // An asset that would lose all of its faces keeps them.
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    let colors = builder.floats(&[[1.0, 1.0, 1.0, 0.3]; 4]);
    let primitive =
        json!({ "attributes": { "POSITION": position, "COLOR_0": colors }, "indices": index, "material": 0 });
    let material = json!({ "alphaMode": "MASK", "alphaCutoff": 0.5 });
    write(folder.path(), "y.gltf", builder.document(&primitive, json!({ "materials": [material] })));
    let (inspection, warnings) = look(&folder.path().join("y.gltf"));
    assert!(inspection.is_ok() && warnings.join("\n").contains("all faces invisible"), "{warnings:?}");
}
