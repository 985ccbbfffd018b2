//! Folders and JSON files that `syntable check --asset PATH` can inspect. Single meshes and images are inspected by
//! their formats.

use crate::sources::bop_models::{self, INFO};
use crate::sources::collision;
use crate::sources::layouts::{scanned_mesh, ycb_mesh};
use crate::sources::pbr_folder;
use crate::sources::ycb::Reconstruction;
use std::path::{Path, PathBuf};
use syntable_mesh::foreign;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::{AssetRoot, read_file};
use syntable_mesh::scan::{extension, list, name_of};
use syntable_mesh::size::{self, StatedLengths};
use syntable_mesh::{ObjectInfo, inspect};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::inspect::{Inspection, Inspector};

syntable_model::register_inspector!(
    Inspector { name: "BOP models", accepts: is_bop, inspect: inspect_bop },
    Inspector {
        name: "JSON file",
        accepts: |path| extension(path) == "json" && !path.is_dir() && !is_bop(path),
        inspect: inspect_json
    },
    Inspector { name: "PBR material folder", accepts: is_material, inspect: inspect_material },
    Inspector { name: "mesh of a format to convert", accepts: is_foreign, inspect: refuse_foreign },
    Inspector { name: "folder of one mesh", accepts: |path| mesh_in_folder(path).is_some(), inspect: inspect_mesh },
);

fn foreign_refusal(path: &Path) -> Option<Error> {
    foreign::refusal(path, &MeshFormats::linked().ok()?.extensions())
}

fn is_foreign(path: &Path) -> bool {
    path.is_file() && foreign_refusal(path).is_some()
}

fn refuse_foreign(path: &Path, _: &dyn Log) -> Result<Inspection> {
    Err(foreign_refusal(path).unwrap_or_else(|| Error::new("not a mesh").in_file(path)))
}

fn is_bop(path: &Path) -> bool {
    if path.is_dir() {
        [path.to_owned(), path.join("models")].iter().any(|folder| bop_models::is_models(folder).unwrap_or(false))
    } else {
        name_of(path) == INFO
    }
}

fn is_material(path: &Path) -> bool {
    !is_bop(path) && mesh_in_folder(path).is_none() && pbr_folder::has_maps(path).unwrap_or(false)
}

/// The mesh of a folder, relative to it: in the layout of Google Scanned Objects or YCB, or the only mesh file.
fn mesh_in_folder(folder: &Path) -> Option<PathBuf> {
    if !folder.is_dir() {
        return None;
    }
    if let Ok(Some(scanned)) = scanned_mesh(folder) {
        return Some(scanned.to_owned());
    }
    if let Ok(Some(mesh)) = ycb_mesh(folder, Reconstruction::default().folder()) {
        return Some(mesh);
    }
    if is_bop(folder) {
        return None;
    }
    let (formats, root) = (MeshFormats::linked().ok()?, AssetRoot::open(folder).ok()?);
    let extensions = formats.extensions();
    let listing = list(folder).ok()?;
    let files: Vec<PathBuf> = listing.files.iter().map(PathBuf::from).collect();
    let parts = |file: &PathBuf| formats.of_file(file).map_or(Vec::new(), |format| (format.parts)(&root, file));
    let parts: Vec<PathBuf> = files.iter().flat_map(parts).collect();
    let is_mesh = |file: &&PathBuf| extensions.contains(&extension(file).as_str()) && !parts.contains(file);
    let meshes: Vec<&PathBuf> = files.iter().filter(is_mesh).collect();
    let stems: Vec<PathBuf> = meshes.iter().map(|file| file.with_extension("")).collect();
    let rules = collision::rules(stems.iter().map(PathBuf::as_path), std::iter::empty());
    let objects: Vec<&PathBuf> =
        meshes.into_iter().zip(rules).filter(|(_, rule)| rule.is_none()).map(|(file, _)| file).collect();
    if let [only] = objects[..] { Some(only.clone()) } else { None }
}

fn inspect_mesh(folder: &Path, log: &dyn Log) -> Result<Inspection> {
    let mesh = mesh_in_folder(folder).ok_or_else(|| Error::new("no mesh in this folder").in_file(folder))?;
    inspect::mesh(&AssetRoot::open(folder)?, &mesh, log)
}

fn inspect_material(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let material = pbr_folder::read(&AssetRoot::open(path)?, &name_of(path), log)?;
    let mut found = Inspection::default();
    for (map, files) in pbr_folder::maps(path)? {
        if let Some(file) = files.first() {
            found = found.fact(map.name(), file.display());
        }
    }
    if let Some(color) = &material.base_color.texture {
        found = found.fact("size", format!("{} x {}", color.texture.width, color.texture.height));
    }
    Ok(found.fact("digest", material.digest))
}

fn inspect_bop(path: &Path, log: &dyn Log) -> Result<Inspection> {
    let folder = if !path.is_dir() {
        match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        }
    } else if bop_models::is_models(path)? {
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
    let mut found = Inspection::default().fact("models", models.len());
    for model in models.values() {
        let info = ObjectInfo { name: model.clone(), ..ObjectInfo::default() };
        // Each model is an asset with its own limits.
        let root = AssetRoot::open(&folder)?;
        let object = bop_models::load(&root, Path::new(""), model, info, log)?;
        size::check(object.mesh.bounds().size().max(), StatedLengths::default())
            .map_err(|error| error.in_file(folder.join(format!("{model}.ply"))))?;
        let [x, y, z]: [f64; 3] = object.mesh.bounds().size().into();
        let triangles = object.mesh.data().triangles.len();
        found = found.fact(model, format!("{triangles} triangles, {x:.4} x {y:.4} x {z:.4} m"));
    }
    Ok(found)
}

fn inspect_json(path: &Path, _: &dyn Log) -> Result<Inspection> {
    let json: serde_json::Value = serde_json::from_slice(&read_file(path)?)
        .map_err(|error| Error::new(format!("invalid JSON: {error}")).in_file(path).at_line(error.line().max(1)))?;
    let holds = match &json {
        serde_json::Value::Object(table) => format!("a table of {} keys", table.len()),
        serde_json::Value::Array(items) => format!("a list of {} items", items.len()),
        _ => "one value".into(),
    };
    Ok(Inspection::default().fact("holds", holds))
}
