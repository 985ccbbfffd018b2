//! The first scene of a dataset that will replace an existing dataset. It is made before the old dataset is deleted,
//! because some mistakes of a recipe show only then.

use crate::run::dataset::adoption::FirstScene;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::JournalEntry;
use crate::run::dataset::layout;
use crate::run::decisions::opening::{self, CheckedRun};
use crate::run::making::scenes;
use crate::run::making::times::Times;
use crate::run::options::RunOptions;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::workers::Pool;
use std::path::PathBuf;
use syntable_model::error::{Error, Result};
use syntable_recipe::Recipe;

/// Makes the first scene of a run that overwrites a dataset, and deletes the dataset. Returns the scene if the old
/// dataset had scenes.
///
/// # Errors
/// If the scene fails. The old dataset then stays.
pub fn replace(
    recipe: &Recipe,
    options: &RunOptions,
    folder: &Folder,
    reporter: &dyn Reporter,
) -> Result<Option<FirstScene>> {
    let wanted = options.wanted(recipe.dataset.scenes)?;
    let first = if folder.has_scenes()? { wanted.iter().next() } else { None };
    let aside = first.map(|first| {
        let images = u64::from(wanted.count()) * u64::from(recipe.dataset.views_per_scene);
        reporter.event(&opening::started(recipe, options, (&wanted, 0), images));
        make(recipe, options, first, folder, reporter)
    });
    let aside = aside.transpose()?;
    tell_foreign(reporter, &folder.discard()?);
    Ok(aside)
}

/// Makes the first scene of a run in its own folder.
fn make(
    recipe: &Recipe,
    options: &RunOptions,
    first: u32,
    folder: &Folder,
    reporter: &dyn Reporter,
) -> Result<FirstScene> {
    let message = "the old dataset is deleted when the first scene of the new one is made".to_owned();
    reporter.event(&Event::Note { message });
    let ahead = layout::first_scene();
    let aside = RunOptions {
        scenes: Some(first..first + 1),
        allow_code: options.allow_code,
        stop: options.stop.clone(),
        ..RunOptions::new(folder.files().inner(&ahead), options.threads, options.cache.clone())
    };
    folder.files().remove_all(&ahead)?;
    let (pool, within) = (Pool::new(options.threads)?, Within(reporter));
    let log = Warnings(&within);
    let begin = || {
        let checked = CheckedRun::new(recipe, &aside, &log)?;
        checked.begin(opening::open_folder(&aside, &within)?, None, &pool, &within)
    };
    let made = begin()
        .and_then(|begun| scenes::make(recipe, &aside, (&pool, &Times::default()), &within, begun))
        .and_then(|made| {
            let entries = made.journal.entries();
            let line = entries.get(first).filter(|line| !line.failed());
            let entry = line.map(|line| JournalEntry { assets: entries.assets().clone(), ..line.entry() });
            let failed = || format!("scene {first} failed in {}", count(recipe.dataset.max_attempts, "attempt"));
            entry.map(|entry| FirstScene { folder: made.folder, entry }).ok_or_else(|| Error::new(failed()))
        });
    match made {
        Ok(ahead) => Ok(ahead),
        Err(error) => {
            folder.files().remove_all(&ahead)?;
            let stays = "the old dataset stays as it was";
            if let Some(reason) = options.stop.requested() {
                let message = format!("stopped by {reason} before the first scene of the new dataset was made");
                return Err(Error::stopped(message).help(format!("{stays}; the same command begins again")));
            }
            let help = error.help_text().map_or_else(|| stays.to_owned(), |help| format!("{stays}; {help}"));
            Err(error.help(help))
        }
    }
}

fn tell_foreign(reporter: &dyn Reporter, left: &[PathBuf]) {
    if let Some(first) = left.first() {
        let files = count(left.len() as u32, "file");
        let message = format!(
            "{files} in the folder, such as {}, stay because no manifest of the dataset lists them",
            first.display()
        );
        reporter.event(&Event::Note { message });
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
