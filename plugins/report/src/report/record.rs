//! What the folder of a run says beyond its images: recipe, outcome of scenes, times, licenses, and glTF files.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetFolder, Reach, read_small};
use syntable_model::product::standard::OBJECT_INFO;
use syntable_model::product::{PerInstance, Value};
use syntable_model::reader::DatasetReader;
use syntable_model::stage::RESERVED;
use syntable_runtime::run::folder::{journal_path, times_path};
use syntable_runtime::run::journal::{Journal, JournalEntry};
use syntable_runtime::run::times::RunTimes;

/// Folders between that of a run and an annotation file, such as `coco/annotations/instances_train.json`.
const WITHIN_RUN: usize = 3;
/// Most bytes of the JSON in a glTF file.
const MAX_JSON: u32 = 64 << 20;

/// What is known of how a dataset was made. Of a dataset of another program that is little.
#[derive(Debug, Default)]
pub struct Record {
    /// The resolved recipe; empty if there is none.
    pub recipe: String,
    /// The same as a table.
    pub table: toml::Table,
    /// The scenes of the run.
    pub journal: BTreeMap<u32, JournalEntry>,
    /// What runs took.
    pub times: Vec<RunTimes>,
    /// What of these records cannot be read: sentences.
    pub damaged: Vec<String>,
    /// glTF files by scene.
    pub models: BTreeMap<u32, PathBuf>,
}

/// An origin of assets: a pool of the recipe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoolView {
    /// Its name.
    pub name: String,
    /// Kind of its source.
    pub kind: String,
    /// Folder of its files; empty where there are none.
    pub folder: String,
    /// Distinct assets that were used.
    pub assets: usize,
    /// Licenses, each with the number of assets, and what is not known.
    pub licenses: Vec<LicenseCount>,
}

/// How many assets have a license.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LicenseCount {
    /// What the asset's file or source says of it: the license, and whom to attribute.
    pub license: String,
    /// Number of assets.
    pub assets: usize,
    /// Their names.
    pub names: Vec<String>,
}

/// Licenses by `pool/name`; of materials, whose pool a glTF file does not say, by `/name`.
pub type Licenses = BTreeMap<String, String>;

impl Record {
    /// Reads what the folder of a run has; nothing of a folder that no run made.
    pub fn of(dataset: &Path) -> Self {
        let Some(root) = run_of(dataset) else { return Self::default() };
        // Somebody else may have made it: what is no file of its own is not read.
        let Ok(folder) = DatasetFolder::open(&root, Reach::Inside) else { return Self::default() };
        let recipe = folder.file(RESERVED[1]).ok().and_then(|path| String::from_utf8(read_small(&path).ok()?).ok());
        let recipe = recipe.unwrap_or_default();
        let table: toml::Table = recipe.parse().unwrap_or_default();
        let mut damaged = Vec::new();
        let mut note = |path: &Path, what: String| damaged.push(format!("{}: {what}", path.display()));
        let own = |path: &Path| folder.has(path.strip_prefix(&root).unwrap_or(path)) || !path.exists();
        let path = journal_path(&root);
        let (mut journal, mut times) = (BTreeMap::new(), Vec::new());
        if own(&path) && own(&times_path(&root)) {
            let faults;
            (journal, faults) =
                Journal::readable(&path).unwrap_or_else(|error| (BTreeMap::new(), vec![error.to_string()]));
            faults.into_iter().for_each(|fault| note(&path, fault));
            times = RunTimes::of_dataset(&root).unwrap_or_else(|error| {
                note(&root, error.to_string());
                Vec::new()
            });
        } else {
            note(&path, "it or what is beside it is no file of the dataset, and is not read".to_owned());
        }
        let models = models(&folder, &table, journal.keys().copied());
        Self { times, recipe, table, journal, damaged, models }
    }

    /// A value of the recipe as text: `dataset.seed`.
    pub fn value(&self, keys: &[&str]) -> Option<String> {
        let (last, tables) = keys.split_last()?;
        let table = tables.iter().try_fold(&self.table, |table, key| table.get(*key)?.as_table())?;
        Some(match table.get(*last)? {
            toml::Value::String(text) => text.clone(),
            other => other.to_string(),
        })
    }

    /// The assets that made scenes used, by pool, with what is known of their licenses.
    pub fn pools(&self, licenses: &Licenses) -> Vec<PoolView> {
        let mut used: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        let made = self.journal.values().filter(|entry| !entry.failed());
        for (asset, digest) in made.flat_map(|entry| &entry.assets) {
            if let Some((pool, name)) = asset.split_once('/').filter(|_| digest != "bad") {
                used.entry(pool).or_default().insert(name);
            }
        }
        for asset in licenses.keys() {
            if let Some((pool, name)) = asset.split_once('/').filter(|(pool, _)| !pool.is_empty()) {
                used.entry(pool).or_default().insert(name);
            }
        }
        let pool = |(pool, names): (&str, BTreeSet<&str>)| {
            let mut by_license: BTreeMap<String, Vec<String>> = BTreeMap::new();
            for name in &names {
                let of = |pool: &str| licenses.get(&format!("{pool}/{name}")).cloned();
                let license = of(pool).or_else(|| of("")).unwrap_or_default();
                by_license.entry(license).or_default().push((*name).to_owned());
            }
            let count = |(license, names): (String, Vec<String>)| LicenseCount { license, assets: names.len(), names };
            let folder = ["root", "folder", "path", "dir"].iter().find_map(|key| self.value(&["assets", pool, key]));
            PoolView {
                name: pool.to_owned(),
                kind: self.value(&["assets", pool, "kind"]).unwrap_or_default(),
                folder: folder.unwrap_or_default(),
                assets: names.len(),
                licenses: by_license.into_iter().map(count).collect(),
            }
        };
        used.into_iter().map(pool).collect()
    }

    /// Licenses that objects of some images have, and bodies, materials and environment maps in glTF files. Those of what
    /// cannot be read are not known.
    pub fn licenses(&self, dataset: &dyn DatasetReader, images: impl Iterator<Item = usize>) -> Licenses {
        let mut found = Licenses::new();
        if dataset.offers().contains(&OBJECT_INFO.id()) {
            for image in images {
                let Ok((_, products)) = dataset.read(image, &[OBJECT_INFO.id()]) else { continue };
                for (_, object) in products.get(OBJECT_INFO).into_iter().flat_map(PerInstance::<Value>::iter) {
                    let json = serde_json::to_value(object).unwrap_or_default();
                    let text = |key: &str| json.get(key).and_then(|it| it.as_str()).unwrap_or_default().to_owned();
                    if !text("license").is_empty() {
                        found.insert(format!("{}/{}", text("pool"), text("name")), text("license"));
                    }
                }
            }
        }
        for path in self.models.values() {
            let Ok(json) = gltf_json(path) else { continue };
            for node in json["nodes"].as_array().into_iter().flatten() {
                let text = |key: &str| node["extras"][key].as_str().unwrap_or_default();
                if !text("asset").is_empty() && !text("license").is_empty() {
                    found.insert(text("asset").to_owned(), text("license").to_owned());
                }
            }
            let materials = json["materials"].as_array().into_iter().flatten();
            let materials = materials.map(|it| (&it["name"], &it["extras"]["license"]));
            let environments = json["scenes"][0]["extras"]["environments"].as_array().into_iter().flatten();
            let environments = environments.map(|it| (&it["name"], &it["license"]));
            for (name, license) in materials.chain(environments) {
                if let (Some(name), Some(license)) = (name.as_str(), license.as_str()) {
                    found.insert(format!("/{name}"), license.to_owned());
                }
            }
        }
        found
    }
}

/// The folder of the run that made what lies at a path, if one did: writers have folders of their own in it, and formats
/// folders in these.
pub fn run_of(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    path.ancestors().take(1 + WITHIN_RUN).find(|folder| folder.join(RESERVED[0]).is_dir()).map(Path::to_owned)
}

/// glTF files of whole scenes, or of the first view of each, of the first writer of the recipe that makes some.
fn models(folder: &DatasetFolder, recipe: &toml::Table, scenes: impl Iterator<Item = u32>) -> BTreeMap<u32, PathBuf> {
    let writers = recipe.get("write").and_then(toml::Value::as_table);
    let is_gltf =
        |(_, options): &(&String, &toml::Value)| options.get("kind").and_then(toml::Value::as_str) == Some("gltf");
    let Some((id, _)) = writers.and_then(|writers| writers.iter().find(is_gltf)) else { return BTreeMap::new() };
    let file = |scene: u32| {
        let names = [format!("{scene:06}.glb"), format!("{scene:06}_0000.glb")];
        let paths = names.into_iter().filter_map(|name| folder.inner(id).file(name).ok());
        paths.into_iter().find(|path| path.is_file())
    };
    scenes.filter_map(|scene| Some((scene, file(scene)?))).collect()
}

/// The JSON of a binary glTF file (glTF 2.0, section 4.4).
fn gltf_json(path: &Path) -> Result<serde_json::Value> {
    let refuse = |what: &str| Error::new(what).in_file(path).permanent();
    let mut file = File::open(path).map_err(|error| Error::io(path, &error))?;
    let mut head = [0; 20];
    file.read_exact(&mut head).map_err(|error| Error::io(path, &error))?;
    let length = u32::from_le_bytes([head[12], head[13], head[14], head[15]]);
    if head[..4] != *b"glTF" || head[16..] != *b"JSON" || length > MAX_JSON {
        return Err(refuse("it is no binary glTF file"));
    }
    let mut text = Vec::new();
    file.take(u64::from(length)).read_to_end(&mut text).map_err(|error| Error::io(path, &error))?;
    serde_json::from_slice(&text).map_err(|error| refuse(&format!("its JSON cannot be read: {error}")))
}
