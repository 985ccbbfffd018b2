//! Files that were downloaded, kept between runs.
//!
//! A file is kept under a digest of its URL and its version, so a file that changes in the store gets a new name here. The
//! files that were not read for the longest time are deleted first.

use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::unique::unique;
use crate::user_cache::user_cache;
use parking_lot::Mutex;
use std::fs::{self, File, FileTimes};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// Environment variable with the size of the cache, in 10⁹ bytes.
const BUDGET_VARIABLE: &str = "SYNTABLE_CACHE_GB";
/// Size of the cache without the variable, bytes.
const BUDGET: u64 = 20_000_000_000;
/// Share of the budget that stays when files are deleted, in hundredths.
const KEPT: u64 = 90;
/// Bytes that a process downloads before it looks at the size of the cache again.
const BETWEEN: u64 = if cfg!(test) { 1 << 20 } else { 1 << 28 };
/// A file that was read within this time keeps its time stamp.
const RECENT: Duration = Duration::from_secs(3600);
/// A process locks the folder of a mirror within this time.
const FRESH: Duration = Duration::from_secs(60);

/// The files in the user's cache, once per process.
static OF_PROCESS: Mutex<Option<Arc<Downloads>>> = Mutex::new(None);

/// Files that were downloaded, and the names of mirrors.
pub struct Downloads {
    root: PathBuf,
    /// Bytes.
    budget: u64,
    /// Bytes that were downloaded since the last look at the size.
    new: AtomicU64,
    cleaning: Mutex<()>,
}

impl Downloads {
    /// The files in the user's cache.
    pub fn of_user() -> Result<Arc<Self>> {
        let root = user_cache().ok_or_else(|| {
            Error::new("a dataset at a URL needs a folder for the files that are downloaded")
                .help("set the environment variable SYNTABLE_CACHE to a folder")
                .of_request()
        })?;
        let budget = match std::env::var(BUDGET_VARIABLE) {
            Ok(text) => match text.parse::<f64>() {
                Ok(size) if size >= 0.0 && size.is_finite() => (size * 1e9) as u64,
                _ => {
                    let message = format!("the environment variable {BUDGET_VARIABLE} is `{text}`");
                    return Err(Error::new(message).help("write a size in 10⁹ bytes, such as 20").of_request());
                }
            },
            Err(_) => BUDGET,
        };
        let root = root.join("remote");
        let mut known = OF_PROCESS.lock();
        match &*known {
            Some(known) if known.root == root && known.budget == budget => Ok(Arc::clone(known)),
            _ => Ok(Arc::clone(known.insert(Self::new(root, budget)))),
        }
    }

    /// The files in a folder of their own.
    pub fn new(root: PathBuf, budget: u64) -> Arc<Self> {
        // Private objects stay private. The error of a folder that cannot be created follows with its first file.
        let _ = create_private(&root);
        let downloads = Self { root, budget, new: AtomicU64::new(0), cleaning: Mutex::new(()) };
        downloads.clean();
        Arc::new(downloads)
    }

    /// The error of a file of the cache.
    pub fn fail(&self, path: &Path, error: &io::Error) -> Error {
        let better = match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "with more room",
            _ => "that this user can write",
        };
        Error::io(path, error)
            .help(format!("the folder keeps files of datasets at URLs: set SYNTABLE_CACHE to a folder {better}"))
    }

    /// A new folder for the names of a mirror, and its lock.
    pub fn new_names(&self) -> Result<(PathBuf, File)> {
        let names = self.names();
        self.remove_abandoned_names();
        let own = names.join(format!("{:016x}", unique()));
        let lock = || {
            fs::create_dir_all(&own)?;
            let lock = File::create_new(own.join(LOCK))?;
            lock.try_lock_shared().map_err(io::Error::from)?;
            Ok(lock)
        };
        let lock = lock().map_err(|error: io::Error| self.fail(&own, &error))?;
        Ok((own, lock))
    }

    /// The path of a complete file.
    pub fn path(&self, key: Digest) -> PathBuf {
        let name = key.to_string();
        self.root.join("files").join(&name[..2]).join(name)
    }

    /// A new file for the content of a file. [`keep`](Self::keep) makes it the complete file.
    pub fn part(&self, key: Digest) -> io::Result<(PathBuf, File)> {
        let path = self.path(key).with_extension(format!("{:016x}.{PART}", unique()));
        fs::create_dir_all(path.parent().unwrap_or(&self.root))?;
        let file = File::options().read(true).write(true).create_new(true).open(&path)?;
        Ok((path, file))
    }

    /// Keeps a complete file under its key.
    pub fn keep(&self, part: &Path, key: Digest) -> io::Result<()> {
        fs::rename(part, self.path(key))
    }

    /// Counts bytes that were downloaded. Looks at the size of the cache from time to time.
    pub fn count(&self, size: u64) {
        if self.new.fetch_add(size, Ordering::Relaxed) + size >= BETWEEN {
            self.new.store(0, Ordering::Relaxed);
            self.clean();
        }
    }

    /// Opens a complete file, if this machine has it.
    pub fn open(&self, key: Digest, size: u64) -> Option<File> {
        let file = File::open(self.path(key)).ok()?;
        let found = file.metadata().ok().filter(|found| found.len() == size)?;
        let is_recent = found.modified().ok()?.elapsed().is_ok_and(|age| age < RECENT);
        if !is_recent {
            // A cache that cannot be written still serves.
            let _ = file.set_times(FileTimes::new().set_modified(SystemTime::now()));
        }
        Some(file)
    }

    fn names(&self) -> PathBuf {
        self.root.join("names")
    }

    /// Removes the names of mirrors whose process ended without removing them.
    fn remove_abandoned_names(&self) {
        for entry in fs::read_dir(self.names()).into_iter().flatten().flatten() {
            let own = entry.path();
            let is_free = || File::open(own.join(LOCK)).map_or(true, |lock| lock.try_lock().is_ok());
            // Another process may be about to create its lock.
            if entry.metadata().is_ok_and(|found| is_older(&found, FRESH)) && is_free() {
                let _ = fs::remove_dir_all(own);
            }
        }
    }

    /// Deletes the files that were not read for the longest time, until the others fit the budget.
    fn clean(&self) {
        let Some(_cleaning) = self.cleaning.try_lock() else { return };
        let mut files: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for folder in fs::read_dir(self.root.join("files")).into_iter().flatten().flatten() {
            for entry in fs::read_dir(folder.path()).into_iter().flatten().flatten() {
                // A process may be writing a part.
                let is_part = entry.path().extension().is_some_and(|extension| extension == PART);
                if let Ok(found) = entry.metadata()
                    && (!is_part || is_older(&found, RECENT))
                {
                    files.push((found.modified().unwrap_or(SystemTime::UNIX_EPOCH), used(&found), entry.path()));
                }
            }
        }
        let mut sum: u64 = files.iter().map(|(_, size, _)| size).sum();
        if sum <= self.budget {
            return;
        }
        files.sort();
        for (_, size, path) in files {
            if sum <= self.budget / 100 * KEPT {
                break;
            }
            // An open file stays readable for its reader.
            if fs::remove_file(path).is_ok() {
                sum -= size;
            }
        }
    }
}

/// Extension of a file that is not complete.
const PART: &str = "part";
/// File that the owner of a mirror's names holds locked.
const LOCK: &str = "lock";

/// Creates a folder that other users of the machine cannot read.
fn create_private(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder.parent().unwrap_or(folder))?;
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

fn is_older(found: &fs::Metadata, age: Duration) -> bool {
    found.modified().is_ok_and(|modified| modified.elapsed().is_ok_and(|since| since > age))
}

/// Bytes that a file takes on disk: a part of a file has gaps.
fn used(found: &fs::Metadata) -> u64 {
    #[cfg(unix)]
    return std::os::unix::fs::MetadataExt::blocks(found) * 512;
    #[cfg(not(unix))]
    return found.len();
}
