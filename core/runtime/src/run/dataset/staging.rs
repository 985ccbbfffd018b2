//! Unfinished files: scenes, and the results of a run's end. They are in the dataset. If the dataset is on another
//! machine, they are in a temporary folder of this one, from which each file is uploaded once.

use crate::run::dataset::folder::Folder;
use crate::run::dataset::staging_area::Staging;
use crate::run::dataset::{layout, requests};
use std::io;
use std::path::PathBuf;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Kind, StoreFolder};

/// Suffix of a staged scene whose files are moving into place.
pub(super) const READY: &str = ".ready";

/// Name of the folder of an unfinished scene.
pub(super) fn part(scene: u32) -> String {
    format!("{scene}.part")
}

/// Name of the folder of a scene whose files are moving into place.
pub(super) fn ready(scene: u32) -> String {
    format!("{scene}{READY}")
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
        self.drop_staged(TRIAL)
    }

    fn fresh(&self, name: &str) -> Result<StoreFolder> {
        self.drop_staged(name)?;
        Ok(self.staged(name))
    }

    /// A staged folder.
    pub(super) fn staged(&self, name: &str) -> StoreFolder {
        match &self.staging {
            Staging::Inside => self.files.inner(&layout::staged(name)),
            Staging::Worker(folder) => self.files.inner(&folder.join(&layout::known(name))),
            Staging::Here { files, .. } => files.inner(&layout::known(name)),
        }
    }

    fn drop_staged(&self, name: &str) -> Result<()> {
        match &self.staging {
            Staging::Inside => self.files.remove_all(&layout::staged(name)),
            Staging::Worker(folder) => self.files.remove_all(&folder.join(&layout::known(name))),
            Staging::Here { files, .. } => files.remove_all(&layout::known(name)),
        }
    }

    /// Drops all staged files except ready scenes.
    pub fn drop_parts(&self) -> Result<()> {
        if let Staging::Worker(folder) = &self.staging {
            return self.files.remove_all(folder);
        }
        let (ready, parts): (Vec<String>, Vec<String>) =
            self.staged_names()?.into_iter().partition(|name| name.ends_with(READY));
        parts.iter().try_for_each(|name| self.files.remove_all(&layout::staged(name)))?;
        if ready.is_empty() { self.files.remove_all(&layout::staging()) } else { Ok(()) }
    }

    /// Drops a staged scene.
    pub fn abandon(&self, scene: u32) -> Result<()> {
        self.drop_staged(&part(scene))
    }

    /// Moves a staged scene to quarantine with a text of its faults, and returns the name of its folder there.
    pub fn quarantine(&self, scene: u32, faults: &str) -> Result<PathBuf> {
        let aside = layout::quarantine(scene);
        self.files.remove_all(&aside)?;
        self.place(&part(scene), Some(&aside), |_| true)?;
        self.abandon(scene)?;
        self.files.inner(&aside).write(&layout::known("faults.txt"), faults.as_bytes())?;
        Ok(self.files.name_of(&aside))
    }

    /// Moves the files of a staged folder to the same paths in the dataset, or in a folder of it, replacing existing
    /// files. Files that are not `wanted` stay.
    pub(super) fn place(&self, name: &str, to: Option<&DatasetPath>, wanted: impl Fn(&str) -> bool) -> Result<()> {
        let staged = self.staged(name);
        let mut paths: Vec<String> = Vec::new();
        each_staged(&staged, "", &mut paths)?;
        paths.retain(|path| wanted(path));
        let paths = paths.into_iter().map(DatasetPath::new).collect::<std::result::Result<Vec<_>, _>>();
        let paths = paths.map_err(|error| Error::new(error.to_string()))?;
        let place = |number: usize| {
            let path = &paths[number];
            let to = to.map_or_else(|| path.clone(), |to| to.join(path));
            match &self.staging {
                Staging::Inside => {
                    let from = layout::staged(name).join(path);
                    self.share(&from, &to)?;
                    self.files.rename(&from, &to)
                }
                _ => self.send(name, path, &to),
            }
        };
        requests::each(&self.files, paths.len(), &place).map(drop)
    }

    /// Moves a staged file of a worker into the dataset, or copies it into the dataset on another machine. It replaces an
    /// existing file.
    pub(super) fn send(&self, name: &str, path: &DatasetPath, to: &DatasetPath) -> Result<()> {
        if let Staging::Worker(folder) = &self.staging {
            let from = folder.join(&layout::known(name)).join(path);
            self.share(&from, to)?;
            return self.files.rename(&from, to);
        }
        let staged = self.staged(name);
        let gone = || Error::io(staged.name_of(path), &io::ErrorKind::NotFound.into());
        self.files.put(to, &mut |file| {
            let mut opened = staged.open(path)?.ok_or_else(gone)?;
            io::copy(&mut opened, file).map(drop).map_err(|error| Error::io(self.files.name_of(to), &error))
        })
    }

    /// Names of the entries in the staging folder of the dataset, sorted.
    pub(super) fn staged_names(&self) -> Result<Vec<String>> {
        let mut names: Vec<String> = self.files.list(&layout::staging())?.into_iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        Ok(names)
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
