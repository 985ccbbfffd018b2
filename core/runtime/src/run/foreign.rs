//! Whether a dataset may be worked on, which somebody else may have made: its own folder has no links, and its lists name
//! files of the dataset alone. Looked at before anything is written, moved or removed.

use super::inside::{is_link, linked};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, FileType};
use std::io::{ErrorKind, Read};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetPath, RESERVED};
use syntable_model::limits::RUN_LIST_BYTES;

const MARK: &str = RESERVED[0];
const RECIPE: &str = RESERVED[1];

/// What lists may name of the files that the program keeps for itself: those of a scene, its manifest where it is stale, and
/// the recipe in the list of the end of a run.
fn may_name(list: &str, key: &str, path: &DatasetPath) -> bool {
    let is_below = |folder: &str| path.strip_prefix(MARK).is_some_and(|path| path.starts_with(folder));
    is_below("/settled/")
        || is_below("/shards/")
        || (key == "stale" && is_below("/scenes/"))
        || (path.as_str() == RECIPE && list.ends_with(FINISHED))
}

/// Name of the list of what the end of a run wrote.
const FINISHED: &str = "finished.json";

/// Something in a dataset that may not be there.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Odd {
    /// Its path, with `/` between folders.
    pub path: String,
    /// What is odd about it.
    pub what: String,
}

/// What to do about a dataset that somebody has changed.
const CHANGED: &str =
    "nothing was touched; no run writes that: somebody changed the dataset, and it may be made to harm";

impl Odd {
    fn into_error(self, root: &Path) -> Error {
        Error::new(self.what).in_file(root.join(self.path)).help(CHANGED).permanent()
    }
}

/// Refuses a dataset whose own folder is reached by a link. Asked before it is locked.
pub fn check_mark(root: &Path) -> Result<()> {
    let mut found = Vec::new();
    for path in [MARK.to_owned(), format!("{MARK}/lock")] {
        let Ok(there) = fs::symlink_metadata(root.join(&path)) else { break };
        let is_mark = path == MARK;
        if (is_mark && !there.is_dir()) || (!is_mark && !there.is_file()) {
            found.push(Odd { what: what_is(there.file_type(), is_mark), path });
            break;
        }
    }
    found.into_iter().next().map_or(Ok(()), |odd| Err(odd.into_error(root)))
}

/// Refuses a dataset whose own folder has links, whose lists name files that are not its own, or of which a listed folder is a
/// link. Asked when nobody else writes to it.
pub fn check(root: &Path) -> Result<()> {
    let mut own = own_files(root)?;
    if !own.odd.is_empty() {
        return Err(own.odd.swap_remove(0).into_error(root));
    }
    let mut folders = own.ready;
    for list in own.lists {
        let names = names(&read(&root.join(&list))?);
        if let Some(odd) = outside(&list, &names).into_iter().next() {
            return Err(odd.into_error(root));
        }
        for name in names.iter().filter_map(|(_, name)| DatasetPath::new(name.as_str()).ok()) {
            if let Some(folder) = name.folders().last().filter(|folder| !folders.contains(*folder)) {
                folders.insert(folder.to_owned());
            }
        }
    }
    // Of each folder with those around it.
    let each = folders.iter().flat_map(|folder| prefixes(folder));
    let all: BTreeSet<&str> = each.collect();
    match all.into_iter().find(|folder| is_link(&root.join(folder))) {
        Some(folder) => Err(linked(root, folder)),
        None => Ok(()),
    }
}

/// A folder and those that it is in, from the outermost one.
fn prefixes(folder: &str) -> impl Iterator<Item = &str> {
    folder.match_indices('/').map(|(end, _)| &folder[..end]).chain([folder])
}

/// What is in the program's own folder of a dataset.
#[derive(Default)]
pub struct OwnFiles {
    /// What is neither a file nor a folder, sorted.
    pub odd: Vec<Odd>,
    /// Paths of the lists of files, sorted.
    pub lists: Vec<String>,
    /// Folders of the dataset that files of staged scenes are moved to.
    ready: BTreeSet<String>,
}

/// Looks at the program's own folder, and at the recipe beside it.
pub fn own_files(root: &Path) -> Result<OwnFiles> {
    let mut own = OwnFiles::default();
    for path in [MARK.to_owned(), RECIPE.to_owned(), format!("{RECIPE}.part")] {
        let Ok(there) = fs::symlink_metadata(root.join(&path)) else { continue };
        let is_mark = path == MARK;
        if (is_mark && there.is_dir()) || (!is_mark && there.is_file()) {
            continue;
        }
        own.odd.push(Odd { what: what_is(there.file_type(), is_mark), path });
    }
    if own.odd.is_empty() {
        walk(root, MARK, &mut own)?;
    }
    own.odd.sort_unstable();
    own.lists.sort_unstable();
    Ok(own)
}

fn walk(root: &Path, inside: &str, own: &mut OwnFiles) -> Result<()> {
    let folder = root.join(inside);
    let entries = match fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(Error::io(&folder, &error)),
    };
    for entry in entries {
        let entry = entry.map_err(|error| Error::io(&folder, &error))?;
        let kind = entry.file_type().map_err(|error| Error::io(entry.path(), &error))?;
        let name = entry.file_name();
        let path = format!("{inside}/{}", name.to_string_lossy());
        if kind.is_dir() {
            walk(root, &path, own)?;
            own.ready.extend(ready_folder(&path).map(str::to_owned));
        } else if !kind.is_file() {
            own.odd.push(Odd { what: what_is(kind, false), path });
        } else if is_list(&path) {
            own.lists.push(path);
        }
    }
    Ok(())
}

/// The folder of the dataset that one of a staged scene becomes.
fn ready_folder(path: &str) -> Option<&str> {
    let (scene, folder) = path.strip_prefix(MARK)?.strip_prefix("/staging/")?.split_once('/')?;
    Some(folder).filter(|folder| scene.ends_with(".ready") && !folder.starts_with(MARK))
}

/// Whether a file of the dataset's own folder lists files: what the end of a run wrote, a scene, a scene that is being moved
/// into place, and those of a dataset that is being deleted.
fn is_list(path: &str) -> bool {
    let mut parts = path.rsplit('/');
    let (name, folder) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    name == FINISHED || name == "staged.json" || (folder == "scenes" && name.ends_with(".json"))
}

fn what_is(kind: FileType, is_folder: bool) -> String {
    let expected = if is_folder { "a folder" } else { "a file" };
    match kind {
        kind if kind.is_symlink() => format!("it is a link where {expected} of the program's own was expected"),
        kind if kind.is_dir() => "it is a folder where a file was expected".to_owned(),
        kind if kind.is_file() => "it is a file where a folder was expected".to_owned(),
        _ => format!("it is a device, a pipe or a socket where {expected} was expected"),
    }
}

/// The bytes of a list; none if it went away.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    Ok(read_list(path)?.unwrap_or_default())
}

/// The bytes of a file that a run keeps in its dataset, if the file exists. Refuses a file larger than [`RUN_LIST_BYTES`].
pub fn read_list(path: &Path) -> Result<Option<Vec<u8>>> {
    let fail = |error: std::io::Error| Error::io(path, &error);
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(fail(error)),
    };
    let check = |length: u64| RUN_LIST_BYTES.check(length).map_err(|error| error.in_file(path));
    check(file.metadata().map_err(fail)?.len())?;
    // The file may grow, or state no length.
    let mut bytes = Vec::new();
    file.take(RUN_LIST_BYTES.most + 1).read_to_end(&mut bytes).map_err(fail)?;
    check(bytes.len() as u64)?;
    Ok(Some(bytes))
}

/// What lists of files have in common.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Lists {
    files: BTreeMap<String, IgnoredAny>,
    writers: BTreeMap<String, Vec<String>>,
    stale: Vec<String>,
}

/// The paths that a list names, each with its key; none if the text is none of a list, which counts as damaged.
pub fn names(text: &[u8]) -> Vec<(&'static str, String)> {
    let Lists { files, writers, stale } = serde_json::from_slice(text).unwrap_or_default();
    let files = files.into_keys().map(|path| ("files", path));
    let writers = writers.into_values().flatten().map(|path| ("writers", path));
    files.chain(writers).chain(stale.into_iter().map(|path| ("stale", path))).collect()
}

/// Those of the paths that a list names and that are not of the dataset, or the program's own and none that lists have.
pub fn outside(list: &str, names: &[(&'static str, String)]) -> Vec<Odd> {
    let odd = |(key, name): &(&'static str, String)| {
        let why = match DatasetPath::new(name.as_str()) {
            Err(error) => error.to_string(),
            Ok(path) if path.is_reserved() && !may_name(list, key, &path) => {
                format!("`{name}` is a path that the program keeps for itself, and that no list has")
            }
            Ok(_) => return None,
        };
        Some(Odd { path: list.to_owned(), what: format!("`{key}` names a file that is not the dataset's: {why}") })
    };
    names.iter().filter_map(odd).collect()
}
