//! Paths of the files that the program keeps in a dataset.
//!
//! ```text
//! recipe.toml                   the resolved recipe with its inputs locked; it gives the same dataset again
//! .syntable/lock                held while a run works
//! .syntable/journal.jsonl       one line per finished scene
//! .syntable/journal/000003.json the line of a scene that a run has made in an object store; until the run ends
//! .syntable/journal/003.jsonl   the lines of scenes 3000 to 3999, which a worker has joined; until the run ends
//! .syntable/claims/000012.json  the claim of a worker on the scenes of a block, until they are made
//! .syntable/staging/w-<worker>/ unfinished scenes of a worker
//! .syntable/shard.json          number of the shard, if the dataset is one
//! .syntable/scenes/000/000003.json manifest of a scene: its files with sizes and digests
//! .syntable/finished.json       manifest of the files that the end of a run wrote
//! .syntable/catalogs/<pool>.json names, categories and numbers of the assets of a pool
//! .syntable/settled/000/000003.toml result of settling, so that a scene is made again without simulating it
//! .syntable/shards/<writer>/000/ input of `finish`, one file per scene
//! .syntable/shards/<writer>/shared/<digest>/000003  the same for bytes that several scenes share
//! .syntable/times.jsonl         working time of stages, one line per run
//! .syntable/staging/3.part/     an unfinished scene
//! .syntable/staging/3.ready/    a scene whose files are moving into place
//! .syntable/quarantine/000003/  files of a scene whose labels contradict each other, and the reason
//! .syntable/ahead/              the first scene of a dataset that will replace this one
//! .syntable/discard/            the rest of a dataset that is being deleted
//! ```

use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetPath, RESERVED};
use syntable_model::stage::path_of_scene;
use syntable_model::store::{Kind, StoreFolder};

/// The program's own folder.
pub const MARK: &str = RESERVED[0];
/// Name of the resolved recipe.
pub const RECIPE: &str = RESERVED[1];
/// Name of the manifest of the results of a run's end.
pub const FINISHED: &str = "finished.json";
/// Name of the folder of the manifests of scenes.
pub const SCENES: &str = "scenes";
/// Name of the folder of unfinished scenes.
pub const STAGING: &str = "staging";
/// Name of the folder of files that are being deleted.
pub const BIN: &str = "discard";
/// Folder of the scenes' files that the end of a run reads.
pub const SHARDS: &str = ".syntable/shards/";
/// Record of a staged scene, at a path that no writer can write.
pub const RECORD: &str = ".syntable/staged.json";
/// A record that a killed run has not finished.
pub const PART_OF_RECORD: &str = ".syntable/staged.json.part";

const JOURNAL: &str = "journal.jsonl";
const CLAIMS: &str = "claims";
const LINES: &str = "journal";
const TIMES: &str = "times.jsonl";

/// A path with valid names.
pub fn known(path: &str) -> DatasetPath {
    DatasetPath::new(path).expect("its parts are names")
}

fn own(name: &str) -> DatasetPath {
    known(&format!("{MARK}/{name}"))
}

/// The program's own folder.
pub fn mark() -> DatasetPath {
    known(MARK)
}

/// The resolved recipe.
pub fn recipe() -> DatasetPath {
    known(RECIPE)
}

/// The lock.
pub fn lock() -> DatasetPath {
    own("lock")
}

/// The journal.
pub fn journal() -> DatasetPath {
    own(JOURNAL)
}

/// The folder of journal lines that are files of their own.
pub fn lines() -> DatasetPath {
    own(LINES)
}

/// The file of a scene's journal line.
pub fn line(scene: u32) -> DatasetPath {
    own(&format!("{LINES}/{scene:06}.json"))
}

/// The file of the joined journal lines of a thousand scenes.
pub fn lines_of_thousand(thousand: u32) -> DatasetPath {
    own(&format!("{LINES}/{thousand:03}.jsonl"))
}

/// The folder of the claims of workers.
pub fn claims() -> DatasetPath {
    own(CLAIMS)
}

/// The claim on a block of scenes. The first worker has generation 0, and one that takes the claim over the next.
pub fn claim(block: u32, generation: u32) -> DatasetPath {
    own(&match generation {
        0 => format!("{CLAIMS}/{block:06}.json"),
        _ => format!("{CLAIMS}/{block:06}-{generation}.json"),
    })
}

/// The number of the shard.
pub fn shard() -> DatasetPath {
    own("shard.json")
}

/// The working times of stages.
pub fn times() -> DatasetPath {
    own(TIMES)
}

/// The manifest of the results of a run's end.
pub fn finished() -> DatasetPath {
    own(FINISHED)
}

/// The folder of the manifests of scenes.
pub fn manifests() -> DatasetPath {
    own(SCENES)
}

/// The manifest of a scene.
pub fn manifest(scene: u32) -> DatasetPath {
    known(&path_of_scene(&format!("{MARK}/{SCENES}"), scene, "json"))
}

/// Whether a folder of the program's own has only files of scenes: manifests, results of settling, or shards.
pub fn is_of_scenes(path: &str) -> bool {
    let inside: Vec<&str> = path.strip_prefix(MARK).unwrap_or_default().split('/').skip(1).collect();
    match inside[..] {
        [SCENES | "settled", _] | ["shards", _, "shared", _] => true,
        ["shards", _, folder] => folder != "shared",
        _ => false,
    }
}

/// The manifests in a folder of manifests, by scene.
///
/// # Errors
/// If a folder cannot be read.
pub fn manifests_in(dataset: &StoreFolder, folder: &DatasetPath) -> Result<Vec<(u32, DatasetPath)>> {
    let mut found = Vec::new();
    for (name, kind) in dataset.list(folder)? {
        let Some(inner) = DatasetPath::new(name).ok().filter(|_| kind == Kind::Folder) else { continue };
        let inner = folder.join(&inner);
        let names = dataset.list(&inner)?.into_iter();
        found.extend(names.filter_map(|(name, _)| {
            let scene: u32 = name.strip_suffix(".json")?.parse().ok()?;
            let path = known(&path_of_scene(folder, scene, "json"));
            (path.as_str() == format!("{inner}/{name}")).then_some((scene, path))
        }));
    }
    found.sort_unstable();
    Ok(found)
}

/// The result of settling a scene.
pub fn settled(scene: u32) -> DatasetPath {
    known(&path_of_scene(&format!("{MARK}/settled"), scene, "toml"))
}

/// The names of a pool's assets.
///
/// # Errors
/// If the name of the pool is not a valid file name. A foreign dataset may lock any name.
pub fn catalog(pool: &str) -> Result<DatasetPath> {
    let path = DatasetPath::new(format!("{MARK}/catalogs/{pool}.json"));
    path.map_err(|error| Error::new(format!("`lock.catalogs` names the pool {pool:?}: {error}")))
}

/// The folder of staged files.
pub fn staging() -> DatasetPath {
    own(STAGING)
}

/// A staged folder or file.
pub fn staged(name: &str) -> DatasetPath {
    own(&format!("{STAGING}/{name}"))
}

/// The record of a ready scene, within its staged folder.
pub fn record() -> DatasetPath {
    known(RECORD)
}

/// The files of a scene whose labels contradict each other.
pub fn quarantine(scene: u32) -> DatasetPath {
    own(&format!("quarantine/{scene:06}"))
}

/// The folder for the first scene of a dataset that will replace this one.
pub fn first_scene() -> DatasetPath {
    own("ahead")
}

/// The folder of files that are being deleted.
pub fn bin() -> DatasetPath {
    own(BIN)
}

/// A file or folder that is being deleted.
pub fn binned(name: &str) -> DatasetPath {
    own(&format!("{BIN}/{name}"))
}

/// The state of a dataset without its files and the lock, in the order in which `--overwrite` removes it. A folder
/// without a journal is no dataset.
pub fn state() -> [DatasetPath; 12] {
    [
        journal(),
        lines(),
        claims(),
        recipe(),
        finished(),
        manifests(),
        own("settled"),
        own("shards"),
        own("catalogs"),
        times(),
        staging(),
        own("quarantine"),
    ]
}

/// Whether a folder has the program's own folder, even as a link. Opening the dataset refuses a link.
pub fn is_dataset(folder: &StoreFolder) -> Result<bool> {
    Ok(folder.look(MARK)?.is_some_and(|there| matches!(there.kind, Kind::Folder | Kind::Link)))
}

/// The journal of a dataset on this machine.
pub fn journal_path(root: &Path) -> PathBuf {
    journal().below(root)
}

/// The working times of stages, in a dataset on this machine.
pub fn times_path(root: &Path) -> PathBuf {
    times().below(root)
}
