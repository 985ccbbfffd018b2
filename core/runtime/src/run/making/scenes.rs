//! Making scenes: several in flight, each committed when it is finished.

use crate::pools::AssetStore;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry, Notice};
use crate::run::decisions::opening::Begun;
use crate::run::decisions::work_list::{Job, Task, Todo, Works};
use crate::run::finish::{Ended, annotate_and_finish};
use crate::run::making::attempt::Tools;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::Recovery;
use crate::run::making::scene::{MadeScene, SceneMaker};
use crate::run::making::sessions::{Sessions, scenes_in_flight};
use crate::run::making::times::{RunTimes, Times};
use crate::run::panics;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::run::{RunOptions, stopping};
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::time::Instant;
use syntable_model::context::Log;
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
}

/// Makes the scenes of a run. From here on the dataset changes.
pub fn make(
    recipe: &Recipe,
    options: &RunOptions,
    pool: &Pool,
    reporter: &dyn Reporter,
    begun: Begun,
) -> Result<MadeScenes> {
    let Begun { folder, mut journal, resolved, growth, todo, assets, aside } = begun;
    if growth.is_none() {
        journal.rewrite()?;
    }
    if let Some(store) = &assets {
        folder.set_catalogs(&store.catalogs())?;
    }
    if folder.is_empty(&journal)? {
        folder.set_recipe(&resolved)?;
    } else {
        folder.propose_recipe(&resolved, growth.map(|growth| growth.replaced()).unwrap_or_default())?;
    }
    let journal = Mutex::new(journal);
    let made_aside = aside.as_ref().map_or(0, |aside| aside.entry.views());
    aside.map_or(Ok(()), |aside| aside.adopt(&folder, &journal))?;
    let mut lacking = 0;
    if let Some(store) = assets.filter(|_| !todo.scenes.is_empty()) {
        let drawn =
            journal.lock().entries().values().flat_map(|entry| entry.assets.clone()).collect::<BTreeMap<_, _>>();
        let made = make_scenes(recipe, options, reporter, &store.expect(drawn), pool, (&folder, &journal), &todo);
        if made.is_err() {
            let _ = folder.drop_parts();
        }
        lacking = made?;
    }
    // The dataset takes the recipe even if there was no scene to make.
    folder.accept_recipe(&mut journal.lock())?;
    let journal = journal.into_inner();
    let entry_of = |scene: &u32| journal.entries().get(scene);
    let whole = todo.scenes.iter().filter(|(_, job)| job.lacks.is_none());
    let new = made_aside + whole.filter_map(|(scene, _)| entry_of(scene)).map(JournalEntry::views).sum::<u32>();
    let changed = |(scene, job): &(&u32, &Job)| job.lacks.is_some() && entry_of(scene) != job.present.as_ref();
    let grown = todo.scenes.iter().filter(changed).count() as u32;
    Ok(MadeScenes { folder, journal, resolved, new, grown, lacking })
}

/// Returns the number of scenes that stay as they were.
fn make_scenes(
    recipe: &Recipe,
    options: &RunOptions,
    reporter: &dyn Reporter,
    assets: &AssetStore,
    pool: &Pool,
    (folder, journal): (&Folder, &Mutex<Journal>),
    todo: &Todo,
) -> Result<u32> {
    let (log, start) = (Warnings(reporter), Instant::now());
    let in_flight = scenes_in_flight(recipe, options.threads, todo.scenes.len());
    let works = Works::new(recipe, todo);
    let tasks: Vec<Task> = todo.scenes.iter().map(|(&scene, job)| works.task(scene, job)).collect();
    let sessions = Sessions::open(&*recipe.render, in_flight)?;
    let (next, made, lacking) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicU32::new(0));
    let (stop, tried) = (AtomicBool::new(false), AtomicBool::new(false));
    let failure: Mutex<Option<Error>> = Mutex::new(None);
    let odd = ReportedNotices::default();
    // Scenes that failed before the first success of a recipe that adds stages. The new stages may be the cause.
    let held = Mutex::new(Vec::new());
    let times = Times::default();
    let cache = &options.cache;
    let tools = Tools { recipe, assets, cache, workers: pool, log: &log, times: &times, stop: &options.stop };
    let maker = SceneMaker { tools, reporter, folder, sessions: &sessions, checks: &recipe.checks };
    let one = |task: &Task, made: Option<MadeScene>| -> Result<()> {
        let Some(made) = made else {
            lacking.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        };
        if made.entry.failed() && todo.adds && folder.is_proposed() {
            held.lock().push(made);
            return Ok(());
        }
        let entry = folder.commit(made.entry, made.kept, made.written, journal)?;
        warn_of_scene(todo, &entry, &odd, &log);
        // The trial after the first scene finds mistakes that would show at the end of the run.
        if !entry.failed() && !tried.swap(true, Ordering::SeqCst) {
            let trial = folder.stage_trial()?;
            let Ended { writers, annotators } = annotate_and_finish(recipe, &log, pool, folder, &[entry], &trial);
            folder.drop_trial()?;
            // An annotator of the dataset may need more scenes than one.
            if let Some(error) = annotators.filter(|error| Recovery::of(error) == Recovery::Stop) {
                return Err(error);
            }
            if let Some((id, error)) = writers {
                let help = "nothing is lost: mend it, then run the same command";
                let error = if error.help_text().is_some() { error } else { error.help(help) };
                return Err(
                    error.context(format!("the end of the run, tried for write.{id} after scene {}", task.scene))
                );
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
                    while !stop.load(Ordering::Relaxed) && !maker.tools.stop.is_requested() {
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
    reporter.event(&Event::Stages { stages: times.all() });
    let devices = recipe.render.devices().unwrap_or_default().into_iter().map(|device| device.name).collect();
    let took = RunTimes {
        scenes: made.load(Ordering::Relaxed) as u32,
        threads: options.threads,
        devices,
        seconds: start.elapsed().as_secs_f64(),
        stages: times.all(),
    };
    let noted = took.append(folder.files());
    if let Some(reason) = options.stop.requested() {
        let (made, all) = (made.into_inner(), tasks.len());
        return Err(Error::stopped(format!("stopped by {reason}: {made} of {all} scenes are done"))
            .help("the same command goes on from there"));
    }
    // The error that stopped the run comes first, since a full disk refuses the times as well.
    failure.into_inner().map_or(noted, Err)?;
    let (held, lacking) = (held.into_inner(), lacking.into_inner());
    let without = lacking + held.len() as u32;
    if without > 0 && todo.adds && folder.is_proposed() {
        let message =
            format!("{} could not be made with what the recipe adds; nothing was written", count(without, "scene"));
        return Err(Error::new(message)
            .in_file(folder.name())
            .help("the warnings above say why; mend the recipe, or leave out what it adds"));
    }
    for made in held {
        folder.commit(made.entry, made.kept, made.written, journal)?;
    }
    Ok(lacking)
}

/// The notices that were reported, about scenes and about single views.
#[derive(Default)]
struct ReportedNotices {
    scenes: Mutex<BTreeSet<Notice>>,
    views: Mutex<BTreeSet<Notice>>,
}

/// Warns of the anomalies of a scene, once per kind, and of a scene that differs after it was made again.
fn warn_of_scene(todo: &Todo, entry: &JournalEntry, odd: &ReportedNotices, log: &dyn Log) {
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
