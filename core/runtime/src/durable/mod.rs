//! Atomic replacement of files and folders.
//!
//! If a kill or a failing call interrupts a command, the target has either its old content or all of its new content,
//! and the same command cleans up. All verbs write through this module. The folder of a run has its own rules, see
//! [`run::folder`](crate::run::dataset::folder).
//!
//! ```text
//! OUT                          the target
//! OUT.part/.syntable-part      the mark: this program works here, or was killed. Locked while it works
//! OUT.part/new                 the unfinished new file or folder; never at the target
//! OUT.part/old                 exchanged with the target: first the finished new content, then the old content
//! ```
//!
//! New content is synced to disk before it gets its name, and the name is synced before old content is deleted. A
//! replaceable folder has a [`FileListing`] of its files, which is written last and deleted last. Only listed files of
//! the listed size are deleted, and a folder with any other file is refused. If another program creates something at
//! the target at the last moment, it is moved back there; if that fails, it stays in `OUT.part/old`.

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
use syntable_model::store::is_url;

/// Name of the mark in the folder beside the target.
const MARK: &str = ".syntable-part";
/// Content of the mark.
const MARK_TEXT: &str = "A command of syntable works here, or was interrupted. The same command clears this folder.\n";
/// Name of the unfinished new content.
const NEW: &str = "new";
/// Name of the old content.
const OLD: &str = "old";
/// Maximum length of a name that can take the suffix `.part`, bytes.
const LONGEST: usize = 250;
/// Maximum time that a file waits for another command that writes it.
const PATIENCE: Duration = Duration::from_secs(10);
/// Number of threads that sync files: many syncs at once take little longer than one.
const SYNCS: usize = 8;
/// Maximum number of links to missing files in a row.
const LINKS: u32 = 8;

/// Content of a target.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Standing {
    /// Nothing, or an empty folder.
    Free,
    /// A folder that a command created.
    Made(FileListing),
    /// Any other content.
    Other,
}

/// Inspects a target.
///
/// # Errors
/// If the target is a URL, or unreadable.
pub fn standing(place: &Path) -> Result<Standing> {
    check_here(place)?;
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

/// Rolls back or completes the work of an interrupted command beside a target.
///
/// # Errors
/// If another command works there, if a foreign file or folder has that name, or if the file system fails.
pub fn mend(place: &Path) -> Result<()> {
    let place = place_of(place)?;
    match fs::symlink_metadata(part_of(&place)) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        _ => Draft::at(place).map(drop),
    }
}

/// Writes or overwrites a file. Follows links, and keeps permissions. Devices and pipes receive the bytes.
///
/// # Errors
/// If the file cannot be written. A path that can never be written, such as a folder, is an error of the request.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_linked(path, bytes, LINKS)
}

fn write_linked(path: &Path, bytes: &[u8], links: u32) -> Result<()> {
    check_here(path)?;
    let there = fs::metadata(path).ok();
    let refuse = |what: &str| Err(Error::new(what).in_file(path).help("name another file"));
    // `/dev/stdout` may lead to a file, which also receives printed output.
    let is_system = ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder)) && !path.starts_with("/dev/shm");
    let is_stream = is_system || there.as_ref().is_some_and(|there| !there.is_file() && !there.is_dir());
    if is_stream {
        return fs::write(path, bytes).map_err(|error| refused(path, &error));
    }
    match &there {
        Some(there) if there.is_dir() => return refuse("the path is a folder"),
        Some(there) if there.permissions().readonly() => return refuse("the file is read-only"),
        None if path.is_symlink() => {
            let target = fs::read_link(path).map_err(|error| refused(path, &error))?;
            let target = path.parent().unwrap_or(Path::new("")).join(target);
            return if links == 0 {
                refuse("its links lead to a missing file")
            } else {
                write_linked(&target, bytes, links - 1)
            };
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

/// Writes a new file.
///
/// A file that another program creates meanwhile is kept, and is an error. The exception is a file system without hard
/// links on a system that cannot refuse to rename over a file (`RENAME_NOREPLACE` of Linux): there, such a file is
/// replaced.
///
/// # Errors
/// If the path exists or cannot be written.
pub fn create_file(path: &Path, bytes: &[u8]) -> Result<()> {
    check_here(path)?;
    let taken = || Error::new("the path already exists").in_file(path).help("choose another path");
    mend(path)?;
    if fs::symlink_metadata(path).is_ok() {
        return Err(taken());
    }
    let draft = Draft::of_file(path)?;
    let new = draft.folder();
    disk::write_new(&new, bytes).map_err(|error| refused(&draft.place, &error))?;
    disk::sync_file(&new).map_err(|error| Error::io(&draft.place, &error))?;
    // A link never replaces a file that appeared meanwhile. A file system without links renames the file instead.
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

/// Refuses a URL, which would become a folder of a strange name.
///
/// # Errors
/// If the path is a URL.
pub fn check_here(path: &Path) -> Result<()> {
    match path.to_str().is_some_and(is_url) {
        true => Err(Error::new("this command writes to folders of this machine, and not to URLs")
            .in_file(path)
            .help("name a path, and upload the result")
            .of_request()),
        false => Ok(()),
    }
}

/// A file-system error at a path of the command. Errors that blame the path are errors of the request.
fn refused(path: &Path, error: &std::io::Error) -> Error {
    let failed = Error::io(path, error);
    // `AlreadyExists` is a file at the path of a needed folder.
    let is_denied =
        matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::AlreadyExists);
    if is_denied || !failed.is_transient() { failed.help("name another path").of_request() } else { failed }
}

/// An unfinished file or folder beside its target. Dropping it leaves nothing.
pub struct Draft {
    place: PathBuf,
    part: PathBuf,
    /// Files written with [`write`](Self::write).
    files: Mutex<BTreeMap<String, Stamp>>,
    /// Lock, held while the command works.
    lock: Option<File>,
}

impl Draft {
    /// Begins a folder: cleans up after an interrupted command, and creates the parent folders.
    ///
    /// # Errors
    /// If the target has no name or is a mount point, if another command works there, or if the file system fails.
    pub fn begin(place: &Path) -> Result<Self> {
        check_here(place)?;
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

    /// Begins a file, and waits for another command that writes it.
    fn of_file(path: &Path) -> Result<Self> {
        // The replaced file is the target of the link.
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

    /// Creates the folder beside a target, or takes over an abandoned one. Returns `None` if another command holds it.
    fn lock(place: &Path) -> Result<Option<Self>> {
        let part = part_of(place);
        let mark = part.join(MARK);
        // The name of a target can be too long although the shorter name of the folder beside it is valid.
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

    /// Cleans up after an interrupted command.
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
            // A folder without a list was never at the target, so all of it is ours.
            discard(&new, disk::remove_dir_all)?;
        }
        Ok(())
    }

    /// The folder in which files are created.
    pub fn folder(&self) -> PathBuf {
        self.part.join(NEW)
    }

    /// The target, without links.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// Writes a new file of the folder, by its path with `/` between folders, and lists it.
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

    /// Gives the folder its name. The target must be unused or an empty folder.
    ///
    /// # Errors
    /// If the target has other content, or the sync fails. The old content stays.
    pub fn publish(self) -> Result<()> {
        sync_tree(&self.folder())?;
        if standing(&self.place)? != Standing::Free {
            return Err(taken(&self.place));
        }
        self.publish_over(false)
    }

    /// Lists the written files, and moves the folder to the target, which is unused or has a folder by the same
    /// command. Deletes the files of that older folder.
    ///
    /// # Errors
    /// If the target has other content, or the sync fails. The old content stays. If only its deletion fails, the error
    /// says so.
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

    /// Moves the new content to the target, syncs it, and deletes the old content.
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

    /// Cleans up beside the target, which is complete.
    fn tidy(mut self) -> Result<()> {
        let tidied = self.mend().and_then(|()| self.end());
        tidied.map_err(|error| {
            error.context(format!("{} is written, but its temporary files remain", self.place.display()))
        })
    }

    /// Exchanges the new content with the content of the target. After an error, the old content stays.
    fn replace(&self) -> Result<()> {
        let (new, old, place) = (self.folder(), self.part.join(OLD), &self.place);
        let failed = |error: std::io::Error| Error::io(place, &error);
        let sync = || disk::sync_folder(&above(place)).and_then(|()| disk::sync_folder(&self.part));
        // After the exchange, a kill must leave the old content under a name that no command deletes unseen.
        disk::rename(&new, &old).map_err(failed)?;
        let exchanged = disk::sync_folder(&self.part).and_then(|()| disk::exchange(&old, place));
        if !matches!(exchanged, Ok(true)) {
            disk::rename(&old, &new).map_err(failed)?;
        }
        if exchanged.map_err(failed)? {
            let back = || -> std::io::Result<()> {
                disk::exchange(&old, place)?;
                // Otherwise, the user has moved something again, and it stays.
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
            // One step for files, on any system. A name that is not synced yet belongs to one of two complete files.
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

    /// Removes the mark and the folder beside the target.
    fn end(&mut self) -> Result<()> {
        let mark = self.part.join(MARK);
        disk::remove_file(&mark).map_err(|error| Error::io(&mark, &error))?;
        self.lock = None;
        match disk::remove_dir(&self.part) {
            // Another command has begun meanwhile.
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

/// The work folder beside a target.
fn part_of(place: &Path) -> PathBuf {
    let mut name = place.file_name().unwrap_or_default().to_owned();
    if name.len() > LONGEST {
        name = Digest::of(name.as_encoded_bytes()).to_string().into();
    }
    name.push(".part");
    place.with_file_name(name)
}

/// The parent folder of a path.
fn above(path: &Path) -> PathBuf {
    let above = path.parent().filter(|above| !above.as_os_str().is_empty());
    above.unwrap_or(Path::new(".")).to_owned()
}

/// A target with the link at its end resolved.
fn place_of(place: &Path) -> Result<PathBuf> {
    let is_link = place.is_symlink();
    let place = if is_link {
        place.canonicalize().map_err(|error| {
            let help = "create the folder that the link leads to, or choose another output folder";
            match error.kind() {
                ErrorKind::NotFound => Error::new("the path is a link to a missing folder").help(help),
                _ => refused(place, &error),
            }
            .in_file(place)
        })?
    } else {
        place.to_owned()
    };
    if place.file_name().is_none() {
        return Err(Error::new("the path does not name a folder").in_file(place));
    }
    Ok(place)
}

/// Refuses a folder that cannot be renamed, before any work is done.
#[cfg(unix)]
fn check_mount(place: &Path) -> Result<()> {
    use std::os::unix::fs::MetadataExt;
    let device = |path: &Path| fs::metadata(path).ok().map(|there| there.dev());
    if device(place).is_some_and(|own| device(&above(place)).is_some_and(|above| above != own)) {
        return Err(Error::new("the path is a mount point, which cannot be replaced")
            .in_file(place)
            .help("choose a folder inside it"));
    }
    Ok(())
}

#[cfg(not(unix))]
fn check_mount(_: &Path) -> Result<()> {
    Ok(())
}

/// Refuses a work folder that this program did not create.
fn check_mark(part: &Path) -> Result<()> {
    let is_mark = |path: &Path| {
        match fs::symlink_metadata(path) {
            // A kill may have cut the mark short.
            Ok(it) if it.is_file() && it.len() <= MARK_TEXT.len() as u64 => {
                fs::read(path).is_ok_and(|text| MARK_TEXT.as_bytes().starts_with(&text))
            }
            Ok(_) => false,
            // The command that worked here has just removed the mark.
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
        // The command that worked here has just ended, or is removing its mark.
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Error::io(part, &error)),
        Ok(false) => Err(Error::new("a foreign file has the name of the staging folder")
            .in_file(part)
            .help("move it away, or choose another output path")),
    }
}

/// Whether an open file is the file at a path.
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
    Error::new("another command is writing it")
        .in_file(place)
        .help("wait until that command ends, or choose another path")
}

fn taken(place: &Path) -> Error {
    Error::new("another program created this path while the command worked")
        .in_file(place)
        .help("choose another path; no file was changed")
}

/// The error for content of the user that is now beside the target.
fn kept(old: &Path, place: &Path) -> Error {
    Error::new(format!("this appeared at {} while a command worked, and was moved here", place.display()))
        .in_file(old)
        .help("move it away, and run the command again")
}

/// Whether new content may replace and delete the old: a file replaces a file, and a folder replaces an empty folder or
/// one that the same command created. Links are neither.
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

/// Deletes the content beside a target: the listed files of a folder with a list. `unlisted` deletes a folder without
/// one.
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

/// Syncs all files of a folder to disk, then the folders.
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
                            // After an error, the other files need no sync.
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
