//! The first scene of a dataset that replaces another one. It is made before the old dataset is deleted, because some mistakes of a
//! recipe show only then.

use crate::run::RunOptions;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::layout;
use crate::run::decisions::opening;
use crate::run::making::scenes;
use crate::run::merge;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::workers::Pool;
use parking_lot::Mutex;
use syntable_model::error::{Error, Result};
use syntable_recipe::Recipe;

/// The first scene, in its own folder.
pub struct Ahead {
    folder: Folder,
    /// The line of the scene in the journal.
    pub entry: JournalEntry,
}

/// Makes the first scene of a run in its own folder.
///
/// # Errors
/// If the scene fails. The old dataset then stays.
pub fn make(recipe: &Recipe, options: &RunOptions, folder: &Folder, reporter: &dyn Reporter) -> Result<Ahead> {
    let message = "the old dataset is deleted when the first scene of the new one is made".to_owned();
    reporter.event(&Event::Note { message });
    let (ahead, first) = (layout::ahead(), options.scenes.as_ref().map_or(0, |scenes| scenes.start));
    let aside = RunOptions {
        scenes: Some(first..first + 1),
        stop: options.stop.clone(),
        ..RunOptions::new(folder.files().inner(&ahead), options.threads, options.cache.clone())
    };
    folder.files().remove_all(&ahead)?;
    let (pool, within) = (Pool::new(options.threads)?, Within(reporter));
    let log = Warnings(&within);
    let made = opening::begin(recipe, &aside, &pool, &within, &log)
        .and_then(|begun| scenes::make(recipe, &aside, &pool, &within, begun))
        .and_then(|made| {
            let entry = made.journal.entries().get(&first).filter(|entry| !entry.failed()).cloned();
            let failed = || format!("scene {first} failed in {}", count(recipe.dataset.max_attempts, "attempt"));
            entry.map(|entry| Ahead { folder: made.folder, entry }).ok_or_else(|| Error::new(failed()))
        });
    match made {
        Ok(ahead) => Ok(ahead),
        Err(error) => {
            folder.files().remove_all(&ahead)?;
            let stays = "the old dataset stays as it was";
            let help = error.help_text().map_or_else(|| stays.to_owned(), |help| format!("{stays}; {help}"));
            Err(error.help(help))
        }
    }
}

impl Ahead {
    /// Moves it into the dataset.
    pub fn adopt(self, folder: &Folder, journal: &Mutex<Journal>) -> Result<()> {
        merge::adopt(folder, &self.folder, &self.entry, journal)?;
        drop(self.folder);
        folder.files().remove_all(&layout::ahead())
    }
}

/// Passes on the events of the scene, and no events of its run.
struct Within<'r>(&'r dyn Reporter);

impl Reporter for Within<'_> {
    fn event(&self, event: &Event) {
        use Event::{Attempt, Image, Message, Scene, Stages, Working};
        if let Image { .. } | Scene { .. } | Attempt { .. } | Message(_) | Working { .. } | Stages { .. } = event {
            self.0.event(event);
        }
    }
}
