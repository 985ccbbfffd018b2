//! URDF: the visual meshes and shapes of a robot or an object with joints, as one mesh with all joints at zero.
//!
//! Links follow the tree of joints from its root. Meshes have their own materials, and materials of the file color the
//! rest. As in RViz, the `up_axis` of a COLLADA file is ignored, and its unit is applied.

use super::xml::{self, attribute, children, parse, vector};
use super::{FormatLog, dae, within};
use nalgebra::{Matrix4, Rotation3, Translation3, Vector3};
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_mesh::Model;
use syntable_mesh::format::{MeshFormat, MeshFormats};
use syntable_mesh::image::DecodedImage;
use syntable_mesh::material::default_material;
use syntable_mesh::placement::Placement;
use syntable_mesh::root::AssetRoot;
use syntable_mesh::scan::{extension, name_of};
use syntable_mesh::text::shorten;
use syntable_model::color::srgb_to_linear;
use syntable_model::context::{Collected, Log};
use syntable_model::error::{Error, Result};
use syntable_model::scene::{Alpha, Color, Encoding, Material, Wrap};

mod shapes;

/// Schemes of file names that ROS and Gazebo resolve by packages.
const SCHEMES: [&str; 3] = ["package://", "model://", "file://"];

/// Reads a file of `root`, named relative to it: meters, z up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let text = xml::text(root.read(&path)?, root.budget()).map_err(at)?;
    let document = parse(&text).map_err(at)?;
    let robot = document.root_element();
    if !robot.has_tag_name("robot") {
        return Err(at(Error::new(format!("the document is `<{}>`, not `<robot>`", shorten(robot.tag_name().name())))
            .help("convert xacro files first: `xacro in.xacro > out.urdf`")));
    }
    let mut reader = UrdfReader {
        root,
        folder: file.parent().unwrap_or(Path::new("")),
        path: &path,
        log,
        formats: MeshFormats::linked().map_err(at)?,
        materials: BTreeMap::new(),
        model: None,
        missing: BTreeSet::new(),
    };
    for material in children(robot, "material") {
        if let (Some(name), Some(material)) = (attribute(material, "name"), reader.material(material).map_err(at)?) {
            reader.materials.insert(name.to_owned(), material);
        }
    }
    let links = placed_links(robot).map_err(at)?;
    let has_visual = links.iter().any(|(link, _)| children(*link, "visual").next().is_some());
    let part = if has_visual { "visual" } else { "collision" };
    if !has_visual {
        log.warn(&at(Error::new("no link has a visual part; the object takes its collision parts")));
    }
    for (link, body_from_link) in links {
        let name = shorten(attribute(link, "name").unwrap_or_default());
        for element in children(link, part) {
            reader.add(element, &body_from_link).map_err(|error| at(within(error, format!("link `{name}`"))))?;
        }
    }
    let missing =
        reader.missing.first().map(|name| format!("no link has a mesh that exists: `{}` is missing", shorten(name)));
    reader.model.ok_or_else(|| at(Error::new(missing.unwrap_or_else(|| "no link has a mesh or a shape".to_owned()))))
}

/// The meshes that a file names, relative to the root; nothing if the file is broken, which its reader reports.
pub fn parts(root: &AssetRoot, file: &Path) -> Vec<PathBuf> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let names = || -> Result<Vec<String>> {
        let root = root.clone().within(Default::default());
        let text = xml::text(root.read(&root.locate(file)?)?, root.budget())?;
        let document = parse(&text)?;
        let meshes = document.descendants().filter(|node| node.has_tag_name("mesh"));
        Ok(meshes.filter_map(|mesh| attribute(mesh, "filename")).map(str::to_owned).collect())
    };
    let resolved = |name: String| resolve(root, folder, &name, &Collected::default(), file).ok().flatten();
    names().unwrap_or_default().into_iter().filter_map(resolved).collect()
}

/// The links of a robot with their placements, from the root of the tree of joints.
fn placed_links<'a, 'd>(robot: Node<'a, 'd>) -> Result<Vec<(Node<'a, 'd>, Matrix4<f64>)>> {
    let links: BTreeMap<&str, Node> =
        children(robot, "link").filter_map(|link| Some((attribute(link, "name")?, link))).collect();
    let mut joints: BTreeMap<&str, Vec<(&str, Matrix4<f64>)>> = BTreeMap::new();
    let mut placed: BTreeSet<&str> = BTreeSet::new();
    for joint in children(robot, "joint") {
        let end = |tag| children(joint, tag).next().and_then(|end| attribute(end, "link"));
        let (Some(parent), Some(child)) = (end("parent"), end("child")) else { continue };
        let name = shorten(attribute(joint, "name").unwrap_or_default());
        if !placed.insert(child) {
            return Err(Error::new(format!("joint `{name}`: the link `{}` has two parents", shorten(child))));
        }
        for link in [parent, child] {
            if !links.contains_key(link) {
                return Err(Error::new(format!("joint `{name}` names the missing link `{}`", shorten(link))));
            }
        }
        let origin = origin(joint).map_err(|error| within(error, format!("joint `{name}`")))?;
        joints.entry(parent).or_default().push((child, origin));
    }
    let in_file: Vec<&str> = children(robot, "link").filter_map(|link| attribute(link, "name")).collect();
    let mut open: Vec<(&str, Matrix4<f64>)> =
        in_file.iter().rev().filter(|name| !placed.contains(*name)).map(|name| (*name, Matrix4::identity())).collect();
    let mut found = Vec::new();
    while let Some((name, body_from_link)) = open.pop() {
        if let Some(&link) = links.get(name) {
            found.push((link, body_from_link));
        }
        // A link has one parent at most, so that each is placed once.
        let below = joints.get(name).into_iter().flatten().rev();
        open.extend(below.map(|(child, parent_from_child)| (*child, body_from_link * parent_from_child)));
    }
    match found.is_empty() {
        true => Err(Error::new("no link is the root of the tree of joints")),
        false => Ok(found),
    }
}

/// The transform that the element `origin` states: roll, pitch and yaw about fixed axes, then a translation.
fn origin(of: Node) -> Result<Matrix4<f64>> {
    let Some(origin) = children(of, "origin").next() else { return Ok(Matrix4::identity()) };
    let xyz: [f64; 3] = vector(origin, "xyz")?.unwrap_or_default();
    let [roll, pitch, yaw]: [f64; 3] = vector(origin, "rpy")?.unwrap_or_default();
    let about = |axis: usize, angle: f64| {
        // The library's sine differs between systems.
        let (s, c) = libm::sincos(angle);
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut matrix = nalgebra::Matrix3::identity();
        (matrix[(u, u)], matrix[(u, v)], matrix[(v, u)], matrix[(v, v)]) = (c, -s, s, c);
        Rotation3::from_matrix_unchecked(matrix)
    };
    let rotation = about(2, yaw) * about(1, pitch) * about(0, roll);
    Ok(Translation3::from(xyz).to_homogeneous() * rotation.to_homogeneous())
}

struct UrdfReader<'a> {
    root: &'a AssetRoot,
    folder: &'a Path,
    path: &'a Path,
    log: &'a dyn Log,
    formats: MeshFormats,
    /// Materials of the robot by name.
    materials: BTreeMap<String, Material>,
    model: Option<Model>,
    /// Missing meshes that were reported.
    missing: BTreeSet<String>,
}

impl UrdfReader<'_> {
    /// Adds the geometry of a visual or collision element.
    fn add(&mut self, element: Node, body_from_link: &Matrix4<f64>) -> Result<()> {
        let Some(geometry) = children(element, "geometry").next() else { return Ok(()) };
        let Some(shape) = geometry.children().find(Node::is_element) else { return Ok(()) };
        let mut placement = body_from_link * origin(element)?;
        let model = match shape.tag_name().name() {
            "mesh" => {
                let scale: [f64; 3] = vector(shape, "scale")?.unwrap_or([1.0; 3]);
                placement *= Matrix4::new_nonuniform_scaling(&Vector3::from(scale));
                match self.mesh(shape)? {
                    Some(model) => model,
                    None => return Ok(()),
                }
            }
            "box" => shapes::cuboid(vector(shape, "size")?.ok_or_else(|| Error::new("a box without `size`"))?),
            "sphere" => shapes::sphere(length(shape, "radius")?),
            "cylinder" => shapes::cylinder(length(shape, "radius")?, length(shape, "length")?),
            other => {
                let what = format!("the shape `{}` is not supported, and left out", shorten(other));
                FormatLog { log: self.log, path: self.path }.warn(&Error::new(what));
                return Ok(());
            }
        };
        let model = self.painted(model, element)?.placed(&Placement::new(placement));
        if model.mesh.positions.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::new("a part is not at a finite place"));
        }
        self.model = Some(match self.model.take() {
            Some(before) => before.with(model, self.root.budget())?,
            None => model,
        });
        Ok(())
    }

    /// Reads a mesh; none, after a warning, if its file is missing.
    fn mesh(&mut self, shape: Node) -> Result<Option<Model>> {
        let name = attribute(shape, "filename").ok_or_else(|| Error::new("a mesh without `filename`"))?;
        let log = FormatLog { log: self.log, path: self.path };
        let Some(file) = resolve(self.root, self.folder, name, &log, self.path)? else {
            if self.missing.insert(name.to_owned()) {
                let what = format!("the mesh `{}` is missing; its part of the object is left out", shorten(name));
                log.warn(
                    &Error::new(what).help("copy the folders of meshes that the file names into the pool's folder"),
                );
            }
            return Ok(None);
        };
        match extension(&file).as_str() {
            "urdf" => Err(Error::new(format!("`{}` is not a mesh", shorten(name)))),
            "dae" => dae::read_as_stated(self.root, &file, self.log).map(Some),
            _ => self.formats.read(self.root, &file, self.log).map(Some),
        }
    }

    /// The model with the material of its element, if the model has none of its own.
    fn painted(&mut self, mut model: Model, element: Node) -> Result<Model> {
        let Some(stated) = children(element, "material").next() else { return Ok(model) };
        let own = self.material(stated)?;
        let material = match own {
            Some(material) => Some(material),
            None => attribute(stated, "name").and_then(|name| self.materials.get(name)).cloned(),
        };
        let plain = default_material(false).digest;
        if let Some(material) = material {
            for slot in model.materials.iter_mut().filter(|slot| slot.digest == plain) {
                *slot = material.clone();
            }
        }
        Ok(model)
    }

    /// A material as an element states it; `None` if the element only names it.
    fn material(&self, element: Node) -> Result<Option<Material>> {
        let name = attribute(element, "name").unwrap_or("material");
        let color: Option<[f32; 4]> = match children(element, "color").next() {
            Some(color) => vector(color, "rgba")?,
            None => None,
        };
        let texture = children(element, "texture").next().and_then(|texture| attribute(texture, "filename"));
        if color.is_none() && texture.is_none() {
            return Ok(None);
        }
        let [r, g, b, alpha] = color.unwrap_or([1.0; 4]).map(|x| x.clamp(0.0, 1.0));
        let mut material = Material::plain(name, [r, g, b].map(srgb_to_linear), 0.5);
        if alpha > 0.0 && alpha < 1.0 {
            material.alpha = Alpha::Blend { factor: alpha };
        }
        if let Some(texture) = texture {
            let log = FormatLog { log: self.log, path: self.path };
            match resolve(self.root, self.folder, texture, &log, self.path)? {
                Some(file) => {
                    let file = self.root.locate(&file)?;
                    if let Some(image) = DecodedImage::read_if_known(self.root, &file, |error| log.warn(&error))? {
                        let texture = image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]);
                        material.base_color.texture = Color::texture(Arc::new(texture)).texture;
                    }
                }
                None => {
                    let what = format!("texture `{}` is missing; using a constant color", shorten(texture));
                    log.warn(&Error::new(what));
                }
            }
        }
        Ok(Some(material.with_digest()))
    }
}

/// A positive length.
fn length(shape: Node, name: &str) -> Result<f64> {
    let [length]: [f64; 1] = vector(shape, name)?.ok_or_else(|| Error::new(format!("a shape without `{name}`")))?;
    Ok(length)
}

/// The file behind a name, relative to the root: below a folder with the name of the package, or else in a folder above
/// the file, or else as any name in a file.
fn resolve(root: &AssetRoot, folder: &Path, name: &str, log: &dyn Log, file: &Path) -> Result<Option<PathBuf>> {
    let name = name.trim();
    let inside = |path: PathBuf| path.strip_prefix(root.folder()).map(Path::to_owned).ok();
    let Some((scheme, rest)) = SCHEMES.iter().find_map(|scheme| Some((*scheme, name.strip_prefix(scheme)?))) else {
        let found = root.find(folder, name)?;
        return Ok(found.and_then(|found| inside(found.noted(|note| log.warn(&note.in_file(file))))));
    };
    let (package, path) = rest.split_once('/').unwrap_or(("", rest));
    if scheme != "file://" {
        for above in folder.ancestors() {
            // The package itself is the folder, or is in it.
            let is_package = name_of(above) == package;
            for base in [Some(above.join(package)), is_package.then(|| above.to_owned())].into_iter().flatten() {
                if let Some(found) = root.find(&base, path)?.filter(|found| found.note.is_none()) {
                    return Ok(inside(found.path));
                }
            }
        }
        for above in folder.ancestors() {
            if let Some(found) = root.find(above, path)?.filter(|found| found.note.is_none()) {
                return Ok(inside(found.path));
            }
        }
    }
    // Without the package, the last parts of the path may still name the file.
    let found = root.find(folder, &format!("/{rest}"))?;
    Ok(found.and_then(|found| inside(found.noted(|note| log.warn(&note.in_file(file))))))
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("URDF", &["urdf"], read).with_stated_up_axis().with_preference(50).with_parts(parts)
);
