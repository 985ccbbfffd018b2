//! Results kept on disk between runs, by purpose and digest.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use syntable_model::context::Cache;
use syntable_model::digest::Digest;

/// A folder of cached results. Deleting it costs time, never correctness.
#[derive(Debug, Clone)]
pub struct DiskCache {
    root: PathBuf,
}

impl DiskCache {
    /// A cache in a folder, which is made when it is first needed.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The user's cache: `$SYNTABLE_CACHE`, else `$XDG_CACHE_HOME/syntable`, else `~/.cache/syntable`, else the
    /// system's folder for temporary files.
    pub fn of_user() -> Self {
        let var = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        Self::new(
            var("SYNTABLE_CACHE")
                .or_else(|| Some(var("XDG_CACHE_HOME")?.join("syntable")))
                .or_else(|| Some(var("HOME")?.join(".cache/syntable")))
                .unwrap_or_else(|| std::env::temp_dir().join("syntable-cache")),
        )
    }

    /// Where it is.
    pub fn root(&self) -> &Path {
        &self.root
    }

    fn path(&self, purpose: &str, key: Digest) -> PathBuf {
        self.root.join(purpose).join(key.to_string())
    }
}

/// Entries carry their own digest, so that a damaged file reads as absent.
impl Cache for DiskCache {
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>> {
        let mut bytes = fs::read(self.path(purpose, key)).ok()?;
        let payload = bytes.split_off(bytes.len().min(32));
        (bytes == Digest::of(&payload).to_string().as_bytes()).then_some(payload)
    }

    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]) {
        let path = self.path(purpose, key);
        let part = path.with_extension(format!("{}-{:?}.part", std::process::id(), std::thread::current().id()));
        let written = || -> std::io::Result<()> {
            fs::create_dir_all(self.root.join(purpose))?;
            let mut file = fs::File::create(&part)?;
            file.write_all(Digest::of(bytes).to_string().as_bytes())?;
            file.write_all(bytes)?;
            file.flush()?;
            fs::rename(&part, &path)
        };
        if written().is_err() {
            // A cache that cannot be written costs time only; what is half written must not stay.
            let _ = fs::remove_file(&part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_what_it_was_given_and_forgets_what_is_damaged() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = DiskCache::new(folder.path());
        let key = Digest::of(b"key");
        assert_eq!(cache.get("hulls", key), None);
        cache.put("hulls", key, b"some bytes");
        assert_eq!(cache.get("hulls", key).as_deref(), Some(&b"some bytes"[..]));
        let path = cache.path("hulls", key);
        let mut bytes = fs::read(&path).expect("written");
        bytes.truncate(bytes.len() - 1);
        fs::write(&path, bytes).expect("writable");
        assert_eq!(cache.get("hulls", key), None);
        fs::write(&path, b"short").expect("writable");
        assert_eq!(cache.get("hulls", key), None);
    }
}
