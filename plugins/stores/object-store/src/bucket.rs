//! A bucket: requests for its objects.

use crate::failure;
use crate::requests::{TRIES, wait, wait_at_most, whole};
use crate::spool::Spool;
use futures_util::{StreamExt, TryStreamExt};
use object_store::path::Path as Key;
use object_store::{
    Error as Failure, GetOptions, ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload,
    UpdateVersion,
};
use parking_lot::Mutex;
use std::io;
use std::path::PathBuf;
use std::process;
use std::sync::Arc;
use std::time::Duration;
use syntable_model::error::{Error, Result};

/// Parts of a large file that are uploaded at once.
const PARTS: usize = 4;

/// Makes the client of a bucket.
pub type Connect = Box<dyn Fn() -> Result<Arc<dyn ObjectStore>> + Send + Sync>;

/// A bucket or container.
pub struct Bucket {
    client: Arc<dyn ObjectStore>,
    /// URL without a `/` at its end, for messages.
    pub name: String,
    /// The process of the client. Connections of another process belong to threads that a fork does not copy.
    process: u32,
    connect: Option<Connect>,
    /// Clients of processes that were forked, for good.
    forked: Mutex<Vec<(u32, &'static Arc<dyn ObjectStore>)>>,
}

impl Bucket {
    /// A bucket with its client. `connect` makes a client for a process that is forked later.
    pub fn new(client: Arc<dyn ObjectStore>, name: String, connect: Option<Connect>) -> Self {
        Self { client, name, process: process::id(), connect, forked: Mutex::default() }
    }

    /// The client of this process.
    pub fn store(&self) -> &Arc<dyn ObjectStore> {
        let here = process::id();
        let Some(connect) = self.connect.as_ref().filter(|_| here != self.process) else { return &self.client };
        let mut forked = self.forked.lock();
        if let Some((_, client)) = forked.iter().find(|(process, _)| *process == here) {
            return client;
        }
        // The same variables made the client of the parent process.
        let Ok(client) = connect() else { return &self.client };
        let client: &'static Arc<dyn ObjectStore> = Box::leak(Box::new(client));
        forked.push((here, client));
        client
    }

    pub fn name_of(&self, path: &str) -> PathBuf {
        PathBuf::from(if path.is_empty() { self.name.clone() } else { format!("{}/{path}", self.name) })
    }

    pub fn fail(&self, path: &str) -> impl Fn(Failure) -> Error + '_ {
        let name = self.name_of(path);
        move |failure| failure::error(&name, &failure)
    }

    pub fn key(&self, path: &str) -> Result<Key> {
        Key::parse(path).map_err(|error| Error::new(error.to_string().to_lowercase()).in_file(self.name_of(path)))
    }

    /// The objects below a folder.
    pub fn below(&self, folder: &str) -> Result<Vec<ObjectMeta>> {
        self.below_at_most(folder, usize::MAX)
    }

    /// The objects below a folder. If they are more than `most`, the list ends after one more.
    pub fn below_at_most(&self, folder: &str, most: usize) -> Result<Vec<ObjectMeta>> {
        let key = self.key(folder)?;
        let prefix = Some(&key).filter(|_| !folder.is_empty());
        let end = most.saturating_add(1);
        wait(whole(|| self.store().list(prefix).take(end).try_collect())).map_err(self.fail(folder))
    }

    /// Whether a folder exists.
    pub fn has_folder(&self, folder: &str) -> Result<bool> {
        let key = self.key(folder)?;
        let first = wait(whole(async || self.store().list(Some(&key)).next().await.transpose()));
        first.map(|first| first.is_some()).map_err(self.fail(folder))
    }

    pub fn head(&self, path: &str) -> Result<Option<ObjectMeta>> {
        match wait(self.store().head(&self.key(path)?)) {
            Ok(meta) => Ok(Some(meta)),
            Err(Failure::NotFound { .. }) => Ok(None),
            Err(failure) => Err(self.fail(path)(failure)),
        }
    }

    /// Uploads a complete file.
    pub fn upload(&self, path: &str, key: &Key, spool: &mut Spool) -> Result<()> {
        let local = |error: io::Error| Error::io(std::env::temp_dir(), &error);
        if let Some(bytes) = spool.small().map_err(local)? {
            return wait(self.store().put(key, bytes.into())).map(drop).map_err(self.fail(path));
        }
        let mut upload = wait(self.store().put_multipart(key)).map_err(self.fail(path))?;
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
        wait(self.getting(key))
    }

    /// The same as a request.
    pub async fn getting(&self, key: &Key) -> object_store::Result<Option<(Vec<u8>, UpdateVersion)>> {
        whole(async || {
            let got = match self.store().get_opts(key, GetOptions::default()).await {
                Ok(got) => got,
                Err(Failure::NotFound { .. }) => return Ok(None),
                Err(failure) => return Err(failure),
            };
            let version = UpdateVersion { e_tag: got.meta.e_tag.clone(), version: got.meta.version.clone() };
            Ok(Some((got.bytes().await?.to_vec(), version)))
        })
        .await
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
            let failure = match wait(self.store().put_opts(key, PutPayload::from(bytes.to_vec()), options)) {
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

    /// Replaces an object if it is unchanged. Returns its version, or none if it is not. An error if the answer takes longer
    /// than `limit`: the request may then have taken effect.
    pub fn renew(
        &self,
        key: &Key,
        bytes: &[u8],
        version: UpdateVersion,
        limit: Duration,
    ) -> object_store::Result<Option<UpdateVersion>> {
        let options = PutOptions { mode: PutMode::Update(version), ..PutOptions::default() };
        let put = self.store().put_opts(key, PutPayload::from(bytes.to_vec()), options);
        match wait_at_most(limit, put) {
            Some(Ok(put)) => Ok(Some(UpdateVersion { e_tag: put.e_tag, version: put.version })),
            Some(Err(Failure::AlreadyExists { .. } | Failure::Precondition { .. } | Failure::NotFound { .. })) => {
                Ok(None)
            }
            Some(Err(failure)) => Err(failure),
            None => Err(Failure::Generic { store: "lease", source: "the store does not answer in time".into() }),
        }
    }

    /// The keys below a key.
    pub fn keys_below(&self, key: &Key) -> object_store::Result<Vec<Key>> {
        wait(whole(|| self.store().list(Some(key)).map_ok(|meta| meta.location).try_collect()))
    }

    pub fn delete(&self, key: &Key) -> object_store::Result<()> {
        match wait(whole(|| self.store().delete(key))) {
            Err(Failure::NotFound { .. }) => Ok(()),
            done => done,
        }
    }
}

/// Whether a request may have failed on its way, and not by an answer that a repetition would get again.
fn is_lost(failure: &Failure) -> bool {
    matches!(failure, Failure::Generic { .. })
}
