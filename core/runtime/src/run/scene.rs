//! One scene: composed, rendered view by view, annotated and written, with its attempts.
//!
//! A scene's thread composes it, then borrows a render session and hands each rendered view to the queue, where it is
//! denoised, annotated and written while the next view is rendered. Views are written in order, and the error of an
//! attempt is that of its first failing view, so nothing depends on the scheduling.

use super::attempt::{self, Tools, keep, provided};
use super::folder::Folder;
use super::journal::{JournalEntry, SceneOutcome};
use super::losses::{Loss, Losses, StageLog};
use super::manifest::{Manifest, Written};
use super::panics::unwound;
use super::progress::{Event, Reporter};
use super::queue::Queue;
use super::records::{self, Records};
use super::seen::{Odd, Seen};
use super::sessions::Sessions;
use super::settled;
use super::times::Times;
use super::todo;
use crate::plan::{Plan, PlannedStage, Producer};
use crate::pools::RecordingAssets;
use parking_lot::{Condvar, Mutex};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_model::check::Check;
use syntable_model::context::{DatasetContext, SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::RADIANCE;
use syntable_model::product::{KeyId, Name, Products, RenderParameters, Scope};
use syntable_model::random::Stream;
use syntable_model::scene::{Placed, Scene, SceneId, Settled, View, ViewId};
use syntable_model::stage::{DatasetInfo, Denoiser, Input, Output, SceneWriter, ViewProducts, Writer};

/// How often an attempt is repeated whose device failed.
const DEVICE_REPEATS: u32 = 2;

/// Makes scenes.
pub struct SceneMaker<'a> {
    pub tools: Tools<'a>,
    pub reporter: &'a dyn Reporter,
    pub folder: &'a Folder,
    pub sessions: &'a Sessions<'a>,
    /// What must hold in every view that is written.
    pub checks: &'a [Check],
}

/// What is made of a scene.
pub struct Work<'a> {
    /// The dataset, with the number of views of the scene.
    pub dataset: DatasetInfo,
    /// What is computed.
    pub plan: Plan,
    /// Who writes.
    pub writers: Vec<&'a (String, Box<dyn Writer>)>,
}

/// A scene to make.
pub struct Task<'a> {
    /// The scene.
    pub scene: u32,
    /// Whether the dataset has it.
    pub is_present: bool,
    /// What is made of a new scene, or of one that is made again.
    pub whole: &'a Work<'a>,
    /// The scene as it is in the dataset, if it only gets what it lacks, and what that is.
    pub extend: Option<(&'a JournalEntry, &'a Work<'a>)>,
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
                        kept: todo::kept(&self.folder.manifest_of(present)?, present, &task.whole.plan),
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
            let again = error.is_passing() && repeat < DEVICE_REPEATS;
            if !again && (error.is_permanent() || error.is_io() || (error.is_device() && task.is_present)) {
                return Err(error);
            }
            let error = if error.is_contradiction() { self.aside(scene, error)? } else { error };
            let no_other = error.is_device() || error.is_contradiction();
            let last = !again && (no_other || number + 1 == self.tools.recipe.dataset.max_attempts);
            self.reporter.event(&Event::Attempt { scene, attempt: number, error: error.to_string(), last });
            if !again {
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

    fn scene_context<'s>(&'s self, work: &'s Work, scene: &'s Scene) -> SceneContext<'s> {
        let Tools { workers, log, cache, .. } = self.tools;
        DatasetContext::new(&work.dataset, workers, log).with_cache(cache).scene(scene)
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
    fn run(&self, staged: &Path, stored: bool, queue: &Queue<'m>) -> Result<Attempted> {
        let (maker, work) = (self.maker, self.work);
        let losses = Arc::new(Losses::default());
        let scene = Arc::new(self.scene(staged, stored)?);
        let cx = maker.scene_context(work, &scene);
        let mut products = Products::new();
        for stage in &work.plan.before_views {
            run_in_scene(maker.tools.times, &losses, stage, &cx, &[], &mut products)?;
        }
        let views: Vec<Arc<View>> = (0..work.dataset.views_per_scene)
            .map(|number| self.core.view(&scene, ViewId(number)).map(Arc::new))
            .collect::<Result<_>>()?;
        let writers = Writers::start(work.writers.iter().copied(), &cx, staged, (maker.tools.times, &losses))?;
        let views = self.render(&scene, &views, writers, (&products, &losses), queue)?;
        for stage in &work.plan.after_views {
            let reads: Vec<Name> = stage.reads.iter().map(|key| key.name).collect();
            let lent: Vec<ViewProducts> = views
                .views
                .iter()
                .map(|view| ViewProducts { view: Arc::clone(&view.view), products: view.products.only(&reads) })
                .collect();
            run_in_scene(maker.tools.times, &losses, stage, &cx, &lent, &mut products)?;
        }
        let mut written = views.writers.close(&cx, &products)?;
        let output = Output::new(staged, records::OWNER, self.core.scene);
        maker.tools.times.of("records", || views.records.write(&work.plan, &products, &output))?;
        written.extend(Some((records::OWNER.to_owned(), output.files())).filter(|(_, files)| !files.is_empty()));
        let (removed, objects) = (scene.settle.removed.len() as u32, scene.objects().len() as u32);
        maker.reporter.event(&Event::Scene { scene: self.core.scene.0, objects, removed });
        let left_out = losses.all();
        let (views, odd) = (work.dataset.views_per_scene, views.seen.odd(&scene));
        Ok(Attempted { views, objects, odd, left_out, written })
    }

    /// Places the bodies, and lets them come to rest or does to them what settling did before, if that is `stored`.
    fn scene(&self, staged: &Path, stored: bool) -> Result<Scene> {
        let (scene, number) = (self.core.scene, self.core.number);
        let mut builder = self.core.place()?;
        let again = if stored { settled::read(self.maker.folder.root(), scene) } else { None };
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

    /// Renders the views, and sees each through annotation and writing.
    fn render(
        &self,
        scene: &Arc<Scene>,
        views: &[Arc<View>],
        writers: Writers<'m>,
        (of_scene, losses): (&Products, &Arc<Losses>),
        queue: &Queue<'m>,
    ) -> Result<Views<'m>> {
        let line = Arc::new(Line::new(writers, losses));
        let work = self.work;
        let after = |view: &View| views.get(view.id.0 as usize + 1).cloned();
        let follow = |view: &Arc<View>, products: Products| {
            let sensing: BTreeMap<String, Stream> = self.core.sensing(&work.plan, view.id);
            let (maker, scene, line) = (self.maker, Arc::clone(scene), Arc::clone(&line));
            let views = (Arc::clone(view), after(view));
            line.clone().announce();
            queue.add(move || line.follow((maker, work), &scene, views, products, &sensing));
        };
        let next = || if line.has_failed() { Ok(false) } else { self.maker.tools.running().map(|()| true) };
        let render = || {
            if work.plan.rendered.is_empty() {
                // Nothing of it needs an image: neither does it need a session.
                return views.iter().try_for_each(|view| {
                    if next()? {
                        follow(view, of_scene.clone());
                    }
                    Ok(())
                });
            }
            self.maker.sessions.with(|session| {
                self.maker.tools.times.of("render.load", || session.load(scene, self.maker.tools.workers))?;
                for view in views {
                    if !next()? {
                        break;
                    }
                    let mut products = of_scene.clone();
                    self.core.render_view(&work.plan, session, (view, after(view).as_deref()), &mut products)?;
                    follow(view, products);
                }
                Ok(())
            })
        };
        // Whatever becomes of it, views that were handed over are waited for: they write into the attempt's folder.
        let rendered = unwound(render);
        // The first failing view speaks for the attempt; the renderer's own error is of a later one.
        let views = line.join()?;
        rendered.map(|()| views)
    }
}

/// The views of a scene on their way from the renderer to the files: annotated at once, written in order.
struct Line<'m> {
    losses: Arc<Losses>,
    state: Mutex<LineState<'m>>,
    moved: Condvar,
}

struct LineState<'m> {
    /// Views that were handed over.
    announced: u32,
    /// The next view to write.
    next: u32,
    /// The error of the first failing view.
    failure: Option<Error>,
    views: Views<'m>,
}

/// The writers of a scene, and what is kept of its views.
struct Views<'m> {
    writers: Writers<'m>,
    records: Records,
    seen: Seen,
    /// What the annotators after the views read.
    views: Vec<ViewProducts>,
}

impl<'m> Line<'m> {
    fn new(writers: Writers<'m>, losses: &Arc<Losses>) -> Self {
        let views = Views { writers, ..Views::default() };
        let state = LineState { announced: 0, next: 0, failure: None, views };
        Self { losses: Arc::clone(losses), state: Mutex::new(state), moved: Condvar::new() }
    }

    fn has_failed(&self) -> bool {
        self.state.lock().failure.is_some()
    }

    fn announce(&self) {
        self.state.lock().announced += 1;
    }

    /// Denoises, senses and annotates a view, waits until it is its turn, and writes it.
    fn follow(
        &self,
        (maker, work): (&SceneMaker, &Work),
        scene: &Scene,
        (view, next): (Arc<View>, Option<Arc<View>>),
        mut products: Products,
        sensing: &BTreeMap<String, Stream>,
    ) {
        let cx = maker.scene_context(work, scene).view(&view).before(next.as_deref());
        let plan = &work.plan;
        let of_view = |error: Error| error.context(format!("view {}", view.id.0));
        let checked =
            |products: &Products| maker.tools.times.of("checks", || check(maker.checks, products)).map_err(of_view);
        let make = || {
            annotate(maker.tools.times, Some(&*self.losses), plan, &cx, sensing, &mut products)?;
            checked(&products)
        };
        let made = if self.has_failed() { Ok(()) } else { unwound(make) };
        let mut state = self.state.lock();
        while state.next != view.id.0 {
            self.moved.wait(&mut state);
        }
        if state.failure.is_none() {
            let written = unwound(|| {
                made?;
                state.views.writers.view(&cx, &products)?;
                maker.tools.times.of("records", || state.views.records.view(plan, &products))?;
                state.views.seen.look(&view, &products);
                state.views.keep(plan, &view, &products);
                maker.reporter.event(&Event::Image { scene: scene.id.0, view: view.id.0 });
                Ok(())
            });
            state.failure = written.err();
        }
        state.next += 1;
        self.moved.notify_all();
    }

    /// Waits for all views that were handed over.
    fn join(self: Arc<Self>) -> Result<Views<'m>> {
        let mut state = self.state.lock();
        while state.next != state.announced {
            self.moved.wait(&mut state);
        }
        match state.failure.take() {
            Some(error) => Err(error),
            None => Ok(std::mem::take(&mut state.views)),
        }
    }
}

impl Default for Views<'_> {
    fn default() -> Self {
        Self { writers: Writers(Vec::new()), records: Records::default(), seen: Seen::default(), views: Vec::new() }
    }
}

impl Views<'_> {
    fn keep(&mut self, plan: &Plan, view: &Arc<View>, products: &Products) {
        let reads = plan.after_views.iter().flat_map(|stage| &stage.reads);
        let names: Vec<Name> = reads.filter(|key| key.scope == Scope::View).map(|key| key.name).collect();
        if !names.is_empty() {
            self.views.push(ViewProducts { view: Arc::clone(view), products: products.only(&names) });
        }
    }
}

/// The scene writers of a recipe, each with the names of the products that it reads.
pub struct Writers<'m>(Vec<Writing<'m>>);

struct Writing<'m> {
    stage: String,
    reads: Vec<String>,
    writer: Box<dyn SceneWriter + 'm>,
    output: Output,
    times: &'m Times,
    losses: Arc<Losses>,
}

impl<'m> Writers<'m> {
    /// Starts the files of a scene in a folder.
    pub fn start(
        writers: impl IntoIterator<Item = &'m (String, Box<dyn Writer>)>,
        cx: &SceneContext,
        staged: &Path,
        (times, losses): (&'m Times, &Arc<Losses>),
    ) -> Result<Self> {
        let start = |(id, writer): &'m (String, Box<dyn Writer>)| {
            let (stage, output) = (format!("write.{id}"), Output::new(staged, id, cx.scene_id));
            let scene_writer = times.of(&stage, || writer.scene(cx, output.clone()))?;
            let losses = Arc::clone(losses);
            Ok(Writing { stage, reads: names(&writer.reads()), writer: scene_writer, output, times, losses })
        };
        writers.into_iter().map(start).collect::<Result<_>>().map(Self)
    }

    /// Writes a view.
    pub fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()> {
        self.view_of(cx, |reads| Ok(products.only(reads)))
    }

    /// Writes a view of which each writer is lent what `lend` gives for the names of the products that it reads.
    pub fn view_of(&mut self, cx: &ViewContext, lend: impl Fn(&[String]) -> Result<Products>) -> Result<()> {
        self.0.iter_mut().try_for_each(|Writing { stage, reads, writer, times, losses, .. }| {
            let log = StageLog { log: cx.log, losses, stage };
            let lent = lend(reads)?;
            times.of(stage, || writer.view(&cx.with_log(&log), &lent))
        })
    }

    /// Ends the files of the scene, and says whose they are.
    pub fn close(self, cx: &SceneContext, products: &Products) -> Result<Written> {
        let close = |Writing { stage, reads, writer, output, times, losses }: Writing| {
            let log = StageLog { log: cx.log, losses: &losses, stage: &stage };
            times.of(&stage, || writer.close(&cx.with_log(&log), &products.only(&reads)))?;
            Ok((output.id().to_owned(), output.files()))
        };
        self.0.into_iter().map(close).collect()
    }
}

/// Names of the products that a writer reads.
pub fn names(inputs: &[Input]) -> Vec<String> {
    inputs.iter().map(|input| input.product.clone()).collect()
}

/// Runs all producers of a view. What they leave out is added to `losses`; without these it is a warning.
pub fn annotate(
    times: &Times,
    losses: Option<&Losses>,
    plan: &Plan,
    cx: &ViewContext,
    sensing: &BTreeMap<String, Stream>,
    products: &mut Products,
) -> Result<()> {
    for stage in &plan.per_view {
        let log = losses.map(|losses| StageLog { log: cx.log, losses, stage: &stage.stage });
        let cx = &log.as_ref().map_or(*cx, |log| cx.with_log(log));
        let made = lend(times, stage, products, |lent| match &*stage.producer {
            Producer::Denoiser(denoiser) => denoiser.denoise(cx, lent),
            Producer::Sensor(sensor) => sensor.sense(cx, &sensing[&stage.stage], lent),
            Producer::View(annotator) => annotator.annotate(cx, lent),
            Producer::Scene(_) | Producer::Dataset(_) => unreachable!("the plan sorts producers by scope"),
        })?;
        keep(plan, made, products)?;
        if let Producer::Denoiser(denoiser) = &*stage.producer {
            plan.denoised.iter().try_for_each(|&of| denoise_objects(times, stage, &**denoiser, of, cx, products))?;
        }
    }
    Ok(())
}

/// Denoises the light on objects as that of the image.
fn denoise_objects(
    times: &Times,
    stage: &PlannedStage,
    denoiser: &dyn Denoiser,
    parameters: RenderParameters,
    cx: &ViewContext,
    products: &mut Products,
) -> Result<()> {
    let own = |key: &KeyId| key.with(parameters);
    let mut of_image = products.only(&stage.reads.iter().map(|key| own(key).name).collect::<Vec<_>>());
    for key in &stage.reads {
        of_image.rename(own(key), *key)?;
    }
    let mut made = lend(times, stage, &of_image, |lent| denoiser.denoise(cx, lent))?.only(&[RADIANCE.id().name]);
    made.rename(RADIANCE.id(), own(&RADIANCE.id()))?;
    products.extend(made)
}

/// Makes all checks on a view.
fn check(checks: &[Check], products: &Products) -> Result<()> {
    let of = |check: &Check| -> Result<Option<String>> {
        let faults = check.run(products)?;
        Ok((!faults.is_empty()).then(|| format!("{}: {}", check.name, faults.join("; "))))
    };
    let faults: Vec<String> = checks.iter().filter_map(|check| of(check).transpose()).collect::<Result<_>>()?;
    if faults.is_empty() { Ok(()) } else { Err(Error::contradiction(faults.join("\n"))) }
}

/// Runs an annotator of the scene.
pub fn run_in_scene(
    times: &Times,
    losses: &Losses,
    stage: &PlannedStage,
    cx: &SceneContext,
    views: &[ViewProducts],
    products: &mut Products,
) -> Result<()> {
    let Producer::Scene(annotator) = &*stage.producer else { unreachable!("the plan sorts producers by scope") };
    let log = StageLog { log: cx.log, losses, stage: &stage.stage };
    let made = lend(times, stage, products, |lent| annotator.annotate(&cx.with_log(&log), views, lent))?;
    products.extend(made)
}

/// Lends a producer what it declares to read, and returns what it made, which is what it declares to provide.
pub fn lend(
    times: &Times,
    stage: &PlannedStage,
    products: &Products,
    make: impl FnOnce(&mut Products) -> Result<()>,
) -> Result<Products> {
    let lent = products.only(&stage.reads.iter().map(|key| key.name).collect::<Vec<_>>());
    let mut filled = lent.clone();
    times.of(&stage.stage, || make(&mut filled))?;
    let made = filled.without(&lent);
    provided(&stage.provides, &made).map_err(|error| error.context(&stage.stage))?;
    Ok(made)
}
