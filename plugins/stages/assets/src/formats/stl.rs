//! STL, binary and text. The format has no unit and no axes; equal corners are merged.
//!
//! Colors are conventions of single programs. In binary files, the two attribute bytes of a triangle hold 5 bits per
//! channel:
//!
//! - VisCAM and SolidView: red in bits 10 to 14, green in 5 to 9, blue in 0 to 4; bit 15 marks a valid color.
//! - Magics: the header has `COLOR=` and four bytes RGBA for the whole part, or `MATERIAL=` with diffuse, specular and
//!   ambient colors, which overrides it. Red is in bits 0 to 4, blue in bits 10 to 14, and bit 15 marks a triangle with
//!   the color of the part.
//!
//! In text, a line `color r g b` within a facet colors that facet; before any facet, it colors the whole part. All
//! colors are sRGB-encoded.

use super::FormatLog;
use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::limits::Budget;
use syntable_mesh::material::{blend, default_material};
use syntable_mesh::paint::{full_intensity, linear_of_display, paint_corners};
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::{finite, lines, shorten};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{MeshData, weld};

/// Size of the header of a binary file, bytes: a comment and the number of triangles.
const HEADER: usize = 84;
/// Size of a binary triangle, bytes: normal, three corners, two attribute bytes.
const TRIANGLE: usize = 50;

/// Bytes of the header that hold text.
const HEADER_TEXT: usize = 80;

/// Reads a file of `root`, named relative to it. Its own axes are kept: z is taken as up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let bytes = root.read(&path)?;
    let log = FormatLog { log, path: &path };
    let StlMesh { corners, colors, opacity } =
        parse(&bytes, root.budget(), &log).map_err(|error| error.in_file(&path))?;
    let mut mesh = merge(&corners);
    if colors.is_empty() {
        return Ok(Model { mesh, materials: vec![default_material(false)] });
    }
    paint_corners(&mut mesh, |triangle, _| {
        let [r, g, b] = colors[triangle];
        [r, g, b, 1.0]
    });
    let mut material = default_material(true);
    if opacity > 0.0 && opacity < 1.0 {
        blend(&mut material, opacity);
        material = material.with_digest();
    }
    Ok(Model { mesh, materials: vec![material] })
}

/// Content of a file.
struct StlMesh {
    /// All corners in order, three per triangle.
    corners: Vec<[f32; 3]>,
    /// Linear colors of the triangles; empty if the file states none.
    colors: Vec<[f32; 3]>,
    /// Opacity of the whole part; 0 means unknown.
    opacity: f32,
}

impl StlMesh {
    fn new(corners: Vec<[f32; 3]>) -> Result<Self> {
        if corners.is_empty() {
            Err(Error::new("no faces"))
        } else {
            Ok(Self { corners, colors: Vec::new(), opacity: 1.0 })
        }
    }
}

fn parse(bytes: &[u8], budget: &Budget, log: &dyn Log) -> Result<StlMesh> {
    // Binary files may begin with `solid` too, but have zero bytes: at the latest in their number of triangles.
    let head = &bytes[..bytes.len().min(HEADER + TRIANGLE)];
    let text =
        head.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !head.contains(&0);
    let count = bytes.get(80..HEADER).map(|count| u32::from_le_bytes(count.try_into().unwrap_or_default()) as usize);
    match count {
        Some(count) if HEADER + TRIANGLE * count == bytes.len() => binary(bytes, count, budget, log),
        _ if text => ascii(bytes, budget),
        Some(count) if HEADER + TRIANGLE * count < bytes.len() => {
            let more = bytes.len() - HEADER - TRIANGLE * count;
            log.warn(&Error::new(format!("{more} bytes after the {count} triangles were ignored")));
            binary(bytes, count, budget, log)
        }
        Some(count) => Err(Error::new(format!(
            "{count} triangles need {} bytes, but the file has {}",
            HEADER + TRIANGLE * count,
            bytes.len()
        ))
        .help("the file is cut short, or not an STL")),
        None => Err(Error::new(format!("not an STL file: {} bytes", bytes.len()))),
    }
}

fn binary(bytes: &[u8], count: usize, budget: &Budget, log: &dyn Log) -> Result<StlMesh> {
    budget.triangles(count)?;
    let mut corners = Vec::with_capacity(3 * count);
    let mut attributes = Vec::with_capacity(count);
    for (t, triangle) in bytes[HEADER..].chunks_exact(TRIANGLE).take(count).enumerate() {
        for corner in triangle[12..48].chunks_exact(12) {
            let number = |i: usize| f32::from_le_bytes([corner[i], corner[i + 1], corner[i + 2], corner[i + 3]]);
            let corner = [number(0), number(4), number(8)];
            if !corner.iter().all(|x| x.is_finite()) {
                return Err(Error::new(format!("non-finite vertex {corner:?} in triangle {t}"))
                    .at_byte((HEADER + TRIANGLE * t) as u64));
            }
            corners.push(corner);
        }
        attributes.push(u16::from_le_bytes([triangle[48], triangle[49]]));
    }
    let mut parsed = StlMesh::new(corners)?;
    color(&mut parsed, &bytes[..HEADER_TEXT], &attributes, log);
    Ok(parsed)
}

/// Reads the colors of a binary file from its header and the attribute bytes of its triangles.
fn color(parsed: &mut StlMesh, header: &[u8], attributes: &[u16], log: &dyn Log) {
    let behind = |key: &[u8]| -> Option<[u8; 4]> {
        let at = header.windows(key.len()).position(|window| window == key)? + key.len();
        header.get(at..at + 4)?.try_into().ok()
    };
    let channel = |attribute: u16, shift: u16| f64::from(attribute >> shift & 31);
    if let Some([r, g, b, alpha]) = behind(b"MATERIAL=").or_else(|| behind(b"COLOR=")) {
        let part = linear_of_display([r, g, b].map(f64::from), 255.0);
        let color = |&attribute: &u16| match attribute & 0x8000 {
            0 => linear_of_display([0, 5, 10].map(|shift| channel(attribute, shift)), 31.0),
            _ => part,
        };
        // A part that was colored as a whole has zeros in all triangles, or the bit that refers to the part.
        let whole = attributes.iter().all(|&attribute| attribute == 0);
        parsed.colors = if whole { vec![part; attributes.len()] } else { attributes.iter().map(color).collect() };
        parsed.opacity = f32::from(alpha) / 255.0;
    } else if attributes.iter().any(|attribute| attribute & 0x8000 != 0) {
        let plain = default_material(false).base_color.factor;
        let color = |&attribute: &u16| match attribute & 0x8000 {
            0 => plain,
            _ => linear_of_display([10, 5, 0].map(|shift| channel(attribute, shift)), 31.0),
        };
        parsed.colors = attributes.iter().map(color).collect();
        let missing = attributes.iter().filter(|&attribute| attribute & 0x8000 == 0).count();
        if missing > 0 {
            log.warn(&Error::new(format!("{missing} of {} triangles have no color; they are gray", attributes.len())));
        }
    } else {
        let other = attributes.iter().filter(|&&attribute| attribute != 0).count();
        if other > 0 {
            let message =
                format!("the attribute bytes of {other} triangles are not a known color format; the mesh is gray");
            let help =
                "colors have bit 15 set, as VisCAM and SolidView write them, or `COLOR=` in the header, as Magics does";
            log.warn(&Error::new(message).help(help));
        }
    }
}

fn ascii(bytes: &[u8], budget: &Budget) -> Result<StlMesh> {
    let mut corners = Vec::new();
    // The color of the part, of the current facet, and of all facets.
    let mut part: Option<[f64; 3]> = None;
    let mut own: Option<[f64; 3]> = None;
    let mut colors: Vec<Option<[f64; 3]>> = Vec::new();
    let mut in_facet = false;
    let mut facet_start = 0;
    let mut of_loop = 0;
    let mut ended = false;
    let mut last = 0;
    for line in lines(bytes) {
        last = line.number;
        let at = |error: Error| error.at_line(line.number);
        let mut words = line.text.split_ascii_whitespace();
        let Some(key) = words.next() else { continue };
        match key.to_ascii_lowercase().as_str() {
            "vertex" => {
                let numbers =
                    words.take(4).map(|word| finite(word, "vertex")).collect::<Result<Vec<_>>>().map_err(at)?;
                let [x, y, z] = numbers[..] else {
                    return Err(at(Error::new(format!("a vertex has {} coordinates", numbers.len()))));
                };
                corners.push([x, y, z]);
                of_loop += 1;
                budget.vertices(corners.len())?;
            }
            "endloop" => {
                if of_loop != 3 {
                    return Err(at(Error::new(format!("a facet has {of_loop} corners"))));
                }
                of_loop = 0;
                budget.triangles(corners.len() / 3)?;
                colors.push(own.or(part));
            }
            "color" => {
                let numbers =
                    words.take(3).map(|word| finite(word, "color").map(f64::from)).collect::<Result<Vec<_>>>();
                let numbers = numbers.map_err(at)?;
                let [r, g, b] = numbers[..] else {
                    return Err(at(Error::new(format!("a color has {} channels", numbers.len()))));
                };
                *(if in_facet { &mut own } else { &mut part }) = Some([r, g, b]);
                // The line may follow the loop that it colors.
                if in_facet && of_loop == 0 && colors.len() > facet_start {
                    colors[facet_start..].fill(own);
                }
            }
            "endsolid" => (ended, part) = (true, None),
            "solid" => ended = false,
            "facet" => (ended, in_facet, own, facet_start) = (false, true, None, colors.len()),
            "endfacet" => (ended, in_facet) = (false, false),
            "outer" => ended = false,
            _ => return Err(at(Error::new(format!("`{}` is not an STL statement", shorten(key))))),
        }
    }
    if !ended || of_loop != 0 {
        return Err(Error::new("the text ends without `endsolid`").at_line(last).help("the file is cut short"));
    }
    let mut parsed = StlMesh::new(corners)?;
    if colors.iter().any(Option::is_some) {
        let full = full_intensity(colors.iter().flatten().flatten().copied());
        let plain = default_material(false).base_color.factor;
        parsed.colors =
            colors.iter().map(|color| color.map_or(plain, |color| linear_of_display(color, full))).collect();
    }
    Ok(parsed)
}

fn merge(corners: &[[f32; 3]]) -> MeshData {
    let ids = weld(corners);
    let mut numbers = vec![0; corners.len()];
    let mut positions = Vec::new();
    for (i, &first) in ids.iter().enumerate() {
        if first as usize == i {
            numbers[i] = positions.len() as u32;
            positions.push(corners[i]);
        }
    }
    let index = |i: usize| numbers[ids[i] as usize];
    let triangles = (0..corners.len() / 3).map(|t| [index(3 * t), index(3 * t + 1), index(3 * t + 2)]).collect();
    MeshData { positions, triangles, ..MeshData::default() }
}

syntable_mesh::register_mesh_format!(MeshFormat::new("STL", &["stl"], read).with_preference(10));

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Collected;

    const TEXT: &str = "solid a b\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1e0 0 0\n  vertex 0 1 0\n \
                        endloop\nendfacet\nfacet normal 0 0 1\n outer loop\n  vertex 1 0 0\n  vertex 1 1 0\n  vertex 0 1 -0\n \
                        endloop\nendfacet\nendsolid\n";

    fn binary_of(corners: &[[f32; 3]]) -> Vec<u8> {
        let mut bytes = b"solid, though binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((corners.len() as u32 / 3).to_le_bytes());
        for triangle in corners.chunks(3) {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn check(bytes: &[u8], want: &str) {
        let error = parse(bytes, &Budget::default(), &Collected::default()).err().expect(want).to_string();
        assert!(error.contains(want), "{error} lacks {want}");
    }

    #[test]
    fn text_and_binary_agree_and_corners_merge() {
        let log = Collected::default();
        let text = parse(TEXT.as_bytes(), &Budget::default(), &log).expect("text").corners;
        let binary = binary_of(&text);
        assert_eq!(parse(&binary, &Budget::default(), &log).expect("binary").corners, text);
        let mesh = merge(&text);
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(mesh.positions.len(), 4);
        assert!(log.warnings().is_empty());
        parse(&[&binary[..], b"xx"].concat(), &Budget::default(), &log).expect("a tail");
        assert_eq!(log.warnings().len(), 1);
    }

    #[test]
    fn broken_files_are_refused() {
        let binary = binary_of(&[[0.0; 3]; 6]);
        check(b"xyz", "not an STL file: 3 bytes");
        let mut foreign = binary.clone();
        foreign[..5].copy_from_slice(b"xxxxx");
        check(&foreign[..100], "2 triangles need 184 bytes, but the file has 100");
        let mut bomb = foreign.clone();
        bomb[80..84].fill(255);
        check(&bomb, "but the file has 184");
        let mut nan = binary.clone();
        nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
        check(&nan, "non-finite vertex");
        check(TEXT.replace("1e0", "1e99").as_bytes(), "non-finite vertex: `1e99`");
        check(TEXT.replace("  vertex 1e0 0 0\n", "").as_bytes(), "a facet has 2 corners");
        check(&TEXT.as_bytes()[..120], "ends without `endsolid`");
        check(b"solid x\nendsolid x\n", "no faces");
    }
}
