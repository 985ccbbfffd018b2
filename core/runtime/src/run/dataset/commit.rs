//! Moves a staged scene into the dataset.

use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry, SceneOutcome};
use crate::run::dataset::layout::{self, MARK, RECORD};
use crate::run::dataset::manifest::{FileState, Manifest, Stamp, Written};
use crate::run::dataset::staging::{READY, part};
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::stage::is_shared;
use syntable_model::store::{Kind, StoreFolder};

/// Maximum number of files to compare and share before a scene keeps its own copy.
const SHARE_TRIES: usize = 4;

/// A staged scene: its journal line, and the files that it replaces.
#[derive(Serialize, Deserialize)]
pub(in crate::run) struct Staged {
    pub(super) entry: JournalEntry,
    pub(super) stale: Vec<DatasetPath>,
}

impl Folder {
    /// Moves the files of a staged scene into place and writes its journal line. If this is interrupted anywhere, the
    /// next [`recover`](Self::recover) either finishes the move or finds nothing of the scene.
    ///
    /// Replaces the scene's earlier files: `kept` stay beside the new ones, all others are deleted. `written` lists the
    /// writers of the new files. A file that does not belong to the scene is a permanent error. The returned entry has
    /// the manifest's digest.
    pub fn commit(
        &self,
        mut entry: JournalEntry,
        kept: Manifest,
        written: Written,
        journal: &Mutex<Journal>,
    ) -> Result<JournalEntry> {
        let scene = entry.scene;
        let part = layout::staged(&part(scene));
        let staged = self.files.inner(&part);
        let own = self.manifest(scene)?.unwrap_or_default();
        let mut stale = own.clone();
        let new = if entry.failed() {
            self.abandon(scene)?;
            stale.files.insert(layout::manifest(scene), Stamp(0, Digest::of(&[])));
            Manifest::default()
        } else {
            Manifest::of_tree(&staged)?
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
        if let SceneOutcome::Made { manifest: digest, .. } = &mut entry.outcome {
            let (text, of_text) = manifest.text();
            staged.write(&layout::manifest(scene), text.as_bytes())?;
            *digest = of_text;
        }
        let record = Staged { entry: entry.clone(), stale: stale.files.into_keys().collect() };
        let text = serde_json::to_string(&record).expect("an entry is plain data");
        let mut journal = journal.lock();
        self.check_places(&new, &own, journal.entries().get(&scene))?;
        let ready = layout::staged(&format!("{scene}{READY}"));
        self.files.remove_all(&ready)?;
        if !entry.failed() {
            self.files.rename(&part, &ready)?;
        }
        // From its record on, even the next run publishes the scene, so the recipe comes first.
        self.accept_recipe(&mut journal)?;
        self.files.inner(&ready).write(&layout::record(), text.as_bytes())?;
        self.publish(&ready, record, &mut journal)?;
        Ok(entry)
    }

    /// Refuses new files of a scene at existing paths outside its `own`. `present` is its journal line.
    fn check_places(&self, new: &Manifest, own: &Manifest, present: Option<&JournalEntry>) -> Result<()> {
        let mut clashes: Vec<&str> = Vec::new();
        for path in new.files.keys().filter(|path| !own.has(path) && !path.starts_with(MARK)) {
            if self.files.look(path)?.is_some() {
                clashes.push(path.as_str());
            }
        }
        if let Some(path) = self.file_in_the_way(new.files.keys(), own)? {
            let owners = self.owners(&[&path])?;
            return Err(taken(&path, owners.get(&path), LEAVE));
        }
        if clashes.is_empty() {
            return Ok(());
        }
        // If the manifest is lost, the scene owns every file that no other manifest lists.
        let present = present.and_then(JournalEntry::manifest);
        let lost = present.is_some_and(|digest| own.text().1 != digest);
        let owners = self.owners(&clashes)?;
        match clashes.iter().find(|path| !lost || owners.contains_key(**path)) {
            Some(path) => Err(taken(path, owners.get(*path), LEAVE)),
            None => Ok(()),
        }
    }

    /// A file where one of these paths needs a folder, unless it is one of `own`, which is removed. A link is an error.
    pub(super) fn file_in_the_way<'p>(
        &self,
        paths: impl Iterator<Item = &'p DatasetPath>,
        own: &Manifest,
    ) -> Result<Option<String>> {
        let folders: BTreeSet<&str> = paths.flat_map(DatasetPath::folders).collect();
        for folder in folders.into_iter().filter(|folder| !own.has(folder)) {
            match self.files.look(folder)? {
                Some(there) if there.kind == Kind::Link => return Err(self.files.linked(folder)),
                Some(there) if there.kind != Kind::Folder => return Ok(Some(folder.to_owned())),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Moves the files of a ready scene into place and writes its line. The record goes last, so an interrupted move
    /// can be resumed.
    pub(super) fn publish(&self, ready: &DatasetPath, staged: Staged, journal: &mut Journal) -> Result<()> {
        // A file to remove may be where new files need a folder.
        staged.stale.iter().try_for_each(|path| self.files.remove(path))?;
        self.move_files(ready, Some(RECORD))?;
        if journal.entries().get(&staged.entry.scene) != Some(&staged.entry) {
            journal.append(staged.entry)?;
        }
        self.files.remove_all(ready)
    }

    /// Moves the files of a staged folder to the same paths in the dataset, replacing existing files; `keep` stays.
    pub(super) fn move_files(&self, staged: &DatasetPath, keep: Option<&str>) -> Result<()> {
        let mut paths: Vec<String> = Vec::new();
        each_staged(&self.files.inner(staged), "", &mut paths)?;
        for path in paths.into_iter().filter(|path| keep != Some(path)) {
            let to = DatasetPath::new(path).map_err(|error| Error::new(error.to_string()))?;
            let from = staged.join(&to);
            if is_shared(&to) {
                self.share(&from, &to)?;
            }
            self.files.rename(&from, &to)?;
        }
        Ok(())
    }

    /// Shares the bytes of another scene's file with a staged one, so that the store has them once. A store that cannot
    /// share keeps the staged file, whose bytes are the same.
    fn share(&self, staged: &DatasetPath, to: &DatasetPath) -> Result<()> {
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

/// The files of a staged folder, sorted.
fn each_staged(staged: &StoreFolder, inside: &str, paths: &mut Vec<String>) -> Result<()> {
    let mut entries = staged.list(inside)?;
    entries.sort_unstable_by(|(a, _), (b, _)| a.cmp(b));
    for (name, kind) in entries {
        let path = if inside.is_empty() { name } else { format!("{inside}/{name}") };
        match kind {
            Kind::Folder => each_staged(staged, &path, paths)?,
            _ => paths.push(path),
        }
    }
    Ok(())
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
