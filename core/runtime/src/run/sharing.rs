//! A dataset that several workers make together, without a master.
//!
//! The first worker, or one that brings a larger recipe, writes the recipe while it has the dataset for itself. Then
//! workers share the dataset and claim blocks of scenes. When all scenes have lines, each worker waits until it has the
//! dataset for itself again; the first one ends the run, and the others find its end.

use crate::pools::AssetStore;
use crate::run::dataset::claims::{ClaimOptions, Claims};
use crate::run::dataset::ending::is_finished;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, SceneLine};
use crate::run::dataset::layout;
use crate::run::dataset::vanished::check_remains;
use crate::run::decisions::growth::Growth;
use crate::run::decisions::inputs;
use crate::run::decisions::opening::{self, Begun, CheckedRun};
use crate::run::making::scenes;
use crate::run::making::times::Times;
use crate::run::options::RunOptions;
use crate::run::outcome::RunOutcome;
use crate::run::progress::{Event, Guarded, Once, Quiet, Reporter, Warnings, count};
use crate::run::stop::{Stop, StopReason};
use crate::run::{finish, run_in};
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};
use syntable_model::unique::unique;
use syntable_recipe::{Recipe, lock_of};

/// Time between the first two attempts to get a dataset that others use, as a part of the time of a lease, and its limit.
const PAUSE: (u32, Duration) = (8, Duration::from_millis(250));
/// The same between later attempts.
const LONG_PAUSE: (u32, Duration) = (4, Duration::from_secs(5));
/// Time after which a worker says that it waits.
const PATIENCE: Duration = Duration::from_secs(3);

/// Makes scenes of a dataset beside other workers, until all are made and the run has ended.
pub fn run(recipe: &Recipe, options: &RunOptions, claim: ClaimOptions, reporter: &dyn Reporter) -> Result<RunOutcome> {
    check(options, claim)?;
    let start = Instant::now();
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let mut wait = Wait::new(reporter, &options.stop, claim.lease);
    let made = make(recipe, options, claim, (reporter, &mut wait))?;
    let alone = RunOptions {
        out: options.out.clone(),
        scenes: options.scenes.clone(),
        cache: options.cache.clone(),
        stop: options.stop.clone(),
        claim: None,
        ..*options
    };
    let end = End { reporter, made, start };
    let open = || {
        let folder = Folder::open_if_free(&options.out)?;
        folder.map(|folder| opening::recovered(folder, &alone, &end)).transpose()
    };
    loop {
        if let Some(outcome) = ended(recipe, options)? {
            end.event(&Event::Finished {
                out: options.out.name().display().to_string(),
                scenes: outcome.scenes,
                failed: outcome.failed,
                images: outcome.images,
                made: 0,
                grown: 0,
                seconds: 0.0,
            });
            return Ok(outcome);
        }
        check_remains(&options.out)?;
        if let Some(outcome) = run_in(recipe, &alone, &end, &Times::default(), &open)? {
            return Ok(outcome);
        }
        wait.pause("other workers make the last scenes or end the run; a suspended one must continue or be killed")?;
    }
}

/// Refuses options that change existing scenes, which other workers may be reading or writing.
fn check(options: &RunOptions, claim: ClaimOptions) -> Result<()> {
    let changes = [
        ("options.overwrite", options.overwrite),
        ("options.repair", options.repair),
        ("options.rewrite", options.rewrite),
        ("options.retry_failed", options.retry_failed),
        ("options.shard", options.shard.is_some()),
    ];
    if let Some((option, _)) = changes.into_iter().find(|(_, is_set)| *is_set) {
        return Err(Error::new(format!("`options.claim` and `{option}` exclude each other"))
            .help("run once without `options.claim`, then start the workers")
            .of_request());
    }
    if claim.block == 0 || claim.lease < Duration::from_millis(1) {
        return Err(Error::new("a claim has at least one scene, and lasts at least a millisecond").of_request());
    }
    Ok(())
}

/// Makes scenes that other workers do not make. Returns the number of images that this worker made.
fn make(
    recipe: &Recipe,
    options: &RunOptions,
    claim: ClaimOptions,
    (reporter, wait): (&dyn Reporter, &mut Wait),
) -> Result<u32> {
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    let worker = format!("{:016x}", unique());
    let Begun { folder, journal, todo, assets, .. } = share(recipe, options, &worker, (&pool, &log, wait))?;
    let Some(assets) = assets.filter(|_| !todo.scenes.is_empty()) else { return Ok(0) };
    let assets = assets.expect(journal.entries().assets().clone());
    let counted = Counted { reporter, images: AtomicU32::new(0) };
    let claims = Claims::new(folder.files(), &worker, claim, todo.scenes.keys().copied());
    let (journal, times) = (Mutex::new(journal), Times::default());
    let work = (&todo, Some(&claims));
    let made = scenes::make_scenes(recipe, options, &counted, &assets, (&pool, &times), (&folder, &journal), work);
    drop(claims);
    let dropped = folder.drop_parts();
    if let Err(error) = made {
        return Err(match options.stop.requested() {
            Some(reason) => stopped(recipe, options, reason).unwrap_or(error),
            // A store may also refuse to write where a worker's own files are gone.
            None => check_remains(&options.out).err().unwrap_or(error),
        });
    }
    dropped?;
    Ok(counted.images.into_inner())
}

/// The error of a worker that was asked to stop: it counts the scenes of all workers.
fn stopped(recipe: &Recipe, options: &RunOptions, reason: StopReason) -> Result<Error> {
    let wanted = options.wanted(recipe.dataset.scenes)?;
    let entries = Journal::entries_of(&options.out)?;
    let (failed, done): (Vec<_>, Vec<_>) =
        entries.iter().filter(|line| wanted.has(line.scene)).partition(SceneLine::failed);
    let failed = if failed.is_empty() { String::new() } else { format!(", {} failed", failed.len()) };
    let all = count(wanted.count(), "scene");
    Ok(Error::stopped(format!("stopped by {reason}: all workers together have done {} of {all}{failed}", done.len()))
        .help("the same command goes on from there"))
}

/// Opens the dataset beside other workers. Writes the recipe first, while no other worker has the dataset, if the dataset has
/// no recipe or a smaller one.
fn share<'a>(
    recipe: &'a Recipe,
    options: &RunOptions,
    worker: &str,
    (pool, log, wait): (&Pool, &'a Warnings, &mut Wait),
) -> Result<Begun<'a>> {
    let dataset = &options.out;
    // Files that placers read are read once, and their warnings must not get lost in the quiet check below.
    recipe.input_digests(log)?;
    // The recipe of the dataset that this one grows. Workers that share the dataset would keep each other from writing it.
    let mut smaller = None;
    loop {
        let present = dataset.read(&layout::recipe())?;
        if present.is_some()
            && present != smaller
            && let Some(folder) = Folder::open_shared(dataset, worker)?
        {
            let begun = CheckedRun::new(recipe, options, log)?.begin(folder, None, pool, log.0)?;
            if begun.growth.as_ref().is_some_and(Growth::is_none) {
                same_inputs(&begun, recipe)?;
                return Ok(begun);
            }
            smaller = present;
        }
        if let Some(folder) = Folder::open_if_free(dataset)? {
            let quiet = Quiet;
            let folder = opening::recovered(folder, options, log.0)?;
            let mut begun = CheckedRun::new(recipe, options, &quiet)?.begin(folder, None, pool, &quiet)?;
            if begun.todo.scenes.values().any(|job| job.present.is_some()) {
                let error = Error::new("the recipe adds files to existing scenes, which workers do not do together");
                return Err(error.in_file(dataset.name()).help("run once without `options.claim`").of_request());
            }
            if let Some(growth) = begun.growth.as_ref().filter(|growth| !growth.is_none()) {
                log.0.event(&Event::Note { message: growth.text() });
            }
            scenes::prepare(options, &mut begun)?;
            begun.folder.accept_recipe(&mut begun.journal)?;
            continue;
        }
        wait.pause("another run has the dataset for itself, or workers of its present recipe use it")?;
    }
}

/// Refuses pools and devices that differ from what the writer of the recipe had.
fn same_inputs(begun: &Begun, recipe: &Recipe) -> Result<()> {
    let Begun { folder, resolved, assets, .. } = begun;
    let (then, now) = (lock_of(&folder.recipe()?.unwrap_or_default()), lock_of(resolved));
    let names = assets.as_ref().map(AssetStore::catalogs).unwrap_or_default();
    inputs::unchanged(&then, &now, &names, Some(folder.files()))?;
    let devices = inputs::devices(recipe)?;
    if then.devices == devices || begun.todo.scenes.is_empty() {
        return Ok(());
    }
    let list = |names: &BTreeSet<String>| match names.is_empty() {
        true => "processors".to_owned(),
        false => names.iter().cloned().collect::<Vec<_>>().join(", "),
    };
    let message =
        format!("the workers of a dataset need equal devices: {} before, {} here", list(&then.devices), list(&devices));
    Err(Error::new(message)
        .in_file(folder.name())
        .help("their images may differ by rounding: choose workers with equal devices, or make shards, which `merge` joins with `options.mixed_devices`")
        .of_request())
}

/// The outcome of the dataset if another worker has ended the run.
fn ended(recipe: &Recipe, options: &RunOptions) -> Result<Option<RunOutcome>> {
    if !is_finished(&options.out)? {
        return Ok(None);
    }
    let entries = Journal::entries_of(&options.out)?;
    let has_all = options.wanted(recipe.dataset.scenes)?.iter().all(|scene| entries.contains(scene));
    Ok(has_all.then(|| finish::outcome_of(&entries)))
}

/// Pauses between attempts to get a dataset that others use.
struct Wait<'w> {
    reporter: &'w dyn Reporter,
    stop: &'w Stop,
    pause: Duration,
    longest: Duration,
    begin: Option<Instant>,
    is_said: bool,
}

impl<'w> Wait<'w> {
    fn new(reporter: &'w dyn Reporter, stop: &'w Stop, lease: Duration) -> Self {
        let [pause, longest] = [PAUSE, LONG_PAUSE].map(|(part, most)| (lease / part).min(most));
        Self { reporter, stop, pause, longest, begin: None, is_said: false }
    }

    /// Waits for a moment, each time a little longer. Says once why.
    fn pause(&mut self, why: &str) -> Result<()> {
        let now = Instant::now();
        let (begin, end) = (*self.begin.get_or_insert(now), now + self.pause);
        while Instant::now() < end {
            if let Some(reason) = self.stop.requested() {
                return Err(Error::stopped(format!("stopped by {reason} while waiting: {why}"))
                    .help("finished scenes are kept, and the same command continues"));
            }
            thread::sleep(PAUSE.1.min(end.saturating_duration_since(Instant::now())));
        }
        self.pause = (self.pause * 3 / 2).min(self.longest);
        if !self.is_said && begin.elapsed() >= PATIENCE {
            self.is_said = true;
            self.reporter.event(&Event::Note { message: format!("waiting: {why}") });
        }
        Ok(())
    }
}

/// Counts the images of this worker.
struct Counted<'r> {
    reporter: &'r dyn Reporter,
    images: AtomicU32,
}

impl Reporter for Counted<'_> {
    fn event(&self, event: &Event) {
        if let Event::Image { .. } = event {
            self.images.fetch_add(1, Ordering::Relaxed);
        }
        self.reporter.event(event);
    }
}

/// Shows the end of a run as the end of the work of this worker: its beginning was shown before.
struct End<'r> {
    reporter: &'r dyn Reporter,
    /// Number of images that this worker made before.
    made: u32,
    start: Instant,
}

impl Reporter for End<'_> {
    fn event(&self, event: &Event) {
        match event.clone() {
            Event::Started { .. } => {}
            Event::Finished { out, scenes, failed, images, made, grown, .. } => {
                let (made, seconds) = (made + self.made, self.start.elapsed().as_secs_f64());
                self.reporter.event(&Event::Finished { out, scenes, failed, images, made, grown, seconds });
            }
            event => self.reporter.event(&event),
        }
    }
}
