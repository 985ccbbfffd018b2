//! A run: several scenes in flight, each composed on a thread of its own, rendered when a session is free, and annotated
//! and written from a bounded queue while the next view is rendered.
//!
//! An image is a pure function of recipe, seed, scene and view: streams are named after stage, scene, attempt and
//! view, results do not depend on threads or order, and a scene's files appear together with its journal line.
//!
//! | module | does |
//! |---|---|
//! | [`folder`], [`journal`], `manifest` | the data model of a dataset on disk |
//! | `change`, `inputs` | whether a run goes on with a dataset, lets it grow, or must not touch it |
//! | `ahead`, `scene`, `sessions`, `queue`, `records`, `settled` | making scenes |
//! | [`verify`], `merge` | comparing a dataset with its journal; one dataset of several parts |

mod ahead;
mod change;
pub mod folder;
mod inputs;
pub mod journal;
mod manifest;
mod merge;
pub(crate) mod panics;
pub mod progress;
mod queue;
mod records;
mod scene;
mod seen;
mod sessions;
mod settled;
pub mod stop;
mod verify;

pub use merge::merge;
pub use verify::{Verified, verify};

use crate::cache::DiskCache;
use crate::plan::Producer;
use crate::pools::AssetStore;
use crate::recipe::{Lock, Recipe, lock_of, with_devices, with_lock, without_lock};
use crate::workers::Pool;
use folder::Folder;
use journal::{Journal, JournalEntry, Notice};
use parking_lot::Mutex;
use progress::{Event, Guarded, Once, Reporter, Warnings, count};
use queue::Queue;
use records::Records;
use scene::{Task, Work, lend, names};
use sessions::{Sessions, scenes_in_flight};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::time::Instant;
use stop::Stop;
use syntable_model::context::{DatasetContext, Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::scene::SceneId;
use syntable_model::stage::{DatasetInfo, Finish};

/// How to run a recipe.
pub struct RunOptions {
    /// The dataset's folder.
    pub out: PathBuf,
    /// Which of the recipe's scenes to make; all if not given.
    pub scenes: Option<Range<u32>>,
    /// Threads.
    pub threads: usize,
    /// Delete a dataset that is there.
    pub overwrite: bool,
    /// Try scenes again that failed in an earlier run.
    pub retry_failed: bool,
    /// Compare all files with the journal first, and make the scenes again whose files are missing or damaged.
    pub repair: bool,
    /// Write the files of writers anew that have other options than then, or annotators with other options, and take away
    /// those of writers that are there no more.
    pub rewrite: bool,
    /// Whether the run ends: annotates the dataset and lets the writers finish.
    pub ends: bool,
    /// Results kept between runs.
    pub cache: DiskCache,
    /// Asks the run to end early.
    pub stop: Stop,
}

impl RunOptions {
    /// All scenes into a folder, with as many threads.
    pub fn new(out: impl Into<PathBuf>, threads: usize, cache: DiskCache) -> Self {
        let (out, stop) = (out.into(), Stop::default());
        Self {
            out,
            scenes: None,
            threads,
            overwrite: false,
            retry_failed: false,
            repair: false,
            rewrite: false,
            ends: true,
            cache,
            stop,
        }
    }
}

/// What a run did.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Scenes in the dataset, failed ones not counted.
    pub scenes: u32,
    /// Scenes that failed.
    pub failed: u32,
    /// Scenes in the dataset that could not be given what a grown recipe adds, or could not be repaired: they are as they
    /// were.
    pub lacking: u32,
    /// Images in the dataset.
    pub images: u32,
}

/// Runs a recipe. An error means that the run stopped early; what was done stays, and the same call goes on from there.
pub fn run(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<Outcome> {
    let start = Instant::now();
    if let Some(table) = recipe.undecided.first() {
        return Err(Error::new(format!("the kind of [{table}] stands for others, and none was chosen"))
            .help("name a kind, or load the recipe with `Overrides::for_run`")
            .permanent());
    }
    recipe.ready()?;
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let log = Warnings(reporter);
    let devices = inputs::devices(recipe)?;
    let files = inputs::files(recipe)?;
    let now = Lock { files: files.clone(), ..Lock::default() };
    inputs::unchanged(&recipe.lock, &now, &BTreeMap::new(), None)?;
    // Nothing is deleted or repaired for a run whose assets cannot be found, or are not those that the recipe was resolved with.
    let mut assets =
        (options.overwrite || options.repair || options.rewrite).then(|| open_pools(recipe, &log)).transpose()?;
    let folder = Folder::open(&options.out)?;
    folder::remove(&folder.ahead())?;
    if options.repair {
        let lines = folder.mend_journal()?;
        if lines > 0 {
            let message = format!("{} of the journal cannot be read, and taken out", count(lines as u32, "line"));
            reporter.event(&Event::Note { message });
        }
    }
    let ahead = match options.overwrite && folder.has_scenes() {
        true => Some(ahead::make(recipe, options, &folder, reporter)?),
        false => None,
    };
    if options.overwrite {
        tell_foreign(reporter, &folder.discard()?);
    } else {
        folder.recover()?;
    }
    let mut journal = Journal::open(&folder.journal())?;
    let pool = Pool::new(options.threads)?;
    if let Some(assets) = assets.as_ref().filter(|_| options.repair)
        && restore_recipe(&folder, recipe, (&files, &devices), &journal, assets)?
    {
        reporter.event(&Event::Note { message: "recipe.toml was written again".to_owned() });
    }
    let Adopted { mut resolved, anew, adds, rewritten } = adopt(&folder, recipe, files, &journal, options, reporter)?;
    if !rewritten.is_empty() {
        if let Some(store) = &assets {
            lock_pools(&folder, &store.catalogs(), &resolved, journal.entries())?;
        }
        let entries: Vec<JournalEntry> = journal.entries().values().cloned().collect();
        let whole = Mutex::new(journal);
        entries.iter().try_for_each(|entry| folder.take_back(entry, &rewritten, &whole))?;
        journal = whole.into_inner();
    }
    if options.retry_failed || anew {
        journal.forget_failed();
    }
    let damaged = if options.repair { repairs(&folder, &journal, &pool, reporter)? } else { BTreeSet::new() };
    let wanted = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes);
    let mut todo = Todo::of(recipe, &journal, wanted.clone(), damaged, adds);
    if let Some(ahead) = &ahead {
        todo.scenes.remove(&ahead.entry.scene);
    }
    for message in recipe.choices.iter().cloned().chain(inputs::emulated(recipe)?) {
        reporter.event(&Event::Note { message });
    }
    reporter.event(&Event::Started {
        out: options.out.display().to_string(),
        scenes: wanted.len() as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed: wanted.filter(|scene| !todo.scenes.contains_key(scene)).count() as u32,
        images: todo.scenes.values().map(|job| u64::from(job.views(recipe))).sum(),
        threads: options.threads,
    });
    if !todo.scenes.is_empty() && assets.is_none() {
        assets = Some(open_pools(recipe, &log)?);
    }
    let names = assets.as_ref().map(AssetStore::catalogs);
    if let Some(names) = &names {
        resolved = lock_pools(&folder, names, &resolved, journal.entries())?;
    }
    if !todo.scenes.is_empty() {
        let before = if journal.entries().is_empty() { BTreeSet::new() } else { lock_of(&resolved).devices };
        inputs::tell_of_devices([&recipe.lock.devices, &before], &devices, &log);
        resolved = with_devices(&resolved, &before.union(&devices).cloned().collect());
    }
    // All is compared: from here on the dataset changes.
    if anew {
        journal.rewrite()?;
    }
    if let Some(names) = &names {
        folder.set_catalogs(names)?;
    }
    if folder.is_empty(&journal) {
        folder.set_recipe(&resolved)?;
    } else {
        folder.propose_recipe(&resolved)?;
    }
    let journal = Mutex::new(journal);
    let made_ahead = ahead.as_ref().map_or(0, |ahead| ahead.entry.views());
    ahead.map_or(Ok(()), |ahead| ahead.adopt(&folder, &journal))?;
    let mut lacking = 0;
    if let Some(store) = assets.filter(|_| !todo.scenes.is_empty()) {
        let drawn =
            journal.lock().entries().values().flat_map(|entry| entry.assets.clone()).collect::<BTreeMap<_, _>>();
        let made = make_scenes(recipe, options, reporter, &store.expect(drawn), &pool, (&folder, &journal), &todo);
        if made.is_err() {
            let _ = folder.drop_parts();
        }
        lacking = made?;
    }
    let journal = journal.into_inner();
    let whole = todo.scenes.iter().filter(|(_, job)| job.lacks.is_none()).map(|(scene, _)| scene);
    let whole = whole.filter_map(|scene| journal.entries().get(scene));
    let made = made_ahead + whole.map(JournalEntry::views).sum::<u32>();
    let changed =
        |(scene, job): &(&u32, &Job)| job.lacks.is_some() && journal.entries().get(scene) != job.present.as_ref();
    let grown = todo.scenes.iter().filter(changed).count() as u32;
    if !options.ends {
        return Ok(Outcome { scenes: 0, failed: 0, lacking, images: 0 });
    }
    let done = finish(recipe, reporter, &pool, &folder, journal, &resolved, options.repair).map_err(stopping)?;
    let outcome = Outcome { lacking, ..done };
    reporter.event(&Event::Finished {
        out: options.out.display().to_string(),
        scenes: outcome.scenes,
        failed: outcome.failed,
        images: outcome.images,
        made,
        grown,
        seconds: start.elapsed().as_secs_f64(),
    });
    Ok(outcome)
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
    inputs::unchanged(&recipe.lock, &now, &names, recipe.folder.as_deref())?;
    Ok(store)
}

/// The recipe of a run that may go on with a dataset.
struct Adopted {
    /// It with the inputs that are locked so far.
    resolved: String,
    /// Whether it replaces another recipe, by which no scene was made.
    anew: bool,
    /// Whether it adds stages to those of the dataset.
    adds: bool,
    /// Writers whose files of scenes that are done are taken away, since they have other options now, or none.
    rewritten: BTreeSet<String>,
}

/// Compares the recipe of the folder with that of the run, and the files that options name. Changes nothing.
fn adopt(
    folder: &Folder,
    recipe: &Recipe,
    files: BTreeMap<String, String>,
    journal: &Journal,
    options: &RunOptions,
    reporter: &dyn Reporter,
) -> Result<Adopted> {
    let now = Lock { files, ..Lock::default() };
    let anew =
        || Adopted { resolved: with_lock(&recipe.resolved, &now), anew: true, adds: false, rewritten: BTreeSet::new() };
    let none_made = folder.is_empty(journal);
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
            return Err(Error::new(format!("the dataset {what}")).in_file(folder.root()).help(help).permanent());
        }
    };
    if none_made && !change::differences(&before, &recipe.resolved).is_empty() {
        let message = "no scene was made by the recipe of the folder; it is replaced".to_owned();
        reporter.event(&Event::Note { message });
        return Ok(anew());
    }
    let growth = change::growth(folder.root(), &before, recipe, options.rewrite)?;
    let mut then = lock_of(&before);
    then.files.retain(|option, _| !change::only_finish(recipe, option));
    inputs::unchanged(&Lock { files: then.files.clone(), ..Lock::default() }, &now, &BTreeMap::new(), None)?;
    if !growth.is_none() {
        reporter.event(&Event::Note { message: growth.text() });
    }
    // What a resolved recipe locks stays locked.
    let resolved = with_lock(&recipe.resolved, &Lock { files: now.files, ..then });
    let rewritten = growth.rewritten.union(&growth.gone).cloned().collect();
    Ok(Adopted { resolved, anew: false, adds: growth.adds, rewritten })
}

/// Compares what the pools offer with what they offered when the dataset was begun. Returns the recipe with that locked,
/// and changes nothing.
fn lock_pools(
    folder: &Folder,
    names: &BTreeMap<String, BTreeMap<String, String>>,
    resolved: &str,
    entries: &BTreeMap<u32, JournalEntry>,
) -> Result<String> {
    let now = Lock { catalogs: inputs::catalogs(names), ..lock_of(resolved) };
    if !entries.is_empty() {
        inputs::unchanged(&lock_of(resolved), &now, names, Some(folder.root()))?;
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
    let mut found = verify::compare(folder.root(), workers)?;
    let lost = folder.without_line(journal);
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

/// Ascending numbers of scenes in words: `0..3, 7`, where `0..3` leaves out 3.
fn ranges(scenes: impl Iterator<Item = u32>) -> String {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for scene in scenes {
        match runs.last_mut() {
            Some(run) if run.end == scene => run.end += 1,
            _ => runs.push(scene..scene + 1),
        }
    }
    let text = |run: &Range<u32>| if run.len() == 1 { run.start.to_string() } else { format!("{run:?}") };
    runs.iter().map(text).collect::<Vec<_>>().join(", ")
}

/// What there is to do for each scene.
struct Todo {
    scenes: BTreeMap<u32, Job>,
    /// Whether the recipe adds stages to those by which scenes were made.
    adds: bool,
}

/// What there is to do for a scene.
struct Job {
    /// Its line of the journal, if it is in the dataset.
    present: Option<JournalEntry>,
    /// What it lacks.
    lacks: Lacks,
}

impl Job {
    /// A scene keeps its number of views when the dataset grows.
    fn views(&self, recipe: &Recipe) -> u32 {
        self.present.as_ref().map_or(recipe.dataset.views_per_scene, JournalEntry::views)
    }
}

impl Todo {
    fn of(recipe: &Recipe, journal: &Journal, wanted: Range<u32>, damaged: BTreeSet<u32>, adds: bool) -> Self {
        let recorded = records::names(&recipe.plan);
        let job = |scene: u32| {
            let Some(entry) = journal.entries().get(&scene) else { return Some(Job { present: None, lacks: None }) };
            let present = Some(entry.clone());
            if damaged.contains(&scene) {
                return Some(Job { present, lacks: None });
            }
            let has = |id: &String| entry.writers().contains(id);
            let lacks: Vec<String> = recipe.write.iter().map(|(id, _)| id).filter(|id| !has(id)).cloned().collect();
            let records = entry.recorded() != recorded;
            let done = entry.failed() || (lacks.is_empty() && !records);
            (!done).then_some(Job { present, lacks: Some((lacks, records)) })
        };
        Self {
            scenes: wanted.chain(damaged.iter().copied()).filter_map(|scene| Some((scene, job(scene)?))).collect(),
            adds,
        }
    }
}

/// What a scene lacks: ids of writers, and whether its products must be recorded anew; none if it is made as a whole.
type Lacks = Option<(Vec<String>, bool)>;

/// What is made of scenes: the whole, or what some lack; once for all scenes that are alike.
struct Works<'a> {
    recipe: &'a Recipe,
    works: BTreeMap<(u32, Lacks), Work<'a>>,
}

impl<'a> Works<'a> {
    fn new(recipe: &'a Recipe, todo: &Todo) -> Self {
        let mut all = Self { recipe, works: BTreeMap::new() };
        for job in todo.scenes.values() {
            for lacks in [None, job.lacks.clone()] {
                let views = job.views(recipe);
                all.works.entry((views, lacks.clone())).or_insert_with(|| work(recipe, views, lacks.as_ref()));
            }
        }
        all
    }

    fn task<'t>(&'t self, scene: u32, job: &'t Job) -> Task<'t> {
        let of = |lacks: &Lacks| &self.works[&(job.views(self.recipe), lacks.clone())];
        let extend = job.present.as_ref().filter(|_| job.lacks.is_some()).map(|present| (present, of(&job.lacks)));
        let is_present = job.present.as_ref().is_some_and(|present| !present.failed());
        Task { scene, is_present, whole: of(&None), extend }
    }
}

fn work<'a>(recipe: &'a Recipe, views: u32, lacks: Option<&(Vec<String>, bool)>) -> Work<'a> {
    let dataset = DatasetInfo { views_per_scene: views, ..dataset_info(recipe) };
    let Some((lacks, records)) = lacks else {
        return Work { dataset, plan: recipe.plan.clone().on(&*recipe.render), writers: recipe.write.iter().collect() };
    };
    let writers: Vec<_> = recipe.write.iter().filter(|(id, _)| lacks.contains(id)).collect();
    let reads: Vec<String> = writers.iter().flat_map(|(_, writer)| names(&writer.reads())).collect();
    let part = recipe.plan.part(reads.iter().map(String::as_str), *records);
    Work { dataset, plan: part.on(&*recipe.render), writers }
}

fn make_scenes(
    recipe: &Recipe,
    options: &RunOptions,
    reporter: &dyn Reporter,
    assets: &AssetStore,
    pool: &Pool,
    (folder, journal): (&Folder, &Mutex<Journal>),
    todo: &Todo,
) -> Result<u32> {
    let log = Warnings(reporter);
    let in_flight = scenes_in_flight(recipe, options.threads, todo.scenes.len());
    let works = Works::new(recipe, todo);
    let tasks: Vec<Task> = todo.scenes.iter().map(|(&scene, job)| works.task(scene, job)).collect();
    let sessions = Sessions::open(&*recipe.render, in_flight)?;
    let (next, made, lacking) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicU32::new(0));
    let (stop, tried) = (AtomicBool::new(false), AtomicBool::new(false));
    let failure: Mutex<Option<Error>> = Mutex::new(None);
    let odd = ToldOdd::default();
    // Scenes that failed before one was made by a recipe that adds stages: they may have failed by these.
    let held = Mutex::new(Vec::new());
    let maker = scene::SceneMaker {
        recipe,
        assets,
        cache: &options.cache,
        workers: pool,
        log: &log,
        reporter,
        folder,
        sessions: &sessions,
        stop: &options.stop,
    };
    let one = |task: &Task, made: Option<scene::Made>| -> Result<()> {
        let Some(made) = made else {
            lacking.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        };
        if made.entry.failed() && todo.adds && folder.is_proposed() {
            held.lock().push(made);
            return Ok(());
        }
        let entry = folder.commit(made.entry, made.kept, made.written, journal)?;
        tell_of_scene(todo, &entry, &odd, &log);
        // A mistake that shows at the end of a run shows after its first scene.
        if !entry.failed() && !tried.swap(true, Ordering::SeqCst) {
            let trial = folder.stage_trial()?;
            let Ended { writers, annotators } = end(recipe, &log, pool, folder, &[entry], &trial);
            folder.drop_trial()?;
            // An annotator of the dataset may need more scenes than one.
            if let Some(error) = annotators.filter(|error| error.is_permanent() || error.is_io()) {
                return Err(error);
            }
            if let Some((id, error)) = writers {
                let help = "nothing is lost: mend it, then run the same command";
                let error = if error.help_text().is_some() { error } else { error.help(help) };
                return Err(error
                    .context(format!("the end of the run, tried for write.{id} after scene {}", task.scene))
                    .permanent());
            }
        }
        Ok(())
    };
    panics::quiet(|| {
        std::thread::scope(|threads| {
            let queue = Queue::start(threads, options.threads);
            for _ in 0..in_flight {
                let queue = queue.clone();
                let (maker, tasks, next, made, stop, failure, one) =
                    (&maker, &tasks, &next, &made, &stop, &failure, &one);
                threads.spawn(move || {
                    while !stop.load(Ordering::Relaxed) && maker.stop.requested().is_none() {
                        let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                        match panics::unwound(|| maker.make(task, &queue).and_then(|made| one(task, made))) {
                            Ok(()) => drop(made.fetch_add(1, Ordering::Relaxed)),
                            Err(error) => {
                                stop.store(true, Ordering::Relaxed);
                                let error = stopping(error).context(format!("scene {}", task.scene));
                                failure.lock().get_or_insert(error);
                            }
                        }
                    }
                });
            }
        });
    });
    if let Some(signal) = options.stop.requested() {
        let (made, all) = (made.into_inner(), tasks.len());
        return Err(Error::new(format!("stopped by {}: {made} of {all} scenes are done", stop::name_of(signal)))
            .help("the same command goes on from there"));
    }
    failure.into_inner().map_or(Ok(()), Err)?;
    let (held, lacking) = (held.into_inner(), lacking.into_inner());
    let without = lacking + held.len() as u32;
    if without > 0 && todo.adds && folder.is_proposed() {
        let message =
            format!("{} could not be made with what the recipe adds; nothing was written", count(without, "scene"));
        return Err(Error::new(message)
            .in_file(folder.root())
            .help("the warnings above say why; mend the recipe, or leave out what it adds")
            .permanent());
    }
    for made in held {
        folder.commit(made.entry, made.kept, made.written, journal)?;
    }
    Ok(lacking)
}

/// What was told of scenes and of single views.
#[derive(Default)]
struct ToldOdd {
    scenes: Mutex<BTreeSet<Notice>>,
    views: Mutex<BTreeSet<Notice>>,
}

/// Tells what is odd about a scene, once of each sort, and whether a scene that was made again is what it was.
fn tell_of_scene(todo: &Todo, entry: &JournalEntry, odd: &ToldOdd, log: &dyn Log) {
    for &notice in &entry.notices {
        if odd.scenes.lock().insert(notice) {
            log.warn(&Error::new(notice.text()).help(notice.help()).context(format!("scene {}", entry.scene)));
        }
    }
    for (&notice, views) in entry.odd_views.iter().filter(|(notice, _)| !notice.may_be_meant()) {
        if odd.views.lock().insert(notice) {
            let of = format!("scene {}, view {}", entry.scene, views[0]);
            log.warn(&Error::new(notice.text_of_view()).help(notice.help_of_view()).context(of));
        }
    }
    let job = &todo.scenes[&entry.scene];
    if let Some(present) = job.present.as_ref().filter(|_| job.lacks.is_none())
        && present.writers() == entry.writers()
        && present.manifest() != entry.manifest()
    {
        log.warn(
            &Error::new("it was made again, and is not what it was")
                .help("the program, the machine or an option without reproducible images differs from then")
                .context(format!("scene {}", entry.scene)),
        );
    }
}

/// An error that ends the run. One of the file system or of a device can be mended from outside.
fn stopping(error: Error) -> Error {
    if error.is_io() && error.help_text().is_none() {
        error.help("the dataset so far is whole: make room, or mend the disk or folder, then run the same command")
    } else if error.is_device() {
        let own = error.help_text().map_or_else(String::new, |help| format!("; {help}"));
        error.help(format!("the dataset keeps all that it had, and the same command goes on from there{own}"))
    } else {
        error
    }
}

/// Annotates the dataset and lets every writer finish that can; an error is reported when all had their turn.
fn finish(
    recipe: &Recipe,
    reporter: &dyn Reporter,
    workers: &dyn Workers,
    folder: &Folder,
    mut journal: Journal,
    resolved: &str,
    repair: bool,
) -> Result<Outcome> {
    let log = &Warnings(reporter);
    let entries: Vec<JournalEntry> = journal.entries().values().cloned().collect();
    let made: Vec<JournalEntry> = entries.iter().filter(|entry| !entry.failed()).cloned().collect();
    check_shards(folder, workers, &made)?;
    let staged = folder.stage_finish()?;
    let Ended { writers, annotators } = end(recipe, log, workers, folder, &made, &staged);
    let failure = writers.map(|(_, error)| error).or(annotators);
    let assets = entries.iter().flat_map(|entry| entry.assets.clone()).collect();
    let resolved = with_lock(resolved, &Lock { assets, ..Lock::default() });
    let published = folder.publish_finish(&resolved, &mut journal, failure.is_none(), repair);
    failure.map_or(published, Err)?;
    tell_at_the_end(&made, reporter);
    Ok(Outcome {
        scenes: made.len() as u32,
        failed: (entries.len() - made.len()) as u32,
        lacking: 0,
        images: entries.iter().map(JournalEntry::views).sum(),
    })
}

/// Views like that are few if they are less than one in as many.
const FEW: u32 = 10;

/// Counts the scenes and the views that are odd. A few views that may be meant are no reason for a warning.
fn tell_at_the_end(made: &[JournalEntry], reporter: &dyn Reporter) {
    let log = Warnings(reporter);
    let all: u32 = made.iter().map(JournalEntry::views).sum();
    for notice in [Notice::Black, Notice::White, Notice::Unlit, Notice::Unlabeled] {
        let whole = || made.iter().filter(|entry| entry.notices.contains(&notice));
        let scenes = whole().count();
        if scenes > 0 {
            let of = format!("{scenes} of {}", count(made.len() as u32, "scene"));
            log.warn(&Error::new(notice.text()).help(notice.help()).context(of));
        }
        let some = || made.iter().filter_map(|entry| Some((entry.scene, entry.odd_views.get(&notice)?)));
        let Some((scene, &[view, ..])) = some().next().map(|(scene, views)| (scene, views.as_slice())) else {
            continue;
        };
        let views =
            whole().map(JournalEntry::views).sum::<u32>() + some().map(|(_, views)| views.len() as u32).sum::<u32>();
        let of = format!("{views} of {}, such as view {view} of scene {scene}", count(all, "view"));
        let warning = Error::new(notice.text_of_view()).help(notice.help_of_view()).context(of);
        if notice.may_be_meant() && views.saturating_mul(FEW) < all {
            reporter.event(&Event::Note { message: warning.to_string() });
        } else {
            log.warn(&warning);
        }
    }
}

/// Compares what the end of a run reads of the scenes with what was written: lines that are gone would be missed by nobody.
fn check_shards(folder: &Folder, workers: &dyn Workers, made: &[JournalEntry]) -> Result<()> {
    let failure = Mutex::new(None);
    workers.run(made.len(), &|index| {
        if let Err(error) = folder.check_shards(&made[index]) {
            failure.lock().get_or_insert(error);
        }
    });
    failure.into_inner().map_or(Ok(()), Err)
}

/// What went wrong at the end of a run.
struct Ended {
    /// The first writer that could not finish, and why.
    writers: Option<(String, Error)>,
    /// Why the first annotator of the dataset failed. Writers that read its products were not asked to finish.
    annotators: Option<Error>,
}

/// Annotates the dataset of some scenes and lets every writer finish into a staging folder whose products are there.
fn end(
    recipe: &Recipe,
    log: &dyn Log,
    workers: &dyn Workers,
    folder: &Folder,
    made: &[JournalEntry],
    staged: &Path,
) -> Ended {
    let dataset = dataset_info(recipe);
    let cx = DatasetContext::new(&dataset, workers, log);
    let recorded = records::names(&recipe.plan);
    let scenes = |has: &dyn Fn(&JournalEntry) -> bool| -> Vec<SceneId> {
        made.iter().filter(|entry| has(entry)).map(|entry| SceneId(entry.scene)).collect()
    };
    let of_dataset = scenes(&|entry| entry.recorded() == recorded);
    let (products, failed) = panics::quiet(|| annotate_dataset(recipe, &cx, folder, &of_dataset));
    let one = |(id, writer): &(String, Box<dyn syntable_model::stage::Writer>)| {
        let (stage, reads) = (format!("write.{id}"), names(&writer.reads()));
        if failed.iter().any(|(name, _)| reads.contains(name)) {
            return None;
        }
        let done = scenes(&|entry| entry.writers().contains(id));
        let finish = Finish::new(folder.root(), id, done).staged(staged);
        let read = products.only(&reads);
        let ended = panics::quiet(|| panics::caught(&stage, || writer.finish(&cx, &read, &finish)));
        ended.err().map(|error| (id.clone(), error))
    };
    // Every writer has its turn, whatever becomes of the others.
    let writers: Vec<(String, Error)> = recipe.write.iter().filter_map(one).collect();
    Ended { writers: writers.into_iter().next(), annotators: failed.into_iter().next().map(|(_, error)| error) }
}

/// Runs the annotators of the dataset on the records of the scenes that are done. Returns what they made, and in the order
/// of the plan the products that could not be made, each with the reason.
fn annotate_dataset(
    recipe: &Recipe,
    cx: &DatasetContext,
    folder: &Folder,
    done: &[SceneId],
) -> (Products, Vec<(String, Error)>) {
    let (mut products, mut failed) = (Products::new(), Vec::<(String, Error)>::new());
    for stage in &recipe.plan.per_dataset {
        let Producer::Dataset(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
        let mut scenes = done.iter().map(|&scene| Records::read(folder.root(), scene));
        let lacks = stage.reads.iter().find_map(|key| failed.iter().find(|(name, _)| key.name == **name));
        let made = match lacks {
            Some((_, error)) => Err(error.clone()),
            None => lend(stage, &products, |lent| annotator.annotate(cx, &mut scenes, lent)),
        };
        if let Err(error) = made.and_then(|made| products.extend(made)) {
            failed.extend(stage.provides.iter().map(|key| (key.name.to_string(), error.clone())));
        }
    }
    (products, failed)
}

/// What stages may know of the dataset of a recipe.
pub(crate) fn dataset_info(recipe: &Recipe) -> DatasetInfo {
    let classes: BTreeSet<&String> = recipe.assets.values().flat_map(|pool| pool.options.classes.keys()).collect();
    DatasetInfo {
        name: recipe.dataset.name.clone(),
        seed: recipe.dataset.seed,
        scenes: recipe.dataset.scenes,
        views_per_scene: recipe.dataset.views_per_scene,
        recipe: without_lock(&recipe.resolved),
        program: concat!("syntable ", env!("CARGO_PKG_VERSION")).to_owned(),
        classes: classes.into_iter().filter(|class| *class != DatasetInfo::OBJECT.1).cloned().collect(),
    }
}
