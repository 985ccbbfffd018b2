//! The end of a run: dataset annotators, and the last step of writers.

use crate::pools::BAD;
use crate::run::dataset::draws::{PoseDraws, in_words};
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry, Notice};
use crate::run::dataset::loss::Loss;
use crate::run::dataset::manifest::Written;
use crate::run::dataset::records::{self, Records};
use crate::run::decisions::work_list;
use crate::run::making::losses::DatasetLender;
use crate::run::making::stages::lend;
use crate::run::making::times::Times;
use crate::run::outcome::RunOutcome;
use crate::run::panics;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::run::shard::WantedScenes;
use parking_lot::Mutex;
use std::collections::BTreeSet;
use syntable_model::context::{DatasetContext, Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::scene::SceneId;
use syntable_model::stage::{Finish, Input, Scenes, Writer};
use syntable_model::store::StoreFolder;
use syntable_recipe::plan::Producer;
use syntable_recipe::{Lock, Recipe, with_lock};

/// Annotates the dataset and runs the last step of every writer. Reports an error only after all writers had their
/// turn. Removes stale files of the `wanted` scenes that could not be written again; other scenes keep such files for a
/// later run. `told` are the anomalies whose remedies the run has shown.
pub fn end(
    recipe: &Recipe,
    reporter: &dyn Reporter,
    workers: &dyn Workers,
    folder: &Folder,
    journal: Journal,
    resolved: &str,
    (repair, wanted, told): (bool, &WantedScenes, &BTreeSet<Notice>),
) -> Result<RunOutcome> {
    let log = &Warnings(reporter);
    let journal = Mutex::new(journal);
    let before = journal.lock().entries().values().filter(|entry| !entry.failed()).cloned().collect::<Vec<_>>();
    check_shards(folder, workers, &before)?;
    let waiting = take_strays(recipe, folder, &before, wanted, &journal)?;
    if waiting > 0 {
        let message = format!(
            "{} keep files of other options, which the dataset's files omit: run without `options.scenes` to write them again",
            count(waiting, "scene")
        );
        reporter.event(&Event::Note { message });
    }
    let mut journal = journal.into_inner();
    let entries: Vec<JournalEntry> = journal.entries().values().cloned().collect();
    let made: Vec<JournalEntry> = entries.iter().filter(|entry| !entry.failed()).cloned().collect();
    let staged = folder.stage_finish()?;
    let dataset = recipe.dataset_info();
    let lender = DatasetLender::new(DatasetContext::new(&dataset, workers, log));
    let Ended { writers, annotators } = annotate_and_finish(recipe, &lender, folder, &made, &staged);
    let failure = writers.map(|(_, error)| error).or(annotators);
    let assets = entries.iter().flat_map(|entry| entry.assets.clone()).collect();
    let resolved = with_lock(resolved, &Lock { assets, ..Lock::default() });
    let published = folder.publish_finish(&resolved, &mut journal, failure.is_none(), repair);
    failure.map_or(published, Err)?;
    let (useless, _) = shared_by_all(&made);
    tell_at_the_end(&made, &useless, told, reporter);
    tell_of_poses(&made, reporter);
    Ok(outcome_of(&entries, lender.losses()))
}

/// The outcome of a run that ended with these lines. `losses` are what the end of the run omitted.
pub fn outcome_of(entries: &[JournalEntry], losses: impl IntoIterator<Item = Loss>) -> RunOutcome {
    let made: Vec<JournalEntry> = entries.iter().filter(|entry| !entry.failed()).cloned().collect();
    let (useless, all_have) = shared_by_all(&made);
    let all_assets = entries.iter().flat_map(|entry| &entry.assets);
    let bad: BTreeSet<&String> = all_assets.filter(|(_, digest)| *digest == BAD).map(|(name, _)| name).collect();
    RunOutcome {
        bad_assets: bad.into_iter().cloned().collect(),
        scenes: made.len() as u32,
        failed: (entries.len() - made.len()) as u32,
        lacking: 0,
        missing: 0,
        useless: useless.into_iter().map(|notice| (notice.text(&all_have), notice.help(&all_have))).collect(),
        images: entries.iter().map(JournalEntry::views).sum(),
        left_out: Loss::sum(made.iter().flat_map(|entry| entry.left_out.clone()).chain(losses)),
    }
}

/// Views are few if they are less than one in this number.
const FEW: u32 = 10;

/// The anomalies that make a dataset useless because all of its scenes have them, and all anomalies that all scenes
/// have.
fn shared_by_all(made: &[JournalEntry]) -> (Vec<Notice>, BTreeSet<Notice>) {
    let both = |a: BTreeSet<Notice>, b: BTreeSet<Notice>| a.intersection(&b).copied().collect();
    let all_have = made.iter().map(|entry| entry.notices.clone()).reduce(both).unwrap_or_default();
    let makes_useless = |notice: &Notice| [Notice::Black, Notice::Unlabeled].contains(notice);
    (Notice::reported(&all_have).filter(makes_useless).collect(), all_have)
}

/// Warns about anomalies of scenes and views. A few anomalous views may be intended, and cause no warning. The errors of
/// the run name the anomalies that make it `useless`.
fn tell_at_the_end(made: &[JournalEntry], useless: &[Notice], told: &BTreeSet<Notice>, reporter: &dyn Reporter) {
    let log = Warnings(reporter);
    let all: u32 = made.iter().map(JournalEntry::views).sum();
    for notice in [Notice::Black, Notice::White, Notice::Unlit, Notice::Unlabeled] {
        let whole = || made.iter().filter(|entry| Notice::reported(&entry.notices).any(|other| other == notice));
        let scenes = whole().count();
        if let Some(first) = whole().next().filter(|_| !useless.contains(&notice)) {
            let of = format!("{scenes} of {}", count(made.len() as u32, "scene"));
            let warning = Error::new(notice.text(&first.notices)).context(of);
            if told.contains(&notice) {
                reporter.event(&Event::Note { message: warning.to_string() });
            } else {
                log.warn(&warning.help(notice.help(&first.notices)));
            }
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

/// Reports the camera poses that conditions refused, and warns about views that do not meet them.
fn tell_of_poses(made: &[JournalEntry], reporter: &dyn Reporter) {
    let mut all = PoseDraws::default();
    made.iter().for_each(|entry| all.add(&entry.poses));
    if !all.refused.is_empty() {
        let refused: u32 = all.refused.values().sum();
        let message = format!("camera poses: {refused} of {} refused: {}", all.drawn, in_words(&all.refused));
        reporter.event(&Event::Note { message });
    }
    let unmet = |entry: &&JournalEntry| !entry.poses.unmet.is_empty();
    if let Some(JournalEntry { scene, poses, .. }) = made.iter().find(unmet) {
        let views = count(made.iter().map(JournalEntry::views).sum(), "view");
        let of = format!("{} of {views}, such as view {} of scene {scene}", all.unmet.len(), poses.unmet[0]);
        let warning = Error::new("no drawn camera pose meets the conditions of [views]").context(of);
        Warnings(reporter)
            .warn(&warning.help("raise `attempts`, relax the conditions, or let `on_failure` be \"error\""));
    }
}

/// Compares the scenes' records with the written lines, because no later step would notice a missing line.
fn check_shards(folder: &Folder, workers: &dyn Workers, made: &[JournalEntry]) -> Result<()> {
    let failure = Mutex::new(None);
    workers.run(made.len(), &|index| {
        if let Err(error) = folder.check_shards(&made[index]) {
            failure.lock().get_or_insert(error);
        }
    });
    failure.into_inner().map_or(Ok(()), Err)
}

/// Removes files of writers that left the recipe, and files of `wanted` scenes that could not be written again. Returns
/// the number of scenes that still wait to be written again.
fn take_strays(
    recipe: &Recipe,
    folder: &Folder,
    made: &[JournalEntry],
    wanted: &WantedScenes,
    journal: &Mutex<Journal>,
) -> Result<u32> {
    let mut waiting = 0;
    for entry in made {
        let files = folder.manifest_of(entry)?;
        let kept = work_list::kept(&files, entry, &recipe.component_of(entry.scene).1.plan);
        let has = |id: &str| recipe.write.iter().any(|(other, _)| other == id);
        let waits = |id: &String| has(id) && !kept.writers.contains_key(id) && !wanted.has(entry.scene);
        waiting += u32::from(files.writers.keys().any(waits));
        let stays = files.only(|id| kept.writers.contains_key(id) || waits(&id.to_owned()));
        if stays != files {
            folder.stage(entry.scene)?;
            folder.commit(entry.clone(), stays, Written::new(), journal)?;
        }
    }
    Ok(waiting)
}

/// Errors at the end of a run.
pub struct Ended {
    /// The first writer that could not finish, and its error.
    pub writers: Option<(String, Error)>,
    /// Error of the first dataset annotator that failed. Writers that read its products did not finish.
    pub annotators: Option<Error>,
}

/// Annotates the dataset of some scenes, and finishes every writer whose products exist into a staging folder.
pub fn annotate_and_finish(
    recipe: &Recipe,
    lender: &DatasetLender,
    folder: &Folder,
    made: &[JournalEntry],
    staged: &StoreFolder,
) -> Ended {
    // Components agree on the annotators of the dataset.
    let recorded = records::names(&recipe.components.first().plan);
    let scenes = |has: &dyn Fn(&JournalEntry) -> bool| -> Vec<SceneId> {
        made.iter().filter(|entry| has(entry)).map(|entry| SceneId(entry.scene)).collect()
    };
    let of_dataset = scenes(&|entry| entry.recorded() == recorded);
    let (products, failed) = panics::quiet(|| annotate_dataset(recipe, lender, folder, &of_dataset));
    let one = |(id, writer): &(String, Box<dyn Writer<Scenes>>)| {
        let (stage, reads) = (format!("write.{id}"), Input::names(&writer.reads()));
        if failed.iter().any(|(name, _)| reads.contains(name)) {
            return None;
        }
        let done = scenes(&|entry| entry.writers().contains(id));
        let plan = &recipe.components.first().plan;
        let finish = Finish::new(folder.files(), id, done).reading(plan.read_by(&writer.reads())).staged(staged);
        let read = products.only(&reads);
        let finish = |cx: &DatasetContext| writer.finish(cx, &read, &finish);
        let ended = panics::quiet(|| panics::caught(&stage, || lender.lend(&stage, finish)));
        ended.err().map(|error| (id.clone(), error))
    };
    // Every writer gets its turn, even after an error.
    let writers: Vec<(String, Error)> = recipe.write.iter().filter_map(one).collect();
    Ended { writers: writers.into_iter().next(), annotators: failed.into_iter().next().map(|(_, error)| error) }
}

/// Runs the dataset annotators on the records of the finished scenes. Returns their products, and the products that
/// failed, in the order of the plan, with reasons.
fn annotate_dataset(
    recipe: &Recipe,
    lender: &DatasetLender,
    folder: &Folder,
    done: &[SceneId],
) -> (Products, Vec<(String, Error)>) {
    let (mut products, mut failed) = (Products::new(), Vec::<(String, Error)>::new());
    for stage in &recipe.components.first().plan.per_dataset {
        let Producer::Dataset(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
        let mut scenes = done.iter().map(|&scene| Records::read(folder.files(), scene));
        let lacks = stage.reads.iter().find_map(|key| failed.iter().find(|(name, _)| key.is(name)));
        let made = match lacks {
            Some((_, error)) => Err(error.clone()),
            None => lend(&Times::default(), stage, &products, |lent| {
                lender.lend(&stage.stage, |cx| annotator.annotate(cx, &mut scenes, lent))
            }),
        };
        if let Err(error) = made.and_then(|made| products.extend(made)) {
            failed.extend(stage.provides.iter().map(|key| (key.to_string(), error.clone())));
        }
    }
    (products, failed)
}
