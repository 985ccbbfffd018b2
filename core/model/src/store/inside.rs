//! Moves and removes files below a folder. Follows no link, because the target of a link is not part of the folder.
//!
//! On Unix, every folder on the way is opened relative to the previous one, so that no other process can put a link in
//! between. On other systems, each folder is checked first.

use crate::error::{Error, Result};
use crate::files::DatasetPath;
#[cfg(not(unix))]
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The remedy for a link on the way to a file of a dataset.
const LINKED: &str = "put the folder itself there: a mount keeps it on another disk, and the dataset's whole folder may be \
                      reached by a link";

/// A folder in which files are moved and removed.
#[derive(Debug)]
pub struct Inside {
    root: PathBuf,
    #[cfg(unix)]
    folder: unix::Folder,
}

/// Refuses a link where a folder of the dataset must be.
pub fn linked(root: &Path, folder: &str) -> Error {
    Error::new(format!("`{folder}` is a link: files behind links are neither written nor removed"))
        .in_file(root)
        .help(LINKED)
}

impl Inside {
    /// Opens the folder, which may be reached by a link.
    pub fn open(root: &Path) -> Result<Self> {
        Ok(Self {
            root: root.to_owned(),
            #[cfg(unix)]
            folder: unix::Folder::open(root).map_err(|error| Error::io(root, &error))?,
        })
    }

    /// Moves a file or folder to a path inside, and creates the folders of the path. A file replaces an existing file;
    /// a link at the path is replaced and not followed.
    pub fn put(&self, from: &Path, to: &DatasetPath) -> Result<()> {
        self.check_folders(to)?;
        self.move_here(from, to).map_err(|error| Error::io(to.below(&self.root), &error))
    }

    /// Removes a file, if it exists, and the folders that are empty then. A folder of this name stays, because it has
    /// other files.
    pub fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.check_folders(path)?;
        match self.remove_here(path) {
            Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                Err(Error::io(path.below(&self.root), &error))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a path if one of its folders is a link.
    fn check_folders(&self, path: &DatasetPath) -> Result<()> {
        let is_link = |folder: &&str| std::fs::symlink_metadata(self.root.join(folder)).is_ok_and(|it| it.is_symlink());
        path.folders().find(is_link).map_or(Ok(()), |folder| Err(linked(&self.root, folder)))
    }

    #[cfg(unix)]
    fn move_here(&self, from: &Path, to: &DatasetPath) -> std::io::Result<()> {
        let (folder, name) = unix::split(to);
        self.folder.walk(folder, true)?.last().unwrap_or(&self.folder).put(from, name)
    }

    #[cfg(unix)]
    fn remove_here(&self, path: &DatasetPath) -> std::io::Result<()> {
        let (folders, name) = unix::split(path);
        let way = self.folder.walk(folders, false)?;
        way.last().unwrap_or(&self.folder).remove_file(name)?;
        // From the innermost folder up to the first that has other files.
        let names: Vec<&str> = folders.split('/').collect();
        for depth in (0..way.len()).rev() {
            let above = if depth == 0 { &self.folder } else { &way[depth - 1] };
            if above.remove_folder(names[depth]).is_err() {
                break;
            }
        }
        Ok(())
    }

    #[cfg(not(unix))]
    fn move_here(&self, from: &Path, to: &DatasetPath) -> std::io::Result<()> {
        let full = to.below(&self.root);
        full.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::rename(from, full)
    }

    #[cfg(not(unix))]
    fn remove_here(&self, path: &DatasetPath) -> std::io::Result<()> {
        let full = path.below(&self.root);
        if fs::symlink_metadata(&full)?.is_dir() {
            return Ok(());
        }
        fs::remove_file(&full)?;
        let mut parent = full.parent();
        while let Some(folder) = parent.filter(|folder| *folder != self.root) {
            if fs::remove_dir(folder).is_err() {
                break;
            }
            parent = folder.parent();
        }
        Ok(())
    }
}

#[cfg(unix)]
mod unix {
    use rustix::fs::{AtFlags, CWD, Mode, OFlags, mkdirat, openat, renameat, unlinkat};
    use rustix::io::Errno;
    use std::io::Result;
    use std::os::fd::OwnedFd;
    use std::path::Path;

    /// A folder that is open.
    #[derive(Debug)]
    pub struct Folder(OwnedFd);

    fn flags() -> OFlags {
        OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC
    }

    /// The folders of a path, and the name in them.
    pub fn split(path: &str) -> (&str, &str) {
        path.rsplit_once('/').unwrap_or(("", path))
    }

    impl Folder {
        pub fn open(root: &Path) -> Result<Self> {
            Ok(Self(openat(CWD, root, flags(), Mode::empty())?))
        }

        /// Opens one folder after the other, from this one. A link is an error, whatever it leads to.
        pub fn walk(&self, folders: &str, make: bool) -> Result<Vec<Self>> {
            let mut way: Vec<Self> = Vec::new();
            for name in folders.split('/').filter(|name| !name.is_empty()) {
                let at = &way.last().unwrap_or(self).0;
                let open = || openat(at, name, flags() | OFlags::NOFOLLOW, Mode::empty());
                let next = match open() {
                    Err(Errno::NOENT) if make => {
                        match mkdirat(at, name, Mode::from_raw_mode(0o777)) {
                            // Another thread has made it meanwhile.
                            Ok(()) | Err(Errno::EXIST) => {}
                            Err(error) => return Err(error.into()),
                        }
                        open()
                    }
                    next => next,
                };
                way.push(Self(next?));
            }
            Ok(way)
        }

        pub fn put(&self, from: &Path, name: &str) -> Result<()> {
            Ok(renameat(CWD, from, &self.0, name)?)
        }

        pub fn remove_file(&self, name: &str) -> Result<()> {
            match unlinkat(&self.0, name, AtFlags::empty()) {
                // The error for a folder depends on the system.
                Err(Errno::ISDIR | Errno::PERM) if self.walk(name, false).is_ok() => Ok(()),
                removed => Ok(removed?),
            }
        }

        pub fn remove_folder(&self, name: &str) -> Result<()> {
            Ok(unlinkat(&self.0, name, AtFlags::REMOVEDIR)?)
        }
    }
}
