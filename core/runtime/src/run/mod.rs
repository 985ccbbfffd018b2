//! A run: scenes in parallel, each from placing to writing on one worker, its pixels spread over all threads.
//!
//! An image is a pure function of recipe, seed, scene and view: streams are named after stage, scene, attempt and
//! view, results do not depend on threads or order, and a scene's files appear together with its journal line.

pub mod folder;
pub mod journal;
pub mod progress;
mod scene;

use crate::cache::DiskCache;
use crate::plan::Plan;
use crate::pools::Library;
use crate::recipe::{Recipe, with_asset_digests};
use crate::workers::Pool;
use folder::Folder;
use journal::{Journal, SceneRecord};
use progress::{Event, Reporter, Warnings};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::Instant;
use syntable_model::error::{Error, Result};
use syntable_model::scene::SceneId;
use syntable_model::stage::{DatasetInfo, Finish, RenderSession};

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
pub fn run(recipe: &Recipe, plan: &Plan, options: &RunOptions, reporter: &dyn Reporter) -> Result<Outcome> {
    let start = Instant::now();
    let folder = Folder::open(&options.out, &recipe.resolved, options.overwrite)?;
    let mut journal = Journal::open(&folder.journal())?;
    if options.retry_failed {
        journal.forget_failed()?;
    }
    let wanted = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes);
    let todo: Vec<u32> = wanted.clone().filter(|scene| !journal.records().contains_key(scene)).collect();
    reporter.event(&Event::Started {
        out: options.out.display().to_string(),
        scenes: wanted.len() as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed: wanted.len() as u32 - todo.len() as u32,
        threads: options.threads,
    });
    let before: u32 = journal.records().values().map(|record| record.views).sum();
    let journal = Mutex::new(journal);
    if !todo.is_empty() {
        make_scenes(recipe, plan, options, reporter, &folder, &journal, &todo)?;
    }
    let outcome = finish(recipe, &folder, journal.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner()))?;
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
    plan: &Plan,
    options: &RunOptions,
    reporter: &dyn Reporter,
    folder: &Folder,
    journal: &Mutex<Journal>,
    todo: &[u32],
) -> Result<()> {
    let dataset = dataset_info(recipe);
    let log = Warnings(reporter);
    let library = Library::open(recipe, &log)?;
    let pool = Pool::new(options.threads)?;
    let workers = options.threads.min(todo.len()).max(1);
    let sessions = Sessions::open(recipe, workers)?;
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let failure: Mutex<Option<Error>> = Mutex::new(None);
    let maker = scene::Maker {
        recipe,
        plan,
        dataset: &dataset,
        library: &library,
        cache: &options.cache,
        workers: &pool,
        log: &log,
        reporter,
        folder,
    };
    scene::with_quiet_panics(|| {
        std::thread::scope(|threads| {
            for _ in 0..workers {
                threads.spawn(|| {
                    while !stop.load(Ordering::Relaxed) {
                        let Some(&scene) = todo.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                        let made = sessions
                            .with(|session| maker.make(SceneId(scene), session))
                            .and_then(|record| commit(folder, journal, record));
                        if let Err(error) = made {
                            stop.store(true, Ordering::Relaxed);
                            failure
                                .lock()
                                .unwrap_or_else(|poisoned| poisoned.into_inner())
                                .get_or_insert_with(|| stopping(error).context(format!("scene {scene}")));
                        }
                    }
                });
            }
        });
    });
    match failure.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner()) {
        None => Ok(()),
        Some(error) => Err(error),
    }
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
fn commit(folder: &Folder, journal: &Mutex<Journal>, record: SceneRecord) -> Result<()> {
    if record.failed() {
        folder.abandon(record.scene)?;
        journal.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).append(record)
    } else {
        folder.commit(record, journal)
    }
}

fn finish(recipe: &Recipe, folder: &Folder, mut journal: Journal) -> Result<Outcome> {
    let dataset = dataset_info(recipe);
    let done: Vec<SceneId> =
        journal.records().values().filter(|record| !record.failed()).map(|record| SceneId(record.scene)).collect();
    for (id, writer) in &recipe.write {
        writer
            .finish(&dataset, &Finish::new(folder.root(), id, done.clone()))
            .map_err(|error| error.context(format!("write.{id}")))?;
    }
    let assets: BTreeMap<String, String> =
        journal.records().values().flat_map(|record| record.assets.clone()).collect();
    folder.finish(&with_asset_digests(&recipe.resolved, &assets))?;
    journal.rewrite()?;
    let records = journal.records().values();
    Ok(Outcome {
        scenes: done.len() as u32,
        failed: records.clone().filter(|record| record.failed()).count() as u32,
        images: records.map(|record| record.views).sum(),
    })
}

fn dataset_info(recipe: &Recipe) -> DatasetInfo {
    DatasetInfo {
        name: recipe.dataset.name.clone(),
        seed: recipe.dataset.seed,
        scenes: recipe.dataset.scenes,
        views_per_scene: recipe.dataset.views_per_scene,
        recipe: folder::without_digests(&recipe.resolved).to_owned() + "\n",
        program: concat!("syntable ", env!("CARGO_PKG_VERSION")).to_owned(),
    }
}

/// Render sessions, lent to one scene at a time: as many as there are workers, or fewer if there are fewer devices.
struct Sessions {
    free: Mutex<Vec<Box<dyn RenderSession>>>,
    returned: Condvar,
}

impl Sessions {
    fn open(recipe: &Recipe, workers: usize) -> Result<Self> {
        let count = recipe.render.max_sessions().map_or(workers, |max| workers.min(max.max(1)));
        let sessions = (0..count)
            .map(|index| recipe.render.open(index).map_err(|error| error.context("render")))
            .collect::<Result<_>>()?;
        Ok(Self { free: Mutex::new(sessions), returned: Condvar::new() })
    }

    fn with<T>(&self, work: impl FnOnce(&mut dyn RenderSession) -> T) -> T {
        let free = || self.free.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let mut session = {
            let mut free = free();
            loop {
                match free.pop() {
                    Some(session) => break session,
                    None => free = self.returned.wait(free).unwrap_or_else(|poisoned| poisoned.into_inner()),
                }
            }
        };
        let result = work(&mut *session);
        free().push(session);
        self.returned.notify_one();
        result
    }
}
