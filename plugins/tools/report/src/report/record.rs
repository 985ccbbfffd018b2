//! Data in the folder of a run other than images: recipe, outcome of scenes, times, licenses, and glTF files.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use syntable_formats::decode;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetFolder;
use syntable_model::limits::RUN_LIST_BYTES;
use syntable_model::mirror::{DatasetFile, store_at};
use syntable_model::product::standard::OBJECT_INFO;
use syntable_model::product::{PerInstance, Value};
use syntable_model::reader::{OpenDataset, Source};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::stage::RESERVED;
use syntable_recipe::{components_of, pool_name, split_pool_name};
use syntable_runtime::run::dataset::journal::{Entries, Journal};
use syntable_runtime::run::dataset::layout::{journal_path, times_path};
use syntable_runtime::run::making::times::RunTimes;

/// Maximum number of folders between a run and an annotation file, such as `coco/annotations/instances_train.json`.
const WITHIN_RUN: usize = 3;
/// Maximum size of the JSON in a glTF file, bytes.
const MAX_JSON: u32 = 64 << 20;

/// Origin of a dataset. Mostly unknown for a dataset of another program.
#[derive(Debug, Default)]
pub struct DatasetRecord {
    /// The folder of the run; `None` if no run made the dataset.
    folder: Option<DatasetFolder>,
    /// The resolved recipe; empty if unknown.
    pub recipe: String,
    /// The recipe as a table.
    pub table: toml::Table,
    /// The scenes of the run.
    pub journal: Entries,
    /// Times of runs.
    pub times: Vec<RunTimes>,
    /// Unreadable records, as sentences.
    pub damaged: Vec<String>,
    /// glTF files by scene.
    pub models: BTreeMap<u32, PathBuf>,
    /// Licenses of pools whose assets have all the same license.
    pub pool_licenses: BTreeMap<String, String>,
}

/// An origin of assets: a pool of the recipe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoolView {
    /// Its name.
    pub name: String,
    /// Kind of its source.
    pub kind: String,
    /// Folder of the files; empty without files.
    pub folder: String,
    /// Distinct assets that were used.
    pub assets: usize,
    /// Licenses with their numbers of assets, including assets of unknown license.
    pub licenses: Vec<LicenseCount>,
}

/// Number of assets with a license.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LicenseCount {
    /// License and attribution, from the asset's file or source.
    pub license: String,
    /// Number of assets.
    pub assets: usize,
    /// Their names.
    pub names: Vec<String>,
}

/// Licenses by `pool/name`. Materials are listed as `/name`, because a glTF file does not state their pool.
pub type Licenses = BTreeMap<String, String>;

impl DatasetRecord {
    /// Reads the records in the folder of a run; empty if no run made the folder.
    pub fn of(registry: &Registry, dataset: &Source) -> Self {
        let opened = run_of(&dataset.path).and_then(|root| match root {
            Some(root) => dataset.folder(&root).map(|folder| Some((root, folder))),
            None => Ok(None),
        });
        let (root, folder) = match opened {
            Ok(Some(opened)) => opened,
            Ok(None) => return Self::default(),
            Err(error) => return Self { damaged: vec![error.to_string()], ..Self::default() },
        };
        let mut damaged = Vec::new();
        let mut note = |path: &Path, what: String| damaged.push(format!("{}: {what}", path.display()));
        let path = root.join(RESERVED[1]);
        let recipe = match find(&folder, &path) {
            Ok(Some(_)) => read_own(&folder, &path).and_then(|bytes| {
                String::from_utf8(bytes).map_err(|_| Error::new("the file is not UTF-8").in_file(&path))
            }),
            Ok(None) => Ok(String::new()),
            Err(error) => Err(error),
        };
        let recipe = recipe.unwrap_or_else(|error| {
            note(&path, error.message().to_owned());
            String::new()
        });
        let table: toml::Table = recipe.parse().unwrap_or_else(|error: toml::de::Error| {
            note(&path, error.message().to_owned());
            toml::Table::new()
        });
        let path = journal_path(&root);
        let (journal, faults) = find(&folder, &path)
            .and_then(|_| Journal::readable(store_at(&root)))
            .unwrap_or_else(|error| (Entries::default(), vec![error.message().to_owned()]));
        faults.into_iter().for_each(|fault| note(&path, fault));
        let path = times_path(&root);
        let times = find(&folder, &path).and_then(|_| RunTimes::of_dataset(store_at(&root))).unwrap_or_else(|error| {
            note(&path, error.message().to_owned());
            Vec::new()
        });
        let lines = read_own(&folder, &path)
            .map_or(0, |bytes| bytes.split(|it| *it == b'\n').filter(|it| !it.is_empty()).count());
        if lines > times.len() {
            note(&path, format!("{} of {lines} lines cannot be read", lines - times.len()));
        }
        let models = models(&folder, &root, &table, journal.scenes(), &mut note);
        let pool_licenses = pool_licenses(registry, &table);
        Self { folder: Some(folder), times, recipe, table, journal, damaged, models, pool_licenses }
    }

    /// Reads a file of the run.
    ///
    /// # Errors
    /// If the file is not regular, or a link leads outside the folder of the run and the source does not permit it.
    pub fn read(&self, path: &Path) -> Result<Vec<u8>> {
        read(self.folder()?, path)
    }

    fn folder(&self) -> Result<&DatasetFolder> {
        self.folder.as_ref().ok_or_else(|| Error::new("no run made the dataset"))
    }

    /// A value of the recipe as text: `dataset.seed`.
    pub fn value(&self, keys: &[&str]) -> Option<String> {
        value(&self.table, keys)
    }

    /// The different values of a key in the components of a mixture, or the value in a recipe that is no mixture.
    pub fn values(&self, keys: &[&str]) -> Vec<String> {
        let mut values: Vec<String> = Vec::new();
        for value in components_of(&self.table).into_iter().filter_map(|(_, table)| value(table, keys)) {
            if !values.contains(&value) {
                values.push(value);
            }
        }
        values
    }

    /// A value of a pool, which a component of a mixture can have.
    fn value_of_pool(&self, pool: &str, key: &str) -> Option<String> {
        let (component, id) = split_pool_name(pool);
        let tables = components_of(&self.table).into_iter();
        let mut tables = tables.filter(|(other, _)| component.is_empty() || component == *other);
        tables.find_map(|(_, table)| value(table, &["assets", id, key]))
    }

    /// The assets that were drawn for scenes, by pool, with their licenses.
    pub fn pools(&self, licenses: &Licenses) -> Vec<PoolView> {
        let mut used: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for (asset, digest) in self.journal.assets() {
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
                let license = of(pool).or_else(|| of("")).or_else(|| self.pool_licenses.get(pool).cloned());
                let license = license.unwrap_or_default();
                by_license.entry(license).or_default().push((*name).to_owned());
            }
            let count = |(license, names): (String, Vec<String>)| LicenseCount { license, assets: names.len(), names };
            let folder = ["root", "folder", "path", "dir"].iter().find_map(|key| self.value_of_pool(pool, key));
            PoolView {
                name: pool.to_owned(),
                kind: self.value_of_pool(pool, "kind").unwrap_or_default(),
                folder: folder.unwrap_or_default(),
                assets: names.len(),
                licenses: by_license.into_iter().map(count).collect(),
            }
        };
        used.into_iter().map(pool).collect()
    }

    /// Licenses of objects in some images, and of bodies, materials and environment maps in glTF files. Also returns
    /// the unreadable parts, as sentences.
    pub fn licenses(&self, dataset: &OpenDataset, images: impl Iterator<Item = usize>) -> (Licenses, Vec<String>) {
        let (mut found, mut unread) = (Licenses::new(), Vec::new());
        if dataset.offers.contains(&OBJECT_INFO.id()) {
            for image in images {
                let products = match dataset.read(image, &[OBJECT_INFO.id()]) {
                    Ok(read) => read.products,
                    Err(error) => {
                        unread.push(format!("licenses of image \"{}\": {error}", dataset.images[image].name));
                        continue;
                    }
                };
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
            let json = match self.folder().and_then(|folder| gltf_json(folder, path)) {
                Ok(json) => json,
                Err(error) => {
                    unread.push(format!("licenses: {error}"));
                    continue;
                }
            };
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
        (found, unread)
    }
}

/// A value in a table as text.
fn value(table: &toml::Table, keys: &[&str]) -> Option<String> {
    let (last, tables) = keys.split_last()?;
    let table = tables.iter().try_fold(table, |table, key| table.get(*key)?.as_table())?;
    Some(match table.get(*last)? {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    })
}

/// Licenses of a recipe's pools: the option of the pool, or else the license that its kind gives to all of its assets.
fn pool_licenses(registry: &Registry, recipe: &toml::Table) -> BTreeMap<String, String> {
    let components = components_of(recipe).into_iter();
    let pools = components.flat_map(|(component, tables)| {
        let pools = tables.get(Slot::Assets.name()).and_then(toml::Value::as_table).into_iter().flatten();
        pools.map(move |(id, pool)| (component, id, pool))
    });
    let license = |pool: &toml::Value| {
        if let Some(license) = pool.get("license").and_then(toml::Value::as_str) {
            return Some(license.to_owned());
        }
        let entry = registry.find(Slot::Assets, pool.get("kind")?.as_str()?)?;
        // A kind that needs a path has licenses in its files.
        match entry.construct_str("").ok()?.stage {
            Stage::Assets(source) => source.license().map(str::to_owned),
            _ => None,
        }
    };
    // Only pools that differ have the names of their components.
    let names = |component: &str, id: &String| [id.clone(), pool_name(component, id)];
    let licenses = pools.filter_map(|(component, id, pool)| Some((names(component, id), license(pool)?)));
    licenses.flat_map(|(names, license)| names.map(|name| (name, license.clone()))).collect()
}

/// A regular, accessible file of a run, if it exists.
///
/// # Errors
/// If the file is not regular, such as a pipe, which would block, or if a link leads outside the folder of the run and
/// the source does not permit it.
fn find(folder: &DatasetFolder, path: &Path) -> Result<Option<PathBuf>> {
    // The name comes from the program, so only a link can lead out.
    let refused = |error: Error| match error.is_io() {
        true => error,
        false => {
            Error::new("a link leads outside the folder: if you trust this dataset, `options.trust_paths` permits it")
                .in_file(path)
        }
    };
    let found = folder.file(path.strip_prefix(folder.path()).unwrap_or(path)).map_err(refused)?;
    match std::fs::symlink_metadata(&found) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        _ => decode::open(&found).map(|_| Some(found)),
    }
}

/// Opens a file of a run, see [`find`].
fn open(folder: &DatasetFolder, path: &Path) -> Result<DatasetFile> {
    let found = find(folder, path)?.ok_or_else(|| Error::new("no such file").in_file(path))?;
    decode::open(&found)
}

fn read(folder: &DatasetFolder, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(folder, path)?.read_to_end(&mut bytes).map_err(|error| Error::io(path, &error))?;
    Ok(bytes)
}

/// Reads a file of the program's own folder. Refuses a file larger than [`RUN_LIST_BYTES`].
fn read_own(folder: &DatasetFolder, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(folder, path)?
        .take(RUN_LIST_BYTES.most + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| Error::io(path, &error))?;
    RUN_LIST_BYTES.check(bytes.len() as u64).map_err(|error| error.in_file(path))?;
    Ok(bytes)
}

/// The folder of the run that made the file at a path, if a run did. Writers have folders inside it, and formats
/// folders inside these.
///
/// # Errors
/// If a folder is unreadable. A report without the record of the run would otherwise look complete.
pub fn run_of(path: &Path) -> Result<Option<PathBuf>> {
    let path = std::path::absolute(path).map_err(|error| Error::io(path, &error))?;
    for folder in path.ancestors().take(1 + WITHIN_RUN) {
        let own = folder.join(RESERVED[0]);
        match std::fs::metadata(&own) {
            Ok(there) if there.is_dir() => return Ok(Some(folder.to_owned())),
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
            Err(error) => return Err(Error::io(&own, &error)),
        }
    }
    Ok(None)
}

/// glTF files of whole scenes, or of the first view of each scene, from the recipe's first writer of such files. `note`
/// receives the unusable files.
fn models(
    folder: &DatasetFolder,
    root: &Path,
    recipe: &toml::Table,
    scenes: impl Iterator<Item = u32>,
    note: &mut dyn FnMut(&Path, String),
) -> BTreeMap<u32, PathBuf> {
    let writers = recipe.get("write").and_then(toml::Value::as_table);
    let is_gltf =
        |(_, options): &(&String, &toml::Value)| options.get("kind").and_then(toml::Value::as_str) == Some("gltf");
    let Some((id, _)) = writers.and_then(|writers| writers.iter().find(is_gltf)) else { return BTreeMap::new() };
    let mut found = BTreeMap::new();
    for scene in scenes {
        for name in [format!("{scene:06}.glb"), format!("{scene:06}_0000.glb")] {
            let path = root.join(id).join(name);
            match find(folder, &path) {
                Ok(Some(_)) => {
                    found.entry(scene).or_insert(path);
                }
                Ok(None) => {}
                Err(error) => note(&path, error.message().to_owned()),
            }
        }
    }
    found
}

/// The JSON of a binary glTF file (glTF 2.0, section 4.4).
fn gltf_json(folder: &DatasetFolder, path: &Path) -> Result<serde_json::Value> {
    let refuse = |what: &str| Error::new(what).in_file(path);
    let mut file = open(folder, path)?;
    let mut head = [0; 20];
    file.read_exact(&mut head).map_err(|error| Error::io(path, &error))?;
    let length = u32::from_le_bytes([head[12], head[13], head[14], head[15]]);
    if head[..4] != *b"glTF" || head[16..] != *b"JSON" || length > MAX_JSON {
        return Err(refuse("not a binary glTF file"));
    }
    let mut text = Vec::new();
    file.take(u64::from(length)).read_to_end(&mut text).map_err(|error| Error::io(path, &error))?;
    serde_json::from_slice(&text).map_err(|error| refuse(&format!("the JSON cannot be read: {error}")))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn links_lead_out_of_a_run_only_if_the_user_trusts_it() {
        let home = tempfile::tempdir().expect("a folder");
        let [data, disk] = ["data", "disk"].map(|name| home.path().join(name));
        [&data, &disk].into_iter().for_each(|folder| std::fs::create_dir(folder).expect("made"));
        std::fs::write(disk.join("000000.glb"), "glTF").expect("written");
        std::os::unix::fs::symlink(&disk, data.join("gltf")).expect("linked");
        let path = data.join("gltf/000000.glb");
        let read = |is_trusted: bool| {
            let folder = Source::new(&data).trusting(is_trusted).folder(&data).expect("there");
            assert_eq!(find(&folder, &data.join("recipe.toml")), Ok(None));
            assert!(find(&folder, &data.join("none/000000.glb")).is_ok_and(|found| found.is_none()));
            let refused = find(&folder, &data).expect_err("a folder").to_string();
            assert!(refused.contains("it is not a file"), "{refused}");
            read(&folder, &path).map_err(|error| error.to_string())
        };
        let refused = read(false).expect_err("it leads out");
        assert!(
            refused.contains("000000.glb: a link leads outside") && refused.contains("options.trust_paths"),
            "{refused}"
        );
        assert_eq!(read(true).as_deref(), Ok(&b"glTF"[..]));
    }

    #[test]
    fn pools_of_components_have_their_own_folders_and_licenses() {
        let pool = |component: &str, id: &str, [root, license]: [&str; 2]| {
            format!("[mixture.{component}.assets.{id}]\nkind = \"files\"\nroot = \"{root}\"\nlicense = \"{license}\"\n")
        };
        let recipe = [
            pool("heaps", "objects", ["a", "MIT"]),
            pool("tables", "objects", ["b", "CC0-1.0"]),
            pool("heaps", "shared", ["c", "ISC"]),
            pool("tables", "shared", ["c", "ISC"]),
        ];
        let table: toml::Table = recipe.concat().parse().expect("TOML");
        let registry = Registry::new([]).expect("no clash");
        let pool_licenses = pool_licenses(&registry, &table);
        let record = DatasetRecord { table, pool_licenses, ..DatasetRecord::default() };
        let found = ["heaps.objects", "tables.objects", "shared"].map(|pool| {
            let license = record.pool_licenses[pool].clone();
            [record.value_of_pool(pool, "root").expect("there"), license]
        });
        assert_eq!(found, [["a", "MIT"], ["b", "CC0-1.0"], ["c", "ISC"]]);
    }
}
