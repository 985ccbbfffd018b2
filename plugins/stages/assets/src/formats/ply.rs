//! PLY, text and binary in both byte orders: vertices, normals, colors, texture coordinates and polygons.
//!
//! Faces are polygons or triangle strips (`tristrips`). Unknown elements and properties are ignored. Comments `TextureFile` name images, as MeshLab and BOP write them; the
//! property `texnumber` of faces selects one of several.
//!
//! Colors are sRGB-encoded, in a column per channel or packed into one, by vertex, by corner (the list `color` of
//! MeshLab's faces) or by face. Their type does not determine full intensity:
//! [`full_intensity`](syntable_mesh::paint::full_intensity) finds it for all types except `uchar`. As in other
//! programs, a texture overrides colors by vertex, and these override colors by corner and by face.

use crate::bop_files::unit_of;
use crate::formats::FormatLog;
use body::{LIST_LIMIT, PlyRows};
use color::{ColorColumns, decode, range};
use header::{Element, PlyHeader, Property};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_mesh::material::default_material;
use syntable_mesh::paint::{VertexAlpha, blend_by_vertex, hide_colors_under_textures};
use syntable_mesh::polygon::triangulate;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::length_unit::LengthUnit;
use syntable_model::scene::{Color, Encoding, MeshData, Wrap};

mod body;
mod color;
mod header;

/// Reads a file of `root`, named relative to it, in its own unit. Its own axes are kept: z is taken as up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let PlyMesh { mesh, alphas, corners, textures, longer_rows, notes } =
        parse(&root.read(&path)?, root.budget()).map_err(at)?;
    if let Some((line, count)) = longer_rows {
        let message = format!("{count} rows have more numbers than the header declares; the excess is ignored");
        log.warn(&at(Error::new(message)).at_line(line));
    }
    for note in notes {
        log.warn(&at(Error::new(note)));
    }
    let mut model = Model { mesh, materials: Vec::new() };
    let used = if textures.len() > 1 && model.mesh.slots.is_empty() {
        log.warn(&at(Error::new(format!(
            "the file names {} textures, but faces have no `texnumber`; using the first",
            textures.len()
        ))));
        1
    } else {
        textures.len()
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut images = Vec::new();
    for name in &textures[..used] {
        let shown = shorten(name);
        images.push(match root.find(folder, name).map_err(at)? {
            Some(_) if model.mesh.uvs.is_empty() => {
                log.warn(&at(Error::new(format!("no texture coordinates for `{shown}`; using a constant color"))));
                None
            }
            Some(image) => {
                let image = image.noted(|note| log.warn(&at(note)));
                let decoded = DecodedImage::read_if_known(root, &image, |error| log.warn(&error))?;
                decoded.map(|image| Arc::new(image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2])))
            }
            None => {
                log.warn(&at(Error::new(format!("texture `{shown}` is missing; using a constant color"))));
                None
            }
        });
    }
    let slot = |t: usize| usize::from(model.mesh.slots.get(t).copied().unwrap_or(0));
    let textured: Vec<bool> =
        (0..model.mesh.triangles.len()).map(|t| images.get(slot(t)).is_some_and(Option::is_some)).collect();
    let slots = (0..textured.len()).map(slot).max().unwrap_or(0) + 1;
    let in_file = FormatLog { log, path: &path };
    let alphas = hide_colors_under_textures(&mut model.mesh, alphas, &corners, &textured, &in_file);
    let default = default_material(!model.mesh.colors.is_empty());
    model.materials = (0..slots)
        .map(|slot| match images.get(slot) {
            Some(Some(image)) => {
                let mut material = default.clone();
                material.base_color = Color::texture(image.clone());
                material.with_digest()
            }
            _ => default.clone(),
        })
        .collect();
    blend_by_vertex(&mut model, &alphas, |_| VertexAlpha::Blends, &in_file);
    Ok(model)
}

/// Content of a file.
pub struct PlyMesh {
    /// The mesh.
    pub mesh: MeshData,
    /// Opacities of the vertices; empty if the file has none.
    pub alphas: Vec<f32>,
    /// Linear colors and opacities of triangles' corners, if vertices have none; empty if the file has none.
    pub corners: Vec<[[f32; 4]; 3]>,
    /// Ignored content.
    pub notes: Vec<String>,
    /// Names of textures.
    pub textures: Vec<String>,
    /// In text files: the first line with more numbers than the header declares, and the number of such lines.
    pub longer_rows: Option<(usize, usize)>,
}

/// Parses a file in memory.
pub fn parse(bytes: &[u8], budget: &Budget) -> Result<PlyMesh> {
    let header = PlyHeader::parse(bytes)?;
    let mut rows = PlyRows::new(&header, bytes);
    let mut vertices = None;
    let mut faces = None;
    let mut notes = Vec::new();
    for element in &header.elements {
        rows.check_size(element)?;
        match element.name.as_str() {
            "vertex" if vertices.is_none() => vertices = Some(read_vertices(element, &mut rows, budget, &mut notes)?),
            "face" if faces.is_none() && element.count > 0 => {
                faces = Some(read_faces(element, &mut rows, vertices.as_ref(), budget, &mut notes)?);
            }
            "tristrips" if faces.is_none() && element.count > 0 => {
                faces = Some(read_strips(element, &mut rows, vertices.as_ref(), budget)?);
            }
            _ => {
                match element.name.as_str() {
                    _ if element.count == 0 => {}
                    "material" => notes.push("the colors of the element `material` are not supported".into()),
                    name @ ("vertex" | "face" | "tristrips") => {
                        let why = "only the first element with faces or of this name is read";
                        notes.push(format!("{} rows of an element `{name}` are ignored: {why}", element.count));
                    }
                    _ => {}
                }
                rows.skip(element)?;
            }
        }
    }
    let Vertices { mesh, alphas } = vertices.ok_or_else(|| Error::new("no vertices"))?;
    let mut faces =
        faces.filter(|faces: &PlyFaces| !faces.triangles.is_empty()).ok_or_else(|| Error::new("no faces"))?;
    if !mesh.colors.is_empty() && !faces.corners.is_empty() {
        notes.push("vertices and faces have colors; using the colors of the vertices".into());
        faces.corners = Vec::new();
    }
    let textures = header.textures;
    let slots = faces.slots(textures.len());
    let corners = std::mem::take(&mut faces.corners);
    let (mesh, alphas) = faces.onto(mesh, alphas);
    let mesh = MeshData { slots, ..mesh };
    Ok(PlyMesh { mesh, alphas, corners, notes, textures, longer_rows: rows.longer() })
}

/// Vertices without faces.
struct Vertices {
    mesh: MeshData,
    /// Opacities; empty if the file has none.
    alphas: Vec<f32>,
}

fn read_vertices(
    element: &Element,
    rows: &mut PlyRows<'_>,
    budget: &Budget,
    notes: &mut Vec<String>,
) -> Result<Vertices> {
    budget.vertices(element.count)?;
    let find = |names: &[&str]| element.properties.iter().position(|p| names.contains(&p.name.as_str()));
    let mut position = [0; 3];
    for (at, name) in position.iter_mut().zip(["x", "y", "z"]) {
        *at = find(&[name]).ok_or_else(|| Error::new(format!("vertices have no property `{name}`")))?;
    }
    let all = |found: [Option<usize>; 3]| -> Option<[usize; 3]> { Some([found[0]?, found[1]?, found[2]?]) };
    let normal = all(["nx", "ny", "nz"].map(|name| find(&[name])));
    let color = ColorColumns::of(element, rows.is_text(), None, notes);
    let uv = find(&["texture_u", "u", "s"]).zip(find(&["texture_v", "v", "t"]));

    // The size was checked: every number has at least two bytes.
    let mut mesh = MeshData { positions: Vec::with_capacity(element.count), ..MeshData::default() };
    let mut colors = Vec::new();
    let mut values = vec![0.0; element.properties.len()];
    for row in 0..element.count {
        rows.begin(element, row)?;
        for (at, (value, property)) in values.iter_mut().zip(&element.properties).enumerate() {
            *value = match property.list {
                None => rows.number(ColorColumns::read_as(color.as_ref(), at, property.scalar))?,
                Some(length) => {
                    rows.list(length, property.scalar, &mut Vec::new(), LIST_LIMIT)?;
                    0.0
                }
            };
        }
        rows.end()?;
        let p = position.map(|at| values[at] as f32);
        if !p.iter().all(|x| x.is_finite()) {
            return Err(rows.place(Error::new(format!("non-finite vertex {row}: {:?}", position.map(|at| values[at])))));
        }
        mesh.positions.push(p);
        if let Some(normal) = normal {
            mesh.normals.push(normal.map(|at| values[at] as f32));
        }
        if let Some(color) = &color {
            colors.push(color.of_row(&values));
        }
        if let Some((u, v)) = uv {
            mesh.uvs.push([values[u] as f32, values[v] as f32]);
        }
    }
    let mut alphas = Vec::new();
    if let Some(columns) = color {
        columns.decode(element, &mut colors, "vertices", notes);
        mesh.colors = colors.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
        if columns.has_alpha() {
            alphas = colors.iter().map(|color| color[3]).collect();
        }
    }
    Ok(Vertices { mesh, alphas })
}

/// Triangles, and the values that faces give their corners.
#[derive(Default)]
struct PlyFaces {
    triangles: Vec<[u32; 3]>,
    corner_uvs: Vec<[[f32; 2]; 3]>,
    /// Linear colors and opacities of the corners.
    corners: Vec<[[f32; 4]; 3]>,
    /// Numbers of textures.
    textures: Vec<f64>,
}

fn read_faces(
    element: &Element,
    rows: &mut PlyRows<'_>,
    vertices: Option<&Vertices>,
    budget: &Budget,
    notes: &mut Vec<String>,
) -> Result<PlyFaces> {
    budget.triangles(element.count)?;
    let positions = &vertices.ok_or_else(|| Error::new("faces come before the vertices"))?.mesh.positions;
    let list =
        |names: &[&str]| element.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()));
    let indices_at =
        list(&["vertex_indices", "vertex_index"]).ok_or_else(|| Error::new("faces have no list `vertex_indices`"))?;
    let (uvs_at, wedge_at) = (list(&["texcoord"]), list(&["color"]));
    let texture_at = element.properties.iter().position(|p| p.list.is_none() && p.name == "texnumber");
    let color = ColorColumns::of(element, rows.is_text(), wedge_at, notes);
    let mut faces = PlyFaces::default();
    let (mut indices, mut uvs, mut wedge, mut other) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut outline = Vec::new();
    let mut values = vec![0.0; element.properties.len()];
    let (mut by_face, mut without_color, mut short) = (Vec::new(), 0, 0);
    for row in 0..element.count {
        rows.begin(element, row)?;
        for (at, property) in element.properties.iter().enumerate() {
            match property.list {
                None => values[at] = rows.number(ColorColumns::read_as(color.as_ref(), at, property.scalar))?,
                Some(length) => {
                    let into = match at {
                        _ if at == indices_at => &mut indices,
                        _ if Some(at) == uvs_at => &mut uvs,
                        _ if Some(at) == wedge_at => &mut wedge,
                        _ => &mut other,
                    };
                    // A face of n corners has n - 2 triangles, and at most four numbers for each corner.
                    let corners = budget.triangles_left(faces.triangles.len()).saturating_add(2);
                    let most = if at == indices_at { corners } else { corners.saturating_mul(4) };
                    rows.list(length, property.scalar, into, most)?;
                }
            }
        }
        rows.end()?;
        if indices.len() < 3 {
            short += 1;
            continue;
        }
        check_indices(&indices, positions.len())
            .map_err(|what| rows.place(Error::new(format!("face {row} {what}"))))?;
        outline.clear();
        outline.extend(indices.iter().map(|&i| positions[i as usize]));
        let cut = triangulate(&outline).map_err(|error| rows.place(error))?;
        budget.triangles(faces.triangles.len() + cut.len())?;
        faces.triangles.extend(cut.iter().map(|corners| corners.map(|i| indices[i] as u32)));
        if uvs_at.is_some() {
            let uv = |i: usize| [0, 1].map(|k| uvs.get(2 * i + k).copied().unwrap_or_default() as f32);
            faces.corner_uvs.extend(cut.iter().map(|corners| corners.map(uv)));
        }
        if texture_at.is_some() {
            faces.textures.resize(faces.triangles.len(), texture_at.map_or(0.0, |at| values[at]));
        }
        if wedge_at.is_some() {
            // Three or four channels for each corner, or a face without colors.
            let channels = wedge.len() / indices.len();
            let is_color = (channels == 3 || channels == 4) && wedge.len() % indices.len() == 0;
            without_color += usize::from(!is_color);
            let corner = |i: usize| {
                let channel = |k: usize| wedge.get(i * channels + k).copied();
                let value = |k: usize| channel(k).filter(|_| is_color).map_or(f32::NAN, |x| x as f32);
                [value(0), value(1), value(2), if channels == 4 { value(3) } else { f32::NAN }]
            };
            faces.corners.extend(cut.iter().map(|corners| corners.map(corner)));
        } else if let Some(color) = &color {
            by_face.resize(faces.triangles.len(), color.of_row(&values));
        }
    }
    if short > 0 {
        notes.push(format!("faces with fewer than three corners are left out: {short}"));
    }
    if let Some(at) = wedge_at {
        let full = range(element.properties[at].scalar, faces.corners.as_flattened_mut(), 0..4);
        decode(faces.corners.iter_mut().flatten(), [full; 2], "corners", &mut Vec::new());
        if without_color > 0 {
            notes.push(format!("{without_color} faces have no colors for their corners, and become white"));
        }
    } else if let Some(columns) = &color {
        columns.decode(element, &mut by_face, "faces", notes);
        faces.corners = by_face.into_iter().map(|color| [color; 3]).collect();
    }
    Ok(faces)
}

/// Refuses an index without a vertex.
fn check_indices(indices: &[f64], vertices: usize) -> Result<(), String> {
    let is_one = |index: &&f64| **index >= 0.0 && **index < vertices as f64 && index.fract() == 0.0;
    match indices.iter().find(|index| !is_one(index)) {
        Some(index) => Err(format!("has index {index}, but the mesh has {vertices} vertices")),
        None => Ok(()),
    }
}

/// Reads triangle strips: every corner after the second one ends a triangle with its two predecessors, and every other triangle
/// is turned around. A negative index starts a new strip.
fn read_strips(
    element: &Element,
    rows: &mut PlyRows<'_>,
    vertices: Option<&Vertices>,
    budget: &Budget,
) -> Result<PlyFaces> {
    let vertices = vertices.ok_or_else(|| Error::new("strips come before the vertices"))?.mesh.positions.len();
    let is_indices = |property: &Property| property.list.is_some() && property.name.starts_with("vertex_ind");
    let at = element.properties.iter().position(is_indices);
    let at = at.ok_or_else(|| Error::new("strips have no list `vertex_indices`"))?;
    let mut faces = PlyFaces::default();
    let (mut indices, mut other) = (Vec::new(), Vec::new());
    for row in 0..element.count {
        rows.begin(element, row)?;
        for (place, property) in element.properties.iter().enumerate() {
            match property.list {
                None => drop(rows.number(property.scalar)?),
                // A strip has at most two corners more than triangles, and as many restarts as corners.
                Some(length) if place == at => {
                    let most = budget.triangles_left(faces.triangles.len()).saturating_mul(4).saturating_add(2);
                    rows.list(length, property.scalar, &mut indices, most)?;
                }
                Some(length) => rows.list(length, property.scalar, &mut other, LIST_LIMIT)?,
            }
        }
        rows.end()?;
        for strip in indices.split(|index| *index < 0.0) {
            check_indices(strip, vertices).map_err(|what| rows.place(Error::new(format!("strip {row} {what}"))))?;
            for (turn, corners) in strip.windows(3).enumerate() {
                let [a, b, c] = [0, 1, 2].map(|k| corners[k] as u32);
                // Repeated corners move a strip without a triangle.
                if a != b && b != c && a != c {
                    faces.triangles.push(if turn % 2 == 0 { [a, b, c] } else { [b, a, c] });
                }
            }
            budget.triangles(faces.triangles.len())?;
        }
    }
    Ok(faces)
}

impl PlyFaces {
    /// Material slots: numbers of textures, if faces have different ones. A number without a texture gets its own slot.
    fn slots(&self, textures: usize) -> Vec<u16> {
        let slot = |&number: &f64| {
            let known = number >= 0.0 && number < textures as f64;
            if known { number as u16 } else { u16::try_from(textures).unwrap_or(u16::MAX) }
        };
        let slots: Vec<u16> = if textures > 0 { self.textures.iter().map(slot).collect() } else { Vec::new() };
        if slots.iter().all(|&slot| slot == 0) && textures < 2 { Vec::new() } else { slots }
    }

    /// Joins faces and vertices. Splits a vertex with several texture coordinates. Returns the opacities of vertices,
    /// too.
    fn onto(self, mut mesh: MeshData, alphas: Vec<f32>) -> (MeshData, Vec<f32>) {
        mesh.triangles = self.triangles;
        if self.corner_uvs.is_empty() {
            return (mesh, alphas);
        }
        let mut split = MeshData::default();
        let mut split_alphas = Vec::new();
        let mut known: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        for (triangle, uvs) in mesh.triangles.iter().zip(&self.corner_uvs) {
            split.triangles.push(std::array::from_fn(|k| {
                let (index, uv) = (triangle[k], uvs[k]);
                *known.entry((index, uv.map(f32::to_bits))).or_insert_with(|| {
                    let i = index as usize;
                    split.positions.push(mesh.positions[i]);
                    split.normals.extend(mesh.normals.get(i));
                    split.colors.extend(mesh.colors.get(i));
                    split_alphas.extend(alphas.get(i));
                    split.uvs.push(uv);
                    (split.positions.len() - 1) as u32
                })
            }));
        }
        (split, split_alphas)
    }
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("PLY", &["ply"], read)
        .with_preference(20)
        .with_unit_by_name(unit_of)
        .with_usual_unit(LengthUnit::Mm)
);
