//! Geometries: triangles, polygons and their arrays.

use crate::formats::xml::{self, ById, attribute, children, numbers, only, target};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use syntable_mesh::limits::Budget;
use syntable_mesh::polygon::triangulate;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

/// The parts of a geometry.
pub struct DaeGeometry<'a> {
    pub parts: Vec<DaePart<'a>>,
}

/// Faces of one material.
pub struct DaePart<'a> {
    /// The symbol of the material.
    pub material: Option<&'a str>,
    pub mesh: MeshData,
}

/// An input of a corner: the values, their stride, the offset of the first, and the place of its index in a corner.
struct Input {
    values: Vec<f32>,
    stride: usize,
    first: usize,
    place: usize,
}

impl Input {
    fn get<const N: usize>(&self, corner: &[usize]) -> Option<[f32; N]> {
        let at = corner.get(self.place)?.checked_mul(self.stride)?.checked_add(self.first)?;
        self.values.get(at..at.checked_add(N)?)?.try_into().ok()
    }
}

impl<'a> DaeGeometry<'a> {
    /// Reads a geometry. Splines, lines and points are left out.
    pub fn read<'d>(geometry: Node<'a, 'd>, ids: &ById<'a, 'd>, budget: &Budget, log: &dyn Log) -> Result<Self> {
        let mut parts = Vec::new();
        let Some(mesh) = only(geometry, "mesh") else {
            log.warn(&Error::new("a geometry without a mesh of polygons is left out"));
            return Ok(Self { parts });
        };
        for element in mesh.children().filter(Node::is_element) {
            let faces = match element.tag_name().name() {
                "triangles" | "polylist" | "polygons" | "tristrips" | "trifans" => element,
                _ => continue,
            };
            parts.push(part(faces, mesh, ids, budget)?);
        }
        Ok(Self { parts })
    }
}

fn part<'a, 'd>(faces: Node<'a, 'd>, mesh: Node<'a, 'd>, ids: &ById<'a, 'd>, budget: &Budget) -> Result<DaePart<'a>> {
    let mut inputs: BTreeMap<&str, Input> = BTreeMap::new();
    let mut width = 0;
    let mut add = |semantic: &'a str, reference: &str, place: usize| -> Result<()> {
        if let Some((values, stride, first)) = source(ids, reference)? {
            budget.bytes((values.len() * size_of::<f32>()) as u64)?;
            inputs.entry(semantic).or_insert(Input { values, stride, first, place });
        }
        Ok(())
    };
    for input in children(faces, "input") {
        let (Some(semantic), Some(reference)) = (attribute(input, "semantic"), attribute(input, "source")) else {
            continue;
        };
        let place = attribute(input, "offset").and_then(|text| text.trim().parse().ok()).unwrap_or(0);
        width = width.max(place + 1);
        if semantic != "VERTEX" {
            add(semantic, reference, place)?;
            continue;
        }
        let vertices = only(mesh, "vertices");
        for input in vertices.into_iter().flat_map(|vertices| children(vertices, "input")) {
            if let (Some(semantic), Some(reference)) = (attribute(input, "semantic"), attribute(input, "source")) {
                add(semantic, reference, place)?;
            }
        }
    }
    let Some(positions) = inputs.get("POSITION") else { return Err(Error::new("faces without positions")) };
    let mut builder = PartBuilder {
        positions,
        normals: inputs.get("NORMAL"),
        uvs: inputs.get("TEXCOORD"),
        colors: inputs.get("COLOR"),
        known: BTreeMap::new(),
        mesh: MeshData::default(),
    };
    for face in polygons(faces, width, budget)? {
        builder.add(&face, width, budget)?;
    }
    Ok(DaePart { material: attribute(faces, "material"), mesh: builder.mesh })
}

/// The indices of each polygon, `width` per corner.
fn polygons(faces: Node, width: usize, budget: &Budget) -> Result<Vec<Vec<usize>>> {
    let kind = faces.tag_name().name();
    let mut lists = Vec::new();
    let holes = children(faces, "ph").filter_map(|hole| only(hole, "p"));
    for list in children(faces, "p").chain(holes) {
        let indices = xml::indices(list)?;
        budget.bytes((indices.len() * size_of::<usize>()) as u64)?;
        lists.push(indices);
    }
    let whole = |list: &[usize]| match list.len().is_multiple_of(width.max(1)) {
        true => Ok(()),
        false => Err(Error::new(format!("{} indices are not a multiple of the {width} of a corner", list.len()))),
    };
    let mut found = Vec::new();
    for list in lists {
        whole(&list)?;
        let corners: Vec<&[usize]> = list.chunks_exact(width.max(1)).collect();
        match kind {
            "triangles" => found.extend(corners.chunks_exact(3).map(<[_]>::concat)),
            "polygons" => found.push(list.clone()),
            "tristrips" => found.extend(corners.windows(3).enumerate().map(|(i, c)| match i % 2 {
                0 => c.concat(),
                _ => [c[1], c[0], c[2]].concat(),
            })),
            "trifans" => found.extend(corners.windows(2).skip(1).map(|c| [corners[0], c[0], c[1]].concat())),
            _ => {
                let counts = only(faces, "vcount").map(xml::indices).transpose()?.unwrap_or_default();
                let mut at = 0_usize;
                for count in counts {
                    let face = corners.get(at..at.saturating_add(count));
                    let face = face.ok_or_else(|| Error::new("a polygon has corners beyond the list of indices"))?;
                    found.push(face.concat());
                    at += count;
                }
            }
        }
        budget.triangles(found.len())?;
    }
    Ok(found)
}

/// Builds the arrays of a part: a vertex for every combination of indices.
struct PartBuilder<'a> {
    positions: &'a Input,
    normals: Option<&'a Input>,
    uvs: Option<&'a Input>,
    colors: Option<&'a Input>,
    /// Vertices by the indices of their arrays.
    known: BTreeMap<[usize; 4], u32>,
    mesh: MeshData,
}

impl PartBuilder<'_> {
    fn add(&mut self, face: &[usize], width: usize, budget: &Budget) -> Result<()> {
        let mut corners = Vec::new();
        for corner in face.chunks_exact(width) {
            let count = self.mesh.positions.len();
            let of =
                |input: Option<&Input>| input.and_then(|input| corner.get(input.place).copied()).unwrap_or_default();
            let key = [of(Some(self.positions)), of(self.normals), of(self.uvs), of(self.colors)];
            let index = match self.known.entry(key) {
                Entry::Occupied(entry) => *entry.get(),
                Entry::Vacant(entry) => {
                    budget.vertices(count + 1)?;
                    let position = self.positions.get::<3>(corner).ok_or_else(|| {
                        let index = corner.get(self.positions.place).copied().unwrap_or_default();
                        Error::new(format!("vertex index {index} is beyond the positions"))
                    })?;
                    if !position.iter().all(|x| x.is_finite()) {
                        return Err(Error::new(format!("non-finite vertex: {}", shorten(&format!("{position:?}")))));
                    }
                    self.mesh.positions.push(position);
                    if let Some(normals) = self.normals {
                        let normal = normals.get::<3>(corner).filter(|normal| normal.iter().all(|x| x.is_finite()));
                        self.mesh.normals.push(normal.unwrap_or_default());
                    }
                    if let Some(uvs) = self.uvs {
                        let uv = uvs.get::<2>(corner).filter(|uv| uv.iter().all(|x| x.is_finite()));
                        self.mesh.uvs.push(uv.unwrap_or_default());
                    }
                    if let Some(colors) = self.colors {
                        let color = colors.get::<3>(corner).filter(|color| color.iter().all(|x| x.is_finite()));
                        self.mesh.colors.push(color.unwrap_or([1.0; 3]).map(|x| x.clamp(0.0, 1.0)));
                    }
                    *entry.insert(count as u32)
                }
            };
            corners.push(index);
        }
        if corners.len() < 3 {
            return Ok(());
        }
        let points: Vec<[f32; 3]> = corners.iter().map(|&i| self.mesh.positions[i as usize]).collect();
        let triangles = triangulate(&points)?;
        budget.triangles(self.mesh.triangles.len() + triangles.len())?;
        self.mesh.triangles.extend(triangles.into_iter().map(|triangle| triangle.map(|i| corners[i])));
        Ok(())
    }
}

/// The numbers of a source, by the id of the source or of its array.
fn source(ids: &ById<'_, '_>, reference: &str) -> Result<Option<(Vec<f32>, usize, usize)>> {
    let Some(source) = target(ids, "source", reference) else { return Ok(None) };
    let accessor = only(source, "technique_common").and_then(|common| only(common, "accessor"));
    let number = |name| accessor.and_then(|it| attribute(it, name)).and_then(|text| text.trim().parse::<usize>().ok());
    let array = accessor.and_then(|it| attribute(it, "source")).and_then(|source| target(ids, "float_array", source));
    let array = array.or_else(|| only(source, "float_array"));
    let Some(array) = array else { return Ok(None) };
    let values = numbers(array)?;
    Ok(Some((values, number("stride").unwrap_or(1).max(1), number("offset").unwrap_or(0))))
}
