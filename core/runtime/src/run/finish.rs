//! The end of a run: dataset annotators, and the last step of writers.

use crate::run::dataset::ending::Finished;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Entries, Journal, JournalEntry, Notice, SceneLine};
use crate::run::dataset::loss::Loss;
use crate::run::dataset::manifest::Written;
use crate::run::dataset::read_ahead::ReadAhead;
use crate::run::dataset::records::{self, Records};
use crate::run::dataset::scene_files::SceneFiles;
use crate::run::decisions::work_list;
use crate::run::making::losses::DatasetLender;
use crate::run::making::stages::lend;
use crate::run::making::times::Times;
use crate::run::outcome::RunOutcome;
use crate::run::panics;
use crate::run::progress::{Event, Reporter, Warnings, count};
use crate::run::remarks::DatasetRemarks;
use crate::run::shard::WantedScenes;
use parking_lot::Mutex;
use std::collections::BTreeSet;
use std::sync::Arc;
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
/// later run. `told` are the anomalies whose remedies the run has shown. If nothing has changed since the last end, its
/// files stay.
pub fn end(
    recipe: &Recipe,
    reporter: &dyn Reporter,
    workers: &dyn Workers,
    folder: &Folder,
    journal: Journal,
    resolved: &str,
    (repair, wanted, told): (bool, &WantedScenes, &BTreeSet<Notice>),
) -> Result<RunOutcome> {
    let journal = Mutex::new(journal);
    let waiting = take_strays(recipe, folder, wanted, &journal)?;
    if waiting > 0 {
        let message = format!(
            "{} keep files of other options, which the dataset's files omit: run without `options.scenes` to write them again",
            count(waiting, "scene")
        );
        reporter.event(&Event::Note { message });
    }
    let mut journal = journal.into_inner();
    let resolved = with_lock(resolved, &Lock { assets: journal.entries().assets().clone(), ..Lock::default() });
    let losses = match folder.last_end(&resolved)?.filter(|_| !repair) {
        Some(Finished { left_out, .. }) => left_out,
        None => write_end(recipe, (workers, &Warnings(reporter)), folder, &mut journal, &resolved, repair)?,
    };
    let remarks = DatasetRemarks::of(journal.entries());
    remarks.tell(told, reporter);
    Ok(remarks.outcome(journal.entries(), losses))
}

/// Writes the files of the end of a run, and moves them into place. Returns what they omit.
fn write_end(
    recipe: &Recipe,
    (workers, log): (&dyn Workers, &dyn Log),
    folder: &Folder,
    journal: &mut Journal,
    resolved: &str,
    repair: bool,
) -> Result<Vec<Loss>> {
    let staged = folder.stage_finish()?;
    let dataset = recipe.dataset_info();
    let lender = DatasetLender::new(DatasetContext::new(&dataset, workers, log));
    let Ended { writers, annotators } = annotate_and_finish(recipe, &lender, folder, journal.entries(), &staged);
    let failure = writers.map(|(_, error)| error).or(annotators);
    let losses = lender.losses();
    let published = folder.publish_finish(resolved, journal, failure.is_none().then_some(&losses), repair);
    failure.map_or(published, Err).map(|()| losses)
}

/// The outcome of a run that ended with these lines.
pub fn outcome_of(entries: &Entries) -> RunOutcome {
    DatasetRemarks::of(entries).outcome(entries, Vec::new())
}

/// Removes files of writers that left the recipe, and files of `wanted` scenes that could not be written again. Returns
/// the number of scenes that still wait to be written again.
fn take_strays(recipe: &Recipe, folder: &Folder, wanted: &WantedScenes, journal: &Mutex<Journal>) -> Result<u32> {
    let stale: Vec<JournalEntry> = {
        let journal = journal.lock();
        let lines = journal.entries().made().filter(SceneLine::has_remarks).map(|line| line.entry());
        lines.filter(|entry| entry.stale).collect()
    };
    let mut waiting = 0;
    for entry in stale {
        let files = folder.manifest_of(&entry)?;
        let kept = work_list::kept(&files, &entry, &recipe.component_of(entry.scene).1.plan);
        let has = |id: &str| recipe.write.iter().any(|(other, _)| other == id);
        let waits = |id: &String| has(id) && !kept.writers.contains_key(id) && !wanted.has(entry.scene);
        waiting += u32::from(files.writers.keys().any(waits));
        let stays = files.only(|id| kept.writers.contains_key(id) || waits(&id.to_owned()));
        if stays != files {
            folder.stage(entry.scene)?;
            folder.commit(entry, stays, Written::new(), journal)?;
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
    entries: &Entries,
    staged: &StoreFolder,
) -> Ended {
    // Components agree on the annotators of the dataset.
    let recorded = records::names(&recipe.components.first().plan);
    let scenes = |has: &dyn Fn(SceneLine) -> bool| -> Vec<SceneId> {
        entries.made().filter(|line| has(*line)).map(|line| SceneId(line.scene)).collect()
    };
    let of_dataset = scenes(&|line| line.recorded() == recorded);
    let files = Arc::new(SceneFiles::new(folder.files(), entries));
    let (products, failed) = panics::quiet(|| annotate_dataset(recipe, lender, &files, &of_dataset));
    let one = |(id, writer): &(String, Box<dyn Writer<Scenes>>)| {
        let (stage, reads) = (format!("write.{id}"), Input::names(&writer.reads()));
        if failed.iter().any(|(name, _)| reads.contains(name)) {
            return None;
        }
        let done = scenes(&|line| line.writers().contains(id));
        let plan = &recipe.components.first().plan;
        let shards = ReadAhead::new(&files, id, &done);
        let finish = Finish::new(folder.files(), id, done)
            .reading(plan.read_by(&writer.reads()))
            .staged(staged)
            .opening(move |scene, path| shards.open(scene, path));
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
    files: &SceneFiles,
    done: &[SceneId],
) -> (Products, Vec<(String, Error)>) {
    let (mut products, mut failed) = (Products::new(), Vec::<(String, Error)>::new());
    for stage in &recipe.components.first().plan.per_dataset {
        let Producer::Dataset(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
        let mut scenes = done.iter().map(|&scene| Records::read(files, scene));
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
