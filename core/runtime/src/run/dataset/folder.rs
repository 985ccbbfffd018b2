//! The dataset's folder, open for a run.
//!
//! **Ownership.** A journal line has the digest of its scene's manifest, and the manifest has the digests of its files,
//! so the journal covers every byte. Each file of the dataset is in exactly one manifest. A scene may replace the files
//! of its own manifest, and the end of a run the files of `finished.json`. Any other existing file stays, and a scene
//! or writer that needs its path is refused. Files that no manifest lists do not belong to the dataset and are never
//! changed.
//!
//! **Foreign datasets.** Another person may have made the dataset. Lists name files by [`DatasetPath`]s, which stay
//! inside the folder. The store moves and removes files without following links. Before any change, `foreign` checks
//! all lists and the program's own folder.
//!
//! **Order.** A scene is finished when its record is in its staged folder. Moving its files and writing its line can be
//! resumed. A scene of a dataset on another machine is finished when its line is written: its manifest is uploaded first,
//! then its files, then its line. `finished.json` has the digest of its journal, which distinguishes an interrupted run from a complete one.
//!
//! | file | does |
//! |---|---|
//! | `layout.rs`, `locking.rs`, `foreign.rs` | paths; locks; checks of a dataset from another person |
//! | `staging.rs`, `commit.rs`, `ending.rs` | unfinished files; moving a scene into place; moving the results of a
//! run's end into place |
//! | `proposal.rs` | the recipe of the dataset, and a recipe that will replace it |
//! | `recovery.rs` | completion of interrupted work; deletion of a dataset |

use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::layout::{self, MARK, RECIPE};
use crate::run::dataset::locking::{busy, lock, try_lock};
use crate::run::dataset::manifest::Manifest;
use crate::run::dataset::staging_area::Staging;
use crate::run::shard::Shard;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, Hold, Kind, StoreFolder};
use syntable_recipe::CatalogNames;

/// An open dataset folder. It is locked against other runs.
pub struct Folder {
    pub(super) files: StoreFolder,
    /// The recipe that replaces the dataset's recipe with the first scene made from it.
    pub(super) proposed: Mutex<Option<Proposed>>,
    /// A file of each folder of shared files that this run has put there.
    pub(super) shared: Mutex<BTreeMap<String, DatasetPath>>,
    /// The place of unfinished files.
    pub(super) staging: Staging,
    is_shared: bool,
    _lock: Hold,
}

/// A recipe that the dataset may grow to.
pub struct Proposed {
    pub(super) recipe: String,
    /// Writers whose files are written again or removed.
    pub(super) replaced: BTreeSet<String>,
}

impl Folder {
    /// Opens a folder that is new, empty, or has a dataset. Completes an interrupted deletion.
    ///
    /// # Errors
    /// If another run works there, or the dataset names files outside or has links that lead outside; no file was
    /// changed then.
    pub fn open(dataset: impl Into<StoreFolder>) -> Result<Self> {
        let dataset = dataset.into();
        Self::open_if_free(&dataset)?.ok_or_else(|| busy(&dataset))
    }

    /// Opens a folder as [`open`](Self::open) does; none if another run works there.
    pub fn open_if_free(dataset: &StoreFolder) -> Result<Option<Self>> {
        dataset.prepare()?;
        // Locking reports errors about links. Another worker may begin the dataset after the list.
        if !dataset.list("")?.is_empty() && !layout::is_dataset(dataset)? {
            return Err(Error::new("the folder is not empty and has no dataset")
                .in_file(dataset.name())
                .help("choose another folder; no file was changed"));
        }
        let Some(lock) = try_lock(dataset, Access::Write)? else { return Ok(None) };
        let folder = Self::locked(dataset.clone(), lock)?;
        if folder.files.has(&layout::bin())? {
            folder.empty_bin()?;
        }
        Ok(Some(folder))
    }

    /// Opens a dataset to read it. The folder may be read-only, unless interrupted work must be completed.
    pub fn read(dataset: impl Into<StoreFolder>) -> Result<Self> {
        let dataset = dataset.into();
        let folder = Self::locked(dataset.clone(), lock(&dataset, Access::Read)?)?;
        if folder.files.has(&layout::bin())? || folder.files.has(&layout::staging())? {
            drop(folder);
            let folder = Self::open(dataset)?;
            folder.recover()?;
            return Ok(folder);
        }
        Ok(folder)
    }

    /// Opens a dataset to make scenes of it beside other workers; none if a run has it for itself. `worker` is a name that
    /// no other worker has.
    ///
    /// # Errors
    /// As of [`open`](Self::open).
    pub fn open_shared(dataset: &StoreFolder, worker: &str) -> Result<Option<Self>> {
        let Some(lock) = try_lock(dataset, Access::Share)? else { return Ok(None) };
        let folder = Self::locked(dataset.clone(), lock)?;
        Ok(Some(Self { staging: Staging::of_worker(dataset, worker)?, is_shared: true, ..folder }))
    }

    /// Whether other workers may write other scenes of the dataset now.
    pub fn is_shared(&self) -> bool {
        self.is_shared
    }

    fn locked(files: StoreFolder, lock: Hold) -> Result<Self> {
        foreign::check(&files)?;
        let (staging, is_shared) = (Staging::of(&files)?, false);
        Ok(Self { files, proposed: Mutex::default(), shared: Mutex::default(), staging, is_shared, _lock: lock })
    }

    /// The files of the dataset.
    pub fn files(&self) -> &StoreFolder {
        &self.files
    }

    /// The name of the folder, for messages.
    pub fn name(&self) -> PathBuf {
        self.files.name()
    }

    /// Opens the journal, or starts one.
    pub fn journal(&self) -> Result<Journal> {
        if self.is_shared { Journal::open_shared(&self.files) } else { Journal::open(&self.files) }
    }

    /// The shard that the dataset is.
    ///
    /// # Errors
    /// If its file is damaged.
    pub fn shard(&self) -> Result<Option<Shard>> {
        Shard::of_dataset(&self.files)
    }

    /// Makes the dataset a shard, or no shard.
    pub fn set_shard(&self, shard: Option<Shard>) -> Result<()> {
        let path = layout::shard();
        match shard {
            _ if self.shard()? == shard => Ok(()),
            Some(shard) => self.files.write(&path, &serde_json::to_vec(&shard).expect("numbers")),
            None => self.files.remove(&path),
        }
    }

    /// Whether a scene has files here.
    pub fn has_scenes(&self) -> Result<bool> {
        Ok(!self.listed_scenes()?.is_empty())
    }

    /// Whether the dataset has no finished scene; failed scenes do not count.
    pub fn is_empty(&self, journal: &Journal) -> Result<bool> {
        Ok(journal.entries().made().next().is_none() && !self.has_scenes()?)
    }

    /// Writes names and categories of the assets of each pool.
    pub fn set_catalogs(&self, catalogs: &BTreeMap<String, CatalogNames>) -> Result<()> {
        for (pool, catalog) in catalogs {
            let path = catalog_path(&self.files, pool)?;
            self.files.write(&path, serde_json::to_string(catalog).expect("names are plain data").as_bytes())?;
        }
        Ok(())
    }

    /// The manifest of a scene, if it is readable.
    pub fn manifest(&self, scene: u32) -> Result<Option<Manifest>> {
        Ok(Manifest::read(&self.files, &layout::manifest(scene))?.map(|(manifest, _)| manifest))
    }

    /// Removes unreadable lines from the journal, and returns their number. A journal without manifests of scenes comes
    /// from another version, and stays.
    pub fn mend_journal(&self) -> Result<usize> {
        if self.files.has(&layout::manifests())? { Journal::mend(&self.files) } else { Ok(0) }
    }

    /// Scenes with a manifest but without a journal line, because their lines are lost.
    pub fn without_line(&self, journal: &Journal) -> Result<Vec<u32>> {
        let mut scenes = self.listed_scenes()?;
        scenes.retain(|scene| !journal.entries().contains(*scene));
        Ok(scenes)
    }

    /// Scenes with a manifest, ascending.
    pub(super) fn listed_scenes(&self) -> Result<Vec<u32>> {
        Ok(layout::manifests_in(&self.files, &layout::manifests())?.into_iter().map(|(scene, _)| scene).collect())
    }

    /// The manifest of a finished scene: the one that the journal names.
    pub fn manifest_of(&self, entry: &JournalEntry) -> Result<Manifest> {
        let path = layout::manifest(entry.scene);
        let read = Manifest::read(&self.files, &path)?.filter(|(_, digest)| entry.manifest() == Some(*digest));
        read.map(|(manifest, _)| manifest).ok_or_else(|| damaged(&self.files, entry.scene, &path))
    }

    /// The owners of these files, for files that a manifest lists.
    pub(super) fn owners(&self, paths: &[&str]) -> Result<BTreeMap<String, String>> {
        let mut owners = BTreeMap::new();
        let mut add = |manifest: &Manifest, owner: &str| {
            let listed = paths.iter().filter(|path| manifest.has(path));
            owners.extend(listed.map(|path| ((*path).to_owned(), owner.to_owned())));
        };
        add(&self.finished()?.manifest, "a file that the end of a run writes");
        for scene in self.listed_scenes()? {
            if let Some(manifest) = self.manifest(scene)? {
                add(&manifest, &owner_of(scene));
            }
        }
        Ok(owners)
    }
}

/// A scene as the owner of files, in messages.
pub(super) fn owner_of(scene: u32) -> String {
    format!("a file of scene {scene}")
}

/// The error for a file of a scene that differs from the scene's manifest, or is gone.
pub(super) fn damaged(dataset: &StoreFolder, scene: u32, path: &DatasetPath) -> Error {
    Error::new(format!("a file of scene {scene} is missing or damaged"))
        .in_file(dataset.name_of(path))
        .help("run again with `options.repair`, which makes the scene again")
}

/// Path of the file with the names of a pool's assets.
///
/// # Errors
/// If the name of the pool is not a valid file name. A foreign dataset may lock any name.
pub fn catalog_path(dataset: &StoreFolder, pool: &str) -> Result<DatasetPath> {
    layout::catalog(pool).map_err(|error| error.in_file(dataset.name_of(RECIPE)))
}

/// Calls `each` with the relative path of every file of a dataset outside the program's own folder.
pub fn each_file(dataset: &StoreFolder, inside: &str, each: &mut dyn FnMut(&str, Kind)) -> Result<()> {
    for (name, kind) in dataset.list(inside)? {
        let inside = if inside.is_empty() { name } else { format!("{inside}/{name}") };
        if inside == MARK {
            continue;
        }
        match kind {
            Kind::Folder => each_file(dataset, &inside, each)?,
            kind => each(&inside, kind),
        }
    }
    Ok(())
}
