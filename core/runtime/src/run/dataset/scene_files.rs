//! Files of scenes that the end of a run reads. Each is compared with the digest in its scene's manifest, because no later
//! step would notice a missing line.

use crate::run::dataset::folder::damaged;
use crate::run::dataset::journal::Entries;
use crate::run::dataset::layout;
use crate::run::dataset::manifest::{FileState, Manifest, Stamp};
use parking_lot::Mutex;
use std::io::{Cursor, Read};
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::scene::SceneId;
use syntable_model::store::{StoreFolder, StoredFile};

/// Size up to which a file is read once, into memory, bytes. A larger one is read twice: for its digest, and by its reader.
const IN_MEMORY: u64 = 16 << 20;

/// The files of the scenes in a journal.
#[derive(Debug)]
pub struct SceneFiles {
    dataset: StoreFolder,
    /// Digests of the manifests, by scene.
    manifests: Vec<(u32, Digest)>,
    /// The manifest that was read last.
    last: Mutex<Option<(u32, Arc<Manifest>)>>,
}

impl SceneFiles {
    /// The files of a journal's scenes.
    pub fn new(dataset: &StoreFolder, entries: &Entries) -> Self {
        let manifests = entries.made().filter_map(|line| Some((line.scene, line.manifest()?))).collect();
        Self { dataset: dataset.clone(), manifests, last: Mutex::default() }
    }

    /// The folder of the dataset.
    pub fn dataset(&self) -> &StoreFolder {
        &self.dataset
    }

    /// The size of a file of a scene, by its manifest, bytes.
    ///
    /// # Errors
    /// As of [`open`](Self::open).
    pub fn size(&self, scene: SceneId, path: &DatasetPath) -> Result<u64> {
        self.stamp(scene, path).map(|Stamp(size, _)| size)
    }

    /// Opens a file of a scene.
    ///
    /// # Errors
    /// If the file or its scene's manifest is missing or damaged, or the scene does not own it.
    pub fn open(&self, scene: SceneId, path: &DatasetPath) -> Result<StoredFile> {
        let wrong = || damaged(&self.dataset, scene.0, path);
        let stamp = self.stamp(scene, path)?;
        if stamp.0 > IN_MEMORY {
            return match stamp.check_in(&self.dataset, path)? {
                FileState::Whole => self.dataset.open(path)?.ok_or_else(wrong),
                _ => Err(wrong()),
            };
        }
        for folder in path.folders() {
            if self.dataset.has_link(folder)? {
                return Err(wrong());
            }
        }
        let file = self.dataset.open(path)?.filter(|file| file.size == stamp.0).ok_or_else(wrong)?;
        let mut bytes = Vec::with_capacity(stamp.0 as usize);
        let read = file.take(stamp.0 + 1).read_to_end(&mut bytes);
        read.map_err(|error| Error::io(self.dataset.name_of(path), &error))?;
        match Stamp::of_bytes(&bytes) == stamp {
            true => Ok(StoredFile { size: stamp.0, version: None, bytes: Box::new(Cursor::new(bytes)) }),
            false => Err(wrong()),
        }
    }

    fn stamp(&self, scene: SceneId, path: &DatasetPath) -> Result<Stamp> {
        let manifest = self.manifest(scene.0)?;
        manifest.files.get(path).copied().ok_or_else(|| damaged(&self.dataset, scene.0, path))
    }

    /// The manifest of a scene. A writer reads several files of one scene after another.
    fn manifest(&self, scene: u32) -> Result<Arc<Manifest>> {
        if let Some((_, manifest)) = self.last.lock().as_ref().filter(|(last, _)| *last == scene) {
            return Ok(manifest.clone());
        }
        let path = layout::manifest(scene);
        let wrong = || damaged(&self.dataset, scene, &path);
        let place = self.manifests.binary_search_by_key(&scene, |(scene, _)| *scene).map_err(|_| wrong())?;
        let read = Manifest::read(&self.dataset, &path)?.filter(|(_, digest)| *digest == self.manifests[place].1);
        let manifest = Arc::new(read.ok_or_else(wrong)?.0);
        *self.last.lock() = Some((scene, manifest.clone()));
        Ok(manifest)
    }
}
