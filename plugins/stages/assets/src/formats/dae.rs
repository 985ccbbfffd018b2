//! COLLADA (`.dae`): the geometries of the visual scene as one mesh, with the colors and images of the common profile.
//!
//! The file states its unit and its upward axis. Skins take the shape in which they were bound, and morphs their base;
//! animations are ignored.

use super::xml::{self, ById, attribute, by_id, children, only, target};
use super::{FormatLog, within};
use geometry::DaeGeometry;
use materials::DaeMaterials;
use nalgebra::{Matrix4, Translation3, Vector3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::placement::Placement;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

mod geometry;
mod materials;

/// Maximum depth of nodes that other nodes insert.
const MAX_DEPTH: usize = 100;
/// Maximum number of placed nodes.
const MAX_NODES: usize = 1 << 20;

/// Reads a file of `root`, named relative to it: meters, z up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let (model, up) = read_with_axis(root, file, log)?;
    Ok(match up {
        UpAxis::Z => model,
        UpAxis::Y => model.y_up_to_z_up(),
        // x up: (x, y, z) becomes (-y, -z, x) by the rotation that takes x to z and z to -y.
        UpAxis::X => {
            let z_from_x = Matrix4::new(0., -1., 0., 0., 0., 0., -1., 0., 1., 0., 0., 0., 0., 0., 0., 1.);
            model.placed(&Placement::new(z_from_x))
        }
    })
}

/// As [`read`], without turning the stated axis upwards, as programs for robots read these files.
pub fn read_as_stated(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    read_with_axis(root, file, log).map(|(model, _)| model)
}

enum UpAxis {
    X,
    Y,
    Z,
}

fn read_with_axis(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<(Model, UpAxis)> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let text = xml::text(root.read(&path)?, root.budget()).map_err(at)?;
    let document = xml::parse(&text).map_err(at)?;
    let collada = document.root_element();
    if collada.tag_name().name() != "COLLADA" {
        return Err(at(Error::new(format!(
            "the document is `<{}>`, not `<COLLADA>`",
            shorten(collada.tag_name().name())
        ))));
    }
    let in_file = FormatLog { log, path: &path };
    let asset = only(collada, "asset");
    let unit = asset.and_then(|asset| only(asset, "unit")).and_then(|unit| attribute(unit, "meter"));
    let meters =
        unit.and_then(|meter| meter.trim().parse::<f64>().ok()).filter(|meters| *meters > 0.0 && meters.is_finite());
    let up = match asset.and_then(|asset| only(asset, "up_axis")).and_then(|axis| axis.text()).map(str::trim) {
        Some("X_UP") => UpAxis::X,
        Some("Z_UP") => UpAxis::Z,
        _ => UpAxis::Y,
    };
    if only(collada, "library_animations").is_some_and(|library| children(library, "animation").next().is_some()) {
        in_file.warn(&Error::new("animations are not supported; the object takes its default pose"));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut reader = DaeReader {
        root,
        log: &in_file,
        ids: by_id(&document),
        geometries: BTreeMap::new(),
        materials: DaeMaterials::new(root, folder, &in_file),
        mesh: MeshData::default(),
        skinned: false,
    };
    let mut nodes = reader.scene_nodes(&document, collada).map_err(at)?;
    nodes.reverse();
    let scale = Matrix4::new_scaling(meters.unwrap_or(1.0));
    let mut open: Vec<(Node, Matrix4<f64>, usize)> = nodes.into_iter().map(|node| (node, scale, 0)).collect();
    let mut placed = 0;
    while let Some((node, body_from_parent, depth)) = open.pop() {
        placed += 1;
        if depth > MAX_DEPTH || placed > MAX_NODES {
            return Err(at(Error::new("the nodes insert each other in a circle, or too often")));
        }
        let below = reader.node(node, &body_from_parent).map_err(at)?;
        open.extend(below.into_iter().rev().map(|(node, body_from_node)| (node, body_from_node, depth + 1)));
    }
    if reader.mesh.triangles.is_empty() {
        return Err(at(Error::new("no faces").help("check that the visual scene has a mesh of polygons")));
    }
    if reader.skinned {
        in_file.warn(&Error::new("skins and morphs take the shape in which they were bound"));
    }
    let materials = reader.materials.into_slots(&reader.ids).map_err(at)?;
    Ok((Model { mesh: reader.mesh, materials }, up))
}

struct DaeReader<'a, 'd> {
    root: &'a AssetRoot,
    log: &'a dyn Log,
    ids: ById<'a, 'd>,
    /// Geometries that were read, by their ids.
    geometries: BTreeMap<&'a str, DaeGeometry<'a>>,
    materials: DaeMaterials<'a>,
    mesh: MeshData,
    /// Whether a skin or a morph was read.
    skinned: bool,
}

impl<'a, 'd> DaeReader<'a, 'd> {
    /// The element of a name that an instance names.
    fn target(&self, name: &str, instance: Node<'a, 'd>) -> Option<Node<'a, 'd>> {
        target(&self.ids, name, attribute(instance, "url")?)
    }

    /// The nodes of the visual scene, or of the only scene, or of all libraries of nodes.
    fn scene_nodes(&self, document: &'a Document<'d>, collada: Node<'a, 'd>) -> Result<Vec<Node<'a, 'd>>> {
        let instance = only(collada, "scene").and_then(|scene| only(scene, "instance_visual_scene"));
        let any = || document.descendants().find(|node| node.tag_name().name() == "visual_scene");
        let scene = instance.and_then(|instance| self.target("visual_scene", instance)).or_else(any);
        let scene = scene.ok_or_else(|| Error::new("no visual scene").help("export the file again with its scene"))?;
        Ok(children(scene, "node").collect())
    }

    /// Adds the meshes of a node; returns the nodes below it, with their placements.
    fn node(
        &mut self,
        node: Node<'a, 'd>,
        body_from_parent: &Matrix4<f64>,
    ) -> Result<Vec<(Node<'a, 'd>, Matrix4<f64>)>> {
        let mut body_from_node = *body_from_parent;
        let mut below = Vec::new();
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "matrix" => {
                    let m: [f64; 16] = xml::array(element)?;
                    body_from_node *= Matrix4::from_row_slice(&m);
                }
                "translate" => body_from_node *= Translation3::from(xml::array::<3>(element)?).to_homogeneous(),
                "scale" => body_from_node *= Matrix4::new_nonuniform_scaling(&Vector3::from(xml::array::<3>(element)?)),
                "rotate" => body_from_node *= rotation(xml::array(element)?),
                _ => {}
            }
        }
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "node" => below.push((element, body_from_node)),
                "instance_node" => below.extend(self.target("node", element).map(|node| (node, body_from_node))),
                "instance_geometry" => {
                    if let Some(geometry) = self.target("geometry", element) {
                        self.place(geometry, element, &Placement::new(body_from_node))?;
                    }
                }
                "instance_controller" => {
                    if let Some((geometry, bind)) =
                        self.target("controller", element).map(|it| self.bound(it)).transpose()?.flatten()
                    {
                        self.skinned = true;
                        self.place(geometry, element, &Placement::new(body_from_node * bind))?;
                    }
                }
                _ => {}
            }
        }
        Ok(below)
    }

    /// The geometry of a skin or a morph, and the matrix that binds it.
    fn bound(&self, controller: Node<'a, 'd>) -> Result<Option<(Node<'a, 'd>, Matrix4<f64>)>> {
        let mut bind = Matrix4::identity();
        let mut at = controller;
        // A skin may deform a morph.
        for _ in 0..2 {
            let Some(kind) = only(at, "skin").or_else(|| only(at, "morph")) else { break };
            if let Some(matrix) = only(kind, "bind_shape_matrix") {
                bind *= Matrix4::from_row_slice(&xml::array::<16>(matrix)?);
            }
            let Some(source) = attribute(kind, "source").and_then(|source| {
                target(&self.ids, "geometry", source).or_else(|| target(&self.ids, "controller", source))
            }) else {
                return Ok(None);
            };
            at = source;
        }
        Ok((at.tag_name().name() == "geometry").then_some((at, bind)))
    }

    /// Adds a geometry at a placement, with the materials that its instance binds.
    fn place(&mut self, geometry: Node<'a, 'd>, instance: Node<'a, 'd>, placement: &Placement) -> Result<()> {
        let id = attribute(geometry, "id").unwrap_or_default();
        let in_geometry = |error| within(error, format!("geometry `{}`", shorten(id)));
        if !self.geometries.contains_key(id) {
            let read = DaeGeometry::read(geometry, &self.ids, self.root.budget(), self.log).map_err(in_geometry)?;
            self.geometries.insert(id, read);
        }
        let Some(found) = self.geometries.get(id) else { return Ok(()) };
        let bound: BTreeMap<&str, &str> = instance
            .descendants()
            .filter(|node| node.tag_name().name() == "instance_material")
            .filter_map(|node| Some((attribute(node, "symbol")?, attribute(node, "target")?)))
            .collect();
        let mut parts = Vec::new();
        for part in &found.parts {
            let target = part.material.map(|symbol| bound.get(symbol).copied().unwrap_or(symbol));
            let textured = !part.mesh.uvs.is_empty();
            parts.push((&part.mesh, self.materials.slot(target, textured)?));
        }
        for (mesh, slot) in parts {
            let part = Model { mesh: mesh.clone(), materials: Vec::new() }.placed(placement);
            if part.mesh.positions.iter().flatten().any(|x| !x.is_finite()) {
                return Err(in_geometry(Error::new("a node gives a non-finite vertex")));
            }
            let before = Model { mesh: std::mem::take(&mut self.mesh), materials: Vec::new() };
            let first = before.mesh.triangles.len();
            self.mesh = before.with(part, self.root.budget()).map_err(in_geometry)?.mesh;
            self.mesh.slots[first..].fill(slot);
        }
        Ok(())
    }
}

/// A rotation by degrees about an axis.
fn rotation([x, y, z, degrees]: [f64; 4]) -> Matrix4<f64> {
    let Some(axis) = Vector3::new(x, y, z).try_normalize(0.0) else { return Matrix4::identity() };
    // Rodrigues' formula; the library's sine differs between systems.
    let (s, c) = libm::sincos(degrees.to_radians());
    let cross = axis.cross_matrix();
    let turn = nalgebra::Matrix3::identity() + cross * s + cross * cross * (1.0 - c);
    turn.to_homogeneous()
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("COLLADA", &["dae"], read).with_stated_up_axis().with_preference(25)
);
