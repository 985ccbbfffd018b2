//! Wavefront OBJ: positions, texture coordinates, normals, vertex colors and faces with materials.
//!
//! Curves, points, lines, groups and smoothing are ignored. The material library and its textures are looked up next to
//! the file; in the layout of Google Scanned Objects, where `meshes/model.mtl` names images in `materials/textures/`,
//! also there. A mesh with texture coordinates and without a library uses the image `texture.png` in that folder.
//!
//! Vertex colors are sRGB-encoded: after the coordinates of a vertex, in [0, 1] or in [0, 255], or in ZBrush's comments
//! `#MRGB` of eight hexadecimal digits per vertex. They multiply the color of the material; a texture overrides them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::limits::Budget;
use syntable_mesh::paint::{full_intensity, linear_of_display};
use syntable_mesh::polygon::triangulate;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::{finite, lines, shorten};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

mod materials;

/// Reads a file of `root`, named relative to it. Its own axes are kept: z is taken as up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let parsed = parse(&root.read(&path)?, root.budget()).map_err(|error| error.in_file(&path))?;
    for (note, line) in &parsed.notes {
        log.warn(&Error::new(note).in_file(&path).at_line(*line));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    materials::attach(parsed, root, folder, &path, log)
}

/// Content of the text, before materials are looked up.
#[derive(Debug, Default)]
pub struct ParsedObj {
    /// Arrays; slots are indices into `uses`. The color of a vertex without one is white.
    pub mesh: MeshData,
    /// Whether a vertex has a color; empty if none has.
    pub colored: Vec<bool>,
    /// Opacities of the vertices; empty if the file has none.
    pub alphas: Vec<f32>,
    /// Ignored statements with their lines.
    pub notes: Vec<(String, usize)>,
    /// Names of `mtllib` with their lines.
    pub libraries: Vec<(String, usize)>,
    /// Material of every slot: its name (empty before any `usemtl`), the line of its first `usemtl`, and whether its
    /// faces have texture coordinates.
    pub uses: Vec<MaterialUse>,
}

/// One slot of a parsed mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaterialUse {
    /// Name after `usemtl`; empty before any.
    pub name: String,
    /// Line of the statement.
    pub line: usize,
    /// Whether its faces have texture coordinates.
    pub textured: bool,
    /// Number of its triangles.
    pub triangles: usize,
}

/// Parses text. Errors carry the line.
pub fn parse(bytes: &[u8], budget: &Budget) -> Result<ParsedObj> {
    let mut parser = Parser::new(budget);
    for line in lines(bytes) {
        let at = |error: Error| error.at_line(line.number);
        parser.statement(&line.text, line.number).map_err(at)?;
        // A slash may end a corner, but a file that ends with one was cut short.
        if parser.last_face == line.number && line.last && line.text.ends_with('/') {
            let token = line.text.split_ascii_whitespace().next_back().unwrap_or_default();
            return Err(at(not_a_corner(token).help("the file is cut short")));
        }
    }
    parser.finish()
}

/// Content that a mesh can do without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum OddContent {
    /// A corner refers to a missing normal.
    Normal,
    /// A corner refers to a missing texture coordinate.
    TextureCoordinate,
    /// A face has fewer than three corners.
    Face,
    /// A vertex has a non-finite color.
    Color,
}

impl OddContent {
    fn text(self, count: usize) -> String {
        match self {
            Self::Normal => format!("{count} corners refer to missing normals; face normals are used"),
            Self::TextureCoordinate => {
                format!("{count} corners refer to texture coordinates, but the file has none")
            }
            Self::Face => format!("faces with fewer than three corners are left out: {count}"),
            Self::Color => format!("{count} vertex colors are not finite; such channels become white"),
        }
    }
}

/// Indices of a corner into positions, texture coordinates and normals; `u32::MAX` if missing.
type Corner = [u32; 3];
const NONE: u32 = u32::MAX;

struct Parser<'a> {
    budget: &'a Budget,
    /// Line of the last face.
    last_face: usize,
    positions: Vec<[f32; 3]>,
    /// Colors and opacities as written; NaN for vertices without. At most as many as positions.
    colors: Vec<[f32; 4]>,
    /// Colors in ZBrush's comments.
    polypaint: Vec<[u8; 3]>,
    /// The first line that maps a texture without a material.
    usemap: Option<usize>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Corners that have become vertices, and their numbers.
    vertices: HashMap<Corner, u32>,
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    slots: Vec<u16>,
    libraries: Vec<(String, usize)>,
    known_libraries: BTreeSet<String>,
    /// Lines of the first odd content of each kind, and the number of such places.
    odd: BTreeMap<OddContent, (usize, usize)>,
    uses: Vec<MaterialUse>,
    /// Slots by name of material, without and with texture coordinates.
    known_uses: HashMap<String, [Option<u16>; 2]>,
    use_name: String,
    use_line: usize,
    /// Slots of the current material without and with texture coordinates.
    use_slots: [Option<u16>; 2],
    face: Vec<Corner>,
    outline: Vec<[f32; 3]>,
}

impl<'a> Parser<'a> {
    fn new(budget: &'a Budget) -> Self {
        Self {
            budget,
            last_face: 0,
            positions: Vec::new(),
            colors: Vec::new(),
            polypaint: Vec::new(),
            usemap: None,
            uvs: Vec::new(),
            normals: Vec::new(),
            vertices: HashMap::new(),
            corners: Vec::new(),
            triangles: Vec::new(),
            slots: Vec::new(),
            libraries: Vec::new(),
            known_libraries: BTreeSet::new(),
            odd: BTreeMap::new(),
            uses: Vec::new(),
            known_uses: HashMap::new(),
            use_name: String::new(),
            use_line: 1,
            use_slots: [None; 2],
            face: Vec::new(),
            outline: Vec::new(),
        }
    }

    fn statement(&mut self, text: &str, number: usize) -> Result<()> {
        let text = text.trim_ascii();
        let (key, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
        match key {
            "v" => self.position(rest, number),
            "#MRGB" => {
                self.polypaint(rest);
                self.budget.vertices(self.polypaint.len())
            }
            "usemap" => {
                self.usemap.get_or_insert(number);
                Ok(())
            }
            "vt" => {
                let numbers = numbers::<2, 3>(rest, "texture coordinate")?;
                self.budget.vertices(self.uvs.len() + 1)?;
                self.uvs.push(match numbers {
                    ([u, _, _], 1) => [u, 0.0],
                    ([u, v, _], _) => [u, v],
                });
                Ok(())
            }
            "vn" => {
                // A non-finite normal counts as missing, since scanners write them; the repair computes it from the
                // faces.
                let mut words = rest.split_ascii_whitespace();
                let mut number = || -> Result<f32> {
                    let word = words.next().ok_or_else(|| Error::new("a normal has fewer than 3 coordinates"))?;
                    word.parse().map_err(|_| Error::new(format!("`{}` is not a number", shorten(word))))
                };
                self.budget.vertices(self.normals.len() + 1)?;
                self.normals.push([number()?, number()?, number()?]);
                Ok(())
            }
            "f" | "fo" => self.face(rest, number),
            "usemtl" => {
                rest.trim_ascii().clone_into(&mut self.use_name);
                self.use_line = number;
                self.use_slots = self.known_uses.get(&self.use_name).copied().unwrap_or_default();
                Ok(())
            }
            "mtllib" => {
                let name = rest.trim_ascii();
                if self.known_libraries.insert(name.to_owned()) {
                    self.libraries.push((name.to_owned(), number));
                }
                Ok(())
            }
            _ if key.is_empty() || key.starts_with('#') => Ok(()),
            // Groups, points, lines, curves and extensions of other programs.
            _ if key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') => Ok(()),
            _ if key.contains(|c: char| c.is_control() || c == char::REPLACEMENT_CHARACTER) => {
                Err(Error::new("not text").help("check that this is an OBJ file"))
            }
            _ => Err(Error::new(format!("`{}` is not an OBJ statement", shorten(key)))),
        }
    }

    /// `x y z`, `x y z w`, `x y z r g b` or `x y z r g b a`.
    fn position(&mut self, rest: &str, line: usize) -> Result<()> {
        let mut words = rest.split_ascii_whitespace().take_while(|token| !token.starts_with('#'));
        let text = words.by_ref().take(3).map(|token| finite(token, "vertex")).collect::<Result<Vec<_>>>()?;
        let [x, y, z] = text[..] else {
            return Err(match text.len() {
                0 => Error::new("a vertex has no coordinates instead of 3"),
                count => Error::new(format!("a vertex has {count} coordinates")),
            });
        };
        let mut color = [f32::NAN; 4];
        let mut count = 0;
        for token in words.take(4) {
            color[count] = token.parse().map_err(|_| Error::new(format!("`{}` is not a number", shorten(token))))?;
            count += 1;
        }
        if count >= 3 {
            if !color[..count].iter().all(|x| x.is_finite()) {
                self.note(OddContent::Color, line);
            }
            self.colors.resize(self.positions.len(), [f32::NAN; 4]);
            self.colors.push(color);
        }
        self.budget.vertices(self.positions.len() + 1)?;
        self.positions.push([x, y, z]);
        Ok(())
    }

    /// Eight hexadecimal digits a vertex, for all vertices in order: a mask and red, green and blue.
    fn polypaint(&mut self, text: &str) {
        for digits in text.trim_ascii().as_bytes().chunks_exact(8) {
            let number = std::str::from_utf8(digits).ok().and_then(|digits| u32::from_str_radix(digits, 16).ok());
            let Some(number) = number else { return };
            let [_, r, g, b] = number.to_be_bytes();
            self.polypaint.push([r, g, b]);
        }
    }

    fn face(&mut self, rest: &str, number: usize) -> Result<()> {
        let mut face = std::mem::take(&mut self.face);
        face.clear();
        self.last_face = number;
        // A face of n corners has n - 2 triangles.
        let most = self.budget.triangles_left(self.triangles.len()).saturating_add(2);
        for token in rest.split_ascii_whitespace().take_while(|token| !token.starts_with('#')) {
            let mut corner = self.corner(token)?;
            // Normals only affect shading: a missing one does not invalidate the mesh.
            if corner[2] != NONE && corner[2] as usize >= self.normals.len() {
                corner[2] = NONE;
                self.note(OddContent::Normal, number);
            }
            if corner[1] != NONE && corner[1] as usize >= self.uvs.len() {
                corner[1] = NONE;
                self.note(OddContent::TextureCoordinate, number);
            }
            if face.len() == most {
                self.budget.triangles(self.triangles.len() + face.len() - 1)?;
            }
            face.push(corner);
        }
        if face.len() < 3 {
            self.note(OddContent::Face, number);
            self.face = face;
            return Ok(());
        }
        let textured = face.iter().all(|corner| corner[1] != NONE);
        let slot = self.slot(textured)?;
        let mut outline = std::mem::take(&mut self.outline);
        outline.clear();
        outline.extend(face.iter().map(|corner| self.positions[corner[0] as usize]));
        let indices: Vec<u32> = face.iter().map(|&corner| self.vertex(corner)).collect();
        let before = self.triangles.len();
        if let [a, b, c] = indices[..] {
            self.triangles.push([a, b, c]);
        } else {
            self.triangles.extend(triangulate(&outline)?.into_iter().map(|corners| corners.map(|i| indices[i])));
        }
        self.budget.triangles(self.triangles.len())?;
        self.uses[usize::from(slot)].triangles += self.triangles.len() - before;
        self.slots.resize(self.triangles.len(), slot);
        (self.face, self.outline) = (face, outline);
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`. Empty parts count as missing, as in `v//` and `v/vt/`.
    fn corner(&self, token: &str) -> Result<Corner> {
        let wrong = || not_a_corner(token);
        let mut parts = token.split('/');
        let mut part = |required: bool| -> Result<Option<i64>> {
            match parts.next() {
                None | Some("") if !required => Ok(None),
                Some(text) => text.parse().map(Some).map_err(|_| wrong()),
                None => Err(wrong()),
            }
        };
        let (position, uv, normal) = (part(true)?, part(false)?, part(false)?);
        if parts.next().is_some() {
            return Err(wrong());
        }
        let resolve = |index: Option<i64>, count: usize, what: &str| match index {
            None => Ok(NONE),
            Some(index) => resolve(index, count).ok_or_else(|| {
                Error::new(format!("{what} index {index} in `{}`, but only {count} so far", shorten(token)))
                    .help("indices start at 1, or count back from -1")
            }),
        };
        Ok([
            resolve(position, self.positions.len(), "vertex")?,
            // The caller counts missing normals, and corners of a file without any texture coordinate.
            match resolve(uv, self.uvs.len(), "texture coordinate") {
                Err(_) if self.uvs.is_empty() => NONE - 1,
                uv => uv?,
            },
            resolve(normal, self.normals.len(), "normal").unwrap_or(NONE - 1),
        ])
    }

    /// Counts odd content that the mesh can do without.
    fn note(&mut self, odd: OddContent, line: usize) {
        self.odd.entry(odd).or_insert((line, 0)).1 += 1;
    }

    fn vertex(&mut self, corner: Corner) -> u32 {
        *self.vertices.entry(corner).or_insert_with(|| {
            self.corners.push(corner);
            (self.corners.len() - 1) as u32
        })
    }

    fn slot(&mut self, textured: bool) -> Result<u16> {
        if let Some(slot) = self.use_slots[usize::from(textured)] {
            return Ok(slot);
        }
        let slot = u16::try_from(self.uses.len()).map_err(|_| Error::new("more than 65536 materials"))?;
        self.uses.push(MaterialUse { name: self.use_name.clone(), line: self.use_line, textured, triangles: 0 });
        self.use_slots[usize::from(textured)] = Some(slot);
        self.known_uses.insert(self.use_name.clone(), self.use_slots);
        Ok(slot)
    }

    fn finish(mut self) -> Result<ParsedObj> {
        if self.triangles.is_empty() {
            return Err(match self.positions.len() {
                0 => Error::new("no vertices and no faces").help("check that this is an OBJ file"),
                count => Error::new(format!("no faces, only {count} vertices")),
            });
        }
        let mut notes: Vec<(String, usize)> =
            self.odd.iter().map(|(odd, (line, count))| (odd.text(*count), *line)).collect();
        if let Some(line) = self.usemap {
            notes.push(("`usemap` is not supported; use `map_Kd` of a material".into(), line));
        }
        if self.colors.is_empty() {
            let colors = self.polypaint.iter().take(self.positions.len());
            self.colors =
                colors.map(|color| color.map(|x| f32::from(x) / 255.0)).map(|[r, g, b]| [r, g, b, f32::NAN]).collect();
        }
        let any = |part: usize| self.corners.iter().any(|corner| corner[part] != NONE);
        let mut mesh = MeshData {
            positions: self.corners.iter().map(|corner| self.positions[corner[0] as usize]).collect(),
            triangles: self.triangles,
            slots: self.slots,
            ..MeshData::default()
        };
        if any(1) {
            let uv = |corner: &Corner| self.uvs.get(corner[1] as usize).copied().unwrap_or_default();
            mesh.uvs = self.corners.iter().map(uv).collect();
        }
        if any(2) {
            // A corner without a normal gets zero; the repair computes it from the faces.
            let normal = |corner: &Corner| self.normals.get(corner[2] as usize).copied().unwrap_or_default();
            mesh.normals = self.corners.iter().map(normal).collect();
        }
        let (mut colored, mut alphas) = (Vec::new(), Vec::new());
        if !self.colors.is_empty() {
            self.colors.resize(self.positions.len(), [f32::NAN; 4]);
            let range = |channels: std::ops::Range<usize>| {
                full_intensity(self.colors.iter().flat_map(|color| &color[channels.clone()]).map(|&x| f64::from(x)))
            };
            let (full, opaque) = (range(0..3), range(3..4));
            let colors = || self.corners.iter().map(|corner| self.colors[corner[0] as usize]);
            mesh.colors = colors().map(|[r, g, b, _]| linear_of_display([r, g, b].map(f64::from), full)).collect();
            colored = colors().map(|[r, g, b, _]| [r, g, b].iter().any(|x| x.is_finite())).collect();
            if self.colors.iter().any(|color| color[3].is_finite()) {
                let alpha = |x: f32| if x.is_finite() { (f64::from(x) / opaque).clamp(0.0, 1.0) as f32 } else { 1.0 };
                alphas = colors().map(|color| alpha(color[3])).collect();
            }
        }
        Ok(ParsedObj { mesh, colored, alphas, notes, libraries: self.libraries, uses: self.uses })
    }
}

fn not_a_corner(token: &str) -> Error {
    Error::new(format!("`{}` is not a face corner", shorten(token)))
}

/// Up to `MAX` numbers; fewer than `LEAST` are reported by the caller, more are ignored.
fn numbers<const LEAST: usize, const MAX: usize>(text: &str, what: &str) -> Result<([f32; MAX], usize)> {
    let mut values = [0.0; MAX];
    let mut count = 0;
    for token in text.split_ascii_whitespace().take_while(|token| !token.starts_with('#')).take(MAX) {
        values[count] = finite(token, what)?;
        count += 1;
    }
    if count == 0 {
        return Err(Error::new(format!("a {what} has no coordinates instead of {LEAST}")));
    }
    Ok((values, count))
}

/// An index from 1, or back from -1, as one from 0.
fn resolve(index: i64, count: usize) -> Option<u32> {
    let index = match index {
        1.. => index - 1,
        0 => return None,
        _ => index.checked_add_unsigned(count as u64)?,
    };
    let index = usize::try_from(index).ok().filter(|&index| index < count)?;
    u32::try_from(index).ok().filter(|&index| index != NONE)
}

syntable_mesh::register_mesh_format!(MeshFormat::new("OBJ", &["obj"], read).with_preference(30));
