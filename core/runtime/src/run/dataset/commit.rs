//! Moves a staged scene into the dataset.

use crate::run::dataset::folder::{Folder, owner_of};
use crate::run::dataset::journal::{Journal, JournalEntry, SceneLine, SceneOutcome};
use crate::run::dataset::layout::{self, MARK, PART_OF_RECORD, RECORD};
use crate::run::dataset::manifest::{FileState, Files, Manifest, Stamp, Written};
use crate::run::dataset::records::OWNER;
use crate::run::dataset::requests;
use crate::run::dataset::staging::{part, ready};
use crate::run::dataset::staging_area::Staging;
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::stage::is_shared;
use syntable_model::store::Kind;

/// Maximum number of files to compare and share before a scene keeps its own copy.
const SHARE_TRIES: usize = 4;
/// Size up to which a file is uploaded with the condition that it is new, bytes. A store does not take larger ones in
/// one request.
const MOST_AT_ONCE: u64 = 16 << 20;

/// A staged scene: its journal line, and the files that it replaces. Of an upload that replaces a scene, all files of
/// the old and the new scene.
#[derive(Serialize, Deserialize)]
pub(in crate::run) struct Staged {
    pub(super) entry: JournalEntry,
    pub(super) stale: Vec<DatasetPath>,
}

/// A scene to commit.
struct Commit {
    entry: JournalEntry,
    /// The files that the scene has.
    own: Manifest,
    /// The staged files.
    new: Manifest,
    /// The files that the scene will have, and its text.
    manifest: Manifest,
    text: String,
    /// The files that the scene has and will not have.
    stale: Vec<DatasetPath>,
}

impl Folder {
    /// Moves the files of a staged scene into place and writes its journal line. If this is interrupted anywhere, the
    /// next [`recover`](Self::recover) either finishes the move or finds no line of the scene.
    ///
    /// Replaces the scene's earlier files: `kept` stay beside the new ones, all others are deleted. `written` lists the
    /// writers of the new files. A file that does not belong to the scene is a permanent error. The returned entry has
    /// the manifest's digest.
    pub fn commit(
        &self,
        entry: JournalEntry,
        kept: Manifest,
        written: Written,
        journal: &Mutex<Journal>,
    ) -> Result<JournalEntry> {
        self.commit_known(entry, kept, written, &Files::new(), journal)
    }

    /// As [`commit`](Self::commit), with staged files whose digests are known and that are on the disk already.
    pub(super) fn commit_known(
        &self,
        mut entry: JournalEntry,
        kept: Manifest,
        written: Written,
        known: &Files,
        journal: &Mutex<Journal>,
    ) -> Result<JournalEntry> {
        let scene = entry.scene;
        let staged = self.staged(&part(scene));
        let own = self.manifest(scene)?.unwrap_or_default();
        let mut stale = own.clone();
        let new = if entry.failed() {
            self.abandon(scene)?;
            stale.files.insert(layout::manifest(scene), Stamp(0, Digest::of(&[])));
            Manifest::default()
        } else {
            Manifest::of_tree(&staged, known, Digest::of_reader)?
        };
        let mut manifest = kept;
        manifest.writers.extend(written);
        for (path, stamp) in &new.files {
            if manifest.files.insert(path.clone(), *stamp).is_some() && !path.starts_with(MARK) {
                return Err(Error::new(format!("two writers write `{path}`"))
                    .help("give one of them another id, folder or path"));
            }
        }
        stale.files.retain(|path, _| !manifest.has(path));
        let names = |id: &String| id == OWNER || entry.writers().contains(id);
        entry.stale = !manifest.writers.keys().all(names);
        let (text, of_text) = manifest.text();
        if let SceneOutcome::Made { manifest: digest, .. } = &mut entry.outcome {
            *digest = of_text;
        }
        let commit = Commit { entry, own, new, manifest, text, stale: stale.files.into_keys().collect() };
        match self.staging {
            Staging::Inside => self.commit_moved(commit, journal),
            Staging::Here { .. } | Staging::Worker(_) => self.commit_sent(commit, journal),
        }
    }

    /// Moves the staged files into place. A record beside them lets the next run finish an interrupted move.
    fn commit_moved(&self, commit: Commit, journal: &Mutex<Journal>) -> Result<JournalEntry> {
        let Commit { entry, own, new, text, stale, .. } = commit;
        let scene = entry.scene;
        if !entry.failed() {
            self.staged(&part(scene)).write(&layout::manifest(scene), text.as_bytes())?;
        }
        let mut journal = journal.lock();
        self.check_places(scene, (&new, &own), journal.entries().get(scene))?;
        let ready = ready(scene);
        self.files.remove_all(&layout::staged(&ready))?;
        if !entry.failed() {
            self.files.rename(&layout::staged(&part(scene)), &layout::staged(&ready))?;
        }
        // From its record on, even the next run publishes the scene, so the recipe comes first.
        self.accept_recipe(&mut journal)?;
        let record = Staged { entry: entry.clone(), stale };
        self.write_record(&record)?;
        self.publish(&ready, record, &mut journal)?;
        Ok(entry)
    }

    /// Uploads the staged files, or moves them while other workers write other scenes. The manifest comes first, so that
    /// files of an interrupted commit belong to the scene, which has no line, and the next commit replaces them. If the
    /// scene has a line already, a record lets the next run forget it. The journal is locked only for its own changes,
    /// since an upload takes long.
    ///
    /// Two workers may commit one scene at the same time. Both write the same bytes.
    fn commit_sent(&self, commit: Commit, journal: &Mutex<Journal>) -> Result<JournalEntry> {
        let Commit { entry, own, new, manifest, text, stale } = commit;
        let (scene, listed) = (entry.scene, layout::manifest(entry.scene));
        let adopted;
        let has_line = {
            let mut journal = journal.lock();
            let present = journal.entries().get(scene);
            adopted = self.check_places(scene, (&new, &own), present)?;
            let has_line = present.is_some_and(|present| !present.failed());
            self.accept_recipe(&mut journal)?;
            has_line
        };
        let mut both = own.clone();
        both.files.extend(manifest.files.clone());
        if has_line {
            // All files that may exist, because the manifest may be lost.
            self.write_record(&Staged { entry: entry.clone(), stale: both.files.keys().cloned().collect() })?;
        }
        if entry.failed() {
            journal.lock().append(entry.clone())?;
            if !self.is_shared() {
                self.remove_each(&stale)?;
            }
        } else {
            // A new scene has no files but these.
            let is_new = own.files.is_empty();
            let listing = if is_new { text.clone() } else { both.text().0 };
            // Another worker may write the same list at this moment.
            let writes_new = || {
                let is_written = self.files.write_new(&listed, listing.as_bytes())?;
                Ok(is_written || self.files.read(&listed)?.is_some_and(|there| there == listing.as_bytes()))
            };
            let is_listed = own == manifest || (is_new && self.is_shared() && writes_new()?);
            if !is_listed {
                self.files.write(&listed, listing.as_bytes())?;
            }
            self.remove_each(&stale)?;
            let owns = |path: &str| own.has(path) || adopted.contains(path) || path.starts_with(MARK);
            self.send_new(scene, &new, owns)?;
            if !is_new && own != manifest {
                self.files.write(&listed, text.as_bytes())?;
            }
            journal.lock().append(entry.clone())?;
            self.abandon(scene)?;
        }
        if has_line {
            self.files.remove_all(&layout::staged(&ready(scene)))?;
        }
        Ok(entry)
    }

    /// Sends the staged files of a scene. A path that the scene does not own must be new in an object store: another scene
    /// may have taken it since the paths were checked.
    fn send_new(&self, scene: u32, new: &Manifest, owns: impl Fn(&str) -> bool + Sync) -> Result<()> {
        let (part, paths) = (&part(scene), new.files.keys().collect::<Vec<_>>());
        let staged = self.staged(part);
        let send = |number: usize| {
            let path = paths[number];
            if !self.files.is_remote() || owns(path) || new.files[path].0 > MOST_AT_ONCE {
                return self.send(part, path, path);
            }
            let bytes = staged.read(path)?.unwrap_or_default();
            if self.files.write_new(path, &bytes)? {
                return Ok(());
            }
            let owners = self.owners(&[path])?;
            match owners.get(path.as_str()) {
                Some(owner) if self.is_shared() && *owner == owner_of(scene) => self.send(part, path, path),
                owner => Err(taken(path, owner, LEAVE)),
            }
        };
        requests::each(&self.files, paths.len(), &send).map(drop)
    }

    /// Writes the record of a scene before its files are moved or replaced.
    fn write_record(&self, record: &Staged) -> Result<()> {
        let text = serde_json::to_string(record).expect("an entry is plain data");
        let folder = layout::staged(&ready(record.entry.scene));
        self.files.inner(&folder).write(&layout::record(), text.as_bytes())
    }

    /// Removes files of a scene.
    fn remove_each(&self, stale: &[DatasetPath]) -> Result<()> {
        requests::each(&self.files, stale.len(), &|number| self.files.remove(&stale[number])).map(drop)
    }

    /// Refuses new files of a scene at existing paths outside its `own`. `present` is its journal line. Returns the paths
    /// that the scene owns although its manifest is lost.
    fn check_places(
        &self,
        scene: u32,
        (new, own): (&Manifest, &Manifest),
        present: Option<SceneLine>,
    ) -> Result<BTreeSet<String>> {
        let unowned = new.files.keys().filter(|path| !own.has(path) && !path.starts_with(MARK));
        let unowned: Vec<&DatasetPath> = unowned.collect();
        let exists = requests::each(&self.files, unowned.len(), &|number| self.files.has(unowned[number]))?;
        let clashes: Vec<&str> =
            unowned.iter().zip(exists).filter(|(_, exists)| *exists).map(|(path, _)| path.as_str()).collect();
        if let Some(path) = self.file_in_the_way(new.files.keys(), own)? {
            let owners = self.owners(&[&path])?;
            return Err(taken(&path, owners.get(&path), LEAVE));
        }
        if clashes.is_empty() {
            return Ok(BTreeSet::new());
        }
        // If the manifest is lost, the scene owns every file that no other manifest lists.
        let present = present.and_then(|present| present.manifest());
        let lost = present.is_some_and(|digest| own.text().1 != digest);
        let owners = self.owners(&clashes)?;
        // Another worker makes the same scene at this moment, and writes the same bytes.
        let is_own = |path: &str| self.is_shared() && owners.get(path) == Some(&owner_of(scene));
        match clashes.iter().filter(|path| !is_own(path)).find(|path| !lost || owners.contains_key(**path)) {
            Some(path) => Err(taken(path, owners.get(*path), LEAVE)),
            None => Ok(clashes.into_iter().map(str::to_owned).collect()),
        }
    }

    /// A file where one of these paths needs a folder, unless it is one of `own`, which is removed. A link is an error.
    pub(super) fn file_in_the_way<'p>(
        &self,
        paths: impl Iterator<Item = &'p DatasetPath>,
        own: &Manifest,
    ) -> Result<Option<String>> {
        let folders: BTreeSet<&str> = paths.flat_map(DatasetPath::folders).collect();
        let folders: Vec<&str> = folders.into_iter().filter(|folder| !own.has(folder)).collect();
        let there = requests::each(&self.files, folders.len(), &|number| self.files.look(folders[number]))?;
        for (folder, there) in folders.into_iter().zip(there) {
            match there {
                Some(there) if there.kind == Kind::Link => return Err(self.files.linked(folder)),
                Some(there) if there.kind != Kind::Folder => return Ok(Some(folder.to_owned())),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Moves the files of a ready scene into place and writes its line. The record goes last, so an interrupted move
    /// can be resumed.
    pub(super) fn publish(&self, ready: &str, staged: Staged, journal: &mut Journal) -> Result<()> {
        // A file to remove may be where new files need a folder.
        self.remove_each(&staged.stale)?;
        self.place(ready, None, |path| ![RECORD, PART_OF_RECORD].contains(&path))?;
        if !journal.entries().has(&staged.entry) {
            journal.append(staged.entry)?;
        }
        self.files.remove_all(&layout::staged(ready))
    }

    /// Shares the bytes of another scene's file with a staged one, if scenes share files at its path, so that the store
    /// has them once. A store that cannot share keeps the staged file, whose bytes are the same.
    pub(super) fn share(&self, staged: &DatasetPath, to: &DatasetPath) -> Result<()> {
        if !is_shared(to) {
            return Ok(());
        }
        let (folder, name) = to.rsplit_once('/').expect("a shared file is in a folder");
        // A file that this run has shared or written is not read again: the end of the run compares all of them.
        let known = self.shared.lock().get(folder).cloned();
        let size = |path: &DatasetPath| {
            let found = self.files.look(path).ok().flatten();
            found.filter(|found| found.kind == Kind::File).map(|found| found.size)
        };
        if let Some(known) = known.filter(|known| size(known).is_some() && size(known) == size(staged))
            && self.files.share(&self.files, &known, staged)?
        {
            return Ok(());
        }
        let stamp = Stamp::of(&self.files, staged)?;
        let mut others: Vec<String> =
            self.files.list(folder).unwrap_or_default().into_iter().map(|(name, _)| name).collect();
        // The last of many scenes: the first files may have as many links as the file system allows.
        others.sort_unstable_by(|a, b| b.cmp(a));
        for other in others.iter().filter(|other| *other != name).take(SHARE_TRIES) {
            let Ok(other) = DatasetPath::new(format!("{folder}/{other}")) else { continue };
            if stamp.check_in(&self.files, &other)? == FileState::Whole
                && self.files.share(&self.files, &other, staged)?
            {
                break;
            }
        }
        self.shared.lock().insert(folder.to_owned(), to.clone());
        Ok(())
    }
}

/// Remedy for a file that no manifest lists.
pub(super) const LEAVE: &str = "move it away, or choose another folder";

/// The error for a path whose file belongs to `owner`. `help` is the remedy if no manifest lists the file.
pub(super) fn taken(path: &str, owner: Option<&String>, help: &str) -> Error {
    let (owner, help) = match owner {
        Some(owner) => (format!("is {owner}"), "give the writer another id, folder or path"),
        None => ("exists and does not belong to the dataset".to_owned(), help),
    };
    Error::new(format!("`{path}` {owner}")).help(help)
}
