//! Where a dataset is stored: a folder of this machine, memory, or an object store.
//!
//! A [`Store`] has few operations, which all of these support. A run needs only the following:
//!
//! | operation | file system | object store |
//! |---|---|---|
//! | [`create`](Store::create) | a file that must not exist | an upload with the condition that the key is new |
//! | [`put`](Store::put) | a temporary file, flushed to disk and renamed | one upload |
//! | [`put_new`](Store::put_new) | a temporary file, flushed to disk, and a hard link to it | one upload with the condition that the key is new |
//! | [`append`](Store::append) | a flushed write to the end of a file | a download, and an upload with the condition that the object is unchanged |
//! | [`rename`](Store::rename) | a rename | copies within the store, then deletions |
//! | [`share`](Store::share) | a hard link | nothing |
//! | [`lock`](Store::lock) | a locked file | a lease, which its owner renews |
//!
//! No caller needs a [`rename`](Store::rename) of a folder to be atomic: what counts is decided by one [`put`](Store::put) or
//! one [`append`](Store::append). Stages do not see a store. Writers see it through [`Output`](crate::stage::Output) and
//! [`Finish`](crate::stage::Finish).

mod file_system;
mod inside;
mod memory;
mod scheme;
mod store_folder;
#[cfg(test)]
mod tests;

pub use file_system::FsStore;
pub use memory::MemStore;
pub use scheme::{StoreScheme, is_url};
pub use store_folder::StoreFolder;

use crate::error::Result;
use crate::files::DatasetPath;
use std::any::Any;
use std::fmt;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Files by path. A folder exists if it contains files.
///
/// Paths are relative to the store, with `/` between folders. Errors name the whole path, as [`name_of`](Self::name_of) gives it.
pub trait Store: Any + fmt::Debug + Send + Sync {
    /// The whole name of a path, for messages. The empty path is the store.
    fn name_of(&self, path: &str) -> PathBuf;

    /// The folder on this machine that holds the files, if any.
    fn local(&self) -> Option<&Path> {
        None
    }

    /// Whether each call is a request over a network. Callers then prepare files on this machine, and send many
    /// requests at once.
    fn is_remote(&self) -> bool {
        false
    }

    /// Prepares the store itself for writing, for example creates a missing folder.
    fn prepare(&self) -> Result<()> {
        Ok(())
    }

    /// The entry at a path, if any. Follows no link.
    ///
    /// # Errors
    /// If the store cannot tell: an entry that may exist must not count as gone.
    fn look(&self, path: &str) -> Result<Option<Found>>;

    /// Names in a folder, in no order. None if the path does not exist or is not a folder. The empty path is the store.
    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>>;

    /// The files below a folder, by their paths in it, in no order. Names that are no [`DatasetPath`] are left out, and so are
    /// the empty objects by which consoles of stores mark folders. The empty path is the store.
    ///
    /// # Errors
    /// If the store cannot tell, or has a name that its client cannot express, or a remote store has more files than
    /// [`REMOTE_FILES`](crate::limits::REMOTE_FILES).
    fn files(&self, folder: &str) -> Result<Vec<(DatasetPath, Stored)>> {
        let mut found = Vec::new();
        let mut folders = vec![String::new()];
        let join = |one: &str, other: &str| if one.is_empty() { other.to_owned() } else { format!("{one}/{other}") };
        while let Some(inner) = folders.pop() {
            for (name, kind) in self.list(&if inner.is_empty() { folder.to_owned() } else { join(folder, &inner) })? {
                let path = join(&inner, &name);
                match kind {
                    Kind::Folder => folders.push(path),
                    Kind::File => {
                        let Some(there) = self.look(&join(folder, &path))? else { continue };
                        let stored = Stored { size: there.size, version: None };
                        found.extend(DatasetPath::new(path).ok().map(|path| (path, stored)));
                    }
                    Kind::Link | Kind::Other => {}
                }
            }
        }
        Ok(found)
    }

    /// Opens a file from its beginning; none if it does not exist.
    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>>;

    /// Creates a file and the folders that it is in; none if the path exists already. Other readers see the whole file
    /// after the writer was dropped, and may see parts of it before.
    ///
    /// A flush reports errors of writing. [`sync`](Self::sync) reports errors that a store finds only later.
    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>>;

    /// Writes a file whole or not at all, and for good. It replaces an existing file. `fill` writes the content once.
    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()>;

    /// Writes a new file whole or not at all, and for good. Returns `false`, and changes nothing, if the path exists: of
    /// several callers on any machines with different bytes, one succeeds.
    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool>;

    /// Adds bytes to the end of a file, for good, and creates the file if necessary. Only one owner appends at a time. If the
    /// call fails, the file is as before; if the program ends within the call, a part of the bytes may be there.
    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()>;

    /// Waits until a file that was created is stored for good.
    fn sync(&self, path: &DatasetPath) -> Result<()>;

    /// Gives a file of this store the bytes of a file of `from`, which may be the same store, without storing them
    /// again. It replaces an existing file. Returns whether the store could; if not, nothing changed.
    fn share(&self, from: &dyn Store, path: &DatasetPath, to: &DatasetPath) -> Result<bool>;

    /// Moves a file or a folder. A file replaces an existing file at once. A store may move the files of a folder one
    /// by one. Follows no link on the way to `to`.
    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()>;

    /// Removes a file, if it exists, and the folders that are empty then. A folder of this name stays. Follows no link.
    fn remove(&self, path: &DatasetPath) -> Result<()>;

    /// Removes a file, or a folder with all its content, if it exists. Follows no link.
    fn remove_all(&self, path: &DatasetPath) -> Result<()>;

    /// Locks a file until the [`Hold`] is dropped; none if another owner holds the lock. A lock to write or to share creates
    /// the file. A lock to read a missing file always succeeds. Readers of a remote store keep no writer out.
    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>>;
}

/// Writes the content of a file.
pub type Fill<'f> = dyn FnMut(&mut dyn Write) -> Result<()> + 'f;

/// The entry at a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// File, folder, or a kind that no run writes.
    pub kind: Kind,
    /// Size of a file, bytes.
    pub size: u64,
    /// The target of a link, as the link states it.
    pub leads_to: Option<String>,
    /// When the content of a file last changed, if the store knows.
    pub modified: Option<SystemTime>,
}

/// The kind of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link of a file system, wherever it leads.
    Link,
    /// A device, a pipe or a socket.
    Other,
}

/// A file as a store lists it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stored {
    /// Its size, bytes.
    pub size: u64,
    /// A text that changes with the content, if the store has one.
    pub version: Option<String>,
}

/// A file that is open for reading.
pub struct StoredFile {
    /// Size when it was opened, bytes.
    pub size: u64,
    /// Its version, as in [`Stored`].
    pub version: Option<String>,
    /// Its content. After a seek, an object store reads a range.
    pub bytes: Box<dyn Content>,
}

/// The reader of a [`StoredFile`].
pub trait Content: Read + Seek + Send {}

impl<C: Read + Seek + Send> Content for C {}

impl Read for StoredFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.bytes.read(buffer)
    }
}

impl Seek for StoredFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

impl fmt::Debug for StoredFile {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("StoredFile").field("size", &self.size).finish_non_exhaustive()
    }
}

/// The purpose of a lock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Others may read, too.
    Read,
    /// Others may share the lock, on any machine, and read. The file is created.
    Share,
    /// No other owner may read or write.
    Write,
}

/// A lock, until it is dropped.
pub struct Hold(#[expect(dead_code, reason = "dropped with the lock")] Box<dyn Any + Send + Sync>);

impl Hold {
    /// A lock that ends when `held` is dropped.
    pub fn new(held: impl Any + Send + Sync) -> Self {
        Self(Box::new(held))
    }
}

impl fmt::Debug for Hold {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Hold")
    }
}
