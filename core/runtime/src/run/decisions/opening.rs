//! Before anything changes: whether a run may go on with the folder, which recipe the dataset has then, and what there is
//! to do.

use crate::pools::AssetStore;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::layout;
use crate::run::dataset::verify;
use crate::run::decisions::growth::{self, Growth};
use crate::run::decisions::inputs;
use crate::run::decisions::work_list::Todo;
use crate::run::making::first_scene::{self, Ahead};
use crate::run::progress::{Event, Reporter, count};
use crate::run::{RunOptions, ranges};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_model::context::{Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;
use syntable_recipe::{CatalogNames, Lock, Recipe, lock_of, with_devices, with_lock};

/// A dataset that a run may begin or go on with.
pub struct Begun<'a> {
    pub folder: Folder,
    pub journal: Journal,
    /// The recipe that it has once a scene is made: resolved, with the inputs that are locked so far.
    pub resolved: String,
    /// How it grows; none if the recipe takes the place of one by which no scene was made.
    pub growth: Option<Growth>,
    pub todo: Todo,
    /// The pools, if they were needed or will be.
    pub assets: Option<AssetStore<'a>>,
    /// The first scene, if it was made aside.
    pub ahead: Option<Ahead>,
}

/// Opens the folder of a run, repaired or emptied as the options ask, and compares all that was there before with all that
/// is now. An error leaves the dataset as it was, but for what was repaired.
pub fn begin<'a>(
    recipe: &'a Recipe,
    options: &RunOptions,
    workers: &dyn Workers,
    reporter: &dyn Reporter,
    log: &'a dyn Log,
) -> Result<Begun<'a>> {
    if let Some(table) = recipe.undecided.first() {
        return Err(Error::new(format!("the kind of [{table}] stands for others, and none was chosen"))
            .help("name a kind, or load the recipe with `Overrides::for_run`"));
    }
    recipe.ready()?;
    recipe.fits()?;
    let devices = inputs::devices(recipe)?;
    let files = recipe.file_digests()?;
    inputs::unchanged(&recipe.lock, &Lock { files: files.clone(), ..Lock::default() }, &BTreeMap::new(), None)?;
    // Nothing is deleted or repaired for a run whose assets cannot be found, or are not those that the recipe was resolved with.
    let first = options.overwrite || options.repair || options.rewrite;
    let mut assets = first.then(|| open_pools(recipe, log)).transpose()?;
    let (folder, ahead) = open_folder(recipe, options, reporter)?;
    let mut journal = folder.journal()?;
    if let Some(assets) = assets.as_ref().filter(|_| options.repair)
        && restore_recipe(&folder, recipe, (&files, &devices), &journal, assets)?
    {
        reporter.event(&Event::Note { message: "recipe.toml was written again".to_owned() });
    }
    let (mut resolved, growth) = compare(&folder, recipe, files, &journal, options, reporter)?;
    if options.retry_failed || growth.is_none() {
        journal.forget_failed();
    }
    let damaged = if options.repair { repairs(&folder, &journal, workers, reporter)? } else { BTreeSet::new() };
    let wanted = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes);
    let mut todo = Todo::of(recipe, &journal, growth.as_ref(), wanted.clone(), damaged);
    if let Some(ahead) = &ahead {
        todo.scenes.remove(&ahead.entry.scene);
    }
    for message in recipe.choices.iter().cloned().chain(inputs::emulated(recipe)?) {
        reporter.event(&Event::Note { message });
    }
    if ahead.is_none() {
        let resumed = wanted.clone().filter(|scene| !todo.scenes.contains_key(scene)).count() as u32;
        reporter.event(&started(recipe, options, resumed, todo.images(recipe)));
    }
    if !todo.scenes.is_empty() && assets.is_none() {
        assets = Some(open_pools(recipe, log)?);
    }
    if let Some(store) = &assets {
        resolved = lock_pools(&folder, &store.catalogs(), &resolved, journal.entries())?;
    }
    if !todo.scenes.is_empty() {
        let before = if journal.entries().is_empty() { BTreeSet::new() } else { lock_of(&resolved).devices };
        inputs::tell_of_devices([&recipe.lock.devices, &before], &devices, log);
        resolved = with_devices(&resolved, &before.union(&devices).cloned().collect());
    }
    Ok(Begun { folder, journal, resolved, growth, todo, assets, ahead })
}

/// The first event of a run.
fn started(recipe: &Recipe, options: &RunOptions, resumed: u32, images: u64) -> Event {
    Event::Started {
        out: options.out.name().display().to_string(),
        scenes: options.scenes.clone().unwrap_or(0..recipe.dataset.scenes).len() as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed,
        images,
        threads: options.threads,
    }
}

/// Opens the folder, and does to it what the options ask. A dataset that is overwritten is deleted once the first scene of
/// the new one is made.
fn open_folder(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<(Folder, Option<Ahead>)> {
    let folder = Folder::open(&options.out)?;
    folder.files().remove_all(&layout::ahead())?;
    if options.repair {
        let lines = folder.mend_journal()?;
        if lines > 0 {
            let message = format!("{} of the journal cannot be read, and taken out", count(lines as u32, "line"));
            reporter.event(&Event::Note { message });
        }
    }
    if !options.overwrite {
        folder.recover()?;
        return Ok((folder, None));
    }
    let ahead = folder.has_scenes()?.then(|| {
        let scenes = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes).len() as u64;
        reporter.event(&started(recipe, options, 0, scenes * u64::from(recipe.dataset.views_per_scene)));
        first_scene::make(recipe, options, &folder, reporter)
    });
    let ahead = ahead.transpose()?;
    tell_foreign(reporter, &folder.discard()?);
    Ok((folder, ahead))
}

fn tell_foreign(reporter: &dyn Reporter, left: &[PathBuf]) {
    if let Some(first) = left.first() {
        let files = count(left.len() as u32, "file");
        let message =
            format!("{files} in the folder, such as {}, stay: no manifest of the dataset lists them", first.display());
        reporter.event(&Event::Note { message });
    }
}

/// Writes the recipe of the folder again if it is lost, and this is certainly the one.
fn restore_recipe(
    folder: &Folder,
    recipe: &Recipe,
    (files, devices): (&BTreeMap<String, String>, &BTreeSet<String>),
    journal: &Journal,
    store: &AssetStore,
) -> Result<bool> {
    let names = store.catalogs();
    let assets = journal.entries().values().flat_map(|entry| entry.assets.clone()).collect();
    let lock = Lock { catalogs: inputs::catalogs(&names), files: files.clone(), assets, ..Lock::default() };
    folder.restore_recipe(&with_devices(&with_lock(&recipe.resolved, &lock), devices))
}

/// Opens the pools of a recipe, which must offer what they offered when the recipe was resolved.
fn open_pools<'a>(recipe: &'a Recipe, log: &'a dyn Log) -> Result<AssetStore<'a>> {
    let store = AssetStore::open(recipe, log)?;
    let names = store.catalogs();
    let now = Lock { catalogs: inputs::catalogs(&names), ..Lock::default() };
    let home = recipe.folder.as_deref().map(StoreFolder::from);
    inputs::unchanged(&recipe.lock, &now, &names, home.as_ref())?;
    Ok(store)
}

/// Compares the recipe of the folder with that of the run, and the files that options name. Returns the recipe with what is
/// locked, and how the dataset grows; none if the recipe takes the place of one by which no scene was made.
fn compare(
    folder: &Folder,
    recipe: &Recipe,
    files: BTreeMap<String, String>,
    journal: &Journal,
    options: &RunOptions,
    reporter: &dyn Reporter,
) -> Result<(String, Option<Growth>)> {
    let now = Lock { files, ..Lock::default() };
    let anew = || (with_lock(&recipe.resolved, &now), None);
    let none_made = folder.is_empty(journal)?;
    let before = match folder.recipe_of_scenes()? {
        Ok(before) => before,
        Err(_) if none_made => return Ok(anew()),
        Err(what) => {
            let help = match options.repair {
                false => "bring it back, or run with its recipe and --repair",
                true => {
                    "this recipe is not certainly the one that it was begun with: bring recipe.toml back, choose another folder \
                     with --out, or begin anew with --overwrite"
                }
            };
            return Err(Error::new(format!("the dataset {what}")).in_file(folder.name()).help(help));
        }
    };
    if none_made && !growth::differences(&before, &recipe.resolved).is_empty() {
        let message = "no scene was made by the recipe of the folder; it is replaced".to_owned();
        reporter.event(&Event::Note { message });
        return Ok(anew());
    }
    let growth = growth::growth(&folder.name(), &before, recipe, options.rewrite)?;
    let mut then = lock_of(&before);
    then.files.retain(|option, _| !growth::only_finish(recipe, option));
    inputs::unchanged(&Lock { files: then.files.clone(), ..Lock::default() }, &now, &BTreeMap::new(), None)?;
    if !growth.is_none() {
        reporter.event(&Event::Note { message: growth.text() });
    }
    // What a resolved recipe locks stays locked.
    Ok((with_lock(&recipe.resolved, &Lock { files: now.files, ..then }), Some(growth)))
}

/// Compares what the pools offer with what they offered when the dataset was begun. Returns the recipe with that locked,
/// and changes nothing.
fn lock_pools(
    folder: &Folder,
    names: &BTreeMap<String, CatalogNames>,
    resolved: &str,
    entries: &BTreeMap<u32, JournalEntry>,
) -> Result<String> {
    let now = Lock { catalogs: inputs::catalogs(names), ..lock_of(resolved) };
    if !entries.is_empty() {
        inputs::unchanged(&lock_of(resolved), &now, names, Some(folder.files()))?;
    }
    Ok(with_lock(resolved, &now))
}

/// Scenes whose files are missing or damaged, or whose lines of the journal are lost.
fn repairs(
    folder: &Folder,
    journal: &Journal,
    workers: &dyn Workers,
    reporter: &dyn Reporter,
) -> Result<BTreeSet<u32>> {
    let mut found = verify::compare(folder.files(), workers)?;
    let lost = folder.without_line(journal)?;
    if !lost.is_empty() {
        let lines = count(lost.len() as u32, "line");
        let message = format!("{lines} of the journal lost; made again: scenes {}", ranges(lost.iter().copied()));
        reporter.event(&Event::Note { message });
    }
    let wrong = found.missing.len() + found.damaged.len();
    let message = match wrong {
        0 => format!("{} compared, all as they were written", count(found.files as u32, "file")),
        _ => format!(
            "{} missing, {} damaged; made again: {}",
            count(found.missing.len() as u32, "file"),
            found.damaged.len(),
            match found.bad_scenes.len() {
                0 => "what the end of a run writes".to_owned(),
                scenes => count(scenes as u32, "scene"),
            }
        ),
    };
    reporter.event(&Event::Note { message });
    found.bad_scenes.extend(lost);
    Ok(found.bad_scenes)
}
