//! Making scenes: several in flight, each committed when it is finished.

use crate::pools::AssetStore;
use crate::run::dataset::claims::Claims;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Entries, Journal, JournalEntry, Notice};
use crate::run::decisions::growth::Growth;
use crate::run::decisions::inputs;
use crate::run::decisions::opening::Begun;
use crate::run::decisions::work_list::{Job, Task, Todo, Works};
use crate::run::finish::{Ended, annotate_and_finish};
use crate::run::making::attempt::Tools;
use crate::run::making::losses::DatasetLender;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::Recovery;
use crate::run::making::scene::{MadeScene, SceneMaker};
use crate::run::making::sessions::{AllSessions, scenes_in_flight};
use crate::run::making::times::{RunTimes, Times};
use crate::run::options::RunOptions;
use crate::run::outcome::stopping;
use crate::run::panics;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::workers::{Pool, Stoppable};
use parking_lot::Mutex;
use std::collections::BTreeSet;
use std::time::Instant;
use syntable_model::context::{DatasetContext, Log};
use syntable_model::error::{Error, Result};
use syntable_recipe::Recipe;

/// A dataset with the scenes that a run made.
pub struct MadeScenes {
    pub folder: Folder,
    pub journal: Journal,
    /// The resolved recipe with its lock.
    pub resolved: String,
    /// Number of new images.
    pub new: u32,
    /// Number of earlier scenes that were extended.
    pub grown: u32,
    /// Number of earlier scenes that stay as they were, because they could not be extended or repaired.
    pub lacking: u32,
    /// Anomalies of whole scenes that the run has reported with their remedies.
    pub told: BTreeSet<Notice>,
}

/// Gives the dataset the recipe of a run, or proposes it. From here on the dataset changes.
pub fn prepare(options: &RunOptions, begun: &mut Begun) -> Result<()> {
    let Begun { folder, journal, resolved, growth, assets, .. } = begun;
    folder.set_shard(options.shard)?;
    if growth.is_none() {
        journal.rewrite()?;
    }
    if let Some(store) = assets {
        folder.set_catalogs(&store.catalogs())?;
    }
    if folder.is_empty(journal)? {
        folder.set_recipe(resolved)
    } else {
        folder.propose_recipe(resolved, growth.as_ref().map(Growth::replaced).unwrap_or_default())
    }
}

/// Makes the scenes of a run.
pub fn make(
    recipe: &Recipe,
    options: &RunOptions,
    (pool, times): (&Pool, &Times),
    reporter: &dyn Reporter,
    mut begun: Begun,
) -> Result<MadeScenes> {
    prepare(options, &mut begun)?;
    let Begun { folder, journal, resolved, todo, assets, aside, .. } = begun;
    let journal = Mutex::new(journal);
    let made_aside = aside.as_ref().map_or(0, |aside| aside.entry.views());
    aside.map_or(Ok(()), |aside| aside.adopt(&folder, &journal))?;
    let (mut lacking, mut told) = (0, BTreeSet::new());
    if let Some(store) = assets.filter(|_| !todo.scenes.is_empty()) {
        let drawn = journal.lock().entries().assets().clone();
        let assets = &store.expect(drawn);
        let made = make_scenes(recipe, options, reporter, assets, (pool, times), (&folder, &journal), (&todo, None));
        if made.is_err() {
            let _ = folder.drop_parts();
        }
        (lacking, told) = made?;
    }
    // The dataset takes the recipe even without a scene to make.
    folder.accept_recipe(&mut journal.lock())?;
    let journal = journal.into_inner();
    let line_of = |scene: &u32| journal.entries().get(*scene);
    let whole = todo.scenes.iter().filter(|(_, job)| job.lacks.is_none());
    let new = made_aside + whole.filter_map(|(scene, _)| line_of(scene)).map(|line| line.views()).sum::<u32>();
    let changed = |(scene, job): &(&u32, &Job)| {
        job.lacks.is_some() && line_of(scene).map(|line| line.entry()).as_ref() != job.present.as_deref()
    };
    let grown = todo.scenes.iter().filter(changed).count() as u32;
    Ok(MadeScenes { folder, journal, resolved, new, grown, lacking, told })
}

/// Makes the scenes on the list of work, or those that `claims` gives. Returns the number of scenes that stay as they were,
/// and the reported anomalies of whole scenes.
pub fn make_scenes(
    recipe: &Recipe,
    options: &RunOptions,
    reporter: &dyn Reporter,
    assets: &AssetStore,
    (pool, times): (&Pool, &Times),
    (folder, journal): (&Folder, &Mutex<Journal>),
    (todo, claims): (&Todo, Option<&Claims>),
) -> Result<(u32, BTreeSet<Notice>)> {
    let (log, start) = (Warnings(reporter), Instant::now());
    let in_flight = scenes_in_flight(recipe, options.threads, todo.scenes.len());
    let in_flight = options.scenes_in_flight.map_or(in_flight, |most| in_flight.min(most.max(1)));
    let works = Works::new(recipe, todo);
    let tasks = todo.scenes.iter().map(|(&scene, job)| works.task(scene, job)).collect();
    let sessions = AllSessions::open(recipe, Some(todo.scenes.keys().copied()), in_flight)?;
    let cache = &options.cache;
    let workers = &Stoppable { workers: pool, stop: &options.stop };
    let tools = Tools { recipe, assets, cache, workers, log: &log, times, stop: &options.stop };
    let maker = SceneMaker { tools, reporter, folder, sessions: &sessions, checks: &recipe.checks };
    let (notices, progress) = (ReportedNotices::default(), Mutex::default());
    let work = SceneWork { maker, tasks, todo, claims, journal, notices, progress };
    panics::quiet(|| {
        std::thread::scope(|threads| {
            let queue = Queue::start(threads, options.threads);
            for _ in 0..in_flight {
                let (work, queue) = (&work, queue.clone());
                threads.spawn(move || while work.next(&queue) {});
            }
        });
    });
    reporter.event(&Event::Stages { stages: times.all() });
    let devices = inputs::devices_of(recipe, |_| true).unwrap_or_default();
    let devices = devices.into_iter().map(|device| device.name).collect();
    let took = RunTimes {
        scenes: work.progress.lock().made,
        threads: options.threads,
        devices,
        seconds: start.elapsed().as_secs_f64(),
        stages: times.all(),
    };
    work.conclude(took.append(folder.files()))
}

/// The scenes of a run, which several threads make.
struct SceneWork<'w> {
    maker: SceneMaker<'w>,
    tasks: Vec<Task<'w>>,
    todo: &'w Todo,
    claims: Option<&'w Claims>,
    journal: &'w Mutex<Journal>,
    notices: ReportedNotices,
    progress: Mutex<SceneProgress>,
}

/// The state of the scenes of a run.
#[derive(Default)]
struct SceneProgress {
    /// Number of tasks that a thread took.
    taken: usize,
    /// Number of finished tasks.
    made: u32,
    /// Number of scenes that stay as they were.
    lacking: u32,
    /// Failed scenes before the first success of a recipe that adds stages. The new stages may be the cause.
    held: Vec<MadeScene>,
    /// Whether a scene has rehearsed the end of the run.
    is_rehearsed: bool,
    /// The first error. No further scene begins after it.
    failure: Option<Error>,
}

impl SceneWork<'_> {
    /// Makes the next scene, or the next claimed block of scenes. Returns `false` if no scene is left, or if the run ends.
    fn next<'env>(&'env self, queue: &Queue<'env>) -> bool {
        if self.maker.tools.stop.is_requested() {
            return false;
        }
        if let Some(claims) = self.claims {
            let made = self.next_block(claims, queue);
            return made.unwrap_or_else(|error| {
                self.progress.lock().failure.get_or_insert(stopping(error));
                false
            });
        }
        let task = {
            let mut progress = self.progress.lock();
            let task = self.tasks.get(progress.taken).filter(|_| progress.failure.is_none());
            progress.taken += 1;
            task
        };
        let Some(task) = task else { return false };
        self.make(task, queue);
        true
    }

    /// Claims a block of scenes, and makes it.
    fn next_block<'env>(&'env self, claims: &Claims, queue: &Queue<'env>) -> Result<bool> {
        let goes_on = || self.progress.lock().failure.is_none() && !self.maker.tools.stop.is_requested();
        let Some((block, scenes)) = claims.next(self.maker.tools.stop)?.filter(|_| goes_on()) else {
            return Ok(false);
        };
        for scene in scenes {
            let task = self.tasks.binary_search_by_key(&scene, |task| task.scene);
            self.make(&self.tasks[task.expect("a claimed scene is on the list of work")], queue);
            if !goes_on() {
                return Ok(false);
            }
        }
        claims.done(block).map(|()| true)
    }

    /// Makes a scene, and commits it.
    fn make<'env>(&'env self, task: &'env Task<'env>, queue: &Queue<'env>) {
        match panics::unwound(|| self.maker.make(task, queue).and_then(|made| self.keep(task, made))) {
            Ok(()) => self.progress.lock().made += 1,
            Err(error) => {
                let error = stopping(error).context(format!("scene {}", task.scene));
                self.progress.lock().failure.get_or_insert(error);
            }
        }
    }

    /// Commits a scene.
    fn keep(&self, task: &Task, made: Option<MadeScene>) -> Result<()> {
        let folder = self.maker.folder;
        let Some(made) = made else {
            self.progress.lock().lacking += 1;
            return Ok(());
        };
        if made.entry.failed() && self.todo.adds && folder.is_proposed() {
            self.progress.lock().held.push(made);
            return Ok(());
        }
        let entry = folder.commit(made.entry, made.kept, made.written, self.journal)?;
        let is_last = self.progress.lock().taken >= self.tasks.len();
        warn_of_scene(self.todo, &entry, &self.notices, is_last, self.maker.tools.log);
        if entry.failed() || std::mem::replace(&mut self.progress.lock().is_rehearsed, true) {
            return Ok(());
        }
        self.rehearse_end(task, &entry)
    }

    /// Rehearses the end of the run after its first scene, because some mistakes would show only then.
    fn rehearse_end(&self, task: &Task, entry: &JournalEntry) -> Result<()> {
        let SceneMaker { tools: Tools { recipe, log, workers, .. }, folder, .. } = &self.maker;
        let trial = folder.stage_trial()?;
        // The real end counts the omitted data of the trial.
        let dataset = recipe.dataset_info();
        let lender = DatasetLender::new(DatasetContext::new(&dataset, *workers, *log));
        let Ended { writers, annotators } =
            annotate_and_finish(recipe, &lender, folder, &Entries::from_iter([entry]), &trial);
        folder.drop_trial()?;
        // An annotator of the dataset may need more than one scene.
        if let Some(error) = annotators.filter(|error| Recovery::of(error) == Recovery::Stop) {
            return Err(error);
        }
        let Some((id, error)) = writers else { return Ok(()) };
        let help = "nothing is lost: mend it, then run the same command";
        let error = if error.help_text().is_some() { error } else { error.help(help) };
        Err(error.context(format!("the end of the run, tried for write.{id} after scene {}", task.scene)))
    }

    /// Commits the held scenes, or returns the error that ended the work. `noted` is the result of writing the working
    /// times.
    fn conclude(self, noted: Result<()>) -> Result<(u32, BTreeSet<Notice>)> {
        let (folder, progress) = (self.maker.folder, self.progress.into_inner());
        if let Some(reason) = self.maker.tools.stop.requested() {
            let (made, all) = (progress.made, self.tasks.len());
            return Err(Error::stopped(format!("stopped by {reason}: {made} of {all} scenes are done"))
                .help("the same command goes on from there"));
        }
        // The error that stopped the run comes first, since a full disk refuses the times as well.
        progress.failure.map_or(noted, Err)?;
        let without = progress.lacking + progress.held.len() as u32;
        if without > 0 && self.todo.adds && folder.is_proposed() {
            let scenes = count(without, "scene");
            let message = format!("{scenes} could not be made with what the recipe adds; nothing was written");
            return Err(Error::new(message)
                .in_file(folder.name())
                .help("the warnings above explain it; mend the recipe, or leave out what it adds"));
        }
        for made in progress.held {
            folder.commit(made.entry, made.kept, made.written, self.journal)?;
        }
        Ok((progress.lacking, self.notices.scenes.into_inner()))
    }
}

/// The notices that were reported, about scenes and about single views.
#[derive(Default)]
struct ReportedNotices {
    scenes: Mutex<BTreeSet<Notice>>,
    views: Mutex<BTreeSet<Notice>>,
}

/// Warns of the anomalies of a scene, once per kind, and of a scene that differs after it was made again. If `is_last`,
/// the end of the run soon names the anomalies of whole scenes.
fn warn_of_scene(todo: &Todo, entry: &JournalEntry, odd: &ReportedNotices, is_last: bool, log: &dyn Log) {
    let all = &entry.notices;
    for notice in Notice::reported(all).filter(|_| !is_last) {
        if odd.scenes.lock().insert(notice) {
            log.warn(&Error::new(notice.text(all)).help(notice.help(all)).context(format!("scene {}", entry.scene)));
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
