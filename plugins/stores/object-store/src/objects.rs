//! A bucket as a store.

use crate::content::ObjectContent;
use crate::failure;
use crate::lease::{Lease, LeaseTimes, Locks};
use crate::requests::wait;
use crate::spool::{NewObject, Spool};
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::path::Path as Key;
use object_store::{
    Error as Failure, GetOptions, ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload,
    UpdateVersion,
};
use std::fmt;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, Fill, Found, Hold, Kind, Store, StoredFile};

/// Parts of a large file that are uploaded at once.
const PARTS: usize = 4;
/// Requests that a call for many objects sends at once.
const AT_ONCE: usize = 32;
/// Times that a request on condition is sent whose answer was lost.
const TRIES: u32 = 5;

/// The objects of a bucket or container.
#[derive(Clone)]
pub struct Objects(Arc<Bucket>);

/// A bucket, and the locks that this store holds in it.
pub struct Bucket {
    store: Arc<dyn ObjectStore>,
    /// URL without a `/` at its end, for messages.
    name: String,
    locks: Arc<Locks>,
}

impl Objects {
    /// The objects of a client. `name` is the URL of the bucket, for messages.
    pub fn new(store: Arc<dyn ObjectStore>, name: impl Into<String>, times: LeaseTimes) -> Self {
        Self(Arc::new(Bucket { store, name: name.into(), locks: Arc::new(Locks::new(times)) }))
    }
}

impl Bucket {
    pub fn name_of(&self, path: &str) -> PathBuf {
        PathBuf::from(if path.is_empty() { self.name.clone() } else { format!("{}/{path}", self.name) })
    }

    fn fail(&self, path: &str) -> impl Fn(Failure) -> Error + '_ {
        let name = self.name_of(path);
        move |failure| failure::error(&name, &failure)
    }

    fn key(&self, path: &str) -> Result<Key> {
        Key::parse(path).map_err(|error| Error::new(error.to_string().to_lowercase()).in_file(self.name_of(path)))
    }

    /// The objects below a folder.
    fn below(&self, folder: &str) -> Result<Vec<ObjectMeta>> {
        let key = self.key(folder)?;
        let prefix = Some(&key).filter(|_| !folder.is_empty());
        wait(whole(|| self.store.list(prefix).try_collect())).map_err(self.fail(folder))
    }

    /// Whether a folder exists.
    fn has_folder(&self, folder: &str) -> Result<bool> {
        let key = self.key(folder)?;
        let first = wait(whole(async || self.store.list(Some(&key)).next().await.transpose()));
        first.map(|first| first.is_some()).map_err(self.fail(folder))
    }

    fn head(&self, path: &str) -> Result<Option<ObjectMeta>> {
        match wait(self.store.head(&self.key(path)?)) {
            Ok(meta) => Ok(Some(meta)),
            Err(Failure::NotFound { .. }) => Ok(None),
            Err(failure) => Err(self.fail(path)(failure)),
        }
    }

    /// Uploads a complete file.
    pub fn upload(&self, path: &str, key: &Key, spool: &mut Spool) -> Result<()> {
        self.locks.check()?;
        let local = |error: io::Error| Error::io(std::env::temp_dir(), &error);
        if let Some(bytes) = spool.small().map_err(local)? {
            return wait(self.store.put(key, bytes.into())).map(drop).map_err(self.fail(path));
        }
        let mut upload = wait(self.store.put_multipart(key)).map_err(self.fail(path))?;
        let mut is_first = true;
        let sent = loop {
            let mut parts = Vec::new();
            while parts.len() < PARTS {
                let part = spool.part(std::mem::take(&mut is_first)).map_err(local)?;
                if part.is_empty() {
                    break;
                }
                parts.push(upload.put_part(part.into()));
            }
            if parts.is_empty() {
                break wait(upload.complete()).map(drop);
            }
            if let Err(failure) = wait(futures_util::future::try_join_all(parts)) {
                break Err(failure);
            }
        };
        sent.map_err(|failure| {
            // Without it, the store keeps the parts, and bills them.
            let _ = wait(upload.abort());
            self.fail(path)(failure)
        })
    }

    /// The content of a small object with its version.
    pub fn get(&self, key: &Key) -> object_store::Result<Option<(Vec<u8>, UpdateVersion)>> {
        wait(whole(async || {
            let got = match self.store.get_opts(key, GetOptions::default()).await {
                Ok(got) => got,
                Err(Failure::NotFound { .. }) => return Ok(None),
                Err(failure) => return Err(failure),
            };
            let version = UpdateVersion { e_tag: got.meta.e_tag.clone(), version: got.meta.version.clone() };
            Ok(Some((got.bytes().await?.to_vec(), version)))
        }))
    }

    /// Writes an object on a condition. Returns its version, or none if the condition does not hold.
    ///
    /// The answer to such a request may be lost after it took effect. If it fails, the object is read back: if it has these
    /// bytes, the request succeeded.
    pub fn put_if(&self, key: &Key, bytes: &[u8], mode: PutMode) -> object_store::Result<Option<UpdateVersion>> {
        let mut tries = 0;
        loop {
            tries += 1;
            let options = PutOptions { mode: mode.clone(), ..PutOptions::default() };
            let failure = match wait(self.store.put_opts(key, PutPayload::from(bytes.to_vec()), options)) {
                Ok(put) => return Ok(Some(UpdateVersion { e_tag: put.e_tag, version: put.version })),
                Err(failure) => failure,
            };
            let is_refused = match failure {
                Failure::AlreadyExists { .. } | Failure::Precondition { .. } => true,
                // Without an object to replace. A new object lacks the bucket.
                Failure::NotFound { .. } => !matches!(mode, PutMode::Create),
                _ => false,
            };
            match self.get(key) {
                Ok(Some((present, version))) if present == bytes => return Ok(Some(version)),
                Ok(_) if is_refused => return Ok(None),
                // The server may carry out the first request later, which the next condition would then find.
                Ok(_) if tries < TRIES && is_lost(&failure) => {}
                _ => return Err(failure),
            }
        }
    }

    /// The leases that this store holds.
    pub fn locks(&self) -> &Arc<Locks> {
        &self.locks
    }

    /// The keys below a key.
    pub fn keys_below(&self, key: &Key) -> object_store::Result<Vec<Key>> {
        wait(whole(|| self.store.list(Some(key)).map_ok(|meta| meta.location).try_collect()))
    }

    pub fn delete(&self, key: &Key) -> object_store::Result<()> {
        match wait(whole(|| self.store.delete(key))) {
            Err(Failure::NotFound { .. }) => Ok(()),
            done => done,
        }
    }
}

/// Whether a request may have failed on its way, and not by an answer that a repetition would get again.
fn is_lost(failure: &Failure) -> bool {
    matches!(failure, Failure::Generic { .. })
}

/// Sends a request, which may be carried out twice, again if the connection broke off within the answer.
pub async fn whole<T>(request: impl AsyncFn() -> object_store::Result<T>) -> object_store::Result<T> {
    let mut tries = 1;
    loop {
        match request().await {
            Err(failure) if tries < TRIES && failure::is_cut(&failure) => tries += 1,
            answer => return answer,
        }
    }
}

impl Store for Objects {
    fn name_of(&self, path: &str) -> PathBuf {
        self.0.name_of(path)
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        let folder = Found { kind: Kind::Folder, size: 0, leads_to: None, modified: None };
        if path.is_empty() {
            return Ok(Some(folder));
        }
        if let Some(meta) = self.0.head(path)? {
            let modified = Some(meta.last_modified.into());
            return Ok(Some(Found { kind: Kind::File, size: meta.size, leads_to: None, modified }));
        }
        Ok(self.0.has_folder(path)?.then_some(folder))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        let key = self.0.key(folder)?;
        let prefix = Some(&key).filter(|_| !folder.is_empty());
        let listed = wait(whole(|| self.0.store.list_with_delimiter(prefix))).map_err(self.0.fail(folder))?;
        let name = |key: &Key| key.filename().unwrap_or_default().to_owned();
        let files = listed.objects.iter().map(|meta| (name(&meta.location), Kind::File));
        Ok(files.chain(listed.common_prefixes.iter().map(|folder| (name(folder), Kind::Folder))).collect())
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        match ObjectContent::open(Arc::clone(&self.0.store), self.0.key(path)?) {
            Ok((size, content)) => Ok(Some(StoredFile { size, bytes: Box::new(content) })),
            Err(Failure::NotFound { .. }) => Ok(None),
            Err(failure) => Err(self.0.fail(path)(failure)),
        }
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        if self.look(path)?.is_some() {
            return Ok(None);
        }
        let (bucket, key) = (Arc::clone(&self.0), self.0.key(path)?);
        Ok(Some(Box::new(NewObject { bucket, path: path.clone(), key, spool: Spool::new(), is_changed: true })))
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        let mut spool = Spool::new();
        fill(&mut spool)?;
        self.0.upload(path, &self.0.key(path)?, &mut spool)
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        let bucket = &self.0;
        bucket.locks.check()?;
        let put = bucket.put_if(&bucket.key(path)?, bytes, PutMode::Create);
        put.map(|version| version.is_some()).map_err(bucket.fail(path))
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        let bucket = &self.0;
        bucket.locks.check()?;
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
        self.0.head(path)?.map(drop).ok_or_else(gone)
    }

    fn share(&self, _: &dyn Store, _: &DatasetPath, _: &DatasetPath) -> Result<bool> {
        Ok(false)
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        let bucket = &self.0;
        bucket.locks.check()?;
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
        let copies = moved.iter().map(|(from, to)| whole(move || bucket.store.copy(from, to)));
        let copied = stream::iter(copies).buffer_unordered(AT_ONCE).try_collect::<Vec<()>>();
        wait(copied).map_err(bucket.fail(to))?;
        moved.iter().try_for_each(|(from, _)| bucket.delete(from)).map_err(bucket.fail(from))
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.0.locks.check()?;
        self.0.delete(&self.0.key(path)?).map_err(self.0.fail(path))
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        let bucket = &self.0;
        bucket.locks.check()?;
        bucket.delete(&bucket.key(path)?).map_err(bucket.fail(path))?;
        let all: Vec<Key> = bucket.below(path)?.into_iter().map(|meta| meta.location).collect();
        let deleted = whole(|| {
            let all = stream::iter(all.clone()).map(Ok).boxed();
            let deleted = bucket.store.delete_stream(all).map(|deleted| match deleted {
                Err(Failure::NotFound { .. }) => Ok(()),
                deleted => deleted.map(drop),
            });
            deleted.try_collect::<Vec<()>>()
        });
        wait(deleted).map(drop).map_err(bucket.fail(path))
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        let (bucket, key) = (&self.0, self.0.key(path)?);
        let held = match access {
            Access::Read => Lease::is_free(bucket, &key).map(|is_free| is_free.then(|| Hold::new(()))),
            Access::Share => Lease::share(bucket, &key).map(|held| held.map(Hold::new)),
            Access::Write => Lease::take(bucket, &key).map(|held| held.map(Hold::new)),
        };
        held.map_err(bucket.fail(path))
    }
}

impl fmt::Debug for Objects {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Objects({})", self.0.name)
    }
}
