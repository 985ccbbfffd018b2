//! Results kept on disk between runs, by purpose and digest.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use syntable_model::context::Cache;
use syntable_model::digest::Digest;
use syntable_model::user_cache::user_cache;

/// A folder of cached results. Deleting it costs time, never correctness.
#[derive(Debug, Clone)]
pub struct DiskCache {
    /// The folder; nothing is kept without one.
    root: Option<PathBuf>,
}

impl DiskCache {
    /// A cache in a folder, which is created when it is first needed.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: Some(root.into()) }
    }

    /// The user's cache, in the folder [`user_cache`]. Nothing is kept without it.
    pub fn of_user() -> Self {
        Self { root: user_cache() }
    }

    /// No cache: nothing is kept.
    pub fn none() -> Self {
        Self { root: None }
    }

    /// The folder of the cache, if results are kept.
    pub fn root(&self) -> Option<&Path> {
        self.root.as_deref()
    }

    fn path(&self, purpose: &str, key: Digest) -> Option<PathBuf> {
        Some(self.root.as_ref()?.join(purpose).join(key.to_string()))
    }
}

/// The header of an entry: a digest of the purpose, the key and the bytes.
fn seal(purpose: &str, key: Digest, bytes: &[u8]) -> String {
    let whole = [purpose.as_bytes(), b"\n", key.to_string().as_bytes(), b"\n", bytes].concat();
    Digest::of(&whole).to_string()
}

/// A damaged file, or the file of another entry under this name, reads as absent.
impl Cache for DiskCache {
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>> {
        let mut bytes = fs::read(self.path(purpose, key)?).ok()?;
        let payload = bytes.split_off(bytes.len().min(32));
        (bytes == seal(purpose, key, &payload).as_bytes()).then_some(payload)
    }

    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]) {
        let Some(path) = self.path(purpose, key) else { return };
        let part = path.with_extension(format!("{}-{:?}.part", std::process::id(), std::thread::current().id()));
        let written = || -> std::io::Result<()> {
            fs::create_dir_all(path.parent().unwrap_or(&path))?;
            let mut file = fs::File::create(&part)?;
            file.write_all(seal(purpose, key, bytes).as_bytes())?;
            file.write_all(bytes)?;
            file.flush()?;
            fs::rename(&part, &path)
        };
        if written().is_err() {
            // A cache that cannot be written only costs time, but an incomplete file must not stay.
            let _ = fs::remove_file(&part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_folder_nothing_is_kept() {
        let cache = DiskCache { root: None };
        cache.put("hulls", Digest::of(b"key"), b"some bytes");
        assert_eq!(cache.get("hulls", Digest::of(b"key")), None);
    }

    #[test]
    fn keeps_what_it_was_given_and_forgets_what_is_damaged() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = DiskCache::new(folder.path());
        let key = Digest::of(b"key");
        assert_eq!(cache.get("hulls", key), None);
        cache.put("hulls", key, b"some bytes");
        assert_eq!(cache.get("hulls", key).as_deref(), Some(&b"some bytes"[..]));
        let path = cache.path("hulls", key).expect("a folder");
        // The intact file of another entry.
        fs::copy(&path, cache.path("hulls", Digest::of(b"other")).expect("a folder")).expect("copied");
        assert_eq!(cache.get("hulls", Digest::of(b"other")), None);
        let mut bytes = fs::read(&path).expect("written");
        bytes.truncate(bytes.len() - 1);
        fs::write(&path, bytes).expect("writable");
        assert_eq!(cache.get("hulls", key), None);
        fs::write(&path, b"short").expect("writable");
        assert_eq!(cache.get("hulls", key), None);
    }
}
