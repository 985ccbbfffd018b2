//! A run: several scenes in flight, each composed on a thread of its own, rendered when a session is free, and annotated
//! and written from a bounded queue while the next view is rendered.
//!
//! An image is a pure function of recipe, seed, scene and view: streams are named after stage, scene, attempt and
//! view, results do not depend on threads or order, and a scene's files appear together with its journal line.

pub mod folder;
pub mod journal;
pub(crate) mod panics;
pub mod progress;
mod queue;
mod records;
mod scene;
mod sessions;

use crate::cache::DiskCache;
use crate::plan::Producer;
use crate::pools::AssetStore;
use crate::recipe::{Recipe, with_asset_digests, without_asset_digests};
use crate::workers::Pool;
use folder::Folder;
use journal::{Journal, JournalEntry};
use parking_lot::Mutex;
use progress::{Event, Reporter, Warnings};
use queue::Queue;
use records::Records;
use scene::{lend, names};
use sessions::{Sessions, scenes_in_flight};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;
use syntable_model::context::DatasetContext;
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::scene::SceneId;
use syntable_model::stage::{DatasetInfo, Finish, FinishedFiles};

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
    /// Results kept between runs.
    pub cache: DiskCache,
}

/// What a run did.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Scenes in the dataset, failed ones not counted.
    pub scenes: u32,
    /// Scenes that failed.
    pub failed: u32,
    /// Images in the dataset.
    pub images: u32,
}

/// Runs a recipe. An error means that the run stopped early; what was done stays, and the same call goes on from there.
pub fn run(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<Outcome> {
    let start = Instant::now();
    recipe.plan.ready()?;
    let log = Warnings(reporter);
    // Nothing is deleted for a run whose assets cannot be found.
    let assets = options.overwrite.then(|| AssetStore::open(recipe, &log)).transpose()?;
    let folder = Folder::open(&options.out, &recipe.resolved, options.overwrite)?;
    let mut journal = Journal::open(&folder.journal())?;
    if options.retry_failed {
        journal.forget_failed()?;
    }
    let wanted = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes);
    let todo: Vec<u32> = wanted.clone().filter(|scene| !journal.entries().contains_key(scene)).collect();
    reporter.event(&Event::Started {
        out: options.out.display().to_string(),
        scenes: wanted.len() as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed: wanted.len() as u32 - todo.len() as u32,
        threads: options.threads,
    });
    let before: u32 = journal.entries().values().map(JournalEntry::views).sum();
    let journal = Mutex::new(journal);
    let pool = Pool::new(options.threads)?;
    if !todo.is_empty() {
        let assets = assets.map_or_else(|| AssetStore::open(recipe, &log), Ok)?;
        make_scenes(recipe, options, reporter, &assets, &pool, (&folder, &journal), &todo)?;
    }
    let outcome = finish(recipe, reporter, &pool, &folder, journal.into_inner())?;
    reporter.event(&Event::Finished {
        out: options.out.display().to_string(),
        scenes: outcome.scenes,
        failed: outcome.failed,
        images: outcome.images,
        made: outcome.images - before,
        seconds: start.elapsed().as_secs_f64(),
    });
    Ok(outcome)
}

fn make_scenes(
    recipe: &Recipe,
    options: &RunOptions,
    reporter: &dyn Reporter,
    assets: &AssetStore,
    pool: &Pool,
    (folder, journal): (&Folder, &Mutex<Journal>),
    todo: &[u32],
) -> Result<()> {
    let dataset = dataset_info(recipe);
    let log = Warnings(reporter);
    let in_flight = scenes_in_flight(recipe, options.threads, todo.len());
    let sessions = Sessions::open(&*recipe.render, in_flight)?;
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let failure: Mutex<Option<Error>> = Mutex::new(None);
    let maker = scene::SceneMaker {
        recipe,
        dataset: &dataset,
        assets,
        cache: &options.cache,
        workers: pool,
        log: &log,
        reporter,
        folder,
        sessions: &sessions,
    };
    panics::quiet(|| {
        std::thread::scope(|threads| {
            let queue = Queue::start(threads, options.threads);
            for _ in 0..in_flight {
                let queue = queue.clone();
                let (maker, next, stop, failure) = (&maker, &next, &stop, &failure);
                threads.spawn(move || {
                    while !stop.load(Ordering::Relaxed) {
                        let Some(&scene) = todo.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                        let made = maker.make(SceneId(scene), &queue);
                        if let Err(error) = made.and_then(|entry| commit(folder, journal, entry)) {
                            stop.store(true, Ordering::Relaxed);
                            let error = stopping(error).context(format!("scene {scene}"));
                            failure.lock().get_or_insert(error);
                        }
                    }
                });
            }
        });
    });
    failure.into_inner().map_or(Ok(()), Err)
}

/// An error that ends the run. One of the file system can be mended from outside.
fn stopping(error: Error) -> Error {
    if error.is_io() {
        error.help("the dataset so far is whole: make room or mend the folder, then run the same command")
    } else {
        error
    }
}

/// A failed scene leaves a line in the journal and no file.
fn commit(folder: &Folder, journal: &Mutex<Journal>, entry: JournalEntry) -> Result<()> {
    if entry.failed() {
        folder.abandon(entry.scene)?;
        journal.lock().append(entry)
    } else {
        folder.commit(entry, journal)
    }
}

/// Annotates the dataset and lets every writer finish; the first error is reported when all had their turn.
fn finish(
    recipe: &Recipe,
    reporter: &dyn Reporter,
    pool: &Pool,
    folder: &Folder,
    mut journal: Journal,
) -> Result<Outcome> {
    let (dataset, log) = (dataset_info(recipe), Warnings(reporter));
    let cx = DatasetContext::new(&dataset, pool, &log);
    let done: Vec<SceneId> =
        journal.entries().values().filter(|entry| !entry.failed()).map(|entry| SceneId(entry.scene)).collect();
    let products = panics::quiet(|| annotate_dataset(recipe, &cx, folder, &done))?;
    let mut finished = Ok(());
    let written = FinishedFiles::default();
    for (id, writer) in &recipe.write {
        let stage = format!("write.{id}");
        let finish = Finish::new(folder.root(), id, done.clone()).beside(Arc::clone(&written));
        let read = products.only(&names(&writer.reads()));
        finished = finished.and(panics::quiet(|| panics::caught(&stage, || writer.finish(&cx, &read, &finish))));
    }
    finished?;
    let assets: BTreeMap<String, String> = journal.entries().values().flat_map(|entry| entry.assets.clone()).collect();
    folder.finish(&with_asset_digests(&recipe.resolved, &assets))?;
    journal.rewrite()?;
    let entries = journal.entries().values();
    Ok(Outcome {
        scenes: done.len() as u32,
        failed: entries.clone().filter(|entry| entry.failed()).count() as u32,
        images: entries.map(JournalEntry::views).sum(),
    })
}

/// Runs the annotators of the dataset on the records of the scenes that are done.
fn annotate_dataset(recipe: &Recipe, cx: &DatasetContext, folder: &Folder, done: &[SceneId]) -> Result<Products> {
    let mut products = Products::new();
    for stage in &recipe.plan.per_dataset {
        let Producer::Dataset(annotator) = &stage.producer else { unreachable!("the plan sorts producers by scope") };
        let mut scenes = done.iter().map(|&scene| Records::read(folder.root(), scene));
        let made = lend(stage, &products, |lent| annotator.annotate(cx, &mut scenes, lent))?;
        products.extend(made)?;
    }
    Ok(products)
}

fn dataset_info(recipe: &Recipe) -> DatasetInfo {
    DatasetInfo {
        name: recipe.dataset.name.clone(),
        seed: recipe.dataset.seed,
        scenes: recipe.dataset.scenes,
        views_per_scene: recipe.dataset.views_per_scene,
        recipe: without_asset_digests(&recipe.resolved),
        program: concat!("syntable ", env!("CARGO_PKG_VERSION")).to_owned(),
    }
}
