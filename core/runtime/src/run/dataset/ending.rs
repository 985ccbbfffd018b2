//! What the end of a run wrote moves into the dataset.

use crate::recipe::without_assets;
use crate::run::dataset::commit::{LEAVE, taken};
use crate::run::dataset::folder::Folder;
use crate::run::dataset::foreign;
use crate::run::dataset::journal::Journal;
use crate::run::dataset::layout::{self, RECIPE};
use crate::run::dataset::manifest::{FileState, Manifest, Stamp};
use crate::run::dataset::staging::FINISH;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::store::{Kind, StoreFolder};

/// What the end of a run wrote.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Finished {
    /// Digest of the journal that the files were written for; none if a writer failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<Digest>,
    /// Digest of the recipe but for the assets that it locks, by which it is recognized if the file is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recipe: Option<Digest>,
    /// The files.
    #[serde(flatten)]
    pub manifest: Manifest,
}

impl Finished {
    /// What the end of the last run in a dataset wrote; nothing if the list cannot be read.
    pub fn of(dataset: &StoreFolder) -> Result<Self> {
        let bytes = foreign::read(dataset, &layout::finished())?;
        Ok(serde_json::from_slice(&bytes).unwrap_or_default())
    }
}

/// The digest by which a recipe is recognized: of all but the assets that it locks.
pub(super) fn digest_of_recipe(text: &str) -> Digest {
    Digest::of(without_assets(text).as_bytes())
}

/// What to do about a file that belongs to nobody, where the list of what the end of a run wrote may be lost.
const CLAIM: &str = "if an earlier run wrote it, run the same command with --repair, which replaces it; else move it away, or \
                     choose another folder";

impl Folder {
    /// What the end of the last run wrote.
    pub fn finished(&self) -> Result<Finished> {
        Finished::of(&self.files)
    }

    pub(super) fn set_finished(&self, finished: &Finished) -> Result<()> {
        let text = serde_json::to_string(finished).expect("a manifest is plain data");
        self.files.write(&layout::finished(), text.as_bytes())
    }

    /// Moves what the end of a run staged into place. A file that is not of an earlier end is not replaced: the error names its
    /// owner. Without `complete`, a writer failed, and the files that it wrote earlier stay.
    ///
    /// What an earlier end wrote is what `finished.json` lists. The list has the recipe from the first end on. A list without it
    /// may be a lost one. With `repair`, a file that no scene lists, at a path that a writer has just written, is then taken for
    /// that writer's. A file of the same bytes is always taken for it, since nothing is lost.
    pub fn publish_finish(&self, resolved: &str, journal: &mut Journal, complete: bool, repair: bool) -> Result<()> {
        let folder = layout::staged(FINISH);
        let old = self.finished()?.manifest;
        let mut new = Manifest::of_tree(&self.files.inner(&folder))?;
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
            self.files.remove_all(&folder.join(&path))?;
        }
        if let Some(path) = self.file_in_the_way(new.files.keys(), &old)? {
            return Err(taken(&path, self.owners(&[&path])?.get(&path), LEAVE));
        }
        // Both are listed until all are moved, so that an interrupted move leaves no file that belongs to nobody.
        let mut both = old.clone();
        both.files.extend(new.files.clone());
        self.set_finished(&Finished { journal: None, recipe: self.finished()?.recipe, manifest: both })?;
        self.set_recipe(resolved)?;
        journal.rewrite()?;
        let folders: BTreeSet<&str> = new.files.keys().flat_map(DatasetPath::folders).collect();
        let mut in_the_way = old.files.keys().filter(|path| folders.contains(path.as_str()));
        in_the_way.try_for_each(|path| self.files.remove(path))?;
        self.move_files(&folder, None)?;
        if complete && refused.is_none() {
            new.files.insert(layout::recipe(), Stamp::of(&self.files, &layout::recipe())?);
            for path in old.files.keys().filter(|path| !new.has(path)) {
                self.files.remove(path)?;
            }
            let Stamp(_, digest) = Stamp::of(&self.files, &layout::journal())?;
            let recipe = Some(digest_of_recipe(resolved));
            self.set_finished(&Finished { journal: Some(digest), recipe, manifest: new })?;
            self.files.remove_all(&layout::staging())?;
        }
        refused.map_or(Ok(()), Err)
    }
}
