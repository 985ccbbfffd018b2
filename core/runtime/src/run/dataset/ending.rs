//! Moves the results of a run's end into the dataset.

use crate::run::dataset::commit::{LEAVE, taken};
use crate::run::dataset::folder::Folder;
use crate::run::dataset::foreign;
use crate::run::dataset::journal::Journal;
use crate::run::dataset::layout::{self, RECIPE};
use crate::run::dataset::loss::Loss;
use crate::run::dataset::manifest::{FileState, Files, Manifest, Stamp};
use crate::run::dataset::staging::FINISH;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::store::{Kind, StoreFolder};
use syntable_recipe::without_assets;

/// Results of a run's end.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Finished {
    /// Digest of the journal that the files belong to; `None` if a writer failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<Digest>,
    /// Digest of the recipe without its locked assets. It identifies the recipe if the file is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recipe: Option<Digest>,
    /// Data that the files omit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<Loss>,
    /// The files.
    #[serde(flatten)]
    pub manifest: Manifest,
}

impl Finished {
    /// Results of the end of the dataset's last run; empty if the list is unreadable.
    pub fn of(dataset: &StoreFolder) -> Result<Self> {
        let bytes = foreign::read(dataset, &layout::finished())?;
        Ok(serde_json::from_slice(&bytes).unwrap_or_default())
    }
}

/// Whether the last run of a dataset ended.
pub fn is_finished(dataset: &StoreFolder) -> Result<bool> {
    let Some(digest) = Finished::of(dataset)?.journal else { return Ok(false) };
    // Lines in files of their own were written after the last end.
    Journal::has_digest(dataset, digest)
}

/// Digest that identifies a recipe: all of it except the locked assets.
pub(super) fn digest_of_recipe(text: &str) -> Digest {
    Digest::of(without_assets(text).as_bytes())
}

/// Remedy for a file of unknown origin, if the list of the last run's results may be lost.
const CLAIM: &str = "if an earlier run wrote it, run again with `options.repair`, which replaces it; else move it away, or \
                     choose another folder";

impl Folder {
    /// Results of the end of the last run.
    pub fn finished(&self) -> Result<Finished> {
        Finished::of(&self.files)
    }

    /// Results of the last end, if the recipe, the journal and the sizes of the files have not changed since.
    pub fn last_end(&self, resolved: &str) -> Result<Option<Finished>> {
        let last = self.finished()?;
        if last.recipe != Some(digest_of_recipe(resolved)) || !is_finished(&self.files)? {
            return Ok(None);
        }
        for (path, Stamp(size, _)) in &last.manifest.files {
            if self.files.look(path)?.is_none_or(|there| there.kind != Kind::File || there.size != *size) {
                return Ok(None);
            }
        }
        Ok(Some(last))
    }

    pub(super) fn set_finished(&self, finished: &Finished) -> Result<()> {
        let text = serde_json::to_string(finished).expect("a manifest is plain data");
        self.files.write(&layout::finished(), text.as_bytes())
    }

    /// Moves the staged results of a run's end into place. Replaces only files of an earlier end; for any other file,
    /// the error names its owner. `losses` are what the new files omit; `None` if a writer failed, whose earlier files
    /// stay.
    ///
    /// `finished.json` lists the files of earlier ends. From the first end on, it also lists the recipe, so a list
    /// without the recipe may be a lost one. With `repair`, a writer then adopts a file that no scene lists and that
    /// has the path of a file it has just written. It always adopts a file with the same bytes, since this loses
    /// nothing.
    pub fn publish_finish(
        &self,
        resolved: &str,
        journal: &mut Journal,
        losses: Option<&Vec<Loss>>,
        repair: bool,
    ) -> Result<()> {
        let staged = self.staged(FINISH);
        let old = self.finished()?.manifest;
        // All scenes are finished, so all threads are free, and no lock is held.
        let mut new = Manifest::of_tree(&staged, &Files::new(), Digest::of_reader_on_threads)?;
        let lost = !old.has(RECIPE);
        let mut refused = None;
        for (path, stamp) in new.files.clone() {
            let Some(there) = self.files.look(&path)? else { continue };
            if old.has(&path) {
                continue;
            }
            let owners = self.owners(&[&path])?;
            let is_whole = || Ok(stamp.check(&self.files, &path)? == FileState::Whole);
            let claimed = there.kind == Kind::File && ((repair && lost) || is_whole()?);
            if owners.is_empty() && claimed {
                continue;
            }
            refused.get_or_insert(taken(&path, owners.get(path.as_str()), if lost { CLAIM } else { LEAVE }));
            new.files.remove(&path);
            staged.remove_all(&path)?;
        }
        if let Some(path) = self.file_in_the_way(new.files.keys(), &old)? {
            return Err(taken(&path, self.owners(&[&path])?.get(&path), LEAVE));
        }
        // Both are listed until all are moved, so an interrupted move leaves no unlisted file.
        let mut both = old.clone();
        both.files.extend(new.files.clone());
        let recipe = self.finished()?.recipe;
        self.set_finished(&Finished { recipe, manifest: both, ..Finished::default() })?;
        self.set_recipe(resolved)?;
        journal.rewrite()?;
        let folders: BTreeSet<&str> = new.files.keys().flat_map(DatasetPath::folders).collect();
        let mut in_the_way = old.files.keys().filter(|path| folders.contains(path.as_str()));
        in_the_way.try_for_each(|path| self.files.remove(path))?;
        self.place(FINISH, None, |_| true)?;
        if let Some(losses) = losses.filter(|_| refused.is_none()) {
            new.files.insert(layout::recipe(), Stamp::of(&self.files, &layout::recipe())?);
            for path in old.files.keys().filter(|path| !new.has(path)) {
                self.files.remove(path)?;
            }
            let Stamp(_, digest) = Stamp::of(&self.files, &layout::journal())?;
            let recipe = Some(digest_of_recipe(resolved));
            let left_out = losses.clone();
            self.set_finished(&Finished { journal: Some(digest), recipe, left_out, manifest: new })?;
            self.files.remove_all(&layout::staging())?;
        }
        refused.map_or(Ok(()), Err)
    }
}
