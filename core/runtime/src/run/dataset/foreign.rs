//! Checks whether a dataset from another person is safe to work on: its own folder has no links, and its lists name
//! only files of the dataset. This runs before any file is written, moved or removed.

use crate::run::dataset::layout::{self, BIN, FINISHED, MARK, PART_OF_RECORD, RECIPE, RECORD, SCENES, STAGING};
use crate::workers::{self, Pool};
use parking_lot::Mutex;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use syntable_model::context::{Serial, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::limits::{Limit, RUN_LIST_BYTES};
use syntable_model::stage::unreadable;
use syntable_model::store::{Kind as FileKind, StoreFolder};
use syntable_model::words::SHOWN;

/// A list of files in the program's own folder. Its path determines its kind.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct FileList {
    /// Path of the list.
    pub path: DatasetPath,
    kind: ListKind,
}

/// Kind of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum ListKind {
    /// The files of a scene.
    Scene,
    /// The results of a run's end.
    Finished,
    /// The files that a staged scene replaces.
    Staged,
}

impl ListKind {
    /// The kind of the list at a path of the program's own folder, if the program reads this file as a list.
    fn at(path: &str) -> Option<Self> {
        let inside = path.strip_prefix(MARK)?.strip_prefix('/')?;
        if let Some((_, staged)) = in_ready(inside) {
            // Once moved into place, the file is a list at its new path.
            return if staged == RECORD { Some(Self::Staged) } else { Self::at(staged) };
        }
        // A deletion keeps the lists until its end.
        let inside = inside.strip_prefix(BIN).and_then(|binned| binned.strip_prefix('/')).unwrap_or(inside);
        match inside.split_once('/') {
            None => (inside == FINISHED).then_some(Self::Finished),
            Some((SCENES, name)) => {
                let scene: u32 = name.rsplit('/').next()?.strip_suffix(".json")?.parse().ok()?;
                layout::manifest(scene).ends_with(&format!("/{SCENES}/{name}")).then_some(Self::Scene)
            }
            Some(_) => None,
        }
    }

    /// Whether a list may name a path that is reserved for the program: shards and settled poses of a scene, the
    /// manifest of a scene that a staged scene replaces, and the recipe in the results of a run's end.
    fn may_name(self, path: &DatasetPath) -> bool {
        let is_below = |folder: &str| path.strip_prefix(MARK).is_some_and(|path| path.starts_with(folder));
        is_below("/settled/")
            || is_below("/shards/")
            || (self == Self::Staged && is_below("/scenes/"))
            || (self == Self::Finished && path.as_str() == RECIPE)
    }

    /// The paths in the text of a list, each with its key; empty if the text is damaged. This parser reads every text
    /// that the program reads as a list of this kind: both types have the same fields, and these fields take any text
    /// as a path.
    fn names(self, text: &[u8]) -> Vec<(&'static str, Cow<'_, str>)> {
        match self {
            Self::Scene | Self::Finished => {
                let ListedFiles { files, writers } = serde_json::from_slice(text).unwrap_or_default();
                let files = files.into_keys().map(|ListedPath(path)| ("files", path));
                files.chain(writers.into_values().flatten().map(|ListedPath(path)| ("writers", path))).collect()
            }
            Self::Staged => {
                let Stale { stale, .. } = serde_json::from_slice(text).unwrap_or_default();
                stale.into_iter().map(|ListedPath(path)| ("stale", path)).collect()
            }
        }
    }
}

/// The number of a staged scene that is moving into place, and the rest of a path in it.
fn in_ready(inside: &str) -> Option<(&str, &str)> {
    let (name, rest) = inside.strip_prefix(STAGING)?.strip_prefix('/')?.split_once('/')?;
    Some((name.strip_suffix(".ready")?, rest))
}

/// A path in a list.
#[derive(PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(transparent)]
struct ListedPath<'a>(#[serde(borrow)] Cow<'a, str>);

/// Same fields as [`Manifest`](crate::run::dataset::manifest::Manifest).
#[derive(Default, Deserialize)]
struct ListedFiles<'a> {
    #[serde(borrow)]
    files: BTreeMap<ListedPath<'a>, IgnoredAny>,
    #[serde(borrow, default)]
    writers: BTreeMap<ListedPath<'a>, Vec<ListedPath<'a>>>,
}

/// Same fields as the record of a staged scene.
#[derive(Default, Deserialize)]
struct Stale<'a> {
    #[serde(rename = "entry")]
    _entry: IgnoredAny,
    #[serde(borrow)]
    stale: Vec<ListedPath<'a>>,
}

/// An entry that a dataset must not have.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct StrayFile {
    /// Path, with `/` between folders.
    pub path: String,
    /// Description of the fault.
    pub what: String,
}

/// Remedy for a dataset that another person has changed.
const CHANGED: &str =
    "no file was changed; no run writes this, so another person or program changed the dataset, perhaps to do harm";

impl StrayFile {
    fn into_error(self, dataset: &StoreFolder) -> Error {
        Error::new(self.what).in_file(dataset.name_of(&self.path)).help(CHANGED)
    }
}

/// Refuses a dataset whose own folder is behind a link. Runs before the dataset is locked.
pub fn check_mark(dataset: &StoreFolder) -> Result<()> {
    for (path, expected) in [(MARK.to_owned(), FileKind::Folder), (layout::lock().to_string(), FileKind::File)] {
        match dataset.look(&path)?.map(|there| there.kind) {
            Some(kind) if kind != expected => {
                return Err(StrayFile { what: what_is(kind, expected), path }.into_error(dataset));
            }
            Some(_) => {}
            None => break,
        }
    }
    Ok(())
}

/// Refuses a dataset whose own folder has links, whose lists name foreign files, or with a listed folder that is a
/// link. Runs while no other program writes the dataset.
///
/// Of a dataset with many scenes, or in an object store, which has no links, this does not read the lists of scenes: each
/// of them is checked when it is read.
pub fn check(dataset: &StoreFolder) -> Result<()> {
    let is_large = || Ok(dataset.list(&layout::manifests())?.len() > FEW_FOLDERS);
    let depth = if dataset.is_remote() || is_large()? { Depth::Folders } else { Depth::Files };
    let mut own = own_files(dataset, depth)?;
    if !own.odd.is_empty() {
        return Err(own.odd.swap_remove(0).into_error(dataset));
    }
    let threads = workers::available().min(own.lists.len() / LISTS_PER_THREAD).min(MOST_THREADS);
    let pool = if threads > 1 { Some(Pool::new(threads)?) } else { None };
    let (odd, mut folders) = names(dataset, &own.lists, pool.as_ref().map_or(&Serial, |pool| pool as &dyn Workers))?;
    if let Some(odd) = odd.into_iter().next() {
        return Err(odd.into_error(dataset));
    }
    folders.append(&mut own.ready);
    // Each folder with its ancestors.
    let each = folders.iter().flat_map(|folder| prefixes(folder));
    let all: BTreeSet<&str> = each.collect();
    for folder in all {
        if dataset.has_link(folder)? {
            return Err(dataset.linked(folder));
        }
    }
    Ok(())
}

/// A folder and its ancestors, from the outermost one.
fn prefixes(folder: &str) -> impl Iterator<Item = &str> {
    folder.match_indices('/').map(|(end, _)| &folder[..end]).chain([folder])
}

/// Content of the program's own folder of a dataset.
#[derive(Default)]
pub struct OwnFiles {
    /// Entries that are neither files nor folders, sorted.
    pub odd: Vec<StrayFile>,
    /// Lists of files, sorted by path.
    pub lists: Vec<FileList>,
    /// Folders of the dataset that receive files of staged scenes.
    ready: BTreeSet<String>,
}

/// Refuses a list with a path that is reserved for the program. Other paths outside the dataset cannot be read
/// as paths.
pub fn check_list<'p>(
    dataset: &StoreFolder,
    list: &DatasetPath,
    mut paths: impl Iterator<Item = &'p DatasetPath>,
) -> Result<()> {
    let kind = ListKind::at(list).unwrap_or(ListKind::Scene);
    match paths.find(|path| path.is_reserved() && !kind.may_name(path)) {
        None => Ok(()),
        Some(path) => Err(StrayFile {
            what: format!("`{path}` is reserved for the program, and no list may have it"),
            path: list.to_string(),
        }
        .into_error(dataset)),
    }
}

/// The entries that [`own_files`] looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// All.
    Files,
    /// Folders, and files that are not of one scene alone.
    Folders,
}

/// Number of folders with the manifests of scenes up to which all manifests are checked before any change.
const FEW_FOLDERS: usize = 10;

/// Reads the program's own folder, and the recipe beside it.
pub fn own_files(dataset: &StoreFolder, depth: Depth) -> Result<OwnFiles> {
    let mut own = OwnFiles::default();
    let recipes = [RECIPE.to_owned(), format!("{RECIPE}.part")].map(|path| (path, FileKind::File));
    for (path, expected) in [(MARK.to_owned(), FileKind::Folder)].into_iter().chain(recipes) {
        if let Some(kind) = dataset.look(&path)?.map(|there| there.kind).filter(|kind| *kind != expected) {
            own.odd.push(StrayFile { what: what_is(kind, expected), path });
        }
    }
    if own.odd.is_empty() {
        walk(dataset, MARK, depth, &mut own)?;
    }
    own.odd.sort_unstable();
    own.lists.sort_unstable();
    Ok(own)
}

fn walk(dataset: &StoreFolder, inside: &str, depth: Depth, own: &mut OwnFiles) -> Result<()> {
    for (name, kind) in dataset.list(inside).map_err(unreadable)? {
        let path = format!("{inside}/{name}");
        if kind == FileKind::Folder {
            if depth == Depth::Files || !layout::is_of_scenes(&path) {
                walk(dataset, &path, depth, own)?;
            }
            own.ready.extend(ready_folder(&path).map(str::to_owned));
        } else if kind != FileKind::File {
            own.odd.push(StrayFile { what: what_is(kind, FileKind::File), path });
        } else if !may_be_staged(&path) {
            let what =
                "no run stages this file: moved into place, it would replace one of the program's own files".to_owned();
            own.odd.push(StrayFile { path, what });
        } else if let Some(kind) = ListKind::at(&path)
            // The program opens no file by another name.
            && let Ok(path) = DatasetPath::new(path)
        {
            own.lists.push(FileList { path, kind });
        }
    }
    Ok(())
}

/// The folder of the dataset that a folder of a staged scene becomes.
fn ready_folder(path: &str) -> Option<&str> {
    let (_, folder) = in_ready(path.strip_prefix(MARK)?.strip_prefix('/')?)?;
    Some(folder).filter(|folder| !folder.starts_with(MARK))
}

/// Whether a file of the program's own folder may move into place with a staged scene: the scene's manifest, the result
/// of settling, and shards.
fn may_be_staged(path: &str) -> bool {
    let inside = path.strip_prefix(MARK).and_then(|inside| inside.strip_prefix('/')).and_then(in_ready);
    let Some(own) = inside.and_then(|(_, staged)| staged.strip_prefix(MARK)?.strip_prefix('/')) else { return true };
    let folder = own.split_once('/').map_or("", |(folder, _)| folder);
    [SCENES, "settled", "shards"].contains(&folder)
        || inside.is_some_and(|(_, staged)| [RECORD, PART_OF_RECORD].contains(&staged))
}

fn what_is(kind: FileKind, expected: FileKind) -> String {
    let expected = if expected == FileKind::Folder { "a folder" } else { "a file" };
    match kind {
        FileKind::Link => format!("a link, where the program expected {expected} of its own"),
        FileKind::Folder => "a folder, where a file was expected".to_owned(),
        FileKind::File => "a file, where a folder was expected".to_owned(),
        FileKind::Other => format!("a device, a pipe or a socket, where {expected} was expected"),
    }
}

/// The bytes of a list; empty if it does not exist.
pub fn read(dataset: &StoreFolder, path: &DatasetPath) -> Result<Vec<u8>> {
    Ok(read_list(dataset, path)?.unwrap_or_default())
}

/// The bytes of a file that a run keeps in its dataset, if it exists. Refuses a file larger than [`RUN_LIST_BYTES`].
pub fn read_list(dataset: &StoreFolder, path: &DatasetPath) -> Result<Option<Vec<u8>>> {
    read_bounded(dataset, path, &RUN_LIST_BYTES)
}

/// The bytes of a file, if the file exists. Refuses a file larger than the limit.
pub fn read_bounded(dataset: &StoreFolder, path: &DatasetPath, limit: &Limit) -> Result<Option<Vec<u8>>> {
    let Some(opened) = dataset.open(path).map_err(unreadable)? else { return Ok(None) };
    let check = |length: u64| limit.check(length).map_err(|error| error.in_file(dataset.name_of(path)));
    check(opened.size)?;
    // The file may grow, or may state no length.
    let mut bytes = Vec::new();
    let read = opened.take(limit.most + 1).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(Error::io(dataset.name_of(path), &error)))?;
    check(bytes.len() as u64)?;
    Ok(Some(bytes))
}

/// Number of lists per thread. More threads do not pay: lists are small, and disks are the limit.
const LISTS_PER_THREAD: usize = 64;
const MOST_THREADS: usize = 8;
/// Size above which lists are read one after the other, bytes. Together they would exceed the memory limit of one.
const LARGE: usize = 1 << 22;

/// Reads lists. Returns foreign or reserved names in the order of the lists, and the folders of all other names.
pub fn names(
    dataset: &StoreFolder,
    lists: &[FileList],
    workers: &dyn Workers,
) -> Result<(Vec<StrayFile>, BTreeSet<String>)> {
    let found = Mutex::new((BTreeMap::new(), BTreeSet::new()));
    let large = Mutex::new(());
    workers.run(lists.len(), &|number| {
        let list = &lists[number];
        let size = dataset.look(&list.path).ok().flatten().map_or(0, |there| there.size);
        let _alone = (size > LARGE as u64).then(|| large.lock());
        let read = read(dataset, &list.path).map(|text| list.look(&text));
        let mut found = found.lock();
        match read {
            Ok((odd, folders)) => {
                found.1.extend(folders);
                if !odd.is_empty() {
                    found.0.insert(number, Ok(odd));
                }
            }
            Err(error) => drop(found.0.insert(number, Err(error))),
        }
    });
    let (odd, folders) = found.into_inner();
    let odd: Vec<Vec<StrayFile>> = odd.into_values().collect::<Result<_>>()?;
    Ok((odd.concat(), folders))
}

impl FileList {
    /// The foreign names of a list, at most [`SHOWN`] and the number of others, and the folders of the remaining names.
    fn look(&self, text: &[u8]) -> (Vec<StrayFile>, BTreeSet<String>) {
        let (mut odd, mut more, mut folders) = (Vec::new(), 0_u64, BTreeSet::new());
        let mut add = |key: &str, why: String| match odd.len() {
            SHOWN.. => more += 1,
            _ => odd.push(self.odd(format!("`{key}` names a file outside the dataset: {why}"))),
        };
        // Files of one folder follow each other.
        let mut last = String::new();
        for (key, name) in self.kind.names(text) {
            match DatasetPath::new(name.into_owned()) {
                Err(error) => add(key, error.to_string()),
                Ok(path) if path.is_reserved() && !self.kind.may_name(&path) => {
                    add(key, format!("`{path}` is reserved for the program, and no list may have it"));
                }
                Ok(path) => {
                    if let Some((folder, _)) = path.rsplit_once('/').filter(|(folder, _)| *folder != last) {
                        folder.clone_into(&mut last);
                        folders.insert(folder.to_owned());
                    }
                }
            }
        }
        if more > 0 {
            odd.push(self.odd(format!("{more} more names are outside the dataset")));
        }
        (odd, folders)
    }

    fn odd(&self, what: String) -> StrayFile {
        StrayFile { path: self.path.to_string(), what }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_known_by_their_place() {
        for (path, kind) in [
            (".syntable/finished.json", Some(ListKind::Finished)),
            (".syntable/scenes/000/000003.json", Some(ListKind::Scene)),
            (".syntable/discard/finished.json", Some(ListKind::Finished)),
            (".syntable/discard/scenes/000/000003.json", Some(ListKind::Scene)),
            (".syntable/staging/3.ready/.syntable/staged.json", Some(ListKind::Staged)),
            (".syntable/staging/3.ready/.syntable/scenes/000/000003.json", Some(ListKind::Scene)),
            // Files of a writer with the id `scenes`, or with a file `finished.json`.
            (".syntable/staging/3.ready/scenes/000003.json", None),
            (".syntable/staging/3.ready/finished.json", None),
            (".syntable/staging/3.part/.syntable/staged.json", None),
            (".syntable/staging/3.part/scenes/000003.json", None),
            (".syntable/staging/finish/finished.json", None),
            (".syntable/shards/scenes/000003.json", None),
            (".syntable/quarantine/000003/scenes/000003.json", None),
            (".syntable/scenes/old/000003.json", None),
            (".syntable/scenes/000/000003.json.part", None),
            (".syntable/staged.json", None),
            ("scenes/000003.json", None),
        ] {
            assert_eq!(ListKind::at(path), kind, "{path}");
        }
    }

    /// A text that the program reads as a list must not hide its names behind fields that the program ignores.
    #[test]
    fn names_are_read_from_every_text_that_counts_as_a_list() {
        let digest = syntable_model::digest::Digest::of(b"").to_string();
        let file = format!(r#"{{".syntable/lock":[0,"{digest}"]}}"#);
        let entry = r#"{"scene":0,"attempt":0,"outcome":"failed"}"#;
        for text in [
            format!(r#"{{"files":{file}}}"#),
            format!(r#"{{"files":{file},"stale":5,"entry":[]}}"#),
            format!(r#"{{"stale":{{}},"files":{{"\u002esyntable/lock":[0,"{digest}"]}}}}"#),
            format!(r#"[{file},{{}}]"#),
        ] {
            assert!(serde_json::from_str::<crate::run::dataset::manifest::Manifest>(&text).is_ok(), "{text}");
            assert_eq!(ListKind::Scene.names(text.as_bytes()), [("files", ".syntable/lock".into())], "{text}");
        }
        for text in [
            format!(r#"{{"entry":{entry},"stale":[".syntable/lock"],"files":5,"writers":5}}"#),
            format!(r#"[{entry},[".syntable/lock"]]"#),
        ] {
            assert!(serde_json::from_str::<crate::run::dataset::commit::Staged>(&text).is_ok(), "{text}");
            assert_eq!(ListKind::Staged.names(text.as_bytes()), [("stale", ".syntable/lock".into())], "{text}");
        }
    }

    #[test]
    fn of_many_bad_names_the_first_are_told_and_the_rest_counted() {
        let list = FileList { path: layout::manifest(0), kind: ListKind::Scene };
        let files: Vec<String> = (0..1000).map(|number| format!(r#""../{number:04}":0"#)).collect();
        let (odd, folders) = list.look(format!(r#"{{"files":{{"a/b/c":0,{}}}}}"#, files.join(",")).as_bytes());
        assert_eq!((odd.len(), folders), (SHOWN + 1, BTreeSet::from(["a/b".to_owned()])));
        assert!(odd[0].what.contains("`../0000`") && odd[SHOWN].what.contains(&format!("{} more", 1000 - SHOWN)));
    }

    /// Opens a dataset with lists of 10,000 scenes with 60 files each, and prints the time that the lists take.
    #[test]
    #[ignore = "measures: cargo test --release -p syntable-runtime --lib ten_thousand -- --ignored --nocapture"]
    fn ten_thousand_lists() {
        let folder = tempfile::tempdir().expect("a folder");
        let digest = syntable_model::digest::Digest::of(b"").to_string();
        for scene in 0..10_000 {
            let names = (0..60).map(|file| format!("png/product_{}/{scene}_{}.png", file % 6, file / 6));
            let names: Vec<String> = names.map(|name| format!("\"{name}\"")).collect();
            let files: Vec<String> = names.iter().map(|name| format!("{name}:[12345,\"{digest}\"]")).collect();
            let text = format!(r#"{{"files":{{{}}},"writers":{{"png":[{}]}}}}"#, files.join(","), names.join(","));
            let path = layout::manifest(scene).below(folder.path());
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            std::fs::write(path, text).expect("writable");
        }
        let own = own_files(&folder.path().into(), Depth::Files).expect("readable");
        assert_eq!(own.lists.len(), 10_000);
        for _ in 0..3 {
            let start = std::time::Instant::now();
            check(&folder.path().into()).expect("sound");
            println!("{:.2} s", start.elapsed().as_secs_f64());
        }
    }
}
