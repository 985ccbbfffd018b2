//! `bop_models`: models in the layout of the BOP benchmark: `models/obj_NNNNNN.ply` in millimeters with
//! `models_info.json`.

use super::keypoints::with_keypoints;
use super::nothing_found;
use crate::bop_files::{MILLIMETER_M, model_id};
use crate::formats::ply;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syntable_mesh::ObjectInfo;
use syntable_mesh::format::MeshFormats;
use syntable_mesh::root::{AssetRoot, exists, read_file};
use syntable_mesh::scan::{is_dir, list, name_of};
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, CatalogEntry, Object, Symmetries};
use syntable_model::stage::AssetLimits;

/// Models of BOP datasets (Hodaň et al.): `<dataset>/models/obj_000001.ply` and so on, in millimeters, with vertex
/// colors or a texture. `root` holds the datasets, or is one dataset, or is its folder of models. Names are
/// `<dataset>/obj_000001`, the category is the dataset. The boxes of `models_info.json` are compared with the meshes.
///
/// Mesh files of other names or formats beside them, such as `obj_000001.glb`, are left out, and a warning names them: the
/// formats differ in units and axes, and so would the poses of the benchmark.
///
/// Objects keep the numbers of their files: `obj_000005.ply` has the `obj_id` 5. Models of several datasets may share a
/// number. If a writer needs unique numbers, use one dataset per pool and recipe, or set numbers with the pool's `ids`
/// or `first_id`. The writer `bop` gets the symmetries of `models_info.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BopModels {
    /// Folder of the datasets.
    root: AssetPath,
    /// Folder of the meshes within each dataset, such as `models` or T-LESS's `models_cad`.
    #[serde(default = "models_folder")]
    models_folder: String,
    /// Datasets to exclude, such as `ycbv` to keep YCB objects for testing.
    #[serde(default)]
    exclude_datasets: Vec<String>,
    #[serde(skip)]
    limits: AssetLimits,
}

fn models_folder() -> String {
    "models".into()
}

/// The file with the models' boxes.
pub(crate) const INFO: &str = "models_info.json";
/// Maximum distance of a box from the stated one, as a fraction of its diagonal.
const TOLERANCE: f64 = 0.01;

impl Config for BopModels {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "bop_models";
    const EXAMPLE: &'static str = "root = \"${ASSETS}/bop\"\nexclude_datasets = [\"ycbv\"]";
    fn build(self) -> Result<Box<dyn AssetSource>, ConfigError> {
        let folder = &self.models_folder;
        if folder.is_empty() || folder.contains(['/', '\\']) || folder.starts_with('.') {
            return Err(ConfigError::new("models_folder", format!("`{folder}` is not the name of a single folder")));
        }
        Ok(Box::new(self))
    }
}

impl AssetSource for BopModels {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.limits = limits;
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        let root = AssetRoot::open(self.root.path())?;
        let datasets = self.datasets(&root)?;
        let unknown = self.exclude_datasets.iter().find(|name| !datasets.contains_key(*name));
        if let Some(name) = unknown {
            log.warn(
                &Error::new(format!("exclude_datasets names `{name}`, which does not exist"))
                    .in_file(root.folder())
                    .help(format!("existing datasets: {}", datasets.keys().cloned().collect::<Vec<_>>().join(", "))),
            );
        }
        let mut entries = Vec::new();
        for folder in self.without_models(&root, &datasets)? {
            warn_of_others(&folder, &BTreeMap::new(), log)?;
        }
        for (dataset, folder) in datasets {
            if self.exclude_datasets.contains(&dataset) {
                continue;
            }
            let folder = root.folder().join(folder);
            let models = models_in(&folder)?;
            warn_of_others(&folder, &models, log)?;
            for (id, _) in read_info(&folder)?.unwrap_or_default() {
                if !models.contains_key(&id) {
                    log.warn(&missing_model(&folder, id));
                }
            }
            let entry = |(id, name): (u64, String)| CatalogEntry {
                // BOP's formats have no number for a file `obj_000000.ply`.
                obj_id: u32::try_from(id).ok().filter(|id| *id > 0),
                ..CatalogEntry::new(format!("{dataset}/{name}"), &dataset)
            };
            entries.extend(models.into_iter().map(entry));
        }
        if entries.is_empty() {
            return Err(nothing_found(&root, &format!("`<dataset>/{}/obj_NNNNNN.ply`", self.models_folder)));
        }
        entries.sort();
        Ok(Catalog { entries })
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let root = AssetRoot::open(self.root.path())?.within(self.limits);
        let unknown = || Error::new(format!("no model `{name}`")).in_file(root.folder());
        let (dataset, model) = name.rsplit_once('/').ok_or_else(unknown)?;
        let folder = self.datasets(&root)?.remove(dataset).ok_or_else(unknown)?;
        let info = ObjectInfo { name: name.to_owned(), category: dataset.to_owned(), license: String::new() };
        load(&root, &folder, model, info, log).map(Asset::from)
    }
}

impl BopModels {
    /// Datasets by name, with their folders of models relative to the root.
    fn datasets(&self, root: &AssetRoot) -> Result<BTreeMap<String, PathBuf>> {
        let folder = root.folder();
        let canonical = folder.canonicalize().map_err(|error| Error::io(folder, &error))?;
        if is_models(folder)? {
            let above = canonical.parent().map(name_of).filter(|_| name_of(&canonical) == self.models_folder);
            return Ok([(above.unwrap_or_else(|| name_of(&canonical)), PathBuf::new())].into());
        }
        let models = Path::new(&self.models_folder);
        if is_models(&folder.join(models))? {
            return Ok([(name_of(&canonical), models.to_owned())].into());
        }
        let mut datasets = BTreeMap::new();
        for name in list(folder)?.folders {
            let path = Path::new(&name).join(models);
            if is_models(&folder.join(&path))? {
                datasets.insert(name, path);
            }
        }
        Ok(datasets)
    }

    /// Folders of models without a file named as in BOP, in datasets that are not excluded.
    fn without_models(&self, root: &AssetRoot, datasets: &BTreeMap<String, PathBuf>) -> Result<Vec<PathBuf>> {
        // The root itself is a dataset, or its folder of models.
        if datasets.values().any(|folder| folder.components().count() < 2) {
            return Ok(Vec::new());
        }
        let mut folders = Vec::new();
        for name in list(root.folder())?.folders {
            let folder = root.folder().join(&name).join(&self.models_folder);
            if !datasets.contains_key(&name) && !self.exclude_datasets.contains(&name) && is_dir(&folder)? {
                folders.push(folder);
            }
        }
        Ok(folders)
    }
}

/// Number of files that one warning names.
const SHOWN: usize = 3;

/// Warns about the mesh files of a folder that are not among its models. The same name in another format is the same
/// object.
fn warn_of_others(folder: &Path, models: &BTreeMap<u64, String>, log: &dyn Log) -> Result<()> {
    let formats = MeshFormats::linked()?;
    let is_other = |name: &String| {
        let path = Path::new(name);
        let is_read = model_id(name).is_some()
            || path.file_stem().is_some_and(|stem| models.values().any(|model| stem == model.as_str()));
        !is_read && formats.of_file(path).is_some()
    };
    let others: Vec<String> = list(folder)?.files.into_iter().filter(is_other).collect();
    if others.is_empty() {
        return Ok(());
    }
    let names = others.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let more = if others.len() > SHOWN { ", …" } else { "" };
    let count = others.len();
    let files = if count == 1 { "mesh file is" } else { "mesh files are" };
    log.warn(
        &Error::new(format!("{count} {files} not named `obj_NNNNNN.ply` and skipped: {names}{more}"))
            .in_file(folder)
            .help("save each as PLY in millimeters under its number, or read the folder with the kind `mesh_folder`"),
    );
    Ok(())
}

/// Whether a folder holds BOP models.
pub(crate) fn is_models(folder: &Path) -> Result<bool> {
    if exists(&folder.join(INFO))? {
        return Ok(true);
    }
    Ok(is_dir(folder)? && list(folder)?.files.iter().any(|name| model_id(name).is_some()))
}

/// Models of a folder by number, with their names.
pub(crate) fn models_in(folder: &Path) -> Result<BTreeMap<u64, String>> {
    let models = list(folder)?.files.into_iter();
    Ok(models.filter_map(|name| Some((model_id(&name)?, name.trim_end_matches(".ply").to_owned()))).collect())
}

pub(crate) fn missing_model(folder: &Path, id: u64) -> Error {
    Error::new(format!("{INFO} names object {id}, but its file is missing"))
        .in_file(folder.join(format!("obj_{id:06}.ply")))
        .help(format!("add the model, or remove the object from {INFO}"))
}

/// Loads a model of a folder relative to the root, and compares it with `models_info.json`.
pub(crate) fn load(root: &AssetRoot, folder: &Path, model: &str, info: ObjectInfo, log: &dyn Log) -> Result<Object> {
    let file = folder.join(format!("{model}.ply"));
    let path = root.folder().join(&file);
    let (object, _) = ply::read(root, &file, log)?.scaled(MILLIMETER_M).into_object(info, &path, log)?;
    let mut object = with_keypoints(object, root, &file)?;
    let mut info = read_info(&root.folder().join(folder))?.unwrap_or_default();
    let stated = model_id(&format!("{model}.ply")).and_then(|id| info.remove(&id));
    let Some(BopModelInfo { bounds: stated, symmetries }) = stated else { return Ok(object) };
    let found = object.mesh.bounds();
    let apart = (found.min - stated.min).norm().max((found.max - stated.max).norm());
    if apart > TOLERANCE * stated.diagonal() {
        log.warn(
            &Error::new(format!("the mesh is {} mm, but {INFO} states {} mm", sizes(&found), sizes(&stated)))
                .in_file(path)
                .help("check that the mesh is in millimeters"),
        );
    }
    match symmetries {
        Ok(symmetries) => object.model.symmetries = symmetries,
        Err(problem) => log.warn(
            &Error::new(format!("the symmetries of {model} are ignored: {problem}"))
                .in_file(root.folder().join(folder).join(INFO))
                .help("see the BOP format of models_info.json"),
        ),
    }
    Ok(object)
}

fn sizes(bounds: &Aabb) -> String {
    bounds.size().iter().map(|x| format!("{:.1}", x / MILLIMETER_M)).collect::<Vec<_>>().join(" x ")
}

/// Entry of a model in `models_info.json`.
pub(crate) struct BopModelInfo {
    /// Box of the mesh, meters.
    bounds: Aabb,
    /// Symmetries, or their fault.
    symmetries: std::result::Result<Symmetries, String>,
}

/// Entries of `models_info.json` by number; `None` without the file.
pub(crate) fn read_info(folder: &Path) -> Result<Option<BTreeMap<u64, BopModelInfo>>> {
    let path = folder.join(INFO);
    if exists(&path)? { parse_info(&path).map(Some) } else { Ok(None) }
}

/// Reads a file like `models_info.json`.
pub(crate) fn parse_info(path: &Path) -> Result<BTreeMap<u64, BopModelInfo>> {
    let bytes = read_file(path)?;
    let wrong = |message: String| Error::new(message).in_file(path);
    let json: Value = serde_json::from_slice(&bytes)
        .map_err(|error| wrong(format!("invalid JSON: {error}")).at_line(error.line().max(1)))?;
    let Value::Object(objects) = json else {
        return Err(wrong("not a table of objects".into()));
    };
    let mut info = BTreeMap::new();
    for (key, value) in &objects {
        let id: u64 = key.parse().map_err(|_| wrong(format!("`{key}` is not an object's number")))?;
        let number = |name: &str| {
            value.get(name).and_then(Value::as_f64).filter(|x| x.is_finite()).ok_or_else(|| {
                wrong(format!("object {id} has no number `{name}`")).help("see the BOP format of models_info.json")
            })
        };
        if number("diameter")? <= 0.0 {
            return Err(wrong(format!("object {id} has the diameter {}", number("diameter")?)));
        }
        let min = [number("min_x")?, number("min_y")?, number("min_z")?];
        let size = [number("size_x")?, number("size_y")?, number("size_z")?];
        let min = Point3::from(min.map(|x| x * MILLIMETER_M));
        let max = Point3::from([0, 1, 2].map(|i| min[i] + size[i] * MILLIMETER_M));
        let symmetries = Symmetries::deserialize(value).map_err(|error| error.to_string());
        info.insert(id, BopModelInfo { bounds: Aabb { min, max }, symmetries });
    }
    Ok(info)
}

syntable_model::register!(BopModels);
