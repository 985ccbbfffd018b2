//! The dataset's folder: what is staged, what is committed, and who may write.
//!
//! ```text
//! <dataset>/recipe.toml                   the resolved recipe with its inputs locked; it gives the same dataset again
//! <dataset>/.syntable/lock                held while a run works
//! <dataset>/.syntable/journal.jsonl       one line per scene that is done
//! <dataset>/.syntable/scenes/000003.json  manifest of a scene: its files with sizes and digests
//! <dataset>/.syntable/finished.json       manifest of what the end of a run wrote
//! <dataset>/.syntable/catalogs/<pool>.json names, categories and numbers of the assets of a pool
//! <dataset>/.syntable/settled/000003.toml what settling did, so that the scene is had again without simulating it
//! <dataset>/.syntable/shards/<writer>/    what `finish` merges, one file per scene
//! <dataset>/.syntable/shards/<writer>/shared/<digest>/000003  the same for bytes that several scenes have: hard links
//! <dataset>/.syntable/times.jsonl          how long stages worked, one line per run
//! <dataset>/.syntable/staging/3.part/     a scene in the making
//! <dataset>/.syntable/staging/3.ready/    a scene whose files are being moved into place
//! <dataset>/.syntable/quarantine/000003/  what was made of a scene whose labels contradict each other, and why
//! <dataset>/.syntable/ahead/              the first scene of a dataset that shall take the place of this one
//! <dataset>/.syntable/discard/            what belonged to a dataset that is being deleted
//! ```
//!
//! **Who owns what.** A line of the journal has the digest of the scene's manifest, and the manifest has the digests of
//! its files: the journal vouches for every byte. A file of the dataset is in exactly one manifest. A scene may replace
//! files of its own manifest, the end of a run those of `finished.json`; any other file that is there already stays, and
//! the scene or writer that wants its path is refused. What no manifest lists is not the dataset's and is never touched.
//!
//! **Whose dataset.** Somebody else may have made it. Lists name files by [`DatasetPath`]s, which stay inside; files are moved
//! and removed by [`Inside`], which follows no link; and before anything is done, all lists and the program's own folder are
//! looked at (`foreign`).
//!
//! **When.** A scene is done when its folder is renamed from `part` to `ready`; moving its files and writing its line can be
//! taken up again. `finished.json` names the digest of the journal that it was written for: a run that was interrupted is
//! told apart from one that ended.

use crate::recipe::{CatalogNames, without_assets};
use crate::run::dataset::foreign;
use crate::run::dataset::inside::{Inside, linked, look};
use crate::run::dataset::journal::{Journal, JournalEntry, Lines, SceneOutcome};
use crate::run::dataset::manifest::{Manifest, Stamp, State, Written};
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetPath, RESERVED};
use syntable_model::stage::is_shared;

/// An open dataset folder. No other run can open it meanwhile.
pub struct Folder {
    root: PathBuf,
    inside: Inside,
    /// The recipe that becomes the dataset's with the first scene that is made by it.
    proposed: Mutex<Option<Proposed>>,
    /// A file of each folder of files that scenes share, which this run has put there.
    shared: Mutex<BTreeMap<String, DatasetPath>>,
    _lock: Option<File>,
}

/// A recipe that the dataset may grow to.
struct Proposed {
    recipe: String,
    /// Writers whose files are written anew, or taken away.
    replaced: BTreeSet<String>,
}

const MARK: &str = RESERVED[0];
const RECIPE: &str = RESERVED[1];
/// Name of the manifest of what the end of a run wrote.
pub(in crate::run) const FINISHED: &str = "finished.json";
/// Name of the folder of the manifests of scenes.
pub(in crate::run) const SCENES: &str = "scenes";
/// Name of the folder of scenes in the making.
pub(in crate::run) const STAGING: &str = "staging";
/// Name of the folder of what is being deleted.
pub(in crate::run) const BIN: &str = "discard";
/// Number of scenes whose file is compared and linked before a scene keeps a file of its own.
const LINK_TRIES: usize = 4;
/// What the end of a run reads of the scenes.
const SHARDS: &str = ".syntable/shards/";
/// Name of the folder of scenes whose labels contradict each other.
const QUARANTINE: &str = "quarantine";
/// What is known of a staged scene, among files that no writer can write.
pub(in crate::run) const RECORD: &str = ".syntable/staged.json";
/// What a dataset consists of beside its files and the lock, in the order in which `--overwrite` takes it away: without a
/// journal there is no dataset.
fn state(root: &Path) -> [PathBuf; 10] {
    [
        journal_path(root),
        root.join(RECIPE),
        finished_path(root),
        scenes_folder(root),
        settled_folder(root),
        root.join(SHARDS),
        catalogs_folder(root),
        times_path(root),
        staging_folder(root),
        root.join(MARK).join(QUARANTINE),
    ]
}

/// A staged scene: its line of the journal, and files of the scene that it no longer has.
#[derive(Serialize, Deserialize)]
pub(in crate::run) struct Staged {
    entry: JournalEntry,
    stale: Vec<DatasetPath>,
}

/// What the end of a run wrote.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Finished {
    /// Digest of the journal that the files were written for; none if a writer failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<Digest>,
    /// Digest of the recipe but for the assets that it locks, by which it is known again when the file is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recipe: Option<Digest>,
    /// The files.
    #[serde(flatten)]
    pub manifest: Manifest,
}

impl Folder {
    /// Opens a folder that is new, empty, or holds a dataset. A deletion that was interrupted is finished.
    ///
    /// # Errors
    /// If another run works there, or the dataset names files or has links that lead elsewhere; then nothing was touched.
    pub fn open(root: &Path) -> Result<Self> {
        let fail = |error: std::io::Error| {
            let full = matches!(error.kind(), ErrorKind::QuotaExceeded | ErrorKind::StorageFull);
            let failed = Error::io(root, &error).help("choose a folder that can be written");
            if full { failed } else { failed.of_request() }
        };
        crate::paths::check_link(root)?;
        fs::create_dir_all(root).map_err(fail)?;
        let empty = fs::read_dir(root).map_err(fail)?.next().is_none();
        if !empty && !root.join(MARK).is_dir() {
            return Err(Error::new("the folder is not empty and holds no dataset")
                .in_file(root)
                .help("choose another folder; nothing was touched")
                .permanent());
        }
        foreign::check_mark(root)?;
        fs::create_dir_all(root.join(MARK)).map_err(fail)?;
        let lock_path = root.join(MARK).join("lock");
        let lock = File::create(&lock_path).map_err(|error| Error::io(&lock_path, &error))?;
        lock_now(&lock, &lock_path, root, File::try_lock)?;
        foreign::check(root)?;
        let inside = Inside::open(root)?;
        let folder = Self {
            root: root.to_owned(),
            inside,
            proposed: Mutex::default(),
            shared: Mutex::default(),
            _lock: Some(lock),
        };
        if folder.bin().exists() {
            folder.empty_bin()?;
        }
        Ok(folder)
    }

    /// Opens a dataset to read it. It may lie where nothing can be written, unless there is something to recover.
    pub fn read(root: &Path) -> Result<Self> {
        let lock = lock_shared(root)?;
        foreign::check(root)?;
        let inside = Inside::open(root)?;
        let folder =
            Self { root: root.to_owned(), inside, proposed: Mutex::default(), shared: Mutex::default(), _lock: lock };
        if folder.bin().exists() || folder.staging().exists() {
            drop(folder);
            let folder = Self::open(root)?;
            folder.recover()?;
            return Ok(folder);
        }
        Ok(folder)
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of the journal.
    pub fn journal(&self) -> PathBuf {
        journal_path(&self.root)
    }

    /// Text of the resolved recipe, if there is one.
    pub fn recipe(&self) -> Result<Option<String>> {
        let path = self.root.join(RECIPE);
        Ok(foreign::read_list(&path)?.map(|bytes| String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// Text of the resolved recipe by which the scenes were made; else what is the matter with it.
    pub fn recipe_of_scenes(&self) -> Result<std::result::Result<String, &'static str>> {
        let Some(text) = self.recipe()? else { return Ok(Err("has lost its recipe.toml")) };
        let listed = self.finished()?.manifest.files.get(RECIPE).copied();
        let is_recipe = || toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("dataset"));
        Ok(match listed {
            // It would say of the scenes what is not true.
            Some(stamp) if stamp != Stamp::of_text(&text) => Err("has a recipe.toml that is damaged, or was edited"),
            None if !is_recipe() => Err("has a damaged recipe.toml"),
            _ => Ok(text),
        })
    }

    /// Makes a resolved recipe that of the dataset as soon as a scene is made by it or fails with it. Until then the
    /// dataset is that of the recipe before, and a run that comes to nothing changes nothing. Files of the writers that are
    /// `replaced` stay until the scene gets new ones, or the run ends.
    pub fn propose_recipe(&self, text: &str, replaced: BTreeSet<String>) -> Result<()> {
        let has = self.recipe()?.as_deref() == Some(text);
        *self.proposed.lock() = (!has).then(|| Proposed { recipe: text.to_owned(), replaced });
        Ok(())
    }

    /// Makes the recipe that was proposed that of the dataset.
    pub fn accept_recipe(&self, journal: &mut Journal) -> Result<()> {
        let mut proposed = self.proposed.lock();
        if let Some(Proposed { recipe, replaced }) = &*proposed {
            // Lines come first: interrupted in between, the recipe of before makes again what they lack.
            journal.forget_writers(replaced)?;
            self.set_recipe(recipe)?;
        }
        *proposed = None;
        Ok(())
    }

    /// Whether the recipe that was proposed is not the dataset's yet.
    pub fn is_proposed(&self) -> bool {
        self.proposed.lock().is_some()
    }

    /// Writes the resolved recipe and lists it, so that it can be told when it is damaged. If another one was listed, the
    /// dataset is unfinished from then on: a run that is killed later leaves a recipe that is listed, or not listed, but
    /// never one that looks damaged.
    pub fn set_recipe(&self, text: &str) -> Result<()> {
        let path = self.root.join(RECIPE);
        let mut listed = self.finished()?.manifest;
        let is_listed = listed.files.remove(RECIPE) == Some(Stamp::of_text(text));
        let is_there = self.recipe()?.as_deref() == Some(text);
        if is_there && (is_listed || self.has_lost_its_list()?) {
            return Ok(());
        }
        // A list that was lost is not begun anew: it would seem to be whole.
        if self.has_lost_its_list()? {
            return self.write(&path, text);
        }
        self.set_finished(&Finished { journal: None, recipe: None, manifest: listed.clone() })?;
        self.write(&path, text)?;
        listed.files.insert(recipe_path(), Stamp::of_text(text));
        self.set_finished(&Finished { journal: None, recipe: Some(digest_of_recipe(text)), manifest: listed })
    }

    /// Whether there are scenes, and the list of what the end of a run wrote is gone: it has the recipe from the beginning.
    fn has_lost_its_list(&self) -> Result<bool> {
        Ok(!self.finished()?.manifest.has(RECIPE) && self.has_scenes())
    }

    /// Whether a scene has files here.
    pub fn has_scenes(&self) -> bool {
        self.scenes_in_folder().next().is_some()
    }

    /// Whether no scene was made, be there failed ones or none.
    pub fn is_empty(&self, journal: &Journal) -> bool {
        journal.entries().values().all(JournalEntry::failed) && !self.has_scenes()
    }

    /// Writes the resolved recipe again if it is missing or damaged, and `text` is the one that is listed but for assets that
    /// it locks. Returns whether it did.
    pub fn restore_recipe(&self, text: &str) -> Result<bool> {
        let path = self.root.join(RECIPE);
        let mut finished = self.finished()?;
        let Some(stamp) = finished.manifest.files.get(RECIPE).copied() else { return Ok(false) };
        if finished.recipe != Some(digest_of_recipe(text)) || stamp.check(&path)? == State::Whole {
            return Ok(false);
        }
        self.write(&path, text)?;
        finished.manifest.files.insert(recipe_path(), Stamp::of_text(text));
        self.set_finished(&finished).map(|()| true)
    }

    /// Writes names and categories of the assets of each pool.
    pub fn set_catalogs(&self, catalogs: &BTreeMap<String, CatalogNames>) -> Result<()> {
        for (pool, catalog) in catalogs {
            let path = catalog_path(&self.root, pool)?;
            create_parent(&path)?;
            self.write(&path, &serde_json::to_string(catalog).expect("names are plain data"))?;
        }
        Ok(())
    }

    /// An empty folder to make a scene in.
    pub fn stage(&self, scene: u32) -> Result<PathBuf> {
        self.fresh(&format!("{scene}.part"))
    }

    /// An empty folder for what the end of a run writes.
    pub fn stage_finish(&self) -> Result<PathBuf> {
        self.fresh("finish")
    }

    /// An empty folder to try the end of a run in.
    pub fn stage_trial(&self) -> Result<PathBuf> {
        self.fresh("trial")
    }

    /// Throws away what the end of a run wrote when it was tried.
    pub fn drop_trial(&self) -> Result<()> {
        remove(&self.staging().join("trial"))
    }

    fn fresh(&self, name: &str) -> Result<PathBuf> {
        let path = self.staging().join(name);
        remove(&path)?;
        fs::create_dir_all(&path).map_err(|error| Error::io(&path, &error))?;
        Ok(path)
    }

    /// The manifest of a scene, if it can be read.
    pub fn manifest(&self, scene: u32) -> Result<Option<Manifest>> {
        Ok(Manifest::read(&manifest_path(&self.root, scene))?.map(|(manifest, _)| manifest))
    }

    /// Takes lines that cannot be read out of the journal, and returns how many. A journal without manifests of scenes is
    /// that of another version and stays.
    pub fn mend_journal(&self) -> Result<usize> {
        if scenes_folder(&self.root).exists() { Journal::mend(&self.journal()) } else { Ok(0) }
    }

    /// Scenes that have a manifest and no line of the journal: their lines are lost.
    pub fn without_line(&self, journal: &Journal) -> Vec<u32> {
        let mut scenes = self.listed_scenes();
        scenes.retain(|scene| !journal.entries().contains_key(scene));
        scenes
    }

    /// Scenes that have a manifest, ascending.
    fn listed_scenes(&self) -> Vec<u32> {
        let mut scenes: Vec<u32> = self.scenes_in_folder().collect();
        scenes.sort_unstable();
        scenes
    }

    /// Scenes that have a manifest, in no order.
    fn scenes_in_folder(&self) -> impl Iterator<Item = u32> {
        let entries = fs::read_dir(scenes_folder(&self.root)).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.path().file_stem()?.to_str()?.parse().ok())
    }

    /// The manifest of a scene that is done: the one that the journal names.
    pub fn manifest_of(&self, entry: &JournalEntry) -> Result<Manifest> {
        let path = manifest_path(&self.root, entry.scene);
        let read = Manifest::read(&path)?.filter(|(_, digest)| entry.manifest() == Some(digest));
        read.map(|(manifest, _)| manifest).ok_or_else(|| damaged(entry, &path))
    }

    /// Compares the shards of a scene with its manifest, and that with the journal.
    pub fn check_shards(&self, entry: &JournalEntry) -> Result<()> {
        let manifest = self.manifest_of(entry)?;
        for (inside, stamp) in manifest.files.iter().filter(|(inside, _)| inside.starts_with(SHARDS)) {
            if stamp.check_in(&self.root, inside)? != State::Whole {
                return Err(damaged(entry, &inside.below(&self.root)));
            }
        }
        Ok(())
    }

    /// Moves the files of a staged scene into place and writes it down. Interrupted anywhere, the next
    /// [`recover`](Self::recover) either finishes the job or finds nothing of the scene.
    ///
    /// Files that the scene had before are replaced; `kept` stay beside the new ones, all others are deleted. `written` says
    /// whose the new ones are. A file that
    /// is not the scene's is a permanent error. The entry that is returned has the manifest's digest.
    pub fn commit(
        &self,
        mut entry: JournalEntry,
        kept: Manifest,
        written: Written,
        journal: &Mutex<Journal>,
    ) -> Result<JournalEntry> {
        let scene = entry.scene;
        let part = self.staging().join(format!("{scene}.part"));
        let own = self.manifest(scene)?.unwrap_or_default();
        let mut stale = own.clone();
        let new = if entry.failed() {
            self.fresh(&format!("{scene}.part"))?;
            stale.files.insert(manifest_inside(scene), Stamp(0, Digest::of(&[])));
            Manifest::default()
        } else {
            Manifest::of_tree(&part)?
        };
        let mut manifest = kept;
        manifest.writers.extend(written);
        for (path, stamp) in &new.files {
            if manifest.files.insert(path.clone(), *stamp).is_some() && !path.starts_with(MARK) {
                return Err(Error::new(format!("`{path}` is written twice"))
                    .help("two writers have one path; give one of them another id, folder or path")
                    .permanent());
            }
        }
        stale.files.retain(|path, _| !manifest.has(path));
        if let SceneOutcome::Made { manifest: digest, .. } = &mut entry.outcome {
            let path = manifest_path(&part, scene);
            create_parent(&path)?;
            let (text, of_text) = manifest.text();
            self.write(&path, &text)?;
            *digest = of_text;
        }
        let staged = Staged { entry: entry.clone(), stale: stale.files.into_keys().collect() };
        create_parent(&part.join(RECORD))?;
        self.write(&part.join(RECORD), &serde_json::to_string(&staged).expect("an entry is plain data"))?;
        let ready = self.staging().join(format!("{scene}.ready"));
        let mut journal = journal.lock();
        let mut clashes: Vec<&str> = Vec::new();
        for path in new.files.keys().filter(|path| !own.has(path) && !path.starts_with(MARK)) {
            if look(&path.below(&self.root))?.is_some() {
                clashes.push(path.as_str());
            }
        }
        if let Some(path) = self.file_in_the_way(new.files.keys(), &own)? {
            let owners = self.owners(&[&path])?;
            return Err(taken(&path, owners.get(&path), LEAVE));
        }
        if !clashes.is_empty() {
            // The files of a scene whose manifest is lost are its own if no other manifest has them.
            let present = journal.entries().get(&scene).and_then(JournalEntry::manifest);
            let lost = present.is_some_and(|digest| own.text().1 != digest);
            let owners = self.owners(&clashes)?;
            if let Some(path) = clashes.iter().find(|path| !lost || owners.contains_key(**path)) {
                return Err(taken(path, owners.get(*path), LEAVE));
            }
        }
        // A scene that is ready is published even by the next run, so its recipe comes first.
        self.accept_recipe(&mut journal)?;
        remove(&ready)?;
        fs::rename(&part, &ready).map_err(|error| Error::io(&part, &error))?;
        self.publish(&ready, staged, &mut journal)?;
        Ok(entry)
    }

    /// Drops all that is staged but scenes that are ready.
    pub fn drop_parts(&self) -> Result<()> {
        let entries = fs::read_dir(self.staging()).into_iter().flatten().flatten();
        let mut paths = entries.map(|entry| entry.path());
        paths.try_for_each(
            |path| if path.extension().is_some_and(|it| it == "ready") { Ok(()) } else { remove(&path) },
        )?;
        // It stays if it is not empty.
        let _ = fs::remove_dir(self.staging());
        Ok(())
    }

    /// Drops a staged scene.
    pub fn abandon(&self, scene: u32) -> Result<()> {
        remove(&self.staging().join(format!("{scene}.part")))
    }

    /// Puts a staged scene aside, with what is wrong with it, and returns its folder.
    pub fn quarantine(&self, scene: u32, faults: &str) -> Result<PathBuf> {
        let (part, aside) = (
            self.staging().join(format!("{scene}.part")),
            self.root.join(MARK).join(QUARANTINE).join(format!("{scene:06}")),
        );
        remove(&aside)?;
        create_parent(&aside)?;
        fs::rename(&part, &aside).map_err(|error| Error::io(&aside, &error))?;
        let path = aside.join("faults.txt");
        fs::write(&path, faults).map_err(|error| Error::io(&path, &error))?;
        Ok(aside)
    }

    /// A file that stands where one of these paths has a folder, unless it is one of `own`, which goes. A link is an error.
    fn file_in_the_way<'p>(
        &self,
        paths: impl Iterator<Item = &'p DatasetPath>,
        own: &Manifest,
    ) -> Result<Option<String>> {
        let folders: BTreeSet<&str> = paths.flat_map(DatasetPath::folders).collect();
        for folder in folders.into_iter().filter(|folder| !own.has(folder)) {
            match look(&self.root.join(folder))? {
                Some(there) if there.is_symlink() => return Err(linked(&self.root, folder)),
                Some(there) if !there.is_dir() => return Ok(Some(folder.to_owned())),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Whose files these are, for those that a manifest lists.
    fn owners(&self, paths: &[&str]) -> Result<BTreeMap<String, String>> {
        let mut owners = BTreeMap::new();
        let mut add = |manifest: &Manifest, owner: &str| {
            let listed = paths.iter().filter(|path| manifest.has(path));
            owners.extend(listed.map(|path| ((*path).to_owned(), owner.to_owned())));
        };
        add(&self.finished()?.manifest, "a file that the end of a run writes");
        for scene in self.listed_scenes() {
            if let Some(manifest) = self.manifest(scene)? {
                add(&manifest, &format!("a file of scene {scene}"));
            }
        }
        Ok(owners)
    }

    /// What the end of the last run wrote.
    pub fn finished(&self) -> Result<Finished> {
        finished(&self.root)
    }

    /// Moves what the end of a run staged into place. A file that is not of an earlier end is not replaced: the error says
    /// whose it is. Without `complete`, a writer failed, and the files that it wrote earlier stay.
    ///
    /// What an earlier end wrote is what `finished.json` lists. The list has the recipe from the first end on; where it has
    /// not, it may be lost, and with `repair` a file that no scene lists, at a path that a writer has just written, is taken
    /// for that writer's. A file of the same bytes is always taken for it, since nothing is lost.
    pub fn publish_finish(&self, resolved: &str, journal: &mut Journal, complete: bool, repair: bool) -> Result<()> {
        let staged = self.staging().join("finish");
        let old = self.finished()?.manifest;
        let mut new = Manifest::of_tree(&staged)?;
        let lost = !old.has(RECIPE);
        let mut refused = None;
        for (path, stamp) in new.files.clone() {
            let there = path.below(&self.root);
            let Some(metadata) = look(&there)? else { continue };
            if old.has(&path) {
                continue;
            }
            let owners = self.owners(&[&path])?;
            let claimed = metadata.is_file() && ((repair && lost) || stamp.check(&there)? == State::Whole);
            if owners.is_empty() && claimed {
                continue;
            }
            refused.get_or_insert(taken(&path, owners.get(path.as_str()), if lost { CLAIM } else { LEAVE }));
            new.files.remove(&path);
            remove(&path.below(&staged))?;
        }
        if let Some(path) = self.file_in_the_way(new.files.keys(), &old)? {
            return Err(taken(&path, self.owners(&[&path])?.get(&path), LEAVE));
        }
        // Both are listed until all are moved, so that an interrupted move leaves no file that is nobody's.
        let mut both = old.clone();
        both.files.extend(new.files.clone());
        self.set_finished(&Finished { journal: None, recipe: self.finished()?.recipe, manifest: both })?;
        self.set_recipe(resolved)?;
        journal.rewrite()?;
        let folders: BTreeSet<&str> = new.files.keys().flat_map(DatasetPath::folders).collect();
        let mut in_the_way = old.files.keys().filter(|path| folders.contains(path.as_str()));
        in_the_way.try_for_each(|path| self.inside.remove(path))?;
        self.move_tree(&staged, "", None)?;
        if complete && refused.is_none() {
            new.files.insert(recipe_path(), Stamp::of(&self.root.join(RECIPE))?);
            for path in old.files.keys().filter(|path| !new.has(path)) {
                self.inside.remove(path)?;
            }
            let Stamp(_, digest) = Stamp::of(&self.journal())?;
            let recipe = Some(digest_of_recipe(resolved));
            self.set_finished(&Finished { journal: Some(digest), recipe, manifest: new })?;
            remove(&self.staging())?;
        }
        refused.map_or(Ok(()), Err)
    }

    fn set_finished(&self, finished: &Finished) -> Result<()> {
        self.write(&finished_path(&self.root), &serde_json::to_string(finished).expect("a manifest is plain data"))
    }

    /// Finishes the scenes that were being moved into place when a run was killed, and drops half-made ones.
    pub fn recover(&self) -> Result<()> {
        remove(&part_of(&self.root.join(RECIPE)))?;
        let staging = self.staging();
        let entries = match fs::read_dir(&staging) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(Error::io(&staging, &error)),
        };
        let mut journal = Journal::open(&self.journal())?;
        for entry in entries {
            let ready = entry.map_err(|error| Error::io(&staging, &error))?.path();
            if ready.extension().is_some_and(|extension| extension == "ready")
                && let Ok(staged) = serde_json::from_slice::<Staged>(&foreign::read(&ready.join(RECORD))?)
            {
                self.publish(&ready, staged, &mut journal)?;
            }
        }
        remove(&staging)
    }

    /// Deletes the dataset: its journal first, then all that its manifests list. Returns the files that stay because they
    /// are not the dataset's.
    pub fn discard(&self) -> Result<Vec<PathBuf>> {
        // A scene that is being moved into place is the dataset's, too; a damaged journal says nothing of it.
        let _ = self.recover();
        if self.journal().exists() && !scenes_folder(&self.root).exists() && self.has_lines()? {
            return Err(Error::new("another version began the dataset, and there is no list of its files")
                .in_file(&self.root)
                .help("delete the folder yourself, or choose another one with --out; nothing was touched")
                .permanent());
        }
        let bin = self.bin();
        fs::create_dir_all(&bin).map_err(|error| Error::io(&bin, &error))?;
        self.empty_bin()?;
        let mut left = Vec::new();
        each_file(&self.root, "", &mut |path| left.push(PathBuf::from(path)))?;
        Ok(left)
    }

    fn has_lines(&self) -> Result<bool> {
        let made = br#""outcome":"made""#;
        let mut lines = Lines::open(&self.journal())?;
        while let Some(line) = lines.next_line()? {
            if line.windows(made.len()).any(|part| part == made) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn empty_bin(&self) -> Result<()> {
        let bin = self.bin();
        for from in state(&self.root) {
            let to = bin.join(from.file_name().expect("a name"));
            if look(&from)?.is_some() && look(&to)?.is_none() {
                fs::rename(&from, &to).map_err(|error| Error::io(&from, &error))?;
            }
        }
        let mut manifests: Vec<PathBuf> = vec![bin.join(FINISHED)];
        let scenes = fs::read_dir(bin.join(SCENES)).into_iter().flatten();
        let names = scenes.flatten().map(|entry| entry.file_name());
        let names = names.filter(|name| name.to_str().is_some_and(foreign::is_manifest));
        manifests.extend(names.map(|name| bin.join(SCENES).join(name)));
        for path in manifests {
            let Some((manifest, _)) = Manifest::read(&path)? else { continue };
            for path in manifest.files.keys() {
                self.inside.remove(path)?;
            }
        }
        remove(&bin)
    }

    /// Where the first scene is made of a dataset that shall take the place of this one.
    pub fn ahead(&self) -> PathBuf {
        self.root.join(MARK).join("ahead")
    }

    fn bin(&self) -> PathBuf {
        self.root.join(MARK).join(BIN)
    }

    fn staging(&self) -> PathBuf {
        staging_folder(&self.root)
    }

    /// The record is the last to go, so that an interrupted move can be taken up again.
    fn publish(&self, ready: &Path, staged: Staged, journal: &mut Journal) -> Result<()> {
        // What goes may stand where a folder of new files shall be.
        for path in &staged.stale {
            self.inside.remove(path)?;
        }
        self.move_tree(ready, "", Some(RECORD))?;
        if journal.entries().get(&staged.entry.scene) != Some(&staged.entry) {
            journal.append(staged.entry)?;
        }
        remove(ready)
    }

    /// Moves the files of a staged folder to the same places in the dataset, replacing what is there; `keep` stays.
    fn move_tree(&self, staged: &Path, inside: &str, keep: Option<&str>) -> Result<()> {
        let folder = staged.join(inside);
        for entry in fs::read_dir(&folder).map_err(|error| Error::io(&folder, &error))? {
            let entry = entry.map_err(|error| Error::io(&folder, &error))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let inside = if inside.is_empty() { name } else { format!("{inside}/{name}") };
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                self.move_tree(staged, &inside, keep)?;
            } else if keep != Some(&inside) {
                let to = DatasetPath::new(inside).map_err(|error| Error::new(error.to_string()).permanent())?;
                if is_shared(&to) {
                    self.share(&entry.path(), &to)?;
                }
                self.inside.put(&entry.path(), &to)?;
            }
        }
        Ok(())
    }

    /// Replaces a staged file by a hard link to the file of another scene that has the same bytes, so that the disk has them
    /// once. Where the file system has no hard links, or no more of this file, the staged file stays: the bytes are the same.
    fn share(&self, staged: &Path, to: &DatasetPath) -> Result<()> {
        let (folder, name) = to.as_str().rsplit_once('/').expect("a shared file is in a folder");
        let link = part_of(staged);
        let linked = |other: &DatasetPath| -> Result<bool> {
            remove(&link)?;
            if fs::hard_link(other.below(&self.root), &link).is_err() {
                return Ok(false);
            }
            fs::rename(&link, staged).map_err(|error| Error::io(staged, &error)).map(|()| true)
        };
        // A file that this run has linked or put there is not read again: the end of the run compares all of them.
        let known = self.shared.lock().get(folder).cloned();
        let size = |path: &Path| fs::symlink_metadata(path).map(|there| (there.is_file(), there.len())).ok();
        if let Some(known) = known.filter(|known| size(&known.below(&self.root)) == size(staged))
            && linked(&known)?
        {
            return Ok(());
        }
        let stamp = Stamp::of(staged)?;
        let others = fs::read_dir(self.root.join(folder)).into_iter().flatten().flatten();
        let mut others: Vec<String> = others.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        // Of many scenes the last ones: a file that has as many links as the file system allows is among the first.
        others.sort_unstable_by(|a, b| b.cmp(a));
        for other in others.iter().filter(|other| *other != name).take(LINK_TRIES) {
            let Ok(other) = DatasetPath::new(format!("{folder}/{other}")) else { continue };
            if stamp.check_in(&self.root, &other)? == State::Whole && linked(&other)? {
                break;
            }
        }
        self.shared.lock().insert(folder.to_owned(), to.clone());
        Ok(())
    }

    fn write(&self, path: &Path, text: &str) -> Result<()> {
        let part = part_of(path);
        let fail = |error: std::io::Error| Error::io(path, &error);
        fs::write(&part, text).map_err(fail)?;
        File::open(&part).and_then(|file| file.sync_all()).map_err(fail)?;
        fs::rename(&part, path).map_err(fail)
    }
}

/// A file in the making.
fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    path.with_file_name(name)
}

fn damaged(entry: &JournalEntry, path: &Path) -> Error {
    Error::new(format!("a file of scene {} is missing or damaged", entry.scene))
        .in_file(path)
        .help("run the same command with --repair: it makes the scene again")
        .permanent()
}

/// By what a recipe is known again: all but the assets that it locks.
fn digest_of_recipe(text: &str) -> Digest {
    Digest::of(without_assets(text).as_bytes())
}

/// What to do about a file that is nobody's.
const LEAVE: &str = "move it away, or choose another folder";
/// The same where the list of what the end of a run wrote may be lost.
const CLAIM: &str = "if an earlier run wrote it, run the same command with --repair, which replaces it; else move it away, or \
                     choose another folder";

/// Says whose file is where another one shall be written; `help` is for one that no manifest lists.
fn taken(path: &str, owner: Option<&String>, help: &str) -> Error {
    let (owner, help) = match owner {
        Some(owner) => (format!("is {owner}"), "two files have one path: give the writer another id, folder or path"),
        None => ("is there already and does not belong to the dataset".to_owned(), help),
    };
    Error::new(format!("`{path}` {owner}")).help(help).permanent()
}

/// Lets no run write a dataset while the lock is held; others may read it. None if there is no lock.
pub fn lock_shared(root: &Path) -> Result<Option<File>> {
    foreign::check_mark(root)?;
    let path = root.join(MARK).join("lock");
    let Ok(lock) = File::open(&path) else { return Ok(None) };
    lock_now(&lock, &path, root, File::try_lock_shared)?;
    Ok(Some(lock))
}

/// Locks a file of a dataset, or says why not.
fn lock_now(
    lock: &File,
    path: &Path,
    root: &Path,
    try_lock: impl Fn(&File) -> Result<(), fs::TryLockError>,
) -> Result<()> {
    match try_lock(lock) {
        Ok(()) => Ok(()),
        Err(fs::TryLockError::WouldBlock) => Err(Error::new("another run is writing this dataset").in_file(root)),
        Err(fs::TryLockError::Error(error)) => Err(Error::io(path, &error)
            .help("the file system must lock files: choose a folder on another one")
            .of_request()),
    }
}

/// Path of the journal of a dataset.
pub fn journal_path(root: &Path) -> PathBuf {
    root.join(MARK).join("journal.jsonl")
}

/// Path of the manifest of a scene.
pub fn manifest_path(root: &Path, scene: u32) -> PathBuf {
    scenes_folder(root).join(format!("{scene:06}.json"))
}

/// Path of what settling did to a scene.
pub fn settled_path(root: &Path, scene: u32) -> PathBuf {
    settled_folder(root).join(format!("{scene:06}.toml"))
}

/// Path of the names of a pool's assets.
///
/// # Errors
/// If the name of the pool is none of a file: a dataset may lock any.
pub fn catalog_path(root: &Path, pool: &str) -> Result<PathBuf> {
    let path = DatasetPath::new(format!("{MARK}/catalogs/{pool}.json"));
    let fail = |error: syntable_model::files::NotInside| {
        Error::new(format!("`lock.catalogs` names the pool {pool:?}: {error}")).in_file(root.join(RECIPE)).permanent()
    };
    path.map(|path| path.below(root)).map_err(fail)
}

/// The same of the manifest of a scene, relative to the dataset.
fn manifest_inside(scene: u32) -> DatasetPath {
    DatasetPath::new(format!("{MARK}/{SCENES}/{scene:06}.json")).expect("its parts are names")
}

fn recipe_path() -> DatasetPath {
    DatasetPath::new(RECIPE).expect("it is a name")
}

/// Path of how long the stages of runs worked.
pub fn times_path(root: &Path) -> PathBuf {
    root.join(MARK).join("times.jsonl")
}

fn finished_path(root: &Path) -> PathBuf {
    root.join(MARK).join(FINISHED)
}

fn scenes_folder(root: &Path) -> PathBuf {
    root.join(MARK).join(SCENES)
}

fn settled_folder(root: &Path) -> PathBuf {
    root.join(MARK).join("settled")
}

fn catalogs_folder(root: &Path) -> PathBuf {
    root.join(MARK).join("catalogs")
}

fn staging_folder(root: &Path) -> PathBuf {
    root.join(MARK).join(STAGING)
}

/// What the end of the last run in a dataset wrote; nothing if the list cannot be read.
pub fn finished(root: &Path) -> Result<Finished> {
    let path = finished_path(root);
    Ok(serde_json::from_slice(&foreign::read(&path)?).unwrap_or_default())
}

/// Calls `each` with every file below a dataset's folder that is not in the program's own folder, by its relative path.
pub fn each_file(root: &Path, inside: &str, each: &mut dyn FnMut(&str)) -> Result<()> {
    let folder = root.join(inside);
    for entry in fs::read_dir(&folder).map_err(|error| Error::io(&folder, &error))? {
        let entry = entry.map_err(|error| Error::io(&folder, &error))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let inside = if inside.is_empty() { name } else { format!("{inside}/{name}") };
        if inside == MARK {
            continue;
        }
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            each_file(root, &inside, each)?;
        } else {
            each(&inside);
        }
    }
    Ok(())
}

/// Creates the folder that a file is in.
pub fn create_parent(path: &Path) -> Result<()> {
    path.parent().map_or(Ok(()), |parent| fs::create_dir_all(parent).map_err(|error| Error::io(parent, &error)))
}

/// Removes a file or folder, if it is there.
pub fn remove(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(error) => Err(error),
    };
    match removed {
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Err(Error::io(path, &error))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::journal::SceneOutcome;

    #[test]
    fn foreign_folders_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("thesis.tex"), "precious").expect("writable");
        let error = Folder::open(folder.path()).err().expect("foreign").to_string();
        assert!(error.contains("nothing was touched"), "{error}");
        assert!(folder.path().join("thesis.tex").exists());
    }

    #[test]
    fn one_run_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = Folder::open(&root).expect("new");
        assert!(Folder::open(&root).err().expect("locked").to_string().contains("another run"));
        drop(open);
        Folder::open(&root).expect("free again");
    }

    fn entry(scene: u32) -> JournalEntry {
        let (writers, manifest) = (vec!["png".to_owned()], String::new());
        let outcome = SceneOutcome::Made { views: 1, objects: 1, writers, recorded: Vec::new(), manifest };
        let (notices, odd_views, errors, assets) = Default::default();
        JournalEntry { scene, attempt: 0, outcome, notices, odd_views, left_out: Vec::new(), errors, assets }
    }

    fn staged(open: &Folder, scene: u32, files: &[(&str, &str)]) -> PathBuf {
        let staged = open.stage(scene).expect("staged");
        for (path, text) in files {
            create_parent(&staged.join(path)).expect("writable");
            fs::write(staged.join(path), text).expect("writable");
        }
        staged
    }

    fn commit(open: &Folder, scene: u32, files: &[(&str, &str)]) -> Result<JournalEntry> {
        staged(open, scene, files);
        let journal = Mutex::new(Journal::open(&open.journal()).expect("there"));
        open.commit(entry(scene), Manifest::default(), Written::new(), &journal)
    }

    fn text(open: &Folder, path: &str) -> Option<String> {
        fs::read_to_string(open.root().join(path)).ok()
    }

    #[cfg(unix)]
    #[test]
    fn scenes_with_the_same_bytes_share_a_file() {
        use std::os::unix::fs::MetadataExt;
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = || Folder::open(&root).expect("a dataset");
        let make = |open: &Folder, scene: u32, bytes: &[u8]| {
            let staged = open.stage(scene).expect("staged");
            let output = syntable_model::stage::Output::new(staged, "w", syntable_model::scene::SceneId(scene));
            let digest = output.write_shared(bytes).expect("written");
            // Two assets of a scene with the same bytes have one file.
            assert_eq!(output.write_shared(bytes).expect("written"), digest);
            let journal = Mutex::new(Journal::open(&open.journal()).expect("there"));
            open.commit(entry(scene), Manifest::default(), Written::new(), &journal).expect("committed");
            root.join(format!(".syntable/shards/w/shared/{digest}/{scene:06}"))
        };
        let number = |path: &Path| fs::metadata(path).expect("there").ino();
        let first = open();
        let [zero, one, other] =
            [(0, b"texture"), (1, b"texture"), (2, b"TEXTURE")].map(|(scene, bytes)| make(&first, scene, bytes));
        assert_eq!(number(&zero), number(&one));
        assert_ne!(number(&zero), number(&other));
        assert_eq!(fs::read(&other).expect("there"), b"TEXTURE");
        // A run that goes on finds the file of an earlier one.
        drop(first);
        let second = open();
        let three = make(&second, 3, b"texture");
        assert_eq!(number(&zero), number(&three));
        drop(second);
        // A damaged file is not linked, and making its scene again mends it.
        fs::remove_file(&three).expect("there");
        fs::write(&three, "TEXTURE").expect("writable");
        let third = open();
        let four = make(&third, 4, b"texture");
        assert_eq!((number(&zero), fs::read(&four).expect("there")), (number(&four), b"texture".to_vec()));
        make(&third, 3, b"texture");
        assert_eq!((number(&zero), fs::read(&three).expect("there")), (number(&three), b"texture".to_vec()));
        // A scene that goes takes nothing from others.
        make(&third, 0, b"another");
        assert!(!zero.exists());
        assert_eq!(fs::read(&one).expect("there"), b"texture");
    }

    #[test]
    fn a_scene_appears_whole_and_is_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = Folder::open(&folder.path().join("data")).expect("new");
        staged(&open, 3, &[("rgb/3.png", "x")]);
        assert!(!open.root().join("rgb").exists());
        let made = commit(&open, 3, &[("rgb/3.png", "x"), ("info.txt", "why")]).expect("committed");
        assert_eq!(text(&open, "rgb/3.png").as_deref(), Some("x"));
        assert!(!open.staging().join("3.ready").exists() && !open.root().join(RECORD).exists());
        let journal = Journal::open(&open.journal()).expect("there");
        assert_eq!(journal.entries()[&3], made);
        let (manifest, digest) =
            Manifest::read(&manifest_path(open.root(), 3)).expect("readable").expect("there is one");
        assert_eq!(Some(&*digest), made.manifest());
        let listed: Vec<(&str, u64)> = manifest.files.iter().map(|(path, stamp)| (path.as_str(), stamp.0)).collect();
        assert_eq!(listed, [("info.txt", 3), ("rgb/3.png", 1)]);
    }

    #[test]
    fn a_file_has_one_owner() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = Folder::open(&folder.path().join("data")).expect("new");
        commit(&open, 3, &[("all.txt", "3")]).expect("committed");
        let error = commit(&open, 4, &[("all.txt", "4"), ("4.txt", "4")]).expect_err("taken");
        assert!(error.is_permanent() && error.to_string().contains("`all.txt` is a file of scene 3"), "{error}");
        assert_eq!((text(&open, "all.txt").as_deref(), text(&open, "4.txt")), (Some("3"), None));
        fs::write(open.root().join("notes.txt"), "mine").expect("writable");
        let error = commit(&open, 4, &[("notes.txt", "4")]).expect_err("taken").to_string();
        assert!(error.contains("does not belong to the dataset"), "{error}");
        assert_eq!(text(&open, "notes.txt").as_deref(), Some("mine"));
        // The end of a run may replace what an earlier end wrote, and nothing else.
        let mut journal = Journal::open(&open.journal()).expect("there");
        for (name, content, whose) in [
            ("end.txt", "1", None),
            ("end.txt", "2", None),
            ("all.txt", "0", Some("scene 3")),
            ("other.txt", "1", None),
        ] {
            fs::write(open.stage_finish().expect("staged").join(name), content).expect("writable");
            let done = open.publish_finish("a = 1\n", &mut journal, true, false);
            match whose {
                None => assert_eq!((done, text(&open, name).as_deref()), (Ok(()), Some(content))),
                Some(whose) => assert!(done.expect_err("taken").to_string().contains(whose)),
            }
        }
        assert_eq!((text(&open, "all.txt").as_deref(), text(&open, "end.txt")), (Some("3"), None));
        assert_eq!(text(&open, "recipe.toml").as_deref(), Some("a = 1\n"));
        let error = commit(&open, 5, &[("other.txt", "5")]).expect_err("taken").to_string();
        assert!(error.contains("the end of a run writes"), "{error}");
        // A scene replaces its own files, and what it no longer has goes.
        commit(&open, 3, &[("other/3.txt", "3")]).expect("committed");
        assert_eq!((text(&open, "all.txt"), text(&open, "other/3.txt").as_deref()), (None, Some("3")));
    }

    #[test]
    fn a_move_that_was_interrupted_is_finished() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = Folder::open(&root).expect("new");
        commit(&open, 3, &[("old.txt", "z")]).expect("committed");
        let ready = staged(&open, 3, &[("rgb/3.png", "x"), ("info.txt", "y")]);
        let record = Staged { entry: entry(3), stale: vec![DatasetPath::new("old.txt").expect("a path")] };
        create_parent(&ready.join(RECORD)).expect("writable");
        fs::write(ready.join(RECORD), serde_json::to_string(&record).expect("plain")).expect("writable");
        // One file was moved, then the program was killed; another scene was half made.
        fs::rename(ready.join("info.txt"), root.join("info.txt")).expect("moved");
        fs::rename(&ready, open.staging().join("3.ready")).expect("moved");
        staged(&open, 4, &[("rgb/4.png", "x")]);
        drop(open);
        let open = Folder::open(&root).expect("again");
        open.recover().expect("recovers");
        assert!(root.join("rgb/3.png").exists() && root.join("info.txt").exists() && !open.staging().exists());
        assert!(!root.join("old.txt").exists() && !root.join("rgb/4.png").exists());
        let scenes: Vec<u32> = Journal::open(&open.journal()).expect("there").entries().keys().copied().collect();
        assert_eq!(scenes, [3]);
    }

    #[test]
    fn a_deletion_takes_the_dataset_and_nothing_else_however_often_it_is_interrupted() {
        // Interrupted before the n-th of the moves into the bin, and at last not at all.
        for moves in 0..=state(Path::new("")).len() {
            let folder = tempfile::tempdir().expect("a folder");
            let root = folder.path().join("data");
            let open = Folder::open(&root).expect("new");
            commit(&open, 3, &[("rgb/3.png", "x"), ("both/3.txt", "x")]).expect("committed");
            fs::write(open.stage_finish().expect("staged").join("end.txt"), "1").expect("writable");
            let mut journal = Journal::open(&open.journal()).expect("there");
            open.publish_finish("a = 1\n", &mut journal, true, false).expect("published");
            fs::write(root.join("both/notes.txt"), "mine").expect("writable");
            fs::create_dir_all(open.bin()).expect("writable");
            for from in &state(&root)[..moves] {
                // There is no staging folder any more.
                let _ = fs::rename(from, open.bin().join(from.file_name().expect("a name")));
            }
            drop(open);
            // The next run deletes the rest, whether it is told to or not.
            let open = Folder::open(&root).expect("again");
            let mut left = Vec::new();
            each_file(&root, "", &mut |path| left.push(path.to_owned())).expect("readable");
            assert_eq!(left, ["both/notes.txt"], "after {moves} moves");
            assert!(Journal::open(&open.journal()).expect("new").entries().is_empty() && !open.bin().exists());
        }
    }
}
