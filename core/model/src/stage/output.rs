//! Where writers put files: the files of a scene, and files that cover many scenes.

use crate::digest::Digest;
use crate::error::{ConfigError, Error, Result};
use crate::files::DatasetPath;
pub use crate::files::RESERVED;
use crate::product::KeyId;
use crate::scene::SceneId;
use crate::store::{StoreFolder, StoredFile};
use std::collections::BTreeSet;
use std::io::{BufReader, Read, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// Where a writer puts the files of one scene: a staging folder whose files are moved into the dataset when the scene is done.
#[derive(Debug, Clone)]
pub struct Output {
    staging: StoreFolder,
    id: String,
    scene: SceneId,
    /// The files that were created, shared by all clones.
    files: Arc<Mutex<BTreeSet<DatasetPath>>>,
}

impl Output {
    /// Output of the writer `id` for a scene. A path of this machine is a staging folder, too.
    pub fn new(staging: impl Into<StoreFolder>, id: impl Into<String>, scene: SceneId) -> Self {
        Self { staging: staging.into(), id: id.into(), scene, files: Arc::default() }
    }

    /// The writer's id in the recipe; the folder that generic writers write to.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Creates a file at a path relative to the dataset, such as `data/mono/rgb/0_0.png`. It must not exist yet. A flush
    /// reports errors of writing; dropping the file does not.
    pub fn create(&self, path: &str) -> Result<FileWriter> {
        self.create_at(of_writer(path)?)
    }

    fn create_at(&self, path: DatasetPath) -> Result<FileWriter> {
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
        let full = self.staging.name_of(&path);
        let mut file = self.create_at(path)?;
        file.write_all(bytes).and_then(|()| file.flush()).map_err(|error| Error::io(full, &error))
    }

    /// Writes this scene's shard, which [`Finish::shard`] reads back.
    pub fn write_shard(&self, bytes: &[u8]) -> Result<()> {
        self.write_at(shard_path(&self.id, self.scene)?, bytes)
    }

    /// Creates this scene's shard, to write it bit by bit.
    pub fn create_shard(&self) -> Result<FileWriter> {
        self.create_at(shard_path(&self.id, self.scene)?)
    }

    /// Writes bytes next to this scene's shard that other scenes are likely to write, too, such as the texture of an
    /// asset. Returns their digest, by which [`Finish::shared`] reads them. A store keeps equal bytes of several scenes
    /// only once, if it can.
    pub fn write_shared(&self, bytes: &[u8]) -> Result<Digest> {
        let digest = Digest::of(bytes);
        let path = shared_path(&self.id, self.scene, digest)?;
        if !self.files().contains(&path) && !self.share(&path, bytes) {
            self.write_at(path, bytes)?;
        }
        Ok(digest)
    }

    /// Shares a file with another scene that has the same bytes in the same staging folder, because a conversion stages
    /// all scenes in one folder. Returns whether a file was shared.
    fn share(&self, path: &DatasetPath, bytes: &[u8]) -> bool {
        let share = || {
            let (folder, _) = path.rsplit_once('/')?;
            let (other, _) = self.staging.list(folder).ok()?.into_iter().next()?;
            let other = DatasetPath::new(format!("{folder}/{other}")).ok()?;
            let has_same = self.staging.read(&other).is_ok_and(|found| found.is_some_and(|found| found == bytes));
            (has_same && self.staging.share(&self.staging, &other, path).is_ok_and(|done| done)).then_some(())
        };
        let is_shared = share().is_some();
        if is_shared {
            self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(path.clone());
        }
        is_shared
    }
}

/// A file that a writer fills.
pub type FileWriter = Box<dyn Write + Send>;

/// Creates a file that must not exist yet. This rule prevents two files with one path in a scene, or at the end of a
/// run.
fn create_new(folder: &StoreFolder, path: &DatasetPath, id: &str) -> Result<FileWriter> {
    folder.create(path)?.ok_or_else(|| {
        Error::new(format!("`{path}` is written twice"))
            .help(format!("two files have one path; give `write.{id}` another id, folder or path"))
    })
}

/// Access of a writer to the dataset at the end of a run.
#[derive(Debug, Clone)]
pub struct Finish {
    dataset: StoreFolder,
    staging: Option<StoreFolder>,
    id: String,
    scenes: Vec<SceneId>,
    reads: Vec<KeyId>,
    open: Option<OpenFile>,
}

type Open = dyn Fn(SceneId, &DatasetPath) -> Result<StoredFile> + Send + Sync;

/// Opens a file of a scene.
#[derive(Clone)]
struct OpenFile(Arc<Open>);

impl std::fmt::Debug for OpenFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("OpenFile")
    }
}

impl Finish {
    /// The end of a run for the writer `id`: `scenes` are done, ascending. Files are written into the dataset, where they
    /// replace older ones. A path of this machine is a dataset, too.
    pub fn new(dataset: impl Into<StoreFolder>, id: impl Into<String>, scenes: Vec<SceneId>) -> Self {
        Self { dataset: dataset.into(), staging: None, id: id.into(), scenes, reads: Vec::new(), open: None }
    }

    /// The same with the keys of the products that the writer reads.
    pub fn reading(self, reads: Vec<KeyId>) -> Self {
        Self { reads, ..self }
    }

    /// The same with a staging folder for the files of all writers, in which no path may be written twice.
    pub fn staged(self, staging: impl Into<StoreFolder>) -> Self {
        Self { staging: Some(staging.into()), ..self }
    }

    /// The same with shards that `open` opens, for example to compare them with digests.
    pub fn opening(self, open: impl Fn(SceneId, &DatasetPath) -> Result<StoredFile> + Send + Sync + 'static) -> Self {
        Self { open: Some(OpenFile(Arc::new(open))), ..self }
    }

    /// The writer's id in the recipe.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The keys of the products that the writer reads.
    pub fn reads(&self) -> &[KeyId] {
        &self.reads
    }

    /// The scenes that are done, ascending.
    pub fn scenes(&self) -> &[SceneId] {
        &self.scenes
    }

    /// Opens the shard that this writer wrote for a scene.
    pub fn shard(&self, scene: SceneId) -> Result<BufReader<StoredFile>> {
        let path = shard_path(&self.id, scene)?;
        let opened = match &self.open {
            Some(OpenFile(open)) => open(scene, &path).map_err(unreadable),
            None => self.open(&path),
        };
        opened.map(BufReader::new)
    }

    /// Reads bytes that this writer stored for a scene with [`Output::write_shared`].
    ///
    /// # Errors
    /// If the file cannot be read, or has other bytes.
    pub fn shared(&self, scene: SceneId, digest: Digest) -> Result<Vec<u8>> {
        let path = shared_path(&self.id, scene, digest)?;
        let full = self.dataset.name_of(&path);
        let mut bytes = Vec::new();
        self.open(&path)?.read_to_end(&mut bytes).map_err(|error| unreadable(Error::io(&full, &error)))?;
        if Digest::of(&bytes) != digest {
            return Err(Error::new("the file has other bytes than its name says").in_file(&full).help(DAMAGED));
        }
        Ok(bytes)
    }

    fn open(&self, path: &DatasetPath) -> Result<StoredFile> {
        let gone = || Error::io(self.dataset.name_of(path), &std::io::ErrorKind::NotFound.into());
        self.dataset.open(path).and_then(|opened| opened.ok_or_else(gone)).map_err(unreadable)
    }

    /// Writes a file of the dataset, whole or not at all.
    pub fn write(&self, path: &str, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
        let path = of_writer(path)?;
        let Some(staging) = &self.staging else {
            let mut fill = Some(fill);
            return self.dataset.put(&path, &mut |file| fill.take().map_or(Ok(()), |fill| fill(file)));
        };
        let mut file = create_new(staging, &path, &self.id)?;
        let filled = fill(&mut *file)
            .and_then(|()| file.flush().map_err(|error| Error::io(self.dataset.name_of(&path), &error)));
        drop(file);
        let filled = filled.and_then(|()| staging.sync(&path));
        if filled.is_err() {
            // The first error is the one to report.
            let _ = staging.remove_all(&path);
        }
        filled
    }
}

/// The remedy for a wrong or missing file of a scene.
pub const DAMAGED: &str = "the dataset is damaged; a run with `options.repair` makes the scene again";

/// The remedy for a file that a disk or a network did not deliver, or that the user may not read.
const UNDELIVERED: &str =
    "the file may be intact; check the disk, the network and the permissions, then run the same command again";

/// Adds the remedy to the error of a dataset's file that cannot be read. Only wrong content means damage.
pub fn unreadable(error: Error) -> Error {
    match error.help_text() {
        Some(_) => error,
        None if error.is_transient() => error.help(UNDELIVERED),
        None => error.help(DAMAGED),
    }
}

/// Path of a writer's shard of a scene.
///
/// # Errors
/// If the id is not a valid name of a folder.
pub fn shard_path(id: &str, scene: SceneId) -> Result<DatasetPath> {
    let path = DatasetPath::new(path_of_scene(&format!("{}/shards/{id}", RESERVED[0]), scene.0, "jsonl"));
    path.map_err(|error| Error::new(error.to_string()))
}

/// Path of a scene's file in a folder that has one file per scene: `folder/012/012345.json`. Each of its folders has the
/// files of a thousand scenes, because many file systems list folders with a million files slowly.
pub fn path_of_scene(folder: &str, scene: u32, extension: &str) -> String {
    format!("{folder}/{:03}/{scene:06}.{extension}", scene / 1000)
}

/// Path of bytes that a writer keeps for the end of a run. Scenes that share the same bytes have files in the same folder.
fn shared_path(id: &str, scene: SceneId, digest: Digest) -> Result<DatasetPath> {
    let path = DatasetPath::new(format!("{}/shards/{id}/{SHARED}/{digest}/{:06}", RESERVED[0], scene.0));
    path.map_err(|error| Error::new(error.to_string()))
}

/// Name of the folder with bytes that scenes share, next to their shards.
const SHARED: &str = "shared";

/// Whether [`Output::write_shared`] wrote a file of a dataset. If so, all files of its folder have the same bytes.
pub fn is_shared(path: &DatasetPath) -> bool {
    let below = path.strip_prefix(RESERVED[0]).and_then(|path| path.strip_prefix("/shards/"));
    below.is_some_and(|path| path.split('/').nth(1) == Some(SHARED))
}

/// Checks an option that names a file or folder of the dataset: a relative path that stays inside it and that the
/// program does not reserve.
pub fn check_path(option: &str, path: &str) -> Result<(), ConfigError> {
    let help = "write it as `a` or `a/b`, relative to the dataset";
    DatasetPath::of_writer(path).map(drop).map_err(|error| ConfigError::new(option, error.to_string()).help(help))
}

fn of_writer(path: &str) -> Result<DatasetPath> {
    DatasetPath::of_writer(path).map_err(|error| Error::new(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::MemStore;

    /// A dataset, a staging folder and the store that they are in.
    fn folders() -> (Arc<MemStore>, [StoreFolder; 2]) {
        let store = Arc::new(MemStore::default());
        let at = |name: &str| StoreFolder::from(Arc::clone(&store)).inner(&DatasetPath::new(name).expect("a path"));
        (Arc::clone(&store), [at("data"), at("staged")])
    }

    #[test]
    fn a_path_is_written_once_at_the_end_of_a_run() {
        let (store, [data, staging]) = folders();
        let write = |id: &str, staged: bool| {
            let finish = Finish::new(&data, id, Vec::new());
            let finish = if staged { finish.staged(&staging) } else { finish };
            finish.write("a/all.jsonl", |out| out.write_all(id.as_bytes()).map_err(|error| Error::io("a", &error)))
        };
        let text = |path: &str| store.get(path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        write("a", true).expect("first");
        let error = write("b", true).expect_err("second");
        assert!(error.is_permanent() && error.to_string().contains("`a/all.jsonl` is written twice"), "{error}");
        assert_eq!(text("staged/a/all.jsonl").as_deref(), Some("a"));
        // Without a staging folder an older file is replaced.
        write("a", false).and_then(|()| write("b", false)).expect("again");
        assert_eq!(text("data/a/all.jsonl").as_deref(), Some("b"));
        // A file that a writer could not fill does not exist.
        for finish in [Finish::new(&data, "a", Vec::new()), Finish::new(&data, "a", Vec::new()).staged(&staging)] {
            finish.write("a/none", |_| Err(Error::new("no"))).expect_err("it fails");
        }
        assert_eq!(store.files().len(), 2);
    }

    #[test]
    fn only_wrong_content_means_damage() {
        let of = |error: std::io::Error| unreadable(Error::io("a", &error)).to_string();
        // EIO, EACCES, ESTALE.
        for code in [5, 13, 116] {
            let said = of(std::io::Error::from_raw_os_error(code));
            assert!(said.contains("may be intact") && !said.contains("damaged"), "{said}");
        }
        for kind in [std::io::ErrorKind::NotFound, std::io::ErrorKind::UnexpectedEof] {
            let said = of(kind.into());
            assert!(said.contains("damaged") && !said.contains("intact"), "{said}");
        }
        assert_eq!(unreadable(Error::new("no").help("do so")).to_string(), "no (do so)");
    }

    #[test]
    fn writers_write_inside_the_dataset() {
        let (store, [data, staging]) = folders();
        let output = Output::new(&staging, "w", SceneId(3));
        let finish = Finish::new(&data, "w", Vec::new());
        for path in ["../a", "/a", "", "a/../../b", "a\\b", "a//b", ".syntable/journal.jsonl", "recipe.toml"] {
            assert!(output.write(path, b"x").is_err() && output.create(path).is_err(), "{path}");
            assert!(finish.write(path, |_| Ok(())).is_err() && check_path("file", path).is_err(), "{path}");
        }
        assert!(output.files().is_empty() && store.files().is_empty(), "nothing was written");
        output.write("data/rgb/0_0.png", b"x").expect("written");
        output.write_shard(b"x").expect("written");
        let paths: Vec<String> = store.files().keys().map(ToString::to_string).collect();
        assert_eq!(paths, ["staged/.syntable/shards/w/000/000003.jsonl", "staged/data/rgb/0_0.png"]);
        for id in ["../../../../w", "a/../b", "/w"] {
            let output = Output::new(&staging, id, SceneId(3));
            let finish = Finish::new(&data, id, Vec::new());
            assert!(output.write_shard(b"x").is_err() && finish.shard(SceneId(3)).is_err(), "{id}");
        }
    }
}
