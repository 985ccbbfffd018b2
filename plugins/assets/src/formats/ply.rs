//! PLY, text and binary in both byte orders: vertices, normals, colors, texture coordinates and polygons.
//!
//! Elements and properties that have no meaning here are ignored. The image is named by the comment
//! `TextureFile`, as MeshLab and BOP write it.

use crate::sources::bop_models::guess_unit;
use body::Rows;
use header::{Element, Header};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::image::Image;
use syntable_mesh::limits::Budget;
use syntable_mesh::material::default_material;
use syntable_mesh::polygon::triangulate;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::shorten;
use syntable_model::color::srgb_to_linear;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Color, Encoding, MeshData, Wrap};

mod body;
mod header;

/// Maximum length of a list that means nothing here.
const LIST_LIMIT: usize = 1 << 20;

/// Reads a file of `root`, named relative to it, in its own unit. Its own axes are kept: z is taken as up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let Parsed { mesh, textures, longer_rows } = parse(&root.read(&path)?, root.budget()).map_err(at)?;
    if let Some((line, count)) = longer_rows {
        let message = format!("{count} rows have more numbers than the header names; the others are ignored");
        log.warn(&at(Error::new(message)).at_line(line));
    }
    let mut material = default_material(!mesh.colors.is_empty());
    if let [name, others @ ..] = &textures[..] {
        let folder = file.parent().unwrap_or(Path::new(""));
        if !others.is_empty() {
            log.warn(&at(Error::new(format!("{} textures are named; the first is used", textures.len()))));
        }
        let shown = shorten(name);
        match root.find(folder, name).map_err(at)? {
            Some(_) if mesh.uvs.is_empty() => {
                log.warn(&at(Error::new(format!("no texture coordinates for `{shown}`; a constant color is used"))));
            }
            Some(image) => {
                let image = image.noted(|note| log.warn(&at(note)));
                let texture = Image::read(root, &image)?.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]);
                material.base_color = Color::texture(Arc::new(texture));
                material = material.with_digest();
            }
            None => log.warn(&at(Error::new(format!("no texture `{shown}`; a constant color is used")))),
        }
    }
    Ok(Model { mesh, materials: vec![material] })
}

/// What a file holds.
pub struct Parsed {
    /// The mesh.
    pub mesh: MeshData,
    /// Names of textures.
    pub textures: Vec<String>,
    /// In text: the first line with more numbers than the header names, and how many such lines there are.
    pub longer_rows: Option<(usize, usize)>,
}

/// Parses a file in memory.
pub fn parse(bytes: &[u8], budget: &Budget) -> Result<Parsed> {
    let header = Header::parse(bytes)?;
    let mut rows = Rows::new(&header, bytes);
    let mut vertices = None;
    let mut faces = None;
    for element in &header.elements {
        rows.check_size(element)?;
        match element.name.as_str() {
            "vertex" if vertices.is_none() => vertices = Some(read_vertices(element, &mut rows, budget)?),
            "face" if faces.is_none() => faces = Some(read_faces(element, &mut rows, vertices.as_ref(), budget)?),
            _ => rows.skip(element)?,
        }
    }
    let mesh = vertices.ok_or_else(|| Error::new("no vertices"))?;
    let faces = faces.ok_or_else(|| Error::new("no faces"))?;
    if faces.triangles.is_empty() {
        return Err(Error::new("no faces"));
    }
    Ok(Parsed { mesh: faces.onto(mesh), textures: header.textures, longer_rows: rows.longer() })
}

fn read_vertices(element: &Element, rows: &mut Rows<'_>, budget: &Budget) -> Result<MeshData> {
    budget.vertices(element.count)?;
    let find = |names: &[&str]| element.properties.iter().position(|p| names.contains(&p.name.as_str()));
    let mut position = [0; 3];
    for (at, name) in position.iter_mut().zip(["x", "y", "z"]) {
        *at = find(&[name]).ok_or_else(|| Error::new(format!("vertices have no property `{name}`")))?;
    }
    let all = |found: [Option<usize>; 3]| -> Option<[usize; 3]> { Some([found[0]?, found[1]?, found[2]?]) };
    let normal = all(["nx", "ny", "nz"].map(|name| find(&[name])));
    let color = all([&["red", "r", "diffuse_red"], &["green", "g", "diffuse_green"], &["blue", "b", "diffuse_blue"]]
        .map(|names| find(names)));
    let uv = find(&["texture_u", "u", "s"]).zip(find(&["texture_v", "v", "t"]));
    let whites: Vec<f64> = element.properties.iter().map(|p| p.scalar.white()).collect();

    // The size was checked: there are at least two bytes for every number.
    let mut mesh = MeshData { positions: Vec::with_capacity(element.count), ..MeshData::default() };
    let mut values = vec![0.0; element.properties.len()];
    for row in 0..element.count {
        rows.begin(element, row)?;
        for (value, property) in values.iter_mut().zip(&element.properties) {
            *value = match property.list {
                None => rows.number(property.scalar)?,
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
        if let Some(color) = color {
            mesh.colors.push(color.map(|at| srgb_to_linear((values[at] / whites[at]).clamp(0.0, 1.0) as f32)));
        }
        if let Some((u, v)) = uv {
            mesh.uvs.push([values[u] as f32, values[v] as f32]);
        }
    }
    Ok(mesh)
}

/// Triangles, and texture coordinates per corner where faces carry them.
#[derive(Default)]
struct Faces {
    triangles: Vec<[u32; 3]>,
    corner_uvs: Vec<[[f32; 2]; 3]>,
}

fn read_faces(element: &Element, rows: &mut Rows<'_>, vertices: Option<&MeshData>, budget: &Budget) -> Result<Faces> {
    budget.triangles(element.count)?;
    let positions = &vertices.ok_or_else(|| Error::new("faces come before the vertices"))?.positions;
    let list =
        |names: &[&str]| element.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()));
    let indices_at =
        list(&["vertex_indices", "vertex_index"]).ok_or_else(|| Error::new("faces have no list `vertex_indices`"))?;
    let uvs_at = list(&["texcoord"]);
    let mut faces = Faces::default();
    let (mut indices, mut uvs, mut other) = (Vec::new(), Vec::new(), Vec::new());
    let mut outline = Vec::new();
    for row in 0..element.count {
        rows.begin(element, row)?;
        for (at, property) in element.properties.iter().enumerate() {
            match property.list {
                None => {
                    rows.number(property.scalar)?;
                }
                Some(length) => {
                    let into = match at {
                        _ if at == indices_at => &mut indices,
                        _ if Some(at) == uvs_at => &mut uvs,
                        _ => &mut other,
                    };
                    // A face of n corners has n - 2 triangles, and texture coordinates two numbers for each corner.
                    let corners = budget.triangles_left(faces.triangles.len()).saturating_add(2);
                    let most = if at == indices_at { corners } else { corners.saturating_mul(2) };
                    rows.list(length, property.scalar, into, most)?;
                }
            }
        }
        rows.end()?;
        if indices.len() < 3 {
            return Err(rows.place(Error::new(format!("face {row} has {} corners; it needs three", indices.len()))));
        }
        if let Some(index) = indices.iter().find(|&&i| !(i >= 0.0 && i < positions.len() as f64 && i.fract() == 0.0)) {
            let message = format!("face {row} has index {index}, but there are {} vertices", positions.len());
            return Err(rows.place(Error::new(message)));
        }
        outline.clear();
        outline.extend(indices.iter().map(|&i| positions[i as usize]));
        let cut = triangulate(&outline).map_err(|error| rows.place(error))?;
        budget.triangles(faces.triangles.len() + cut.len())?;
        faces.triangles.extend(cut.iter().map(|corners| corners.map(|i| indices[i] as u32)));
        if uvs_at.is_some() {
            let uv = |i: usize| [0, 1].map(|k| uvs.get(2 * i + k).copied().unwrap_or_default() as f32);
            faces.corner_uvs.extend(cut.iter().map(|corners| corners.map(uv)));
        }
    }
    Ok(faces)
}

impl Faces {
    /// Joins faces and vertices; a vertex with several texture coordinates is split.
    fn onto(self, mut mesh: MeshData) -> MeshData {
        mesh.triangles = self.triangles;
        if self.corner_uvs.is_empty() {
            return mesh;
        }
        let mut split = MeshData::default();
        let mut known: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        for (triangle, uvs) in mesh.triangles.iter().zip(&self.corner_uvs) {
            split.triangles.push(std::array::from_fn(|k| {
                let (index, uv) = (triangle[k], uvs[k]);
                *known.entry((index, uv.map(f32::to_bits))).or_insert_with(|| {
                    let i = index as usize;
                    split.positions.push(mesh.positions[i]);
                    split.normals.extend(mesh.normals.get(i));
                    split.colors.extend(mesh.colors.get(i));
                    split.uvs.push(uv);
                    (split.positions.len() - 1) as u32
                })
            }));
        }
        split
    }
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("PLY", &["ply"], read).with_preference(20).with_unit_guess(guess_unit)
);
