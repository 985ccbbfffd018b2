//! Decides, before any change, whether a run may continue a folder, which recipe the dataset then has, and the work to
//! do.

use crate::pools::AssetStore;
use crate::run::dataset::adoption::FirstScene;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Entries, Journal};
use crate::run::dataset::layout;
use crate::run::dataset::verify;
use crate::run::decisions::growth::{self, Growth};
use crate::run::decisions::inputs;
use crate::run::decisions::work_list::Todo;
use crate::run::options::RunOptions;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::run::scene_range::ranges;
use crate::run::shard::{Shard, WantedScenes};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::{Log, Steps, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;
use syntable_recipe::{CatalogNames, Lock, Recipe, lock_of, with_devices, with_lock};

/// A dataset that a run may begin or continue.
pub struct Begun<'a> {
    pub folder: Folder,
    pub journal: Journal,
    /// Recipe of the dataset once a scene is made: resolved, with the inputs locked so far.
    pub resolved: String,
    /// Growth of the dataset; `None` if the recipe replaces one that has made no scene.
    pub growth: Option<Growth>,
    pub todo: Todo,
    /// The pools, if they were needed or will be.
    pub assets: Option<AssetStore<'a>>,
    /// The first scene, if it was made before a dataset was overwritten.
    pub aside: Option<FirstScene>,
}

/// A run whose recipe and inputs were checked, before its folder is opened.
pub struct CheckedRun<'a, 'o> {
    recipe: &'a Recipe,
    options: &'o RunOptions,
    log: &'a dyn Log,
    devices: BTreeSet<String>,
    files: BTreeMap<String, String>,
    assets: Option<AssetStore<'a>>,
}

impl<'a, 'o> CheckedRun<'a, 'o> {
    /// Checks a recipe and its inputs: nothing is deleted or repaired for a run with missing or changed assets.
    pub fn new(recipe: &'a Recipe, options: &'o RunOptions, log: &'a dyn Log) -> Result<Self> {
        if let Some(table) = recipe.undecided.first() {
            return Err(Error::new(format!(
                "the kind of [{table}] is a placeholder for other kinds, and none was chosen"
            ))
            .help("name a kind, or load the recipe with `Overrides::for_run`"));
        }
        options.wanted(recipe.dataset.scenes)?;
        recipe.ready(options.allow_code)?;
        recipe.fits()?;
        let devices = inputs::devices(recipe)?;
        let files = recipe.input_digests(log)?;
        inputs::unchanged(&recipe.lock, &Lock { files: files.clone(), ..Lock::default() }, &BTreeMap::new(), None)?;
        let changes = options.overwrite || options.repair || options.rewrite;
        let assets = changes.then(|| open_pools(recipe, log)).transpose()?;
        Ok(Self { recipe, options, log, devices, files, assets })
    }

    /// Compares the dataset of a folder with the recipe and its inputs, and lists the work. After an error the dataset
    /// is unchanged, except for repairs.
    pub fn begin(
        self,
        folder: Folder,
        aside: Option<FirstScene>,
        workers: &dyn Workers,
        reporter: &dyn Reporter,
    ) -> Result<Begun<'a>> {
        let Self { recipe, options, log, devices, files, mut assets } = self;
        let mut journal = folder.journal()?;
        if let Some(assets) = assets.as_ref().filter(|_| options.repair)
            && restore_recipe(&folder, recipe, (&files, &devices), &journal, assets)?
        {
            reporter.event(&Event::Note { message: "recipe.toml was written again".to_owned() });
        }
        same_shard(&folder, options.shard, &journal)?;
        let (mut resolved, growth) = compare(&folder, recipe, files, &journal, options, reporter)?;
        if options.retry_failed || growth.is_none() {
            journal.forget_failed();
        }
        let damaged = if options.repair { repairs(&folder, &journal, workers, reporter)? } else { BTreeSet::new() };
        let wanted = options.wanted(recipe.dataset.scenes)?;
        let mut todo = Todo::of(recipe, &journal, growth.as_ref(), &wanted, damaged);
        if let Some(aside) = &aside {
            todo.scenes.remove(&aside.entry.scene);
        }
        for message in recipe.choices.iter().cloned().chain(inputs::emulated(recipe)?) {
            reporter.event(&Event::Note { message });
        }
        if aside.is_none() {
            let resumed = wanted.iter().filter(|scene| !todo.scenes.contains_key(scene)).count() as u32;
            reporter.event(&started(recipe, options, (&wanted, resumed), todo.images(recipe)));
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
        Ok(Begun { folder, journal, resolved, growth, todo, assets, aside })
    }
}

/// The first event of a run.
pub fn started(recipe: &Recipe, options: &RunOptions, (wanted, resumed): (&WantedScenes, u32), images: u64) -> Event {
    Event::Started {
        out: options.out.name().display().to_string(),
        scenes: wanted.count(),
        views_per_scene: recipe.dataset.views_per_scene,
        resumed,
        images,
        threads: options.threads,
    }
}

/// Refuses a shard in the folder of another shard or of a whole dataset, and a whole dataset in the folder of a shard.
fn same_shard(folder: &Folder, now: Option<Shard>, journal: &Journal) -> Result<()> {
    let then = folder.shard()?;
    if then == now || folder.is_empty(journal)? {
        return Ok(());
    }
    let text = |shard: Option<Shard>| shard.map_or_else(|| "no shard".to_owned(), |shard| format!("shard {shard}"));
    let message = format!("the folder has a dataset that is {}, and this run makes {}", text(then), text(now));
    let help = match then {
        Some(then) => format!("run with `options.shard` {then}, or choose another folder with `options.out`"),
        None => "run without `options.shard`, or choose another folder with `options.out`".to_owned(),
    };
    Err(Error::new(message).in_file(folder.name()).help(help).of_request())
}

/// Opens the folder of a run. Completes the work of an interrupted run, unless the run will overwrite the dataset.
pub fn open_folder(options: &RunOptions, reporter: &dyn Reporter) -> Result<Folder> {
    let (steps, mut opened) = (Steps::default(), None);
    steps.begin(format!("opening {}: a killed run may keep its lock for a while", options.out.name().display()));
    Warnings(reporter).during(&steps, &mut || opened = Some(Folder::open(&options.out)));
    recovered(opened.expect("the work was done")?, options, reporter)
}

/// Completes the work of an interrupted run in an open folder, unless the run will overwrite the dataset.
pub fn recovered(folder: Folder, options: &RunOptions, reporter: &dyn Reporter) -> Result<Folder> {
    folder.files().remove_all(&layout::first_scene())?;
    if options.repair {
        let lines = folder.mend_journal()?;
        if lines > 0 {
            let message = format!("removed {} of the journal as unreadable", count(lines as u32, "line"));
            reporter.event(&Event::Note { message });
        }
    }
    if !options.overwrite {
        folder.recover()?;
    }
    Ok(folder)
}

/// Writes the recipe of the folder again if it is lost and this recipe certainly equals it.
fn restore_recipe(
    folder: &Folder,
    recipe: &Recipe,
    (files, devices): (&BTreeMap<String, String>, &BTreeSet<String>),
    journal: &Journal,
    store: &AssetStore,
) -> Result<bool> {
    let names = store.catalogs();
    let assets = journal.entries().assets().clone();
    let lock = Lock { catalogs: inputs::catalogs(&names), files: files.clone(), assets, ..Lock::default() };
    folder.restore_recipe(&with_devices(&with_lock(&recipe.resolved, &lock), devices))
}

/// Opens the pools of a recipe for its steps. Their contents must match the resolved recipe.
fn open_pools<'a>(recipe: &'a Recipe, log: &'a dyn Log) -> Result<AssetStore<'a>> {
    let store = AssetStore::open_for_run(recipe, log)?;
    let names = store.catalogs();
    let now = Lock { catalogs: inputs::catalogs(&names), ..Lock::default() };
    let home = recipe.folder.as_deref().map(StoreFolder::from);
    inputs::unchanged(&recipe.lock, &now, &names, home.as_ref())?;
    Ok(store)
}

/// Compares the recipes of the folder and of the run, and the files in options. Returns the recipe with its locks, and
/// the growth of the dataset; `None` if the recipe replaces one that has made no scene.
fn compare(
    folder: &Folder,
    recipe: &Recipe,
    files: BTreeMap<String, String>,
    journal: &Journal,
    options: &RunOptions,
    reporter: &dyn Reporter,
) -> Result<(String, Option<Growth>)> {
    let now = Lock { files, ..Lock::default() };
    let first_recipe = || (with_lock(&recipe.resolved, &now), None);
    let none_made = folder.is_empty(journal)?;
    let before = match folder.recipe_of_scenes()? {
        Ok(before) => before,
        Err(_) if none_made => return Ok(first_recipe()),
        Err(what) => {
            let help = match options.repair {
                false => "restore the file, or run with its recipe and `options.repair`",
                true => {
                    "this recipe may differ from the dataset's recipe: restore recipe.toml, choose another folder \
                     with `options.out`, or replace the dataset with `options.overwrite`"
                }
            };
            return Err(Error::new(format!("the dataset {what}")).in_file(folder.name()).help(help));
        }
    };
    if none_made && !growth::differences(&before, &recipe.resolved).is_empty() {
        let message = "the recipe of the folder has made no scene, and is replaced".to_owned();
        reporter.event(&Event::Note { message });
        return Ok(first_recipe());
    }
    let growth = growth::growth(&folder.name(), &before, recipe, options.rewrite)?;
    let mut then = lock_of(&before);
    then.files.retain(|option, _| !growth::only_finish(recipe, option));
    inputs::unchanged(&Lock { files: then.files.clone(), ..Lock::default() }, &now, &BTreeMap::new(), None)?;
    if !growth.is_none() {
        reporter.event(&Event::Note { message: growth.text() });
    }
    // Locks of a resolved recipe stay.
    Ok((with_lock(&recipe.resolved, &Lock { files: now.files, ..then }), Some(growth)))
}

/// Compares the pools with their state when the dataset began. Returns the recipe with locked pools. Changes no file.
fn lock_pools(
    folder: &Folder,
    names: &BTreeMap<String, CatalogNames>,
    resolved: &str,
    entries: &Entries,
) -> Result<String> {
    let now = Lock { catalogs: inputs::catalogs(names), ..lock_of(resolved) };
    if !entries.is_empty() {
        inputs::unchanged(&lock_of(resolved), &now, names, Some(folder.files()))?;
    }
    Ok(with_lock(resolved, &now))
}

/// Scenes with missing or damaged files, or with lost journal lines.
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
        let message = format!("{lines} of the journal lost; making scenes {} again", ranges(lost.iter().copied()));
        reporter.event(&Event::Note { message });
    }
    let wrong = found.missing.len() + found.damaged.len();
    let message = match wrong {
        0 => format!("{} compared, all unchanged", count(found.files as u32, "file")),
        _ => format!(
            "{} missing, {} damaged; made again: {}",
            count(found.missing.len() as u32, "file"),
            found.damaged.len(),
            match found.bad_scenes.len() {
                0 => "files that a run writes at its end".to_owned(),
                scenes => count(scenes as u32, "scene"),
            }
        ),
    };
    reporter.event(&Event::Note { message });
    found.bad_scenes.extend(lost);
    Ok(found.bad_scenes)
}
