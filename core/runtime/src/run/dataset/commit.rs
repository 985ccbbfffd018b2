//! A staged scene moves into the dataset.

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

/// Number of scenes whose file is compared and shared before a scene keeps a file of its own.
const SHARE_TRIES: usize = 4;

/// A staged scene: its line of the journal, and files of the scene that it no longer has.
#[derive(Serialize, Deserialize)]
pub(in crate::run) struct Staged {
    pub(super) entry: JournalEntry,
    pub(super) stale: Vec<DatasetPath>,
}

impl Folder {
    /// Moves the files of a staged scene into place and writes its line. Interrupted anywhere, the next
    /// [`recover`](Self::recover) either finishes the job or finds nothing of the scene.
    ///
    /// Files that the scene had before are replaced; `kept` stay beside the new ones, all others are deleted. `written` has the
    /// writers of the new ones. A file that is not the scene's is a permanent error. The entry that is returned has the
    /// manifest's digest.
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
                return Err(Error::new(format!("`{path}` is written twice"))
                    .help("two writers have one path; give one of them another id, folder or path"));
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
        // A scene that has its record is published even by the next run, so its recipe comes first.
        self.accept_recipe(&mut journal)?;
        self.files.inner(&ready).write(&layout::record(), text.as_bytes())?;
        self.publish(&ready, record, &mut journal)?;
        Ok(entry)
    }

    /// Refuses new files of a scene at places that are not its `own`. `present` is its line of the journal.
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
        // The files of a scene whose manifest is lost are its own if no other manifest has them.
        let present = present.and_then(JournalEntry::manifest);
        let lost = present.is_some_and(|digest| own.text().1 != digest);
        let owners = self.owners(&clashes)?;
        match clashes.iter().find(|path| !lost || owners.contains_key(**path)) {
            Some(path) => Err(taken(path, owners.get(*path), LEAVE)),
            None => Ok(()),
        }
    }

    /// A file where one of these paths has a folder, unless it is one of `own`, which goes. A link is an error.
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

    /// Moves the files of a scene that is ready into place, and writes its line. The record is the last to go, so that an
    /// interrupted move can be resumed.
    pub(super) fn publish(&self, ready: &DatasetPath, staged: Staged, journal: &mut Journal) -> Result<()> {
        // What goes may be where a folder of new files must be.
        staged.stale.iter().try_for_each(|path| self.files.remove(path))?;
        self.move_files(ready, Some(RECORD))?;
        if journal.entries().get(&staged.entry.scene) != Some(&staged.entry) {
            journal.append(staged.entry)?;
        }
        self.files.remove_all(ready)
    }

    /// Moves the files of a staged folder to the same places in the dataset, replacing what is there; `keep` stays.
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

    /// Lets a staged file share the bytes of another scene's file, so that the store has them once. A store that cannot share
    /// keeps the staged file: the bytes are the same.
    fn share(&self, staged: &DatasetPath, to: &DatasetPath) -> Result<()> {
        let (folder, name) = to.rsplit_once('/').expect("a shared file is in a folder");
        // A file that this run has shared or put there is not read again: the end of the run compares all of them.
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
        // Of many scenes the last ones: a file that has as many links as the file system allows is among the first.
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

/// What to do about a file that belongs to nobody.
pub(super) const LEAVE: &str = "move it away, or choose another folder";

/// Says whose file is where another one must be written; `help` is for one that no manifest lists.
pub(super) fn taken(path: &str, owner: Option<&String>, help: &str) -> Error {
    let (owner, help) = match owner {
        Some(owner) => (format!("is {owner}"), "two files have one path: give the writer another id, folder or path"),
        None => ("is there already and does not belong to the dataset".to_owned(), help),
    };
    Error::new(format!("`{path}` {owner}")).help(help)
}
