//! One scene of a run: its attempts, its files, and its line of the journal.

use crate::run::dataset::draws::SceneDraws;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{JournalEntry, SceneOutcome};
use crate::run::dataset::loss::Loss;
use crate::run::dataset::manifest::{Manifest, Written};
use crate::run::dataset::records::{self, Records};
use crate::run::dataset::settled;
use crate::run::decisions::work_list::{self, Task, Work};
use crate::run::making::anomalies::{Anomalies, AnomalyScan};
use crate::run::making::attempt::{Attempt, Tools};
use crate::run::making::losses::Losses;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::{Attempts, SceneAttempts};
use crate::run::making::sessions::AllSessions;
use crate::run::making::times::Times;
use crate::run::making::walk::{SceneWalk, ViewSink, scene_event};
use crate::run::making::writers::Writers;
use crate::run::progress::Reporter;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::context::{SceneContext, ViewContext};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::scene::{PlacedBodies, Scene, Settled, View};
use syntable_model::stage::{Output, Scenes};
use syntable_model::store::StoreFolder;
use syntable_recipe::plan::Plan;

/// Makes scenes.
pub struct SceneMaker<'a> {
    pub tools: Tools<'a>,
    pub reporter: &'a dyn Reporter,
    pub folder: &'a Folder,
    pub sessions: &'a AllSessions<'a>,
    /// Checks of every view, before it is written.
    pub checks: &'a [Arc<dyn LabelCheck>],
}

/// A finished scene in its staging folder: its line of the journal, its new files, and its earlier files that stay.
pub struct MadeScene {
    pub entry: JournalEntry,
    pub kept: Manifest,
    pub written: Written,
}

impl<'a> SceneMaker<'a> {
    /// Makes a scene in its staging folder, with as many attempts as the recipe allows. Returns `None` if all attempts
    /// failed and the dataset keeps its existing scene.
    ///
    /// A scene with missing parts is rebuilt from its stored result of settling. If the new stages fail, they would
    /// have failed in this attempt from the start, so the next attempts make the whole scene again.
    ///
    /// # Errors
    /// If the run must stop.
    pub fn make<'env>(&'env self, task: &Task<'env>, queue: &Queue<'env>) -> Result<Option<MadeScene>> {
        let &Task { scene, is_present, whole, extend } = task;
        let (tools, reporter) = (self.tools, self.reporter);
        let first = extend.map_or(0, |(present, _)| present.attempt);
        let attempts = SceneAttempts { tools, reporter, scene, first, is_present };
        let attempt = |number: u32| match extend.filter(|_| number == first) {
            Some((present, work)) => Ok((self.attempt(scene, number, (work, true), queue)?, Some(present))),
            None => Ok((self.attempt(scene, number, (whole, false), queue)?, None)),
        };
        let Attempts { made, number, errors } = attempts.make(attempt, |error| self.quarantine(scene, error))?;
        let earlier = extend.into_iter().flat_map(|(present, _)| present.errors.iter().cloned());
        let errors: Vec<String> = earlier.chain(errors.iter().map(Error::to_string)).collect();
        match made {
            Some((made, Some(present))) => {
                let kept = work_list::kept(&self.folder.manifest_of(present)?, present, &whole.plan);
                let (written, entry) = extended(present, made, whole);
                Ok(Some(MadeScene { entry, kept, written }))
            }
            Some((WrittenScene { views, objects, anomalies, left_out, written, assets, draws }, None)) => {
                let outcome = outcome(views, objects, whole);
                let Anomalies { scene: notices, views: odd_views, .. } = anomalies;
                let SceneDraws { poses, choices } = draws;
                let component = whole.component.id.clone();
                let entry = JournalEntry {
                    notices,
                    odd_views,
                    poses,
                    choices,
                    component,
                    left_out,
                    errors,
                    assets,
                    ..JournalEntry::new(scene, number, outcome)
                };
                Ok(Some(MadeScene { entry, kept: Manifest::default(), written }))
            }
            None if is_present => self.folder.abandon(scene).map(|()| None),
            None => {
                let component = whole.component.id.clone();
                let failed = JournalEntry::new(scene, number, SceneOutcome::Failed);
                let entry = JournalEntry { component, errors, ..failed };
                Ok(Some(MadeScene { entry, kept: Manifest::default(), written: Written::new() }))
            }
        }
    }

    /// One attempt at some work, from the `stored` result of settling if it exists.
    fn attempt<'env>(
        &'env self,
        scene: u32,
        number: u32,
        (work, stored): (&'env Work<'env>, bool),
        queue: &Queue<'env>,
    ) -> Result<WrittenScene> {
        let staged = self.folder.stage(scene)?;
        let attempt = Attempt::new(self.tools, &work.dataset, (scene, number));
        let written = self.write(&attempt, work, (&staged, stored), queue)?;
        Ok(WrittenScene { assets: attempt.assets.into_digests(), draws: attempt.draws.into_inner(), ..written })
    }

    /// Composes the scene of an attempt, walks over it, and writes its files.
    fn write<'env>(
        &'env self,
        attempt: &Attempt<'env>,
        work: &'env Work<'env>,
        (staged, stored): (&StoreFolder, bool),
        queue: &Queue<'env>,
    ) -> Result<WrittenScene> {
        let (times, losses) = (self.tools.times, Arc::new(Losses::default()));
        let scene = Arc::new(self.frozen(attempt, staged, stored)?);
        let walk = self.walk(work);
        let start = |cx: &SceneContext| {
            let writers = Writers::start(work.writers.iter().copied(), cx, staged, (times, &losses))?;
            let (records, scan) = (Records::default(), AnomalyScan::default());
            Ok(FileSink { writers, records, scan, plan: &work.plan, times })
        };
        let (files, products) = walk.scene(attempt, &scene, &losses, queue, start)?;
        let mut written = files.writers.close(&walk.context(&scene), &products)?;
        let output = Output::new(staged, records::OWNER, attempt.scene);
        times.of("records", || files.records.write(&work.plan, &products, &output))?;
        written.extend(Some((records::OWNER.to_owned(), output.files())).filter(|(_, files)| !files.is_empty()));
        self.reporter.event(&scene_event(&scene));
        let (views, objects) = (work.dataset.views_per_scene, scene.objects().len() as u32);
        let (anomalies, left_out) = (files.scan.anomalies(&scene), losses.all());
        let (assets, draws) = Default::default();
        Ok(WrittenScene { views, objects, anomalies, left_out, written, assets, draws })
    }

    /// Places the bodies, and settles them, or applies the `stored` result of settling.
    fn frozen(&self, attempt: &Attempt, staged: &StoreFolder, stored: bool) -> Result<Scene> {
        let scene = attempt.scene;
        let mut builder = attempt.place()?;
        let again = if stored { settled::read(self.folder.files(), scene) } else { None };
        let report = match again.map(|settled| settled.apply(&mut builder)) {
            Some(Ok(report)) => report,
            _ => {
                let placed = PlacedBodies::of(&builder);
                let report = attempt.settle(&mut builder)?;
                if let Some(settled) = Settled::between(&placed, &builder, &report) {
                    settled::write(staged, scene, &settled)?;
                }
                report
            }
        };
        builder.freeze(report)
    }

    /// Moves the files of a scene whose labels contradict each other out of the dataset.
    fn quarantine(&self, scene: u32, error: Error) -> Result<Error> {
        let folder = self.folder.quarantine(scene, &format!("{error}\n"))?;
        let help = "a stage that provides labels is wrong, and no file of the scene is in the dataset; this folder has its files";
        Ok(error.in_file(folder).help(help))
    }

    fn walk<'m>(&'m self, work: &'m Work) -> SceneWalk<'m> {
        let Self { tools, sessions, checks, reporter, .. } = *self;
        let sessions = sessions.of(work.component);
        SceneWalk { tools, sessions, checks, reporter, dataset: &work.dataset, plan: &work.plan }
    }
}

/// The outcome of a finished scene. The commit adds the digest of the manifest.
fn outcome(views: u32, objects: u32, work: &Work) -> SceneOutcome {
    let writers = work.writers.iter().map(|(id, _)| id.clone()).collect();
    SceneOutcome::Made { views, objects, writers, recorded: records::names(&work.plan), manifest: Digest::of(&[]) }
}

/// The new files and the journal line of a scene that got its missing parts. The line equals the line of a scene that
/// had them from the start.
fn extended(present: &JournalEntry, made: WrittenScene, whole: &Work) -> (Written, JournalEntry) {
    let WrittenScene { views, objects, anomalies, left_out, written, assets, .. } = made;
    let mut entry = present.clone();
    entry.outcome = outcome(views, objects, whole);
    // New findings replace earlier ones.
    entry.notices.retain(|notice| !anomalies.looked_at.contains(notice));
    entry.odd_views.retain(|notice, _| !anomalies.looked_at.contains(notice));
    entry.notices.extend(anomalies.scene);
    entry.odd_views.extend(anomalies.views);
    entry.left_out.retain(|old| !left_out.iter().any(|new| new.stage == old.stage));
    entry.left_out.extend(left_out);
    entry.left_out.sort();
    entry.assets.extend(assets);
    (written, entry)
}

/// A scene that an attempt has written.
struct WrittenScene {
    views: u32,
    objects: u32,
    anomalies: Anomalies,
    left_out: Vec<Loss>,
    written: Written,
    /// Digests of the assets that it drew.
    assets: BTreeMap<String, String>,
    draws: SceneDraws,
}

/// Writes the views of a scene, and keeps the data of the views for the journal and for annotators of the dataset.
struct FileSink<'m> {
    writers: Writers<'m, Scenes>,
    records: Records,
    scan: AnomalyScan,
    plan: &'m Plan,
    times: &'m Times,
}

impl ViewSink for FileSink<'_> {
    fn view(&mut self, cx: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()> {
        self.writers.view(cx, products)?;
        self.times.of("records", || self.records.view(self.plan, products))?;
        self.scan.look(view, products);
        Ok(())
    }
}
