//! Files in the making: scenes, and what the end of a run writes.

use crate::run::dataset::folder::Folder;
use crate::run::dataset::layout;
use std::path::PathBuf;
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

/// Ending of the name of a staged scene whose files are being moved into place.
pub(super) const READY: &str = ".ready";

/// Name of the folder of a scene in the making.
pub(super) fn part(scene: u32) -> String {
    format!("{scene}.part")
}

/// Name of the folder of what the end of a run writes.
pub(super) const FINISH: &str = "finish";
/// Name of the folder in which the end of a run is tried.
const TRIAL: &str = "trial";

impl Folder {
    /// An empty folder to make a scene in.
    pub fn stage(&self, scene: u32) -> Result<StoreFolder> {
        self.fresh(&part(scene))
    }

    /// An empty folder for what the end of a run writes.
    pub fn stage_finish(&self) -> Result<StoreFolder> {
        self.fresh(FINISH)
    }

    /// An empty folder to try the end of a run in.
    pub fn stage_trial(&self) -> Result<StoreFolder> {
        self.fresh(TRIAL)
    }

    /// Throws away what the end of a run wrote when it was tried.
    pub fn drop_trial(&self) -> Result<()> {
        self.files.remove_all(&layout::staged(TRIAL))
    }

    fn fresh(&self, name: &str) -> Result<StoreFolder> {
        let folder = layout::staged(name);
        self.files.remove_all(&folder)?;
        Ok(self.files.inner(&folder))
    }

    /// Drops all that is staged but scenes that are ready.
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

    /// Puts a staged scene aside, with what is wrong with it, and returns the name of its folder.
    pub fn quarantine(&self, scene: u32, faults: &str) -> Result<PathBuf> {
        let (part, aside) = (layout::staged(&part(scene)), layout::quarantine(scene));
        self.files.remove_all(&aside)?;
        if self.files.has(&part)? {
            self.files.rename(&part, &aside)?;
        }
        self.files.inner(&aside).write(&layout::known("faults.txt"), faults.as_bytes())?;
        Ok(self.files.name_of(&aside))
    }

    /// Names of what is staged, sorted.
    pub(super) fn staged_names(&self) -> Result<Vec<String>> {
        let mut names: Vec<String> = self.files.list(&layout::staging())?.into_iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        Ok(names)
    }
}
