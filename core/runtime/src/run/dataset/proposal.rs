//! The recipe of a dataset, and a recipe that will replace it.

use crate::run::dataset::ending::{Finished, digest_of_recipe};
use crate::run::dataset::folder::{Folder, Proposed};
use crate::run::dataset::foreign;
use crate::run::dataset::journal::Journal;
use crate::run::dataset::layout::{self, RECIPE};
use crate::run::dataset::manifest::{FileState, Stamp};
use std::collections::BTreeSet;
use syntable_model::error::Result;

impl Folder {
    /// Text of the resolved recipe, if the dataset has one.
    pub fn recipe(&self) -> Result<Option<String>> {
        let bytes = foreign::read_list(&self.files, &layout::recipe())?;
        Ok(bytes.map(|bytes| String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// Text of the resolved recipe that made the scenes, or its fault.
    pub fn recipe_of_scenes(&self) -> Result<std::result::Result<String, &'static str>> {
        let Some(text) = self.recipe()? else { return Ok(Err("has lost its recipe.toml")) };
        let listed = self.finished()?.manifest.files.get(RECIPE).copied();
        let is_recipe = || toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("dataset"));
        Ok(match listed {
            // A changed recipe would describe the scenes wrongly.
            Some(stamp) if stamp != Stamp::of_text(&text) => Err("has a recipe.toml that is damaged, or was edited"),
            None if !is_recipe() => Err("has a damaged recipe.toml"),
            _ => Ok(text),
        })
    }

    /// Makes a resolved recipe the dataset's recipe as soon as a scene is made from it or fails with it. Until then,
    /// the dataset keeps its recipe, and a run that makes no scene changes nothing. Files of `replaced` writers stay
    /// until the scene gets new ones, or the run ends.
    pub fn propose_recipe(&self, text: &str, replaced: BTreeSet<String>) -> Result<()> {
        let has = self.recipe()?.as_deref() == Some(text);
        *self.proposed.lock() = (!has).then(|| Proposed { recipe: text.to_owned(), replaced });
        Ok(())
    }

    /// Makes the proposed recipe the dataset's recipe.
    pub fn accept_recipe(&self, journal: &mut Journal) -> Result<()> {
        let mut proposed = self.proposed.lock();
        if let Some(Proposed { recipe, replaced }) = &*proposed {
            // Lines come first: after an interruption in between, the earlier recipe makes the missing files again.
            journal.forget_writers(replaced)?;
            self.set_recipe(recipe)?;
        }
        *proposed = None;
        Ok(())
    }

    /// Whether a proposed recipe is still pending.
    pub fn is_proposed(&self) -> bool {
        self.proposed.lock().is_some()
    }

    /// Writes the resolved recipe and lists it, so that damage becomes visible. If another recipe was listed, the
    /// dataset becomes unfinished: a run that is killed later leaves a listed or unlisted recipe, but never one that
    /// looks damaged.
    pub fn set_recipe(&self, text: &str) -> Result<()> {
        let path = layout::recipe();
        let mut listed = self.finished()?.manifest;
        let is_listed = listed.files.remove(RECIPE) == Some(Stamp::of_text(text));
        let is_there = self.recipe()?.as_deref() == Some(text);
        if is_there && (is_listed || self.has_lost_its_list()?) {
            return Ok(());
        }
        // A lost list is not started again, because it would look complete.
        if self.has_lost_its_list()? {
            return self.files.write(&path, text.as_bytes());
        }
        self.set_finished(&Finished { manifest: listed.clone(), ..Finished::default() })?;
        self.files.write(&path, text.as_bytes())?;
        listed.files.insert(path, Stamp::of_text(text));
        let recipe = Some(digest_of_recipe(text));
        self.set_finished(&Finished { recipe, manifest: listed, ..Finished::default() })
    }

    /// Whether the dataset has scenes but lost the list of a run's results, which has the recipe from the beginning.
    fn has_lost_its_list(&self) -> Result<bool> {
        Ok(!self.finished()?.manifest.has(RECIPE) && self.has_scenes()?)
    }

    /// Writes the resolved recipe again if it is missing or damaged and `text` equals the listed recipe except for
    /// locked assets. Returns whether it did.
    pub fn restore_recipe(&self, text: &str) -> Result<bool> {
        let path = layout::recipe();
        let mut finished = self.finished()?;
        let Some(stamp) = finished.manifest.files.get(RECIPE).copied() else { return Ok(false) };
        if finished.recipe != Some(digest_of_recipe(text)) || stamp.check(&self.files, &path)? == FileState::Whole {
            return Ok(false);
        }
        self.files.write(&path, text.as_bytes())?;
        finished.manifest.files.insert(path, Stamp::of_text(text));
        self.set_finished(&finished).map(|()| true)
    }
}
