//! A bucket as a store.

use crate::bucket::{Bucket, Connect};
use crate::content::ObjectContent;
use crate::lease::{Lease, LeaseTimes, Locks};
use crate::requests::{TRIES, wait, whole};
use crate::spool::Spool;
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::path::Path as Key;
use object_store::{Error as Failure, ObjectMeta, ObjectStore, ObjectStoreExt, PutMode};
use std::collections::BTreeSet;
use std::fmt;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::limits::REMOTE_FILES;
use syntable_model::store::{Access, Fill, Found, Hold, Kind, Store, Stored, StoredFile};

/// Requests that a call for many objects sends at once.
const AT_ONCE: usize = 32;

/// The objects of a bucket or container.
#[derive(Clone)]
pub struct Objects {
    bucket: Arc<Bucket>,
    locks: Arc<Locks>,
}

impl Objects {
    /// The objects of a client. `name` is the URL of the bucket, for messages.
    pub fn new(store: Arc<dyn ObjectStore>, name: impl Into<String>, times: LeaseTimes) -> Self {
        Self { bucket: Arc::new(Bucket::new(store, name.into(), None)), locks: Arc::new(Locks::new(times)) }
    }

    /// The same with a function that makes the client, for this process and for processes that are forked from it.
    pub(crate) fn connected(connect: Connect, name: impl Into<String>, times: LeaseTimes) -> Result<Self> {
        let bucket = Bucket::new(connect()?, name.into(), Some(connect));
        Ok(Self { bucket: Arc::new(bucket), locks: Arc::new(Locks::new(times)) })
    }

    /// The bucket, to write a file or a folder in it.
    fn writes(&self, path: &str) -> Result<&Bucket> {
        self.locks.check(path)?;
        Ok(&self.bucket)
    }
}

impl Store for Objects {
    fn name_of(&self, path: &str) -> PathBuf {
        self.bucket.name_of(path)
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        let folder = Found { kind: Kind::Folder, size: 0, leads_to: None, modified: None };
        if path.is_empty() {
            return Ok(Some(folder));
        }
        if let Some(meta) = self.bucket.head(path)? {
            let modified = Some(meta.last_modified.into());
            return Ok(Some(Found { kind: Kind::File, size: meta.size, leads_to: None, modified }));
        }
        Ok(self.bucket.has_folder(path)?.then_some(folder))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        let key = self.bucket.key(folder)?;
        let prefix = Some(&key).filter(|_| !folder.is_empty());
        let listed =
            wait(whole(|| self.bucket.store().list_with_delimiter(prefix))).map_err(self.bucket.fail(folder))?;
        let name = |key: &Key| key.filename().unwrap_or_default().to_owned();
        // A console marks a folder by an object of its name.
        let files = listed.objects.iter().filter(|meta| meta.location != key);
        let files = files.map(|meta| (name(&meta.location), Kind::File));
        Ok(files.chain(listed.common_prefixes.iter().map(|folder| (name(folder), Kind::Folder))).collect())
    }

    /// One list, whatever the folders in it.
    fn files(&self, folder: &str) -> Result<Vec<(DatasetPath, Stored)>> {
        let start = if folder.is_empty() { 0 } else { folder.len() + 1 };
        let listed = self.bucket.below_at_most(folder, REMOTE_FILES.most as usize)?;
        REMOTE_FILES.check(listed.len() as u64).map_err(|error| error.in_file(self.name_of(folder)))?;
        let folders: BTreeSet<String> = (listed.iter().flat_map(|meta| {
            let path = meta.location.as_ref();
            path.match_indices('/').map(|(end, _)| path[..end].to_owned())
        }))
        .collect();
        let is_marker = |meta: &ObjectMeta| meta.size == 0 && folders.contains(meta.location.as_ref());
        let file = |meta: &ObjectMeta| {
            let path = DatasetPath::new(meta.location.as_ref().get(start..)?).ok()?;
            Some((path, Stored { size: meta.size, version: version_of(meta.e_tag.as_deref()) }))
        };
        Ok(listed.iter().filter(|meta| !is_marker(meta)).filter_map(file).collect())
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        match ObjectContent::open(Arc::clone(self.bucket.store()), self.bucket.key(path)?) {
            Ok(content) => Ok(Some(StoredFile {
                size: content.size(),
                version: version_of(content.version()),
                bytes: Box::new(content),
            })),
            Err(Failure::NotFound { .. }) => Ok(None),
            Err(failure) => Err(self.bucket.fail(path)(failure)),
        }
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        if self.look(path)?.is_some() {
            return Ok(None);
        }
        let (objects, key) = (self.clone(), self.bucket.key(path)?);
        Ok(Some(Box::new(NewObject { objects, path: path.clone(), key, spool: Spool::new(), is_changed: true })))
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        let mut spool = Spool::new();
        fill(&mut spool)?;
        self.writes(path)?.upload(path, &self.bucket.key(path)?, &mut spool)
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        let bucket = self.writes(path)?;
        let put = bucket.put_if(&bucket.key(path)?, bytes, PutMode::Create);
        put.map(|version| version.is_some()).map_err(bucket.fail(path))
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        let bucket = self.writes(path)?;
        let key = bucket.key(path)?;
        for _ in 0..TRIES {
            let (mut all, mode) = match bucket.get(&key).map_err(bucket.fail(path))? {
                Some((all, version)) => (all, PutMode::Update(version)),
                None => (Vec::new(), PutMode::Create),
            };
            all.extend_from_slice(bytes);
            if bucket.put_if(&key, &all, mode).map_err(bucket.fail(path))?.is_some() {
                return Ok(());
            }
        }
        Err(Error::new("other programs write this object all the time").in_file(bucket.name_of(path)))
    }

    fn sync(&self, path: &DatasetPath) -> Result<()> {
        let gone = || Error::io(self.name_of(path), &io::ErrorKind::NotFound.into());
        self.bucket.head(path)?.map(drop).ok_or_else(gone)
    }

    fn share(&self, _: &dyn Store, _: &DatasetPath, _: &DatasetPath) -> Result<bool> {
        Ok(false)
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        self.writes(from)?;
        let bucket = self.writes(to)?;
        let mut moved: Vec<(Key, Key)> = Vec::new();
        if bucket.head(from)?.is_some() {
            moved.push((bucket.key(from)?, bucket.key(to)?));
        }
        for meta in bucket.below(from)? {
            let inside = &meta.location.as_ref()[from.len()..];
            moved.push((meta.location.clone(), bucket.key(&format!("{to}{inside}"))?));
        }
        if moved.is_empty() {
            return Err(Error::io(self.name_of(from), &io::ErrorKind::NotFound.into()));
        }
        let copies = moved.iter().map(|(from, to)| whole(move || bucket.store().copy(from, to)));
        let copied = stream::iter(copies).buffer_unordered(AT_ONCE).try_collect::<Vec<()>>();
        wait(copied).map_err(bucket.fail(to))?;
        moved.iter().try_for_each(|(from, _)| bucket.delete(from)).map_err(bucket.fail(from))
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.writes(path)?.delete(&self.bucket.key(path)?).map_err(self.bucket.fail(path))
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        let bucket = self.writes(path)?;
        bucket.delete(&bucket.key(path)?).map_err(bucket.fail(path))?;
        let all: Vec<Key> = bucket.below(path)?.into_iter().map(|meta| meta.location).collect();
        let deleted = whole(|| {
            let all = stream::iter(all.clone()).map(Ok).boxed();
            let deleted = bucket.store().delete_stream(all).map(|deleted| match deleted {
                Err(Failure::NotFound { .. }) => Ok(()),
                deleted => deleted.map(drop),
            });
            deleted.try_collect::<Vec<()>>()
        });
        wait(deleted).map(drop).map_err(bucket.fail(path))
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        let (bucket, key) = (&self.bucket, self.bucket.key(path)?);
        let held = match access {
            Access::Read => {
                Lease::is_free(bucket, &key, self.locks.times).map(|is_free| is_free.then(|| Hold::new(())))
            }
            Access::Share => Lease::share(bucket, &key, &self.locks).map(|held| held.map(Hold::new)),
            Access::Write => Lease::take(bucket, &key, &self.locks).map(|held| held.map(Hold::new)),
        };
        held.map_err(bucket.fail(path))
    }
}

impl fmt::Debug for Objects {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Objects({})", self.bucket.name)
    }
}

/// The text of an entity tag. Azure quotes tags in answers, and not in lists.
fn version_of(tag: Option<&str>) -> Option<String> {
    tag.map(|tag| tag.trim_matches('"').to_owned())
}

/// A file that is uploaded at each flush, and when it is dropped.
struct NewObject {
    objects: Objects,
    path: DatasetPath,
    key: Key,
    spool: Spool,
    is_changed: bool,
}

impl NewObject {
    fn upload(&mut self) -> Result<()> {
        if std::mem::take(&mut self.is_changed) {
            self.objects.writes(&self.path)?.upload(&self.path, &self.key, &mut self.spool)?;
            // The next write goes on at the end.
            self.spool.go_on();
        }
        Ok(())
    }
}

impl Write for NewObject {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.is_changed = true;
        self.spool.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.upload().map_err(|error| io::Error::other(error.message().to_owned()))
    }
}

impl Drop for NewObject {
    fn drop(&mut self) {
        // A flush reports errors.
        let _ = self.upload();
    }
}
