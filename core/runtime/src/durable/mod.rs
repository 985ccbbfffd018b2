//! Files and folders that take their place whole.
//!
//! Whatever kills a command, and whatever call fails, a place has what was there before or all of what is new, and the same
//! command mends what is left beside it. All verbs write through here; the folder of a run has rules of its own, see
//! [`run::folder`](crate::run::dataset::folder).
//!
//! ```text
//! OUT                          the place
//! OUT.part/.syntable-part      the mark: this program works here, or was killed. Locked while it works
//! OUT.part/new                 the new file or folder while it is made; it never stood at the place
//! OUT.part/old                 what is exchanged with the place: the finished file or folder, then what was there before
//! ```
//!
//! What is new is brought to disk before it gets its name, and the name before anything old is deleted. A folder that may be
//! replaced has a [`FileListing`] of its files, the last file to be written and the last to be deleted. Only listed files of the
//! listed size are deleted. A folder with anything else is refused. If something else came to the place at the last moment, it
//! goes back there; if that fails, it stays in `OUT.part/old`.

mod disk;
mod listing;
#[cfg(test)]
mod tests;

pub use listing::{FileListing, LISTING};

use crate::run::dataset::manifest::Stamp;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};

/// Name of the mark in the folder beside a place.
const MARK: &str = ".syntable-part";
/// Content of the mark.
const MARK_TEXT: &str = "A command of syntable works here, or was interrupted. The same command clears this folder.\n";
/// What is being made.
const NEW: &str = "new";
/// What stood at the place.
const OLD: &str = "old";
/// Bytes of the longest name to which `.part` is appended.
const LONGEST: usize = 250;
/// How long a file waits for another command that writes it.
const PATIENCE: Duration = Duration::from_secs(10);
/// Number of threads that bring files to disk: file systems do many at the price of few.
const SYNCS: usize = 8;
/// Number of links to files that are not there yet that are followed.
const LINKS: u32 = 8;

/// What stands at a place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Standing {
    /// Nothing, or an empty folder.
    Free,
    /// A folder that a command made.
    Made(FileListing),
    /// Something else.
    Other,
}

/// Looks at a place.
///
/// # Errors
/// If it cannot be read.
pub fn standing(place: &Path) -> Result<Standing> {
    let failed = |error: std::io::Error| refused(place, &error);
    match fs::metadata(place) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Standing::Free),
        Err(error) => return Err(failed(error)),
        Ok(there) if !there.is_dir() => return Ok(Standing::Other),
        Ok(_) => {}
    }
    if fs::read_dir(place).map_err(failed)?.next().is_none() {
        return Ok(Standing::Free);
    }
    Ok(FileListing::read(place)?.map_or(Standing::Other, Standing::Made))
}

/// Undoes or finishes what an interrupted command left beside a place.
///
/// # Errors
/// If another command works there, if something else has that name, or if the file system fails.
pub fn mend(place: &Path) -> Result<()> {
    let place = place_of(place)?;
    match fs::symlink_metadata(part_of(&place)) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        _ => Draft::at(place).map(drop),
    }
}

/// Writes a file, over one that is there. Links lead to the file, and permissions stay. Devices and pipes take what is written.
///
/// # Errors
/// If it cannot be written. A path that no try can write, such as a folder, is a mistake of the request.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_linked(path, bytes, LINKS)
}

fn write_linked(path: &Path, bytes: &[u8], links: u32) -> Result<()> {
    let there = fs::metadata(path).ok();
    let refuse = |what: &str| Err(Error::new(what).in_file(path).help("name another file"));
    // `/dev/stdout` may lead to a file, which what is printed goes to as well.
    let is_system = ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder)) && !path.starts_with("/dev/shm");
    let is_stream = is_system || there.as_ref().is_some_and(|there| !there.is_file() && !there.is_dir());
    if is_stream {
        return fs::write(path, bytes).map_err(|error| refused(path, &error));
    }
    match &there {
        Some(there) if there.is_dir() => return refuse("it is a folder"),
        Some(there) if there.permissions().readonly() => return refuse("it is read-only"),
        None if path.is_symlink() => {
            let target = fs::read_link(path).map_err(|error| refused(path, &error))?;
            let target = path.parent().unwrap_or(Path::new("")).join(target);
            return if links == 0 { refuse("its links lead nowhere") } else { write_linked(&target, bytes, links - 1) };
        }
        _ => {}
    }
    let draft = Draft::of_file(path)?;
    let new = draft.folder();
    let permit = || there.as_ref().map_or(Ok(()), |there| disk::set_permissions(&new, there.permissions()));
    let written = disk::write_new(&new, bytes).and_then(|()| permit());
    written.map_err(|error| refused(&draft.place, &error))?;
    disk::sync_file(&new).map_err(|error| Error::io(&draft.place, &error))?;
    draft.publish_over(there.is_some())
}

/// Writes a file that must not be there yet.
///
/// A file that comes to the path meanwhile is kept, and is an error. The exception is a file system without hard links on
/// which the system cannot refuse to rename over a file (`RENAME_NOREPLACE` of Linux): there, such a file is replaced.
///
/// # Errors
/// If it is there, or cannot be written.
pub fn create_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let taken = || Error::new("it exists already").in_file(path).help("choose another path");
    mend(path)?;
    if fs::symlink_metadata(path).is_ok() {
        return Err(taken());
    }
    let draft = Draft::of_file(path)?;
    let new = draft.folder();
    disk::write_new(&new, bytes).map_err(|error| refused(&draft.place, &error))?;
    disk::sync_file(&new).map_err(|error| Error::io(&draft.place, &error))?;
    // A link never replaces a file that has come meanwhile. Where the file system has no links, a name is moved.
    let named = disk::link(&new, path).or_else(|error| match error.kind() {
        ErrorKind::AlreadyExists => Err(error),
        _ => disk::rename_new(&new, path),
    });
    match named {
        Ok(()) => sync(&above(path)).and_then(|()| draft.tidy()),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(taken()),
        Err(error) => Err(Error::io(path, &error)),
    }
}

/// An error of the file system at a path that the command names. Those that say that the path is wrong are mistakes of the request.
fn refused(path: &Path, error: &std::io::Error) -> Error {
    let failed = Error::io(path, error);
    // What exists already is a file where a folder is needed.
    let is_denied =
        matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::AlreadyExists);
    if is_denied || !failed.is_transient() { failed.help("name another path").of_request() } else { failed }
}

/// A file or folder in the making, beside its place. Dropped, it leaves nothing.
pub struct Draft {
    place: PathBuf,
    part: PathBuf,
    /// What was written with [`write`](Self::write).
    files: Mutex<BTreeMap<String, Stamp>>,
    /// Held as long as the command works.
    lock: Option<File>,
}

impl Draft {
    /// Begins a folder. What an interrupted command left is cleared. The folders above the place are made.
    ///
    /// # Errors
    /// If the place has no name or is a mount point, if another command works there, or if the file system fails.
    pub fn begin(place: &Path) -> Result<Self> {
        let place = place_of(place)?;
        if let Some(above) = place.parent().filter(|above| !above.as_os_str().is_empty()) {
            disk::create_dir_all(above).map_err(|error| refused(above, &error))?;
        }
        check_mount(&place)?;
        let draft = Self::at(place)?;
        let new = draft.folder();
        disk::create_dir(&new).map_err(|error| Error::io(&new, &error))?;
        Ok(draft)
    }

    /// Begins a file; waits for another command that writes it.
    fn of_file(path: &Path) -> Result<Self> {
        // A link leads to what is replaced.
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let start = Instant::now();
        loop {
            match Self::lock(&path)? {
                Some(draft) => return draft.mended(),
                None if start.elapsed() > PATIENCE => return Err(busy(&path)),
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    fn at(place: PathBuf) -> Result<Self> {
        Self::lock(&place)?.ok_or_else(|| busy(&place))?.mended()
    }

    /// Makes the folder beside a place, or takes over one that was left; none if another command holds it.
    fn lock(place: &Path) -> Result<Option<Self>> {
        let part = part_of(place);
        let mark = part.join(MARK);
        // The folder beside a place has a shorter name than one that is too long, and could be made.
        match fs::symlink_metadata(place) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(refused(place, &error)),
            _ => {}
        }
        loop {
            match disk::create_dir(&part) {
                Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(refused(place, &error)),
                _ => {}
            }
            check_mark(&part)?;
            let file = match disk::open_lock(&mark) {
                Ok(file) => file,
                // The command that worked here has just ended.
                Err(error) if error.kind() == ErrorKind::NotFound && !mark.is_symlink() => continue,
                Err(error) => return Err(Error::io(&mark, &error)),
            };
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => return Ok(None),
                // Some file systems have no locks.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            if !is_at(&file, &mark) {
                continue;
            }
            let draft = Self { place: place.to_owned(), part, files: Mutex::default(), lock: Some(file) };
            if let Some(file) = &draft.lock {
                let marked = file.set_len(0).and_then(|()| disk::write(file, MARK_TEXT.as_bytes()));
                marked.map_err(|error| Error::io(&mark, &error))?;
            }
            return Ok(Some(draft));
        }
    }

    /// Clears what an interrupted command left.
    fn mended(self) -> Result<Self> {
        self.mend()?;
        Ok(self)
    }

    fn mend(&self) -> Result<()> {
        let (new, old) = (self.part.join(NEW), self.part.join(OLD));
        let is_there = |path: &Path| disk::is_there(path).map_err(|error| Error::io(path, &error));
        if is_there(&old)? {
            match standing(&self.place)? {
                Standing::Free => {
                    disk::rename(&old, &self.place).map_err(|error| Error::io(&self.place, &error))?;
                    sync(&above(&self.place))?;
                }
                _ if may_replace(&self.place, &old)? => discard(&old, disk::remove_dir)?,
                _ => return Err(kept(&old, &self.place)),
            }
        }
        if is_there(&new)? {
            // A folder without a list was never at the place, and all in it is ours.
            discard(&new, disk::remove_dir_all)?;
        }
        Ok(())
    }

    /// The folder in which files are made.
    pub fn folder(&self) -> PathBuf {
        self.part.join(NEW)
    }

    /// The place, without links.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// Writes a file of the folder, once, by its path with `/` between folders, and lists it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &str, bytes: &[u8]) -> Result<()> {
        let full = self.folder().join(path);
        let parent = above(&full);
        disk::create_dir_all(&parent).map_err(|error| Error::io(&parent, &error))?;
        disk::write_new(&full, bytes).map_err(|error| Error::io(&full, &error))?;
        self.files.lock().insert(path.to_owned(), Stamp::of_bytes(bytes));
        Ok(())
    }

    /// Gives the folder its name, which must be free or that of an empty folder.
    ///
    /// # Errors
    /// If something stands there, or cannot be brought to disk. What was there before stays.
    pub fn publish(self) -> Result<()> {
        sync_tree(&self.folder())?;
        if standing(&self.place)? != Standing::Free {
            return Err(taken(&self.place));
        }
        self.publish_over(false)
    }

    /// Lists the files that were written, and lets the folder take the place of one that the same command made before, or of
    /// nothing. The files of the one before are deleted.
    ///
    /// # Errors
    /// If something else stands there, or cannot be brought to disk. What was there before stays. If only its deletion
    /// fails, the error says so.
    pub fn publish_listed(self, made_by: &str) -> Result<()> {
        let listing = FileListing { made_by: made_by.to_owned(), files: std::mem::take(&mut *self.files.lock()) };
        let path = self.folder().join(LISTING);
        disk::write_new(&path, listing.text().as_bytes()).map_err(|error| Error::io(&path, &error))?;
        sync_tree(&self.folder())?;
        let replaces = match standing(&self.place)? {
            Standing::Free => false,
            Standing::Made(there) if there.made_by == made_by => {
                there.check(&self.place)?;
                true
            }
            _ => return Err(taken(&self.place)),
        };
        self.publish_over(replaces)
    }

    /// Puts what is new into its place, brings that to disk, and deletes what was there before.
    fn publish_over(self, replaces: bool) -> Result<()> {
        let (new, place) = (self.folder(), self.place.clone());
        let failed = |error: std::io::Error| Error::io(&place, &error);
        if let Ok(there) = fs::metadata(&place)
            && there.is_dir()
        {
            disk::set_permissions(&new, there.permissions()).map_err(|error| Error::io(&new, &error))?;
            if cfg!(windows) && !replaces {
                disk::remove_dir(&place).map_err(failed)?;
            }
        }
        if replaces {
            self.replace()?;
        } else {
            disk::rename(&new, &place).map_err(failed)?;
            if let Err(error) = sync(&above(&place)) {
                let _ = disk::rename(&place, &new);
                return Err(error);
            }
        }
        self.tidy()
    }

    /// Clears what is beside the place, which is whole.
    fn tidy(mut self) -> Result<()> {
        let tidied = self.mend().and_then(|()| self.end());
        tidied.map_err(|error| {
            error.context(format!("{} is written, but not all beside it is cleared", self.place.display()))
        })
    }

    /// Exchanges what is new with what stands at the place. An error leaves what stood there.
    fn replace(&self) -> Result<()> {
        let (new, old, place) = (self.folder(), self.part.join(OLD), &self.place);
        let failed = |error: std::io::Error| Error::io(place, &error);
        let sync = || disk::sync_folder(&above(place)).and_then(|()| disk::sync_folder(&self.part));
        // A kill after the exchange must leave what stood at the place under a name that nobody deletes unseen.
        disk::rename(&new, &old).map_err(failed)?;
        let exchanged = disk::sync_folder(&self.part).and_then(|()| disk::exchange(&old, place));
        if !matches!(exchanged, Ok(true)) {
            disk::rename(&old, &new).map_err(failed)?;
        }
        if exchanged.map_err(failed)? {
            let back = || -> std::io::Result<()> {
                disk::exchange(&old, place)?;
                // Otherwise the user has moved something once more: it stays.
                if may_replace(&old, &old).unwrap_or(false) { disk::rename(&old, &new) } else { Ok(()) }
            };
            return match may_replace(place, &old) {
                Ok(true) => sync().map_err(|error| {
                    let _ = back();
                    failed(error)
                }),
                looked => {
                    let refused = looked.err().unwrap_or_else(|| taken(place));
                    back().map_or_else(|_| Err(kept(&old, place)), |()| Err(refused))
                }
            };
        }
        if new.is_file() {
            // One step for files, on any system. A name that is not on disk yet is one of two whole files.
            return disk::rename(&new, place).and_then(|()| sync()).map_err(failed);
        }
        disk::rename(place, &old).map_err(failed)?;
        let back = || disk::rename(&old, place);
        match may_replace(&new, &old) {
            Ok(true) => {}
            looked => {
                let refused = looked.err().unwrap_or_else(|| taken(place));
                return back().map_or_else(|_| Err(kept(&old, place)), |()| Err(refused));
            }
        }
        if let Err(error) = disk::rename(&new, place) {
            let _ = back();
            return Err(failed(error));
        }
        sync().map_err(|error| {
            let _ = disk::rename(place, &new).and_then(|()| back());
            failed(error)
        })
    }

    /// Removes the mark, and the folder beside the place.
    fn end(&mut self) -> Result<()> {
        let mark = self.part.join(MARK);
        disk::remove_file(&mark).map_err(|error| Error::io(&mark, &error))?;
        self.lock = None;
        match disk::remove_dir(&self.part) {
            // Another command has come meanwhile.
            Err(error) if matches!(error.kind(), ErrorKind::DirectoryNotEmpty | ErrorKind::NotFound) => Ok(()),
            removed => removed.map_err(|error| Error::io(&self.part, &error)),
        }
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if self.lock.is_some() && !disk::is_killed() {
            // The error that led here is the one to report.
            let _ = self.mend().and_then(|()| self.end());
        }
    }
}

/// The folder beside a place in which the command works.
fn part_of(place: &Path) -> PathBuf {
    let mut name = place.file_name().unwrap_or_default().to_owned();
    if name.len() > LONGEST {
        name = Digest::of(name.as_encoded_bytes()).to_string().into();
    }
    name.push(".part");
    place.with_file_name(name)
}

/// The folder that a path is in.
fn above(path: &Path) -> PathBuf {
    let above = path.parent().filter(|above| !above.as_os_str().is_empty());
    above.unwrap_or(Path::new(".")).to_owned()
}

/// A place without links at its end.
fn place_of(place: &Path) -> Result<PathBuf> {
    let is_link = place.is_symlink();
    let place = if is_link {
        place.canonicalize().map_err(|error| {
            let help = "make the folder that it leads to, or choose another --out";
            match error.kind() {
                ErrorKind::NotFound => Error::new("it is a link to what is not there").help(help),
                _ => refused(place, &error),
            }
            .in_file(place)
        })?
    } else {
        place.to_owned()
    };
    if place.file_name().is_none() {
        return Err(Error::new("it is no name of a folder").in_file(place));
    }
    Ok(place)
}

/// Refuses a folder that cannot get another name, before work is done.
#[cfg(unix)]
fn check_mount(place: &Path) -> Result<()> {
    use std::os::unix::fs::MetadataExt;
    let device = |path: &Path| fs::metadata(path).ok().map(|there| there.dev());
    if device(place).is_some_and(|own| device(&above(place)).is_some_and(|above| above != own)) {
        return Err(Error::new("it is a mount point, which no new folder can replace")
            .in_file(place)
            .help("choose a folder in it"));
    }
    Ok(())
}

#[cfg(not(unix))]
fn check_mount(_: &Path) -> Result<()> {
    Ok(())
}

/// Refuses a folder beside a place that this program did not make.
fn check_mark(part: &Path) -> Result<()> {
    let is_mark = |path: &Path| {
        match fs::symlink_metadata(path) {
            // A kill may have cut it.
            Ok(it) if it.is_file() && it.len() <= MARK_TEXT.len() as u64 => {
                fs::read(path).is_ok_and(|text| MARK_TEXT.as_bytes().starts_with(&text))
            }
            Ok(_) => false,
            // The command that worked here has just removed it.
            Err(error) => error.kind() == ErrorKind::NotFound,
        }
    };
    let is_ours = || -> std::io::Result<bool> {
        if !fs::symlink_metadata(part)?.is_dir() {
            return Ok(false);
        }
        let names = fs::read_dir(part)?.map(|entry| Ok(entry?.file_name()));
        let names = names.collect::<std::io::Result<Vec<_>>>()?;
        let is_marked = names.iter().any(|name| name == MARK) && is_mark(&part.join(MARK));
        Ok(names.is_empty() || is_marked && names.iter().all(|name| [MARK, NEW, OLD].iter().any(|own| name == own)))
    };
    match is_ours() {
        Ok(true) => Ok(()),
        // The command that worked here has just ended, or removes its mark.
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Error::io(part, &error)),
        Ok(false) => Err(Error::new("it stands where the result is made before it gets its name")
            .in_file(part)
            .help("move it away, or choose another path")),
    }
}

/// Whether an open file is the one that has a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |it: &fs::Metadata| (it.dev(), it.ino());
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(there)) => id(&open) == id(&there),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.is_file()
}

fn busy(place: &Path) -> Error {
    Error::new("another command is writing it").in_file(place).help("wait until that has ended, or choose another path")
}

fn taken(place: &Path) -> Error {
    Error::new("something came there while the command worked")
        .in_file(place)
        .help("choose another path; nothing was touched")
}

/// Something of the user that is now beside the place.
fn kept(old: &Path, place: &Path) -> Error {
    Error::new(format!("it came to {} while a command worked, and was kept here", place.display()))
        .in_file(old)
        .help("move it away, and run the command again")
}

/// Whether what is new may replace what is old, which is then deleted: a file replaces a file, and a folder replaces an empty
/// folder or one that the same command made. Links are neither.
fn may_replace(new: &Path, old: &Path) -> Result<bool> {
    let kind = |path: &Path| fs::symlink_metadata(path).map_err(|error| Error::io(path, &error));
    let (is_new, is_old) = (kind(new)?, kind(old)?);
    if !is_new.is_dir() || !is_old.is_dir() {
        return Ok(is_new.is_file() && is_old.is_file());
    }
    if fs::read_dir(old).map_err(|error| Error::io(old, &error))?.next().is_none() {
        return Ok(true);
    }
    let made_by = |folder: &Path| Ok(FileListing::read(folder)?.map(|listing| listing.made_by));
    let old = made_by(old)?;
    Ok(old.is_some() && old == made_by(new)?)
}

/// Deletes what is beside a place: listed files of a folder that has a list. `unlisted` deletes a folder without one.
fn discard(path: &Path, unlisted: impl FnOnce(&Path) -> std::io::Result<()>) -> Result<()> {
    let failed = |error: std::io::Error| Error::io(path, &error);
    let there = fs::symlink_metadata(path).map_err(failed)?;
    if !there.is_dir() {
        return disk::remove_file(path).map_err(failed);
    }
    match FileListing::read(path)? {
        Some(listing) => listing.delete(path),
        None => unlisted(path).map_err(failed),
    }
}

fn sync(folder: &Path) -> Result<()> {
    disk::sync_folder(folder).map_err(|error| Error::io(folder, &error))
}

/// Brings all files of a folder to disk, then the folders.
fn sync_tree(folder: &Path) -> Result<()> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    let mut next = 0;
    while let Some(folder) = folders.get(next).cloned() {
        next += 1;
        let failed = |error: std::io::Error| Error::io(&folder, &error);
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let kind = entry.file_type().map_err(|error| Error::io(entry.path(), &error))?;
            if kind.is_dir() {
                folders.push(entry.path());
            } else if kind.is_file() {
                files.push(entry.path());
            }
        }
    }
    files.sort();
    let sync_file = |path: &PathBuf| disk::sync_file(path).map_err(|error| Error::io(path, &error));
    if files.len() < 4 * SYNCS {
        files.iter().try_for_each(sync_file)?;
    } else {
        let (taken, failed) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
        std::thread::scope(|scope| {
            for _ in 0..SYNCS {
                scope.spawn(|| {
                    while let Some(path) = files.get(taken.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(error) = sync_file(path) {
                            failed.lock().insert(path.clone(), error);
                            // The others need not be tried.
                            taken.store(files.len(), Ordering::Relaxed);
                        }
                    }
                });
            }
        });
        if let Some((_, error)) = failed.into_inner().pop_first() {
            return Err(error);
        }
    }
    folders.iter().rev().try_for_each(|folder| sync(folder))
}
