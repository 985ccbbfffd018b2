//! A folder of this machine as a store.

use crate::error::{Error, Result};
use crate::files::DatasetPath;
use crate::store::inside::Inside;
use crate::store::{Access, Fill, Found, Hold, Kind, Store, StoredFile};
use crate::unique::unique;
#[cfg(unix)]
use rustix::fs::OFlags;
use std::fs::{self, File, FileType, OpenOptions, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The files below a folder, which may be reached by a link. From there on, moves and removals follow no link.
///
/// Data that a call stores for good is flushed to disk before the call returns. The file system must support file
/// locks.
#[derive(Debug)]
pub struct FsStore {
    root: PathBuf,
    /// Open from the first move or removal on.
    inside: OnceLock<Inside>,
}

impl FsStore {
    /// The files below a folder, which need not exist yet.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), inside: OnceLock::new() }
    }

    /// Refuses a folder whose path is a link to nothing: no folder can be created there.
    pub fn check_link(&self) -> Result<()> {
        let is_link = fs::symlink_metadata(&self.root).is_ok_and(|there| there.is_symlink());
        if is_link && !self.root.exists() {
            return Err(Error::new("it is a link to a missing file")
                .in_file(&self.root)
                .help("make the folder that it leads to, or choose another `options.out`"));
        }
        Ok(())
    }

    fn inside(&self) -> Result<&Inside> {
        if self.inside.get().is_none() {
            // Another thread may have opened it meanwhile, which is just as good.
            let _ = self.inside.set(Inside::open(&self.root)?);
        }
        Ok(self.inside.get().expect("it is set"))
    }

    /// Creates a folder of the store.
    fn create_folder(&self, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(|error| {
            let is_full = matches!(error.kind(), ErrorKind::QuotaExceeded | ErrorKind::StorageFull);
            let failed = Error::io(&self.root, &error).help("choose a folder that can be written");
            if is_full { failed } else { failed.of_request() }
        })
    }
}

impl Store for FsStore {
    fn name_of(&self, path: &str) -> PathBuf {
        // Joined to an empty path, a folder would get a separator at its end.
        if path.is_empty() { self.root.clone() } else { self.root.join(path) }
    }

    fn local(&self) -> Option<&Path> {
        Some(&self.root)
    }

    /// Creates the folder.
    ///
    /// # Errors
    /// If the path is a link to what does not exist, or the folder cannot be created.
    fn prepare(&self) -> Result<()> {
        self.check_link()?;
        self.create_folder(&self.root)
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        let full = self.name_of(path);
        let there = match fs::symlink_metadata(&full) {
            Ok(there) => there,
            Err(error) if is_gone(&error) => return Ok(None),
            Err(error) => return Err(Error::io(full, &error)),
        };
        let kind = kind_of(there.file_type());
        let leads_to = match kind {
            Kind::Link => {
                Some(fs::read_link(full).map_or_else(|_| String::new(), |to| to.to_string_lossy().into_owned()))
            }
            _ => None,
        };
        Ok(Some(Found { kind, size: there.len(), leads_to, modified: there.modified().ok() }))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        let full = self.name_of(folder);
        let fail = |error: io::Error| Error::io(&full, &error);
        let entries = match fs::read_dir(&full) {
            Ok(entries) => entries,
            Err(error) if is_gone(&error) => return Ok(Vec::new()),
            Err(error) => return Err(fail(error)),
        };
        let entry = |entry: io::Result<fs::DirEntry>| {
            let entry = entry.map_err(fail)?;
            let kind = entry.file_type().map_err(|error| Error::io(entry.path(), &error))?;
            Ok((entry.file_name().to_string_lossy().into_owned(), kind_of(kind)))
        };
        entries.map(entry).collect()
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        let full = path.below(&self.root);
        let mut options = OpenOptions::new();
        options.read(true);
        // The program's own files are no links. Opening a pipe must not wait for its other end.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, {
            let link = if path.is_reserved() { OFlags::NOFOLLOW } else { OFlags::empty() };
            (OFlags::NONBLOCK | link).bits().cast_signed()
        });
        let opened = options.open(&full).and_then(|file| Ok((file.metadata()?, file)));
        match opened {
            Ok((found, _)) if !found.is_file() => Err(Error::new("not a regular file").in_file(full)),
            Ok((found, file)) => Ok(Some(StoredFile { size: found.len(), version: None, bytes: Box::new(file) })),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Error::io(full, &error)),
        }
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        let full = path.below(&self.root);
        match create_file(&full)? {
            Ok(file) => Ok(Some(Box::new(BufWriter::new(file)))),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(None),
            Err(error) => Err(Error::io(full, &error)),
        }
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        let full = path.below(&self.root);
        let part = part_of(path)?.below(&self.root);
        let fail = |error: io::Error| Error::io(&full, &error);
        // An interrupted call may have left the file.
        let _ = fs::remove_file(&part);
        let mut file = BufWriter::new(create_file(&part)?.map_err(fail)?);
        let filled = fill(&mut file).and_then(|()| {
            let synced = file.flush().and_then(|()| file.get_ref().sync_all());
            synced.and_then(|()| fs::rename(&part, &full)).map_err(fail)
        });
        if filled.is_err() {
            // The first error is the one to report.
            let _ = fs::remove_file(&part);
        }
        filled
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        let full = path.below(&self.root);
        let fail = |error: io::Error| Error::io(&full, &error);
        // Callers on other machines write at the same time, and each needs a name of its own.
        let part = part_of(&format!("{path}.{:016x}", unique()))?.below(&self.root);
        let mut file = create_file(&part)?.map_err(fail)?;
        let written = file.write_all(bytes).and_then(|()| file.sync_all());
        drop(file);
        let linked = written.and_then(|()| fs::hard_link(&part, &full));
        let _ = fs::remove_file(&part);
        match linked {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
            // The file system has no hard links. A reader may see a part of the file.
            Err(error) if matches!(error.kind(), ErrorKind::Unsupported | ErrorKind::PermissionDenied) => {
                match File::create_new(&full) {
                    Ok(mut file) => file.write_all(bytes).and_then(|()| file.sync_all()).map_err(fail).map(|()| true),
                    Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
                    Err(error) => Err(fail(error)),
                }
            }
            Err(error) => Err(fail(error)),
        }
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        let full = path.below(&self.root);
        let fail = |error: io::Error| Error::io(&full, &error);
        create_parent(&full)?;
        let mut options = OpenOptions::new();
        options.create(true).append(true);
        // The target of a link is not part of the store.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, OFlags::NOFOLLOW.bits().cast_signed());
        let mut file = options.open(&full).map_err(fail)?;
        let before = file.metadata().map_err(fail)?.len();
        file.write_all(bytes).and_then(|()| file.sync_data()).map_err(|error| {
            // A part of the bytes must not precede the next ones.
            let _ = file.set_len(before);
            fail(error)
        })
    }

    fn sync(&self, path: &DatasetPath) -> Result<()> {
        let full = path.below(&self.root);
        File::open(&full).and_then(|file| file.sync_data()).map_err(|error| Error::io(&full, &error))
    }

    fn share(&self, from: &dyn Store, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        let Some(source) = from.local().map(|root| path.below(root)) else { return Ok(false) };
        let full = to.below(&self.root);
        create_parent(&full)?;
        match fs::hard_link(&source, &full) {
            Ok(()) => return Ok(true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // The file system has no hard links or allows no further link to this file, or the other file is on another
            // file system.
            Err(_) => return Ok(false),
        }
        let link = part_of(to)?.below(&self.root);
        let _ = fs::remove_file(&link);
        if fs::hard_link(&source, &link).is_err() {
            return Ok(false);
        }
        fs::rename(&link, &full).map_err(|error| Error::io(&full, &error))?;
        // The rename does nothing if both names are of the same file already.
        let _ = fs::remove_file(&link);
        Ok(true)
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        self.inside()?.put(&from.below(&self.root), to)
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.inside()?.remove(path)
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        let full = path.below(&self.root);
        let removed = match fs::symlink_metadata(&full) {
            Ok(there) if there.is_dir() => fs::remove_dir_all(&full),
            Ok(_) => fs::remove_file(&full),
            Err(error) => Err(error),
        };
        match removed {
            Err(error) if !is_gone(&error) => Err(Error::io(full, &error)),
            _ => Ok(()),
        }
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        let full = path.below(&self.root);
        let file = match access {
            Access::Write | Access::Share => {
                self.create_folder(full.parent().unwrap_or(&self.root))?;
                File::create(&full).map_err(|error| Error::io(&full, &error))?
            }
            Access::Read => match File::open(&full) {
                Ok(file) => file,
                // The folder may be read-only.
                Err(_) => return Ok(Some(Hold::new(()))),
            },
        };
        let locked = match access {
            Access::Write => file.try_lock(),
            Access::Read | Access::Share => file.try_lock_shared(),
        };
        match locked {
            Ok(()) => Ok(Some(Hold::new(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(Error::io(&full, &error)
                .help("the file system must lock files: choose a folder on another file system")
                .of_request()),
        }
    }
}

/// The temporary file next to a file. The content is written to it first.
fn part_of(path: &str) -> Result<DatasetPath> {
    DatasetPath::new(format!("{path}.part")).map_err(|error| Error::new(error.to_string()))
}

/// Creates a new file, and the folders that it is in. Another worker may remove an empty folder in between.
fn create_file(path: &Path) -> Result<io::Result<File>> {
    for _ in 1..FOLDER_TRIES {
        create_parent(path)?;
        match File::create_new(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            created => return Ok(created),
        }
    }
    create_parent(path)?;
    Ok(File::create_new(path))
}

/// Times that a folder is created for one file, and each folder of its path for itself.
const FOLDER_TRIES: u32 = 100;

/// Creates the folders that a file is in. Another worker may remove an empty one in between: then the system finds the
/// folder when it is to create it, and does not find it a moment later.
fn create_parent(path: &Path) -> Result<()> {
    let Some(parent) = path.parent() else { return Ok(()) };
    let mut created = fs::create_dir_all(parent);
    for _ in 1..FOLDER_TRIES {
        let is_race = |error: &io::Error| matches!(error.kind(), ErrorKind::AlreadyExists | ErrorKind::NotFound);
        match &created {
            Err(error) if is_race(error) => created = fs::create_dir_all(parent),
            _ => break,
        }
    }
    created.map_err(|error| Error::io(parent, &error))
}

fn is_gone(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

fn kind_of(file_type: FileType) -> Kind {
    match file_type {
        file_type if file_type.is_symlink() => Kind::Link,
        file_type if file_type.is_dir() => Kind::Folder,
        file_type if file_type.is_file() => Kind::File,
        _ => Kind::Other,
    }
}
