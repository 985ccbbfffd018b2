//! The folder of names, and the mirror that a path is in.

use super::ahead::Ahead;
use super::downloads::Downloads;
use super::listed::Listed;
use super::remote_file::{Open, RemoteFile};
use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::shown;
use crate::store::{StoreFolder, Stored};
use parking_lot::RwLock;
use std::collections::BTreeSet;
use std::fmt;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Weak};

/// The mirrors of the process, by the folders of their names.
static MIRRORS: RwLock<Vec<(PathBuf, Weak<Mirror>)>> = RwLock::new(Vec::new());

/// Folder of annotation files in COCO's layout. The images are beside it.
const ANNOTATIONS: &str = "annotations";

/// The names of the files below a URL. Dropping the last reference removes the names, and keeps the downloads.
pub struct Mirror {
    /// A folder of its own, which is locked.
    own: PathBuf,
    _lock: File,
    /// The names, in a folder in `own`.
    root: PathBuf,
    listed: Arc<Listed>,
    ahead: Ahead,
    process: u32,
}

impl Mirror {
    /// Lists a folder or a file at a URL. Returns the mirror, and the path of the folder or the file in it.
    ///
    /// # Errors
    /// If no linked crate knows the scheme of the URL, the store has no such folder or file, or the store or the cache fails.
    pub fn open(url: &str) -> Result<(Arc<Self>, PathBuf)> {
        let url = url.trim_end_matches('/');
        let named = StoreFolder::at(url)?;
        let list = named.files()?;
        if !list.is_empty() {
            let mirror = Self::of(named, url, list, Downloads::of_user()?)?;
            return Ok((Arc::clone(&mirror), mirror.root.clone()));
        }
        // An annotation file: its dataset is the folder above, or the one above that.
        let above = |url: &str| url.rsplit_once('/').map(|(above, name)| (above.to_owned(), name.to_owned()));
        let missing = || Error::new("no such folder or file").in_file(url);
        let Some((mut folder, mut name)) = above(url).filter(|(folder, _)| !folder.ends_with('/')) else {
            return Err(missing());
        };
        if !StoreFolder::at(&folder)?.has(&name)? {
            return Err(missing());
        }
        if let Some((outer, last)) = above(&folder).filter(|(outer, last)| last == ANNOTATIONS && !outer.ends_with('/'))
        {
            (folder, name) = (outer, format!("{last}/{name}"));
        }
        let store = StoreFolder::at(&folder)?;
        let list = store.files()?;
        let mirror = Self::of(store, &folder, list, Downloads::of_user()?)?;
        let path = mirror.root.join(name);
        Ok((mirror, path))
    }

    /// The mirror of a folder with these files.
    pub(crate) fn of(
        store: StoreFolder,
        url: &str,
        list: Vec<(DatasetPath, Stored)>,
        downloads: Arc<Downloads>,
    ) -> Result<Arc<Self>> {
        let (own, lock) = downloads.new_names()?;
        // Readers name a dataset after its folder.
        let root = own.join("names").join(url.rsplit('/').next().filter(|name| !name.is_empty()).unwrap_or("dataset"));
        let fail = |error: std::io::Error| downloads.fail(&own, &error);
        let listed = Arc::new(Listed::new(store, url, list, Arc::clone(&downloads)));
        create_names(&root, &listed.files).map_err(fail)?;
        let root = root.canonicalize().map_err(fail)?;
        shown::show(&root, url);
        let (ahead, process) = (Ahead::new(Arc::clone(&listed)), std::process::id());
        let mirror = Arc::new(Self { own, _lock: lock, root, listed, ahead, process });
        MIRRORS.write().push((mirror.root.clone(), Arc::downgrade(&mirror)));
        Ok(mirror)
    }

    /// The folder of the names.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Whether the process was forked after the mirror was made: threads that held its locks are not there.
    fn is_forked(&self) -> bool {
        self.process != std::process::id()
    }

    /// Opens a file, and downloads the files that probably follow.
    pub(super) fn open_file(&self, number: usize) -> Result<Open> {
        let opened = if self.is_forked() {
            self.listed.open_alone(number)
        } else {
            self.ahead.follow(number);
            self.listed.open(number)
        };
        opened.inspect_err(|error| self.listed.outage().note(error))
    }

    /// Why a download failed since the last call. A reader may have taken the failure for damage of the dataset.
    pub fn take_outage(&self) -> Option<Error> {
        self.listed.outage().take()
    }
}

impl fmt::Debug for Mirror {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Mirror({})", shown::shown(&self.root).display())
    }
}

impl Drop for Mirror {
    fn drop(&mut self) {
        MIRRORS.write().retain(|(root, _)| *root != self.root);
        shown::forget(&self.root);
        if !self.is_forked() {
            // The next mirror removes what cannot be removed now.
            let _ = fs::remove_dir_all(&self.own);
        }
    }
}

/// The folder at a path of this machine. In a mirror, it is the folder of the store, which has all its files with their content.
pub fn store_at(folder: &Path) -> StoreFolder {
    let Some((mirror, inside)) = mirror_of(folder) else { return folder.into() };
    let store = mirror.listed.store();
    DatasetPath::new(inside).map_or_else(|_| store.clone(), |inside| store.inner(&inside))
}

/// The mirror that a path is in, and the number of its file.
pub(super) fn mirrored(path: &Path) -> Option<(Arc<Mirror>, usize)> {
    let (mirror, inside) = mirror_of(path)?;
    let number = mirror.listed.find(&inside)?;
    Some((mirror, number))
}

/// The mirror that a path is in, and the path in it.
fn mirror_of(path: &Path) -> Option<(Arc<Mirror>, String)> {
    let mirrors = MIRRORS.read();
    if mirrors.is_empty() {
        return None;
    }
    let path = without_dots(&std::path::absolute(path).ok()?);
    let (root, mirror) = mirrors.iter().find(|(root, _)| path.starts_with(root))?;
    let inside = path.strip_prefix(root).ok()?.to_str()?.replace(std::path::MAIN_SEPARATOR, "/");
    Some((mirror.upgrade()?, inside))
}

/// A path without `.` and `..`. No folder of a mirror is a link.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => drop(plain.pop()),
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

/// Creates empty files, folders first. Names that this machine refuses, and a file that is also a folder, are left out: no
/// reader can name them.
fn create_names(root: &Path, files: &[RemoteFile]) -> std::io::Result<()> {
    let unless_full =
        |created: std::io::Result<()>| created.or_else(|error| if is_full(&error) { Err(error) } else { Ok(()) });
    fs::create_dir_all(root)?;
    let folders: BTreeSet<&str> = files.iter().filter_map(|file| Some(file.path.rsplit_once('/')?.0)).collect();
    folders.into_iter().try_for_each(|folder| unless_full(fs::create_dir_all(root.join(folder))))?;
    files.iter().try_for_each(|file| unless_full(File::create_new(file.path.below(root)).map(drop)))
}

/// Whether no further file fits.
fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::ReadOnlyFilesystem)
}
