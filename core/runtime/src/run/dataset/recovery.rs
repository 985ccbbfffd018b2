//! Completes interrupted work, and deletes datasets.

use crate::run::dataset::commit::Staged;
use crate::run::dataset::folder::{Folder, each_file};
use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, JournalLines};
use crate::run::dataset::layout::{self, FINISHED, RECIPE, SCENES};
use crate::run::dataset::manifest::{Manifest, Stamp};
use crate::run::dataset::staging::READY;
use crate::run::dataset::staging_area::Staging;
use std::path::PathBuf;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::Kind;

impl Folder {
    /// Finishes moving scenes whose move was interrupted, and drops unfinished ones. On another machine, it forgets scenes
    /// whose replacement was interrupted, so that a run makes them again.
    pub fn recover(&self) -> Result<()> {
        // Remains of a killed replacement of the recipe, the only one outside the program's own folder.
        self.files.remove_all(&layout::known(&format!("{RECIPE}.part")))?;
        if !self.files.has(&layout::staging())? {
            return self.files.remove_all(&layout::claims());
        }
        let mut journal = self.journal()?;
        for name in self.staged_names()?.into_iter().filter(|name| name.ends_with(READY)) {
            let Ok(inside) = DatasetPath::new(&*name) else { continue };
            let record = layout::staging().join(&inside).join(&layout::record());
            let Ok(staged) = serde_json::from_slice::<Staged>(&foreign::read(&self.files, &record)?) else { continue };
            match self.staging {
                Staging::Inside => self.publish(&name, staged, &mut journal)?,
                _ => self.forget(staged, &mut journal)?,
            }
        }
        self.files.remove_all(&layout::staging())?;
        self.files.remove_all(&layout::claims())
    }

    /// Forgets a scene after some of its files were replaced. They stay in its manifest, so that the next scene of its number
    /// replaces them.
    fn forget(&self, replaced: Staged, journal: &mut Journal) -> Result<()> {
        let scene = replaced.entry.scene;
        let mut listed = self.manifest(scene)?.unwrap_or_default();
        for path in replaced.stale {
            listed.files.entry(path).or_insert(Stamp(0, Digest::of(&[])));
        }
        self.files.write(&layout::manifest(scene), listed.text().0.as_bytes())?;
        journal.forget(scene)
    }

    /// Deletes the dataset: its journal first, then all files in its manifests. Returns the files that stay because
    /// they do not belong to the dataset.
    pub fn discard(&self) -> Result<Vec<PathBuf>> {
        // A scene that is moving into place belongs to the dataset, too, even if the journal is damaged.
        let _ = self.recover();
        if !self.files.has(&layout::manifests())? && self.has_lines()? {
            return Err(Error::new("another version began the dataset, and it has no list of its files")
                .in_file(self.name())
                .help("delete the folder yourself, or choose another folder with `options.out`; no file was changed"));
        }
        self.empty_bin()?;
        let mut left = Vec::new();
        each_file(&self.files, "", &mut |path, _| left.push(PathBuf::from(path)))?;
        Ok(left)
    }

    fn has_lines(&self) -> Result<bool> {
        let made = br#""outcome":"made""#;
        let mut lines = JournalLines::open(&self.files)?;
        while let Some(line) = lines.next_line()? {
            if line.windows(made.len()).any(|part| part == made) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Moves the state of a dataset into the bin, and deletes the files in its manifests. The bin exists until all are
    /// deleted, so the next run completes an interrupted deletion.
    pub(super) fn empty_bin(&self) -> Result<()> {
        for from in layout::state() {
            let (_, name) = from.rsplit_once('/').unwrap_or(("", &from));
            let to = layout::binned(name);
            match self.files.look(&from)?.map(|there| there.kind) {
                None => {}
                Some(_) if self.files.look(&to)?.is_none() => self.files.rename(&from, &to)?,
                // A store that moves folders file by file was interrupted.
                Some(Kind::Folder) => self.move_rest(&from, &to)?,
                Some(_) => {}
            }
        }
        let of_scenes = layout::manifests_in(&self.files, &layout::binned(SCENES))?.into_iter().map(|(_, path)| path);
        for path in [layout::binned(FINISHED)].into_iter().chain(of_scenes) {
            let Some((manifest, _)) = Manifest::read(&self.files, &path)? else { continue };
            manifest.files.keys().try_for_each(|path| self.files.remove(path))?;
        }
        self.files.remove_all(&layout::bin())
    }

    /// Moves the files of a folder that its counterpart in the bin lacks.
    fn move_rest(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        for (name, kind) in self.files.list(from)? {
            let Ok(name) = DatasetPath::new(name) else { continue };
            let (from, to) = (from.join(&name), to.join(&name));
            match kind {
                _ if self.files.look(&to)?.is_none() => self.files.rename(&from, &to)?,
                Kind::Folder => self.move_rest(&from, &to)?,
                _ => {}
            }
        }
        Ok(())
    }
}
