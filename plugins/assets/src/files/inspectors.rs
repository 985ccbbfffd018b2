//! What `syntable check --asset PATH` can look at.
//!
//! An inspector loads its asset as a source would, checks the extent with no scale applied, and says what it found.

use crate::files::formats::environment;
use crate::files::formats::picture::Picture;
use crate::files::formats::ply;
use crate::files::object::{Identity, finish};
use crate::files::root::{AssetRoot, read_file};
use crate::files::scan::{extension, list, name_of};
use crate::files::sources::bop_models::{self, INFO, MILLIMETRE};
use crate::files::sources::ycb::{Reconstruction, mesh_in};
use crate::files::sources::{MESH_EXTENSIONS, google_scanned_objects, pbr_folder, read_mesh};
use std::path::{Path, PathBuf};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::inspect::{Inspection, Inspector};
use syntable_model::scene::{EXTENT_M, Material, Object, Topology};

syntable_model::register_inspector!(
    Inspector { name: "BOP models", accepts: is_bop, inspect: inspect_bop },
    Inspector { name: "JSON file", accepts: |path| has(path, &["json"]) && !is_bop(path), inspect: inspect_json },
    Inspector {
        name: "OBJ mesh",
        accepts: |path| has(path, &["obj"]) || scanned(path).is_some(),
        inspect: inspect_mesh
    },
    Inspector { name: "PBR material folder", accepts: is_material, inspect: inspect_material },
    Inspector { name: "PLY mesh", accepts: |path| has(path, &["ply"]), inspect: inspect_mesh },
    Inspector { name: "STL mesh", accepts: |path| has(path, &["stl"]), inspect: inspect_mesh },
    Inspector { name: "environment map", accepts: |path| has(path, &["hdr", "exr"]), inspect: inspect_environment },
    Inspector { name: "glTF mesh", accepts: |path| has(path, &["glb", "gltf"]), inspect: inspect_mesh },
    Inspector { name: "mesh folder", accepts: |path| mesh_of(path).is_some(), inspect: inspect_mesh },
    Inspector {
        name: "picture",
        accepts: |path| pbr_folder::is_picture(path) && !path.is_dir(),
        inspect: inspect_picture
    },
);

/// A model of more separate parts holds several things.
const MAX_PARTS: usize = 2;

fn has(path: &Path, extensions: &[&str]) -> bool {
    extensions.contains(&extension(path).as_str()) && !path.is_dir()
}

fn is_bop(path: &Path) -> bool {
    if path.is_dir() {
        bop_models::is_models(path) || bop_models::is_models(&path.join("models"))
    } else {
        name_of(path) == INFO
    }
}

fn is_material(path: &Path) -> bool {
    !is_bop(path) && scanned(path).is_none() && mesh_of(path).is_none() && pbr_folder::has_maps(path)
}

/// The mesh of a folder in the layout of Google Scanned Objects or YCB, relative to it.
fn scanned(folder: &Path) -> Option<PathBuf> {
    if !folder.is_dir() {
        return None;
    }
    let gso = Path::new(google_scanned_objects::MESH);
    if folder.join(gso).exists() { Some(gso.to_owned()) } else { mesh_in(folder, Reconstruction::default()) }
}

/// The one mesh that lies in a folder.
fn mesh_of(folder: &Path) -> Option<PathBuf> {
    if !folder.is_dir() || is_bop(folder) || scanned(folder).is_some() {
        return None;
    }
    let is_mesh = |name: &&String| MESH_EXTENSIONS.contains(&extension(Path::new(name)).as_str());
    let listing = list(folder).ok()?;
    let meshes: Vec<&String> = listing.files.iter().filter(is_mesh).collect();
    if let [only] = meshes[..] { Some(PathBuf::from(only)) } else { None }
}

/// The folder that a mesh may read from, and the mesh relative to it. In the layout of Google Scanned Objects,
/// `<name>/meshes/model.obj`, that is the object's folder; else the mesh's own.
fn place(path: &Path) -> Result<(AssetRoot, PathBuf)> {
    if let Some(mesh) = scanned(path).or_else(|| mesh_of(path)) {
        return Ok((AssetRoot::open(path)?, mesh));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let above = folder.parent().filter(|above| *above != Path::new(""));
    match above {
        Some(above) if name_of(folder) == "meshes" && above.join("materials").is_dir() => {
            Ok((AssetRoot::open(above)?, Path::new("meshes").join(name_of(path))))
        }
        _ if folder.is_dir() => Ok((AssetRoot::open(folder)?, PathBuf::from(name_of(path)))),
        _ => Err(Error::new("no such file").in_file(path)),
    }
}

fn inspect_mesh(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let (root, file) = place(path)?;
    let shown = root.folder().join(&file);
    let identity = Identity { name: name_of(path), ..Identity::default() };
    let (unit, (object, topology)) = if extension(&file) == "ply" {
        let model = ply::read(&root, &file, log)?;
        let widest = |axis: usize| {
            let values = || model.mesh.positions.iter().map(|p| f64::from(p[axis]));
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        let extent = (0..3).map(widest).fold(0.0, f64::max);
        // PLY has no unit. BOP counts in millimetres; and a thing of the household is not hundred metres wide.
        let millimetres = bop_models::model_id(&name_of(&file)).is_some()
            || (extent > *EXTENT_M.end() && extent * MILLIMETRE <= *EXTENT_M.end());
        let (unit, factor) = if millimetres { ("millimetre, as in BOP", MILLIMETRE) } else { ("metre", 1.0) };
        (unit, finish(model.scaled(factor), identity, &shown, log)?)
    } else {
        ("metre", finish(read_mesh(&root, &file, log)?, identity, &shown, log)?)
    };
    object.check_extent().map_err(|error| error.in_file(&shown))?;
    warn_of_parts(&topology, &shown, log);
    Ok(describe(&object, &topology).fact("unit", unit))
}

fn warn_of_parts(topology: &Topology, file: &Path, log: &dyn Log) {
    let parts = topology.significant_parts();
    if parts > MAX_PARTS {
        log.warn(
            &Error::new(format!("{parts} separate parts; it may hold several things"))
                .in_file(file)
                .help("a pool with `exclude_multi_part = true` leaves it out"),
        );
    }
}

fn describe(object: &Object, topology: &Topology) -> Inspection {
    let mesh = &object.mesh;
    let [x, y, z]: [f64; 3] = mesh.bounds().size().into();
    let yes = |yes: bool| if yes { "yes" } else { "no" };
    let mut textures: Vec<_> = object.materials.iter().flat_map(|material| textures_of(material)).collect();
    textures.sort_unstable();
    textures.dedup();
    Inspection::default()
        .fact("triangles", mesh.data().triangles.len())
        .fact("vertices", mesh.data().positions.len())
        .fact("size", format!("{x:.4} x {y:.4} x {z:.4} m"))
        .fact("lowest point", format!("z = {:.4} m", mesh.bounds().min.z))
        .fact("closed", yes(topology.is_closed()))
        .fact("parts", topology.significant_parts())
        .fact("volume", format!("{:.4} litre", topology.solid_volume() * 1e3))
        .fact("mass", format!("{:.3} kg", object.mass_kg))
        .fact("texture coordinates", yes(!mesh.data().uvs.is_empty()))
        .fact("vertex colours", yes(!mesh.data().colors.is_empty()))
        .fact("materials", object.materials.len())
        .fact("textures", textures.len())
        .fact("digest", object.digest)
}

fn textures_of(material: &Material) -> Vec<String> {
    material.textures().map(|reference| reference.texture.digest.to_string()).collect()
}

fn inspect_material(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let material = pbr_folder::read(&AssetRoot::open(path)?, &name_of(path), log)?;
    let mut found = Inspection::default();
    for (map, files) in pbr_folder::maps(path)? {
        if let Some(file) = files.first() {
            found = found.fact(map.name(), file.display());
        }
    }
    if let Some(colour) = &material.base_color.texture {
        found = found.fact("size", format!("{} x {}", colour.texture.width, colour.texture.height));
    }
    Ok(found.fact("digest", material.digest))
}

fn inspect_bop(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let folder = if !path.is_dir() {
        match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        }
    } else if bop_models::is_models(path) {
        path.to_owned()
    } else {
        path.join("models")
    };
    let info = if path.is_dir() { bop_models::read_info(&folder)? } else { Some(bop_models::parse_info(path)?) };
    let models = bop_models::models_in(&folder)?;
    for id in info.iter().flatten().map(|(id, _)| *id) {
        if !models.contains_key(&id) {
            return Err(bop_models::missing_model(&folder, id));
        }
    }
    if info.is_none() {
        log.warn(&Error::new(format!("no {INFO}; sizes cannot be checked")).in_file(&folder));
    }
    let root = AssetRoot::open(&folder)?;
    let mut found = Inspection::default().fact("models", models.len());
    for model in models.values() {
        let identity = Identity { name: model.clone(), ..Identity::default() };
        let object = bop_models::load(&root, Path::new(""), model, identity, log)?;
        object.check_extent().map_err(|error| error.in_file(folder.join(format!("{model}.ply"))))?;
        let [x, y, z]: [f64; 3] = object.mesh.bounds().size().into();
        let triangles = object.mesh.data().triangles.len();
        found = found.fact(model, format!("{triangles} triangles, {x:.4} x {y:.4} x {z:.4} m"));
    }
    Ok(found)
}

fn inspect_picture(path: &Path, _: &dyn Log) -> Result<Inspection> {
    let picture = Picture::read(path)?;
    Ok(Inspection::default()
        .fact("size", format!("{} x {}", picture.width, picture.height))
        .fact("kind", &picture.kind)
        .fact("alpha", if picture.has_alpha() { "yes" } else { "no" }))
}

fn inspect_environment(path: &Path, _: &dyn Log) -> Result<Inspection> {
    let map = environment::read(path)?;
    // Every texel and channel counted alike, as other programs do.
    let channels = map.texels().as_flattened();
    let mean = channels.iter().map(|&x| f64::from(x)).sum::<f64>() / channels.len() as f64;
    Ok(Inspection::default()
        .fact("size", format!("{} x {}", map.width(), map.height()))
        .fact("mean radiance", format!("{mean:.3}"))
        .fact("largest radiance", format!("{:.1}", channels.iter().fold(0.0, |max: f32, &x| max.max(x))))
        .fact("digest", map.digest))
}

fn inspect_json(path: &Path, _: &dyn Log) -> Result<Inspection> {
    let json: serde_json::Value = serde_json::from_slice(&read_file(path)?)
        .map_err(|error| Error::new(format!("not sound JSON: {error}")).in_file(path).at_line(error.line().max(1)))?;
    let holds = match &json {
        serde_json::Value::Object(table) => format!("a table of {} keys", table.len()),
        serde_json::Value::Array(items) => format!("a list of {} items", items.len()),
        _ => "one value".into(),
    };
    Ok(Inspection::default().fact("holds", holds))
}
