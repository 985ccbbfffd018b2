//! Where writers put files: the files of a scene, and files that cover many scenes.

use crate::digest::Digest;
use crate::error::{ConfigError, Error, Result};
use crate::files::DatasetPath;
pub use crate::files::RESERVED;
use crate::scene::SceneId;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Where a writer puts the files of one scene: a staging folder whose content is moved into the dataset when the scene
/// is done.
#[derive(Debug, Clone)]
pub struct Output {
    staging: PathBuf,
    id: String,
    scene: SceneId,
    /// What was created, shared by all that have this output.
    files: Arc<Mutex<BTreeSet<DatasetPath>>>,
}

impl Output {
    /// Output of the writer `id` for a scene.
    pub fn new(staging: impl Into<PathBuf>, id: impl Into<String>, scene: SceneId) -> Self {
        Self { staging: staging.into(), id: id.into(), scene, files: Arc::default() }
    }

    /// The writer's id in the recipe; the folder that generic writers write to.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Creates a file at a path relative to the dataset, such as `data/mono/rgb/0_0.png`. It must not exist yet.
    pub fn create(&self, path: &str) -> Result<BufWriter<File>> {
        self.create_at(of_writer(path)?)
    }

    fn create_at(&self, path: DatasetPath) -> Result<BufWriter<File>> {
        let file = create_new(&self.staging, &path, &self.id)?;
        self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(path);
        Ok(file)
    }

    /// Paths of the files that were created so far.
    pub fn files(&self) -> BTreeSet<DatasetPath> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes a whole file at a path relative to the dataset.
    pub fn write(&self, path: &str, bytes: &[u8]) -> Result<()> {
        self.write_at(of_writer(path)?, bytes)
    }

    fn write_at(&self, path: DatasetPath, bytes: &[u8]) -> Result<()> {
        let full = path.below(&self.staging);
        let mut file = self.create_at(path)?;
        file.write_all(bytes).and_then(|()| file.flush()).map_err(|error| Error::io(full, &error))
    }

    /// Writes this scene's shard, which [`Finish::shard`] reads back.
    pub fn write_shard(&self, bytes: &[u8]) -> Result<()> {
        self.write_at(shard_path(&self.id, self.scene)?, bytes)
    }

    /// Creates this scene's shard, to write it bit by bit.
    pub fn create_shard(&self) -> Result<BufWriter<File>> {
        self.create_at(shard_path(&self.id, self.scene)?)
    }

    /// Writes bytes beside this scene's shard that other scenes are likely to write, too, such as the texture of an asset.
    /// Returns their digest, by which [`Finish::shared`] reads them. Scenes of a dataset that share the same bytes take disk
    /// space once, provided that the file system has hard links.
    pub fn write_shared(&self, bytes: &[u8]) -> Result<Digest> {
        let digest = Digest::of(bytes);
        let path = shared_path(&self.id, self.scene, digest)?;
        if !self.files().contains(&path) && !self.links_same(&path, bytes) {
            self.write_at(path, bytes)?;
        }
        Ok(digest)
    }

    /// Links a file to one of another scene with the same bytes in the same staging folder: a conversion stages all scenes in
    /// one. Returns whether it did.
    fn links_same(&self, path: &DatasetPath, bytes: &[u8]) -> bool {
        let full = path.below(&self.staging);
        let same = || {
            let other = fs::read_dir(full.parent()?).ok()?.next()?.ok()?.path();
            let is_same = fs::read(&other).is_ok_and(|found| found == bytes);
            (is_same && fs::hard_link(other, &full).is_ok()).then_some(())
        };
        let is_linked = same().is_some();
        if is_linked {
            self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(path.clone());
        }
        is_linked
    }
}

/// Creates a file that must not exist yet: the one rule against two files of one path in a scene, or at the end of a run.
fn create_new(folder: &Path, path: &DatasetPath, id: &str) -> Result<BufWriter<File>> {
    let full = path.below(folder);
    if let Some(parent) = full.parent() {
        fs::create_dir_all(parent).map_err(|error| Error::io(parent, &error))?;
    }
    match File::create_new(&full) {
        Ok(file) => Ok(BufWriter::new(file)),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            Err(Error::new(format!("`{path}` is written twice"))
                .help(format!("two files have one path; give `write.{id}` another id, folder or path"))
                .permanent())
        }
        Err(error) => Err(Error::io(full, &error)),
    }
}

/// What a writer can see and do at the end of a run.
#[derive(Debug, Clone)]
pub struct Finish {
    root: PathBuf,
    staging: Option<PathBuf>,
    id: String,
    scenes: Vec<SceneId>,
}

impl Finish {
    /// The end of a run for the writer `id`: `scenes` are done, ascending. Files are written into the dataset, where they
    /// replace older ones.
    pub fn new(root: impl Into<PathBuf>, id: impl Into<String>, scenes: Vec<SceneId>) -> Self {
        Self { root: root.into(), staging: None, id: id.into(), scenes }
    }

    /// The same with a staging folder for the files of all writers, in which no path may be written twice.
    pub fn staged(self, staging: impl Into<PathBuf>) -> Self {
        Self { staging: Some(staging.into()), ..self }
    }

    /// The writer's id in the recipe.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The scenes that are done, ascending.
    pub fn scenes(&self) -> &[SceneId] {
        &self.scenes
    }

    /// Opens the shard that this writer wrote for a scene.
    pub fn shard(&self, scene: SceneId) -> Result<BufReader<File>> {
        let path = shard_path(&self.id, scene)?.below(&self.root);
        let help = "the dataset is damaged; `syntable run --repair` makes the scene again";
        File::open(&path).map(BufReader::new).map_err(|error| Error::io(&path, &error).help(help))
    }

    /// Reads what this writer wrote for a scene with [`Output::write_shared`].
    ///
    /// # Errors
    /// If the file cannot be read, or has other bytes.
    pub fn shared(&self, scene: SceneId, digest: Digest) -> Result<Vec<u8>> {
        let path = shared_path(&self.id, scene, digest)?.below(&self.root);
        let help = "the dataset is damaged; `syntable run --repair` makes the scene again";
        let bytes = fs::read(&path).map_err(|error| Error::io(&path, &error).help(help))?;
        if Digest::of(&bytes) != digest {
            return Err(Error::new("the file has other bytes than its name says")
                .in_file(&path)
                .help(help)
                .permanent());
        }
        Ok(bytes)
    }

    /// Writes a file of the dataset, whole or not at all.
    pub fn write(&self, path: &str, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
        let path = of_writer(path)?;
        let (full, mut file) = match &self.staging {
            Some(staging) => (path.below(staging), create_new(staging, &path, &self.id)?),
            None => {
                let part = of_writer(&format!("{path}.part"))?;
                let full = part.below(&self.root);
                // What an interrupted call has left.
                let _ = fs::remove_file(&full);
                (full, create_new(&self.root, &part, &self.id)?)
            }
        };
        let fail = |error: std::io::Error| Error::io(path.below(&self.root), &error);
        let filled = fill(&mut file).and_then(|()| {
            file.flush().and_then(|()| file.get_ref().sync_all()).map_err(fail)?;
            match &self.staging {
                Some(_) => Ok(()),
                None => fs::rename(&full, path.below(&self.root)).map_err(fail),
            }
        });
        if filled.is_err() {
            // The first error is the one to report.
            let _ = fs::remove_file(&full);
        }
        filled
    }
}

/// Path of a writer's shard of a scene.
///
/// # Errors
/// If the id is no name of a folder.
pub fn shard_path(id: &str, scene: SceneId) -> Result<DatasetPath> {
    let path = DatasetPath::new(format!("{}/shards/{id}/{:06}.jsonl", RESERVED[0], scene.0));
    path.map_err(|error| Error::new(error.to_string()).permanent())
}

/// Path of bytes that a writer keeps for the end of a run. Scenes that share the same bytes have files in the same folder.
fn shared_path(id: &str, scene: SceneId, digest: Digest) -> Result<DatasetPath> {
    let path = DatasetPath::new(format!("{}/shards/{id}/{SHARED}/{digest}/{:06}", RESERVED[0], scene.0));
    path.map_err(|error| Error::new(error.to_string()).permanent())
}

/// Name of the folder of what scenes share, beside their shards.
const SHARED: &str = "shared";

/// Whether a path of a dataset is one of [`Output::write_shared`]: then all files of its folder have the same bytes.
pub fn is_shared(path: &DatasetPath) -> bool {
    let below = path.strip_prefix(RESERVED[0]).and_then(|path| path.strip_prefix("/shards/"));
    below.is_some_and(|path| path.split('/').nth(1) == Some(SHARED))
}

/// Checks an option that names a file or folder of the dataset: a relative path that stays inside it, and is none of the
/// program's own.
pub fn check_path(option: &str, path: &str) -> Result<(), ConfigError> {
    let help = "write it as `a` or `a/b`, relative to the dataset";
    DatasetPath::of_writer(path).map(drop).map_err(|error| ConfigError::new(option, error.to_string()).help(help))
}

fn of_writer(path: &str) -> Result<DatasetPath> {
    DatasetPath::of_writer(path).map_err(|error| Error::new(error.to_string()).permanent())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_written_once_at_the_end_of_a_run() {
        let folder = std::env::temp_dir().join(format!("syntable-finish-{}", std::process::id()));
        let write = |id: &str, staged: bool| {
            let finish = Finish::new(folder.join("data"), id, Vec::new());
            let finish = if staged { finish.staged(folder.join("staging")) } else { finish };
            finish.write("a/all.jsonl", |out| out.write_all(id.as_bytes()).map_err(|error| Error::io("a", &error)))
        };
        write("a", true).expect("first");
        let error = write("b", true).expect_err("second");
        assert!(error.is_permanent() && error.to_string().contains("`a/all.jsonl` is written twice"), "{error}");
        assert_eq!(fs::read_to_string(folder.join("staging/a/all.jsonl")).expect("written"), "a");
        // Without a staging folder an older file is replaced.
        write("a", false).and_then(|()| write("b", false)).expect("again");
        assert_eq!(fs::read_to_string(folder.join("data/a/all.jsonl")).expect("written"), "b");
        fs::remove_dir_all(&folder).expect("removable");
    }

    #[test]
    fn writers_write_inside_the_dataset() {
        let folder = std::env::temp_dir().join(format!("syntable-inside-{}", std::process::id()));
        let output = Output::new(folder.join("staged"), "w", SceneId(3));
        let finish = Finish::new(folder.join("data"), "w", Vec::new());
        for path in ["../a", "/a", "", "a/../../b", "a\\b", "a//b", ".syntable/journal.jsonl", "recipe.toml"] {
            assert!(output.write(path, b"x").is_err() && output.create(path).is_err(), "{path}");
            assert!(finish.write(path, |_| Ok(())).is_err() && check_path("file", path).is_err(), "{path}");
        }
        assert!(output.files().is_empty() && !folder.exists(), "nothing was written");
        output.write("data/rgb/0_0.png", b"x").expect("written");
        output.write_shard(b"x").expect("written");
        let shard = folder.join("staged/.syntable/shards/w/000003.jsonl");
        assert!(shard.is_file() && folder.join("staged/data/rgb/0_0.png").is_file());
        for id in ["../../../../w", "a/../b", "/w"] {
            let output = Output::new(folder.join("staged"), id, SceneId(3));
            let finish = Finish::new(folder.join("data"), id, Vec::new());
            assert!(output.write_shard(b"x").is_err() && finish.shard(SceneId(3)).is_err(), "{id}");
        }
        fs::remove_dir_all(&folder).expect("removable");
    }
}
