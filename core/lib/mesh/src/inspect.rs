//! Reports of `syntable check --asset PATH` on meshes and images.
//!
//! A mesh is loaded in the same way as by a source, and its size is checked as by a pool without options.

use crate::format::{ImageFormats, MeshFormats, Unit};
use crate::image::DecodedImage;
use crate::resting::RestingShape;
use crate::root::AssetRoot;
use crate::scan::{extension, name_of};
use crate::size::{self, StatedLengths};
use crate::{ObjectInfo, environment};
use std::path::{Path, PathBuf};
use syntable_convex::StablePose;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::inspect::Inspection;
use syntable_model::scene::{EnvironmentMap, MassOrigin, MassProperties, Object, Topology};

/// Folders of robot descriptions, which have their meshes beside them.
const DESCRIPTIONS: [&str; 3] = ["urdf", "urdfs", "robots"];

/// Stable poses of at least this probability are in a report.
const SHOWN_PROBABILITY: f64 = 0.01;

/// A mesh with more separate parts probably has several objects.
const MAX_PARTS: usize = 2;

/// Inspects a mesh file at a path. The file may refer to files of its own folder; in the layout of Google Scanned
/// Objects, `<name>/meshes/model.obj` next to `<name>/materials`, and of ROS, `<name>/urdf/model.urdf`, to files of the
/// folder above.
pub fn mesh_file(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let folder = folder_of(path);
    let above = folder.parent().filter(|above| *above != Path::new(""));
    match above {
        Some(above) if name_of(folder) == "meshes" && above.join("materials").is_dir() => {
            mesh(&AssetRoot::open(above)?, &Path::new("meshes").join(name_of(path)), log)
        }
        Some(above) if DESCRIPTIONS.contains(&name_of(folder).as_str()) => {
            mesh(&AssetRoot::open(above)?, &Path::new(&name_of(folder)).join(name_of(path)), log)
        }
        _ if folder.is_dir() => mesh(&AssetRoot::open(folder)?, &PathBuf::from(name_of(path)), log),
        _ => Err(Error::new("no such file").in_file(path)),
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Inspects a mesh file, named relative to its root.
pub fn mesh(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Inspection> {
    let formats = MeshFormats::linked()?;
    let shown = root.folder().join(file);
    let model = formats.read(root, file, log)?;
    let format = formats.of_file(file);
    let stated = format.map_or(Unit::METER, |format| (format.unit_of)(file));
    let longest = Aabb::of(model.mesh.positions.iter().map(|p| Point3::from(p.map(f64::from)))).size().max();
    let is_possible = |meters: f64| size::check(longest * meters, StatedLengths::default()).is_ok();
    let usual = format.and_then(|format| format.usual_unit);
    let (meters, unit) = match usual.filter(|unit| !is_possible(stated.meters) && is_possible(unit.meters())) {
        Some(unit) => (unit.meters(), format!("{0}, by its size: a pool needs `units = \"{0}\"`", unit.name())),
        None => (stated.meters, stated.name.to_owned()),
    };
    let model = if meters == 1.0 { model } else { model.scaled(meters) };
    let info = ObjectInfo { name: name_of(file), ..ObjectInfo::default() };
    let (object, topology) = model.into_object(info, &shown, log)?;
    let longest = object.mesh.bounds().size().max();
    size::check(longest, StatedLengths::default()).map_err(|error| error.in_file(&shown))?;
    if let Some(doubt) = size::doubt(longest) {
        log.warn(&doubt.in_file(&shown));
    }
    let parts = topology.significant_parts();
    if parts > MAX_PARTS {
        log.warn(
            &Error::new(format!("{parts} separate parts; the file may hold several objects"))
                .in_file(&shown)
                .help("a pool with `single_part_only = true` excludes it"),
        );
    }
    Ok(describe(&object, &topology).fact("unit", unit))
}

fn describe(object: &Object, topology: &Topology) -> Inspection {
    let mesh = &object.mesh;
    let [x, y, z]: [f64; 3] = mesh.bounds().size().into();
    let mut textures: Vec<_> = object
        .materials
        .iter()
        .flat_map(|material| material.textures())
        .map(|used| used.texture.digest.to_string())
        .collect();
    textures.sort_unstable();
    textures.dedup();
    Inspection::default()
        .fact("triangles", mesh.data().triangles.len())
        .fact("vertices", mesh.data().positions.len())
        .fact("size", format!("{x:.4} x {y:.4} x {z:.4} m"))
        .fact("lowest point", format!("z = {:.4} m", mesh.bounds().min.z))
        .fact("closed", yes_no(topology.is_closed()))
        .fact("parts", topology.significant_parts())
        .fact("volume", format!("{:.4} liter", topology.solid_volume() * 1e3))
        .fact("mass", describe_mass(&object.mass))
        .fact("stable poses", describe_poses(object))
        .fact("texture coordinates", yes_no(!mesh.data().uvs.is_empty()))
        .fact("vertex colors", yes_no(!mesh.data().colors.is_empty()))
        .fact("materials", object.materials.len())
        .fact("textures", textures.len())
        .fact("digest", object.digest)
}

fn describe_mass(mass: &MassProperties) -> String {
    let [x, y, z]: [f64; 3] = mass.center.into();
    let estimated = if mass.origin == MassOrigin::Estimated { " (estimated)" } else { "" };
    format!("{:.3} kg{estimated}, center at ({x:.4}, {y:.4}, {z:.4}) m", mass.kg)
}

/// The stable poses of an object, most probable first: probability, and the direction of its file that points up.
fn describe_poses(object: &Object) -> String {
    let poses = RestingShape::of(object).poses;
    let (shown, rare): (Vec<_>, Vec<_>) = poses.iter().partition(|pose| pose.probability >= SHOWN_PROBABILITY);
    let mut lines: Vec<String> = shown
        .iter()
        .map(|StablePose { up: [x, y, z], probability, .. }| {
            format!("{probability:.3} with ({x:.3}, {y:.3}, {z:.3}) up")
        })
        .collect();
    if !rare.is_empty() {
        let all: f64 = rare.iter().map(|pose| pose.probability).sum();
        lines.push(format!("{all:.3} in {} others", rare.len()));
    }
    lines.join(", ")
}

fn yes_no(yes: bool) -> &'static str {
    if yes { "yes" } else { "no" }
}

/// Inspects an image file: a texture or an environment map, depending on its extension.
pub fn image_file(path: &Path, _: &dyn Log) -> Result<Inspection> {
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(Error::new("no such file").in_file(path));
    }
    let root = AssetRoot::open(folder)?;
    if ImageFormats::linked()?.radiance_extensions().contains(&extension(path).as_str()) {
        environment::read(&root, path).map(|map| describe_environment(&map))
    } else {
        DecodedImage::read(&root, path).map(|image| describe_image(&image))
    }
}

fn describe_image(image: &DecodedImage) -> Inspection {
    Inspection::default()
        .fact("size", format!("{} x {}", image.width, image.height))
        .fact("kind", &image.kind)
        .fact("alpha", yes_no(image.has_alpha()))
}

fn describe_environment(map: &EnvironmentMap) -> Inspection {
    // The mean over all texels and channels with equal weight, as image viewers report it.
    let channels = map.texels().as_flattened();
    let mean = channels.iter().map(|&x| f64::from(x)).sum::<f64>() / channels.len() as f64;
    Inspection::default()
        .fact("size", format!("{} x {}", map.width(), map.height()))
        .fact("mean radiance", format!("{mean:.3}"))
        .fact("largest radiance", format!("{:.1}", channels.iter().fold(0.0, |max: f32, &x| max.max(x))))
        .fact("digest", map.digest)
}
