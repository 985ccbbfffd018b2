//! Samples in memory: the views of a recipe's scenes with the products that a program requests, without files.

mod order;
mod source;

pub use source::{NextScene, SceneSource};

use crate::cache::DiskCache;
use crate::pools::AssetStore;
use crate::run::dataset::loss::Loss;
use crate::run::making::attempt::{Attempt, Tools};
use crate::run::making::losses::Losses;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::SceneAttempts;
use crate::run::making::sessions::{AllSessions, scenes_in_flight};
use crate::run::making::times::Times;
use crate::run::making::walk::{SceneWalk, ViewSink, scene_event};
use crate::run::panics;
use crate::run::progress::{Event, Guarded, Once, Reporter, Warnings};
use crate::run::scene_range;
use crate::run::stop::Stop;
use crate::workers::{self, Pool, Stoppable};
use order::{Closing, SceneOrder};
use parking_lot::Mutex;
use source::{Requests, SceneList};
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syntable_model::context::{SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products, Scope};
use syntable_model::scene::{Scene, View};
use syntable_model::stage::DatasetInfo;
use syntable_recipe::plan::Plan;
use syntable_recipe::{Component, Recipe};

/// Number of samples that wait for the caller of a [`Generator`], besides the scenes in flight.
const WAITING: usize = 1;

/// The samples to make, and how to make them.
#[derive(Clone)]
pub struct GenerateOptions {
    /// Names of the products of a sample, such as `rgb` and `amodal_mask`. If empty, samples have all products that the
    /// recipe computes. A writer of the recipe must read the products, or the recipe must be loaded with them as
    /// [`wanted`](syntable_recipe::RecipeRequest::load).
    pub products: Vec<String>,
    /// Numbers of the scenes, not empty. `None` for all scenes of the recipe.
    pub scenes: Option<Range<u32>>,
    /// Run code that the recipe brings: native libraries by a path beside it, and programs. It is code of the recipe's author.
    pub allow_code: bool,
    /// Number of threads. The samples do not depend on it.
    pub threads: usize,
    /// Cache of results that later runs can use.
    pub cache: DiskCache,
    /// Ends the work early on request.
    pub stop: Stop,
}

impl Default for GenerateOptions {
    /// All scenes and products, on all cores.
    fn default() -> Self {
        let (products, scenes, allow_code, stop) = (Vec::new(), None, false, Stop::default());
        Self { products, scenes, allow_code, threads: workers::available(), cache: DiskCache::of_user(), stop }
    }
}

/// One view of a scene, with the pixels and labels that a run of the recipe would write.
#[derive(Clone)]
pub struct Sample {
    /// The scene: bodies at rest, materials, lights.
    pub scene: Arc<Scene>,
    /// Camera, exposure and lights.
    pub view: Arc<View>,
    /// The requested products, of the view, its moment and its scene.
    pub products: Products,
}

/// The result of [`generate`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Generated {
    /// Numbers of the scenes that failed, ascending.
    pub failed: Vec<u32>,
    /// Data that stages omitted from the samples.
    pub left_out: Vec<Loss>,
}

/// Makes samples, and passes them to `take` in the order of scenes and views. Several scenes are made in parallel, and
/// their samples wait for their turn.
///
/// A scene that fails has no samples. The reporter gets an event, and the result has the scene's number.
///
/// # Errors
/// If the recipe cannot be run, a product is not computed, `take` refuses a sample, or the work was asked to stop.
pub fn generate(
    recipe: &Recipe,
    options: &GenerateOptions,
    reporter: &dyn Reporter,
    take: &mut dyn FnMut(Sample) -> Result<()>,
) -> Result<Generated> {
    let scenes = scene_range::within(options.scenes.as_ref(), recipe.dataset.scenes)?;
    let (scenes, count) = (SceneList::new(scenes.clone()), scenes.len());
    generate_scenes(recipe, options, (&scenes, count), reporter, &mut |_, samples| {
        samples.into_iter().flatten().try_for_each(&mut *take)
    })
}

/// Makes the scenes of a source, and passes the samples of each to `take`, in the order of the source. A scene that fails has
/// `None`. At most `count` scenes are in work. The options' scenes do not matter.
///
/// # Errors
/// As [`generate`], and if the recipe lacks a scene of the source.
fn generate_scenes(
    recipe: &Recipe,
    options: &GenerateOptions,
    (scenes, count): (&dyn SceneSource, usize),
    reporter: &dyn Reporter,
    take: &mut dyn FnMut(u32, Option<Vec<Sample>>) -> Result<()>,
) -> Result<Generated> {
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    recipe.ready(options.allow_code)?;
    recipe.fits()?;
    let components =
        recipe.components.all().map(|component| SampleWork::of(recipe, component, options)).collect::<Result<_>>()?;
    let (assets, times) = (AssetStore::open_for_run(recipe, &log)?, Times::default());
    let in_flight = scenes_in_flight(recipe, options.threads, count);
    let sessions = AllSessions::open(recipe, scenes.all(), in_flight)?;
    let stop = options.stop.nested();
    let (workers, cache) = (&Stoppable { workers: &pool, stop: &stop }, &options.cache);
    let tools = Tools { recipe, assets: &assets, cache, workers, log: &log, times: &times, stop: &stop };
    let maker = SampleMaker { tools, reporter, sessions: &sessions, components, left_out: Mutex::default() };
    let order = SceneOrder::new(scenes, count.min(in_flight) as u64);
    let mut failed = Vec::new();
    let result = panics::quiet(|| {
        thread::scope(|threads| {
            let queue = Queue::start(threads, options.threads);
            for _ in 0..in_flight {
                let (queue, maker, order) = (queue.clone(), &maker, &order);
                threads.spawn(move || {
                    while let Some((place, scene)) = order.begin() {
                        order.put(place, scene, panics::unwound(|| maker.scene(scene, &queue)));
                    }
                });
            }
            drop(queue);
            // The threads end with the loop, even after an error or a panic.
            let _closed = Closing(&order, &stop);
            while let Some((scene, samples)) = order.take() {
                let samples = samples?;
                if samples.is_none() {
                    failed.push(scene);
                }
                take(scene, samples)?;
            }
            Ok(())
        })
    });
    reporter.event(&Event::Stages { stages: times.all() });
    match options.stop.requested() {
        Some(reason) => Err(Error::stopped(format!("stopped by {reason}"))),
        None => result.map(|()| Generated { failed, left_out: Loss::sum(maker.left_out.into_inner()) }),
    }
}

/// The work on the scenes of a component.
struct SampleWork {
    /// Names of the products that samples have.
    names: Vec<String>,
    plan: Plan,
    dataset: DatasetInfo,
}

impl SampleWork {
    fn of(recipe: &Recipe, component: &Component, options: &GenerateOptions) -> Result<Self> {
        let names = products(component, options)?;
        let plan = component.plan.part(names.iter().map(String::as_str), false).on(&*component.render);
        Ok(Self { names, plan, dataset: recipe.info_of(component) })
    }
}

/// Names of the products that samples of a component have.
fn products(component: &Component, options: &GenerateOptions) -> Result<Vec<String>> {
    let entries = &component.plan.entries;
    let computed: Vec<&KeyId> =
        entries.iter().map(|entry| &entry.key).filter(|key| key.scope != Scope::Dataset).collect();
    if options.products.is_empty() {
        return Ok(computed.into_iter().map(|key| key.to_string()).collect());
    }
    match options.products.iter().find(|name| !computed.iter().any(|key| key.is(name))) {
        Some(name) => Err(Error::new(format!("the recipe does not compute `{name}`"))
            .help("load the recipe with it as `wanted`, or name it in a writer; `syntable list products` shows all")),
        None => Ok(options.products.clone()),
    }
}

/// Makes the samples of scenes.
struct SampleMaker<'a> {
    tools: Tools<'a>,
    reporter: &'a dyn Reporter,
    sessions: &'a AllSessions<'a>,
    /// The work on the scenes of each component.
    components: Vec<SampleWork>,
    left_out: Mutex<Vec<Loss>>,
}

impl SampleMaker<'_> {
    /// The samples of a scene. `None` if the scene fails. An error stops the work.
    fn scene<'env>(&'env self, scene: u32, queue: &Queue<'env>) -> Result<Option<Vec<Sample>>> {
        let Self { tools, reporter, .. } = *self;
        let scenes = tools.recipe.dataset.scenes;
        if scene >= scenes {
            return Err(Error::new(format!("scene {scene}: the recipe has scenes 0..{scenes}")).of_request());
        }
        let attempts = SceneAttempts { tools, reporter, scene, first: 0, is_present: false };
        let attempts = attempts.make(|number| self.attempt(scene, number, queue), Ok);
        Ok(attempts.map_err(|error| error.context(format!("scene {scene}")))?.made)
    }

    fn attempt<'env>(&'env self, scene: u32, number: u32, queue: &Queue<'env>) -> Result<Vec<Sample>> {
        let Self { tools, reporter, sessions, .. } = *self;
        let (index, component) = tools.recipe.component_of(scene);
        let SampleWork { names, plan, dataset } = &self.components[index];
        let (sessions, checks) = (sessions.of(component), &tools.recipe.checks);
        let walk = SceneWalk { tools, sessions, checks, reporter, dataset, plan };
        let attempt = Attempt::new(tools, dataset, (scene, number));
        let mut builder = attempt.place()?;
        let report = attempt.settle(&mut builder)?;
        let frozen = Arc::new(builder.freeze(report)?);
        let losses = Arc::new(Losses::default());
        let start =
            |_: &SceneContext| Ok(SampleSink { scene: Arc::clone(&frozen), names: names.clone(), all: Vec::new() });
        let (sink, of_scene) = walk.scene(&attempt, &frozen, &losses, queue, start)?;
        self.left_out.lock().extend(losses.all());
        reporter.event(&scene_event(&frozen));
        let of_scene = of_scene.only(names);
        let mut samples = sink.all;
        for sample in &mut samples {
            sample.products.extend(of_scene.clone().without(&sample.products))?;
        }
        Ok(samples)
    }
}

/// Keeps the views of a scene.
struct SampleSink {
    scene: Arc<Scene>,
    names: Vec<String>,
    all: Vec<Sample>,
}

impl ViewSink for SampleSink {
    fn view(&mut self, _: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()> {
        let (scene, view) = (Arc::clone(&self.scene), Arc::clone(view));
        self.all.push(Sample { scene, view, products: products.only(&self.names) });
        Ok(())
    }
}

/// Takes a sample.
type Take<'a> = &'a mut dyn FnMut(Sample) -> Result<()>;

/// Number of scenes in addition to the threads from which the length of a list does not matter.
const LISTED: usize = 1024;

/// Iterator of samples, which separate threads make while the caller works. Dropping it ends the work.
///
/// The iterator ends after the last sample, or after the first error.
pub struct Generator {
    samples: Option<Receiver<Sample>>,
    thread: Option<JoinHandle<Result<Generated>>>,
    stop: Stop,
    result: Generated,
}

impl Generator {
    /// Starts to make samples.
    pub fn start(recipe: Arc<Recipe>, options: GenerateOptions, reporter: Arc<dyn Reporter>) -> Self {
        Self::spawn(options, move |options, take| generate(&recipe, options, &*reporter, take))
    }

    /// Starts to make the samples of a list of scenes, in its order. The options' scenes do not matter.
    pub fn of_scenes(
        recipe: Arc<Recipe>,
        options: GenerateOptions,
        scenes: impl Iterator<Item = u32> + Clone + Send + Sync + 'static,
        reporter: Arc<dyn Reporter>,
    ) -> Self {
        Self::spawn(options, move |options, take| {
            let count = scenes.clone().take(options.threads + LISTED).count();
            let scenes = SceneList::new(scenes);
            generate_scenes(&recipe, options, (&scenes, count), &*reporter, &mut |_, samples| {
                samples.into_iter().flatten().try_for_each(&mut *take)
            })
        })
    }

    fn spawn(
        options: GenerateOptions,
        work: impl FnOnce(&GenerateOptions, Take) -> Result<Generated> + Send + 'static,
    ) -> Self {
        let (sender, samples) = sync_channel(WAITING);
        // The caller's handle may belong to other work, too.
        let stop = options.stop.nested();
        let options = GenerateOptions { stop: stop.clone(), ..options };
        let thread = thread::spawn(move || {
            work(&options, &mut |sample| {
                // The receiver is gone once the iterator is dropped.
                sender.send(sample).map_err(|_| Error::new("the samples are no longer wanted"))
            })
        });
        Self { samples: Some(samples), thread: Some(thread), stop, result: Generated::default() }
    }

    /// The failed scenes, and the data that stages omitted. Complete after the last sample.
    pub fn result(&self) -> &Generated {
        &self.result
    }

    /// The next sample, as [`Iterator::next`] returns it, or [`Waited::NotYet`] after `patience`.
    pub fn next_within(&mut self, patience: Duration) -> Waited {
        match self.samples.as_ref().map(|samples| samples.recv_timeout(patience)) {
            Some(Ok(sample)) => Waited::Next(Some(Ok(Box::new(sample)))),
            Some(Err(RecvTimeoutError::Timeout)) => Waited::NotYet,
            Some(Err(RecvTimeoutError::Disconnected)) | None => Waited::Next(self.end().map(Err)),
        }
    }

    /// Waits for the threads after the last sample. Returns their error once.
    fn end(&mut self) -> Option<Error> {
        self.samples = None;
        match self.thread.take()?.join() {
            Ok(Ok(result)) => {
                self.result = result;
                None
            }
            Ok(Err(error)) => Some(error),
            Err(_) => Some(Error::new("the thread that makes samples panicked")),
        }
    }
}

/// The result of waiting for a sample.
pub enum Waited {
    /// A sample, an error, or nothing after the last sample.
    Next(Option<Result<Box<Sample>>>),
    /// The sample is still in work.
    NotYet,
}

impl Iterator for Generator {
    type Item = Result<Sample>;

    fn next(&mut self) -> Option<Result<Sample>> {
        match self.samples.as_ref().and_then(|samples| samples.recv().ok()) {
            Some(sample) => Some(Ok(sample)),
            None => self.end().map(Err),
        }
    }
}

impl Drop for Generator {
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            self.stop.cancel();
            self.samples = None;
            let _ = thread.join();
        }
    }
}

/// Makes scenes on request. Dropping it ends the work.
pub struct SceneService {
    requests: Option<Sender<u32>>,
    made: Receiver<(u32, Option<Vec<Sample>>)>,
    thread: Option<JoinHandle<Result<Generated>>>,
    stop: Stop,
}

impl SceneService {
    /// Starts the threads, which wait for requests. The options' scenes do not matter.
    pub fn start(recipe: Arc<Recipe>, options: GenerateOptions, reporter: Arc<dyn Reporter>) -> Self {
        let ((requests, asked), (sender, made)) = (channel(), channel());
        let stop = options.stop.nested();
        let options = GenerateOptions { stop: stop.clone(), ..options };
        let thread = thread::spawn(move || {
            let (source, count) = (Requests::new(asked), recipe.dataset.scenes as usize);
            generate_scenes(&recipe, &options, (&source, count), &*reporter, &mut |scene, samples| {
                sender.send((scene, samples)).map_err(|_| Error::new("the scenes are no longer wanted"))
            })
        });
        Self { requests: Some(requests), made, thread: Some(thread), stop }
    }

    /// Requests a scene.
    pub fn request(&self, scene: u32) {
        // If the work has ended, the next wait returns its error.
        let _ = self.requests.as_ref().map(|requests| requests.send(scene));
    }

    /// The next of the requested scenes, in the order of requests: its number and samples, `None` if it failed. `None` after
    /// `patience`.
    ///
    /// # Errors
    /// If the work has ended.
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<(u32, Option<Vec<Sample>>)>> {
        match self.made.recv_timeout(patience) {
            Ok(made) => Ok(Some(made)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(match self.thread.take().map(JoinHandle::join) {
                Some(Ok(Err(error))) => error,
                Some(Err(_)) => Error::new("the thread that makes scenes panicked"),
                Some(Ok(Ok(_))) | None => Error::new("the work on scenes has ended"),
            }),
        }
    }
}

impl Drop for SceneService {
    fn drop(&mut self) {
        self.requests = None;
        self.stop.cancel();
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
