//! Writes samples to files.

use crate::context::{DatasetContext, SceneContext, ViewContext};
use crate::error::{ConfigError, Error, Result};
use crate::names::ProductName;
use crate::product::{Key, KeyId, Product, Products};
use crate::scene::SceneId;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A file format. The files of a scene appear in the dataset when the whole scene is done; a file that covers many
/// scenes is written in `finish`, from per-scene shards.
pub trait Writer: Send + Sync {
    /// The products that it reads, each with the kinds of value that it can store. It is lent these and no others.
    fn reads(&self) -> Vec<Input>;
    /// Starts a scene. Dropping the scene writer without closing it abandons the scene.
    fn scene(&self, cx: &SceneContext, output: Output) -> Result<Box<dyn SceneWriter>>;
    /// Writes what covers many scenes. Called at the end of every run, with all scenes that are done and the products of
    /// the dataset that it reads; called again, it writes the same files.
    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        let _ = (cx, products, finish);
        Ok(())
    }
}

/// A writer at work on one scene.
pub trait SceneWriter: Send {
    /// Writes one view. Views come in order. `products` holds what the writer reads of the view, and of the scene as far
    /// as it is known before the views.
    fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()>;
    /// Ends the scene. `products` holds all that the writer reads of the scene.
    fn close(self: Box<Self>, cx: &SceneContext, products: &Products) -> Result<()>;
}

/// A product that a writer reads.
#[derive(Debug, Clone)]
pub struct Input {
    /// Name of the product.
    pub product: String,
    /// What the writer can store under this name.
    pub accepts: Accepts,
    /// The writer's option that names the product, such as `include[2]`, for diagnostics.
    pub option: Option<String>,
}

/// What a writer can store.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Accepts {
    /// Any product.
    Any,
    /// A product of exactly this key's type.
    Type(KeyId),
    /// A product that the function does not refuse. The refusal is a reason and a remedy, such as `a PNG file has no
    /// channel for 32-bit floats; write it with exr or npy`.
    If(fn(&KeyId) -> Result<(), String>),
}

impl Input {
    /// A product that the writer knows, of exactly its type.
    pub fn of<T: Product>(key: Key<T>) -> Self {
        Self { product: key.id().name.to_string(), accepts: Accepts::Type(key.id()), option: None }
    }

    /// The products that an option named `include` lists.
    pub fn included(include: &[ProductName], accepts: Accepts) -> Vec<Self> {
        let input = |(i, name): (usize, &ProductName)| Self {
            product: name.as_str().to_owned(),
            accepts,
            option: Some(format!("include[{i}]")),
        };
        include.iter().enumerate().map(input).collect()
    }
}

impl Accepts {
    /// Refuses a product that cannot be stored, with the reason.
    pub fn check(&self, key: &KeyId) -> Result<(), String> {
        match self {
            Self::Any => Ok(()),
            Self::Type(own) if own.type_id() == key.type_id() => Ok(()),
            Self::Type(own) => Err(format!("it is {}, not {}", key.type_name(), own.type_name())),
            Self::If(check) => check(key),
        }
    }
}

/// Where a writer puts the files of one scene: a staging folder whose content is moved into the dataset when the scene
/// is done.
#[derive(Debug, Clone)]
pub struct Output {
    staging: PathBuf,
    id: String,
    scene: SceneId,
}

impl Output {
    /// Output of the writer `id` for a scene.
    pub fn new(staging: impl Into<PathBuf>, id: impl Into<String>, scene: SceneId) -> Self {
        Self { staging: staging.into(), id: id.into(), scene }
    }

    /// The writer's id in the recipe; the folder that generic writers write to.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Creates a file at a path relative to the dataset, such as `data/mono/rgb/0_0.png`. It must not exist yet.
    pub fn create(&self, path: &str) -> Result<BufWriter<File>> {
        relative(path)?;
        self.create_at(path)
    }

    fn create_at(&self, path: &str) -> Result<BufWriter<File>> {
        let full = self.staging.join(path);
        if let Some(parent) = full.parent() {
            fs::create_dir_all(parent).map_err(|error| Error::io(parent, &error))?;
        }
        match File::create_new(&full) {
            Ok(file) => Ok(BufWriter::new(file)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                Err(Error::new(format!("`{path}` is written twice"))
                    .help(format!(
                        "two files of a scene have one path; give `write.{}` another id, folder or path",
                        self.id
                    ))
                    .permanent())
            }
            Err(error) => Err(Error::io(full, &error)),
        }
    }

    /// Writes a whole file at a path relative to the dataset.
    pub fn write(&self, path: &str, bytes: &[u8]) -> Result<()> {
        relative(path)?;
        self.write_at(path, bytes)
    }

    fn write_at(&self, path: &str, bytes: &[u8]) -> Result<()> {
        let mut file = self.create_at(path)?;
        file.write_all(bytes).and_then(|()| file.flush()).map_err(|error| Error::io(self.staging.join(path), &error))
    }

    /// Writes this scene's shard, which [`Finish::shard`] reads back.
    pub fn write_shard(&self, bytes: &[u8]) -> Result<()> {
        self.write_at(&shard_path(&self.id, self.scene), bytes)
    }
}

/// What a writer can see and do at the end of a run.
#[derive(Debug, Clone)]
pub struct Finish {
    root: PathBuf,
    id: String,
    scenes: Vec<SceneId>,
    written: FinishedFiles,
}

/// The files that the writers of a run have written at its end, each with the writer's id.
pub type FinishedFiles = Arc<Mutex<BTreeMap<String, String>>>;

impl Finish {
    /// The end of a run for the writer `id`: `scenes` are done, ascending.
    pub fn new(root: impl Into<PathBuf>, id: impl Into<String>, scenes: Vec<SceneId>) -> Self {
        Self { root: root.into(), id: id.into(), scenes, written: FinishedFiles::default() }
    }

    /// The same beside other writers, none of which may write a file that another has written.
    pub fn beside(self, written: FinishedFiles) -> Self {
        Self { written, ..self }
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
        let path = self.root.join(shard_path(&self.id, scene));
        File::open(&path)
            .map(BufReader::new)
            .map_err(|error| Error::io(&path, &error).help("the dataset is damaged; run again with --overwrite"))
    }

    /// Writes a file of the dataset, whole or not at all; an older one is replaced.
    pub fn write(&self, path: &str, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
        let full = self.root.join(relative(path)?);
        let fail = |error: std::io::Error| Error::io(&full, &error);
        let before =
            self.written.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned(), self.id.clone());
        if let Some(other) = before.filter(|other| *other != self.id) {
            return Err(Error::new(format!("`{path}` is already the file of `write.{other}`"))
                .help(format!("give one of `write.{other}` and `write.{}` another file name", self.id))
                .permanent());
        }
        if let Some(parent) = full.parent() {
            fs::create_dir_all(parent).map_err(fail)?;
        }
        let mut name = full.file_name().unwrap_or_default().to_owned();
        name.push(".part");
        let part = full.with_file_name(name);
        let mut file = BufWriter::new(File::create(&part).map_err(fail)?);
        let filled = fill(&mut file).and_then(|()| {
            file.flush().and_then(|()| file.get_ref().sync_all()).map_err(fail)?;
            fs::rename(&part, &full).map_err(fail)
        });
        if filled.is_err() {
            // The first error is the one to report; a leftover part is replaced by the next run.
            let _ = fs::remove_file(&part);
        }
        filled
    }
}

/// Path of a writer's shard of a scene, relative to the dataset.
pub fn shard_path(id: &str, scene: SceneId) -> String {
    format!(".syntable/shards/{id}/{:06}.jsonl", scene.0)
}

/// Names at the top of a dataset, and of a staged scene, that the program keeps for itself.
pub const RESERVED: [&str; 3] = [".syntable", ".scene.json", "recipe.toml"];

/// Checks an option that names a file or folder of the dataset: a relative path that stays inside it, and is none of the
/// program's own.
pub fn check_path(option: &str, path: &str) -> Result<(), ConfigError> {
    let help = "write it as `a` or `a/b`, relative to the dataset";
    inside(path).map(drop).map_err(|message| ConfigError::new(option, message).help(help))
}

fn relative(path: &str) -> Result<&Path> {
    inside(path).map_err(|message| Error::new(message).permanent())
}

/// A path that stays inside the dataset and is none of the program's own, or what is wrong with it.
fn inside(path: &str) -> std::result::Result<&Path, String> {
    let relative = Path::new(path);
    let mut parts = relative.components();
    let first = parts.next();
    let is_normal = |part: Component| matches!(part, Component::Normal(_));
    if !first.is_some_and(is_normal) || !parts.all(is_normal) || path.contains('\\') {
        Err(format!("`{path}` is not a path inside the dataset"))
    } else if RESERVED.iter().any(|name| first == Some(Component::Normal(name.as_ref()))) {
        Err(format!("`{path}` is a path that the program keeps for itself"))
    } else {
        Ok(relative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_the_dataset_has_one_writer() {
        let folder = std::env::temp_dir().join(format!("syntable-finish-{}", std::process::id()));
        let written = FinishedFiles::default();
        let write = |id: &str| {
            Finish::new(&folder, id, Vec::new())
                .beside(written.clone())
                .write("all.jsonl", |out| out.write_all(id.as_bytes()).map_err(|error| Error::io("all.jsonl", &error)))
        };
        write("a").expect("first");
        let error = write("b").expect_err("second");
        assert!(error.is_permanent() && error.to_string().contains("already the file of `write.a`"), "{error}");
        assert_eq!(fs::read_to_string(folder.join("all.jsonl")).expect("written"), "a");
        fs::remove_dir_all(&folder).expect("removable");
    }

    #[test]
    fn paths_stay_inside() {
        assert!(relative("data/rgb/0_0.png").is_ok());
        for path in ["../a", "/a", "", "a/../../b", "a\\b", ".syntable/journal.jsonl", "recipe.toml"] {
            assert!(relative(path).is_err() && check_path("file", path).is_err(), "{path}");
        }
    }
}
