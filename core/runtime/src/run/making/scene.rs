//! One scene of a run: composed, walked over and written, with its attempts.

use crate::pools::RecordingAssets;
use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{JournalEntry, SceneOutcome};
use crate::run::dataset::loss::Loss;
use crate::run::dataset::manifest::{Manifest, Written};
use crate::run::dataset::records::{self, Records};
use crate::run::dataset::settled;
use crate::run::decisions::work_list::{self, Task, Work};
use crate::run::making::anomalies::{Odd, Seen};
use crate::run::making::attempt::{self, Tools};
use crate::run::making::losses::Losses;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::{DEVICE_REPEATS, Recovery};
use crate::run::making::sessions::Sessions;
use crate::run::making::times::Times;
use crate::run::making::walk::{Sink, Walk, scene_event};
use crate::run::making::writers::Writers;
use crate::run::panics::unwound;
use crate::run::progress::{Event, Reporter};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::context::{SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::scene::{Placed, Scene, SceneId, Settled, View};
use syntable_model::stage::{Output, Scenes};
use syntable_model::store::StoreFolder;
use syntable_recipe::plan::Plan;

/// Makes scenes.
pub struct SceneMaker<'a> {
    pub tools: Tools<'a>,
    pub reporter: &'a dyn Reporter,
    pub folder: &'a Folder,
    pub sessions: &'a Sessions<'a>,
    /// What must hold in every view that is written.
    pub checks: &'a [Arc<dyn LabelCheck>],
}

/// A scene that is made: its line of the journal, and the files of before that it keeps.
pub struct Made {
    pub entry: JournalEntry,
    pub kept: Manifest,
    pub written: Written,
}

impl<'a> SceneMaker<'a> {
    /// Makes a scene in its staging folder, with as many attempts as the recipe allows. An error stops the run.
    ///
    /// A scene that only gets what it lacks is had from its stored outcome of settling. If what is new fails, the attempt
    /// would have failed with it from the start: the scene is made again, by the attempts that follow. A scene that the
    /// dataset has stays as it is if all attempts fail, and there is nothing to commit.
    ///
    /// A device that fails says nothing about the scene: no attempt with other random numbers follows. A new scene fails
    /// with the error; one that the dataset has keeps its files, and the run stops. Labels that contradict each other say
    /// that a stage is wrong: no other attempt hides it, and what was made is put aside.
    pub fn make<'env>(&'env self, task: &Task<'env>, queue: &Queue<'env>) -> Result<Option<Made>> {
        let (mut errors, mut first) = (Vec::new(), 0);
        let mut last = self.tools.recipe.dataset.max_attempts.saturating_sub(1);
        if let Some((present, work)) = task.extend {
            first = present.attempt;
            errors.clone_from(&present.errors);
            match self.attempt(task, first, (work, true), queue)? {
                Tried::Made(mut outcome, assets) => {
                    let written = std::mem::take(&mut outcome.written);
                    return Ok(Some(Made {
                        written,
                        entry: extended(present, outcome, assets, task.whole),
                        kept: work_list::kept(&self.folder.manifest_of(present)?, present, &task.whole.plan),
                    }));
                }
                Tried::Failed(error) => {
                    errors.push(error.to_string());
                    if error.is_contradiction() {
                        return Ok(None);
                    }
                }
            }
            first += 1;
        }
        let kept = Manifest::default();
        for number in first..self.tools.recipe.dataset.max_attempts {
            match self.attempt(task, number, (task.whole, false), queue)? {
                Tried::Made(Attempted { views, objects, odd, left_out, written }, assets) => {
                    let outcome = outcome(views, objects, task.whole);
                    let Odd { scene: notices, views: odd_views, .. } = odd;
                    let (scene, attempt) = (task.scene, number);
                    let entry = JournalEntry { scene, attempt, outcome, notices, odd_views, left_out, errors, assets };
                    return Ok(Some(Made { entry, kept, written }));
                }
                Tried::Failed(error) => {
                    errors.push(error.to_string());
                    if error.is_device() || error.is_contradiction() {
                        last = number;
                        break;
                    }
                }
            }
        }
        if task.is_present {
            return self.folder.abandon(task.scene).map(|()| None);
        }
        let (outcome, (notices, odd_views, left_out, assets)) = (SceneOutcome::Failed, Default::default());
        let scene = task.scene;
        let entry = JournalEntry { scene, attempt: last, outcome, notices, odd_views, left_out, errors, assets };
        Ok(Some(Made { entry, kept, written: Written::new() }))
    }

    /// One attempt at some work, from the `stored` outcome of settling if there is one. While a device fails, the same
    /// attempt is repeated. An error stops the run.
    fn attempt<'env>(
        &'env self,
        task: &Task<'env>,
        number: u32,
        (work, stored): (&'env Work<'env>, bool),
        queue: &Queue<'env>,
    ) -> Result<Tried> {
        let scene = task.scene;
        for repeat in 0..=DEVICE_REPEATS {
            self.tools.running()?;
            let staged = self.folder.stage(scene)?;
            let assets = RecordingAssets::new(self.tools.assets);
            let core =
                attempt::Attempt { tools: self.tools, dataset: &work.dataset, scene: SceneId(scene), number, assets };
            let attempt = Attempt { maker: self, work, core };
            let error = match unwound(|| attempt.run(&staged, stored, queue)) {
                Ok(made) => return Ok(Tried::Made(made, attempt.core.assets.into_digests())),
                Err(error) => error,
            };
            self.tools.running()?;
            // A refused asset or a full disk concerns the run, and so does what other random numbers cannot change.
            self.tools.assets.refused()?;
            let recovery = Recovery::of(&error, repeat);
            // A scene that the dataset has is no worse for a device that stays away: the run stops.
            let stops = recovery == Recovery::FailScene && error.is_device() && task.is_present;
            if stops || recovery == Recovery::Stop {
                return Err(error);
            }
            let error = if error.is_contradiction() { self.aside(scene, error)? } else { error };
            let last = match recovery {
                Recovery::Repeat => false,
                Recovery::NextAttempt => number + 1 == self.tools.recipe.dataset.max_attempts,
                Recovery::FailScene | Recovery::Stop => true,
            };
            self.reporter.event(&Event::Attempt { scene, attempt: number, error: error.to_string(), last });
            if recovery != Recovery::Repeat {
                return Ok(Tried::Failed(error));
            }
        }
        unreachable!("the last repetition returns")
    }

    /// Puts a scene aside whose labels contradict each other.
    fn aside(&self, scene: u32, error: Error) -> Result<Error> {
        let folder = self.folder.quarantine(scene, &format!("{error}\n"))?;
        let help =
            "a stage that provides labels is wrong, and nothing of the scene was written; what was made of it is there";
        Ok(error.in_file(folder).help(help))
    }

    fn walk<'m>(&'m self, work: &'m Work) -> Walk<'m> {
        let Self { tools, sessions, checks, reporter, .. } = *self;
        Walk { tools, sessions, checks, reporter, dataset: &work.dataset, plan: &work.plan }
    }
}

/// The outcome of a scene that was made; the manifest is listed when it is committed.
fn outcome(views: u32, objects: u32, work: &Work) -> SceneOutcome {
    let writers = work.writers.iter().map(|(id, _)| id.clone()).collect();
    SceneOutcome::Made { views, objects, writers, recorded: records::names(&work.plan), manifest: String::new() }
}

/// The line of a scene that got what it lacked: that of a scene that had it from the start.
fn extended(
    present: &JournalEntry,
    Attempted { views, objects, odd, left_out, .. }: Attempted,
    assets: BTreeMap<String, String>,
    whole: &Work,
) -> JournalEntry {
    let mut entry = present.clone();
    entry.outcome = outcome(views, objects, whole);
    // What was looked at again is as it is now.
    entry.notices.retain(|notice| !odd.looked_at.contains(notice));
    entry.odd_views.retain(|notice, _| !odd.looked_at.contains(notice));
    entry.notices.extend(odd.scene);
    entry.odd_views.extend(odd.views);
    entry.left_out.retain(|old| !left_out.iter().any(|new| new.stage == old.stage));
    entry.left_out.extend(left_out);
    entry.left_out.sort();
    entry.assets.extend(assets);
    entry
}

/// What came of an attempt.
enum Tried {
    /// What it gave, with the digests of the assets that it drew.
    Made(Attempted, BTreeMap<String, String>),
    /// Why it failed.
    Failed(Error),
}

/// What an attempt gave.
struct Attempted {
    views: u32,
    objects: u32,
    odd: Odd,
    left_out: Vec<Loss>,
    written: Written,
}

/// One attempt at a scene, with what is made of it.
struct Attempt<'m, 'a> {
    maker: &'m SceneMaker<'a>,
    work: &'m Work<'a>,
    core: attempt::Attempt<'m>,
}

impl<'m> Attempt<'m, '_> {
    fn run(&self, staged: &StoreFolder, stored: bool, queue: &Queue<'m>) -> Result<Attempted> {
        let (maker, work, times) = (self.maker, self.work, self.maker.tools.times);
        let losses = Arc::new(Losses::default());
        let scene = Arc::new(self.scene(staged, stored)?);
        let walk = maker.walk(work);
        let start = |cx: &SceneContext| {
            let writers = Writers::start(work.writers.iter().copied(), cx, staged, (times, &losses))?;
            Ok(SceneSink { writers, records: Records::default(), seen: Seen::default(), plan: &work.plan, times })
        };
        let (files, products) = walk.scene(&self.core, &scene, &losses, queue, start)?;
        let mut written = files.writers.close(&walk.context(&scene), &products)?;
        let output = Output::new(staged, records::OWNER, self.core.scene);
        times.of("records", || files.records.write(&work.plan, &products, &output))?;
        written.extend(Some((records::OWNER.to_owned(), output.files())).filter(|(_, files)| !files.is_empty()));
        maker.reporter.event(&scene_event(&scene));
        let (views, objects) = (work.dataset.views_per_scene, scene.objects().len() as u32);
        Ok(Attempted { views, objects, odd: files.seen.odd(&scene), left_out: losses.all(), written })
    }

    /// Places the bodies, and lets them come to rest or does to them what settling did before, if that is `stored`.
    fn scene(&self, staged: &StoreFolder, stored: bool) -> Result<Scene> {
        let (scene, number) = (self.core.scene, self.core.number);
        let mut builder = self.core.place()?;
        let again = if stored { settled::read(self.maker.folder.files(), scene) } else { None };
        let report = match again.map(|settled| settled.apply(&mut builder)) {
            Some(Ok(report)) => report,
            _ => {
                let placed = Placed::of(&builder);
                let report = self.core.settle(&mut builder)?;
                if let Some(settled) = Settled::between(&placed, &builder, &report) {
                    settled::write(staged, scene, &settled)?;
                }
                report
            }
        };
        builder.freeze(scene, number, report)
    }
}

/// Writes the views of a scene, and keeps what the journal and the annotators of the dataset want of them.
struct SceneSink<'m> {
    writers: Writers<'m, Scenes>,
    records: Records,
    seen: Seen,
    plan: &'m Plan,
    times: &'m Times,
}

impl Sink for SceneSink<'_> {
    fn view(&mut self, cx: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()> {
        self.writers.view(cx, products)?;
        self.times.of("records", || self.records.view(self.plan, products))?;
        self.seen.look(view, products);
        Ok(())
    }
}
