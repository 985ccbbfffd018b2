//! Unfinished files: scenes, and the results of a run's end.

use crate::run::dataset::folder::Folder;
use crate::run::dataset::layout;
use std::path::PathBuf;
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

/// Suffix of a staged scene whose files are moving into place.
pub(super) const READY: &str = ".ready";

/// Name of the folder of an unfinished scene.
pub(super) fn part(scene: u32) -> String {
    format!("{scene}.part")
}

/// Name of the folder for the results of a run's end.
pub(super) const FINISH: &str = "finish";
/// Name of the folder for a rehearsal of the end of a run.
const TRIAL: &str = "trial";

impl Folder {
    /// An empty folder for a scene.
    pub fn stage(&self, scene: u32) -> Result<StoreFolder> {
        self.fresh(&part(scene))
    }

    /// An empty folder for the results of a run's end.
    pub fn stage_finish(&self) -> Result<StoreFolder> {
        self.fresh(FINISH)
    }

    /// An empty folder for a rehearsal of the end of a run.
    pub fn stage_trial(&self) -> Result<StoreFolder> {
        self.fresh(TRIAL)
    }

    /// Deletes the results of a rehearsal.
    pub fn drop_trial(&self) -> Result<()> {
        self.files.remove_all(&layout::staged(TRIAL))
    }

    fn fresh(&self, name: &str) -> Result<StoreFolder> {
        let folder = layout::staged(name);
        self.files.remove_all(&folder)?;
        Ok(self.files.inner(&folder))
    }

    /// Drops all staged files except ready scenes.
    pub fn drop_parts(&self) -> Result<()> {
        let (ready, parts): (Vec<String>, Vec<String>) =
            self.staged_names()?.into_iter().partition(|name| name.ends_with(READY));
        parts.iter().try_for_each(|name| self.files.remove_all(&layout::staged(name)))?;
        if ready.is_empty() { self.files.remove_all(&layout::staging()) } else { Ok(()) }
    }

    /// Drops a staged scene.
    pub fn abandon(&self, scene: u32) -> Result<()> {
        self.files.remove_all(&layout::staged(&part(scene)))
    }

    /// Moves a staged scene to quarantine with a text of its faults, and returns the name of its folder there.
    pub fn quarantine(&self, scene: u32, faults: &str) -> Result<PathBuf> {
        let (part, aside) = (layout::staged(&part(scene)), layout::quarantine(scene));
        self.files.remove_all(&aside)?;
        if self.files.has(&part)? {
            self.files.rename(&part, &aside)?;
        }
        self.files.inner(&aside).write(&layout::known("faults.txt"), faults.as_bytes())?;
        Ok(self.files.name_of(&aside))
    }

    /// Names of the entries in the staging folder, sorted.
    pub(super) fn staged_names(&self) -> Result<Vec<String>> {
        let mut names: Vec<String> = self.files.list(&layout::staging())?.into_iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        Ok(names)
    }
}
