//! Samples in memory: the views of a recipe's scenes with the products that a program wants, and no files.

use crate::cache::DiskCache;
use crate::pools::{AssetStore, RecordingAssets};
use crate::run::dataset::loss::Loss;
use crate::run::making::attempt::{Attempt, Tools};
use crate::run::making::losses::Losses;
use crate::run::making::queue::Queue;
use crate::run::making::recovery::Recovery;
use crate::run::making::sessions::{Sessions, scenes_in_flight};
use crate::run::making::times::Times;
use crate::run::making::walk::{Sink, Walk, scene_event};
use crate::run::panics;
use crate::run::progress::{Event, Guarded, Once, Reporter, Warnings};
use crate::run::stop::Stop;
use crate::workers::{self, Pool};
use parking_lot::{Condvar, Mutex};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, JoinHandle};
use syntable_model::context::{SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products, Scope};
use syntable_model::scene::{Scene, SceneId, View};
use syntable_recipe::Recipe;

/// Samples that wait for a caller of [`Generator`], beside the scenes that are in flight.
const WAITING: usize = 1;

/// Which samples are made, and how.
#[derive(Clone)]
pub struct GenerateOptions {
    /// Names of the products that a sample has, such as `rgb` and `amodal_mask`; all that the recipe computes if empty. The
    /// recipe must have been loaded with them as [`wanted`](syntable_recipe::RecipeRequest::load), or have a writer of them.
    pub products: Vec<String>,
    /// Scenes; all of the recipe if none.
    pub scenes: Option<Range<u32>>,
    /// Threads. The samples do not depend on it.
    pub threads: usize,
    /// Results kept between runs.
    pub cache: DiskCache,
    /// Asks the work to end early.
    pub stop: Stop,
}

impl Default for GenerateOptions {
    /// All scenes and products, on all cores.
    fn default() -> Self {
        let (products, scenes, stop) = (Vec::new(), None, Stop::default());
        Self { products, scenes, threads: workers::available(), cache: DiskCache::of_user(), stop }
    }
}

/// One view of a scene, with the pixels and labels that a run of the recipe would write.
#[derive(Clone)]
pub struct Sample {
    /// The scene: bodies at rest, materials, lights.
    pub scene: Arc<Scene>,
    /// Camera, exposure and lights.
    pub view: Arc<View>,
    /// The products that were asked for, of the view and of its scene.
    pub products: Products,
}

/// What a call of [`generate`] came to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Generated {
    /// Scenes that failed in all attempts, ascending.
    pub failed: Vec<u32>,
    /// What stages left out of the images of the other scenes.
    pub left_out: Vec<Loss>,
}

/// Makes samples and hands them over in order of scenes and views. A few scenes are made ahead, in parallel; their samples wait
/// until it is their turn.
///
/// A scene that fails in all attempts has no samples: the reporter hears of it, and the result names it.
///
/// # Errors
/// If the recipe cannot be run, a product is not computed, `take` refuses a sample, or the work was asked to stop.
pub fn generate(
    recipe: &Recipe,
    options: &GenerateOptions,
    reporter: &dyn Reporter,
    take: &mut dyn FnMut(Sample) -> Result<()>,
) -> Result<Generated> {
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    recipe.ready()?;
    recipe.fits()?;
    let names = products(recipe, options)?;
    let plan = recipe.plan.part(names.iter().map(String::as_str), false).on(&*recipe.render);
    let scenes = options.scenes.clone().unwrap_or(0..recipe.dataset.scenes);
    let (assets, times) = (AssetStore::open(recipe, &log)?, Times::default());
    let in_flight = scenes_in_flight(recipe, options.threads, scenes.len());
    let sessions = Sessions::open(&*recipe.render, in_flight)?;
    let (dataset, stop) = (recipe.dataset_info(), options.stop.nested());
    let tools =
        Tools { recipe, assets: &assets, cache: &options.cache, workers: &pool, log: &log, times: &times, stop: &stop };
    let walk = Walk { tools, sessions: &sessions, checks: &recipe.checks, reporter, dataset: &dataset, plan: &plan };
    let maker = Maker { walk, names: &names, left_out: Mutex::default() };
    let order = Order::new(scenes.start, scenes.len().min(in_flight) as u32);
    let mut failed = Vec::new();
    let result = panics::quiet(|| {
        thread::scope(|threads| {
            let queue = Queue::start(threads, options.threads);
            for _ in 0..in_flight {
                let (queue, maker, order, end) = (queue.clone(), &maker, &order, scenes.end);
                threads.spawn(move || {
                    while let Some(scene) = order.begin(end) {
                        order.put(scene, panics::unwound(|| maker.scene(scene, &queue)));
                    }
                });
            }
            drop(queue);
            // Whatever ends the loop, the threads end, too.
            let _closed = Closing(&order, &stop);
            for scene in scenes.clone() {
                match order.take(scene)? {
                    Some(samples) => samples.into_iter().try_for_each(&mut *take)?,
                    None => failed.push(scene),
                }
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

/// Names of the products that samples have.
fn products(recipe: &Recipe, options: &GenerateOptions) -> Result<Vec<String>> {
    let computed: Vec<&KeyId> =
        recipe.plan.entries.iter().map(|entry| &entry.key).filter(|key| key.scope != Scope::Dataset).collect();
    if options.products.is_empty() {
        return Ok(computed.into_iter().map(|key| key.name.to_string()).collect());
    }
    match options.products.iter().find(|name| !computed.iter().any(|key| key.name == **name)) {
        Some(name) => Err(Error::new(format!("the recipe does not compute `{name}`"))
            .help("load the recipe with it as `wanted`, or name it in a writer; `syntable list products` shows all")),
        None => Ok(options.products.clone()),
    }
}

/// Makes the samples of scenes.
struct Maker<'a> {
    walk: Walk<'a>,
    names: &'a [String],
    left_out: Mutex<Vec<Loss>>,
}

impl<'a> Maker<'a> {
    /// The samples of a scene; none if it fails in all attempts. An error stops the work.
    fn scene(&self, scene: u32, queue: &Queue<'a>) -> Result<Option<Vec<Sample>>> {
        let attempts = self.walk.tools.recipe.dataset.max_attempts.max(1);
        let (mut number, mut repeats) = (0, 0);
        loop {
            let error = match panics::unwound(|| self.attempt(scene, number, queue)) {
                Ok(samples) => return Ok(Some(samples)),
                Err(error) => error,
            };
            self.walk.tools.running()?;
            self.walk.tools.assets.refused()?;
            let recovery = Recovery::of(&error, repeats);
            let last = match recovery {
                Recovery::Stop => return Err(error.context(format!("scene {scene}"))),
                Recovery::FailScene => true,
                Recovery::Repeat => false,
                Recovery::NextAttempt => number + 1 == attempts,
            };
            let event = Event::Attempt { scene, attempt: number, error: error.to_string(), last };
            self.walk.reporter.event(&event);
            if last {
                return Ok(None);
            }
            (number, repeats) = if recovery == Recovery::Repeat { (number, repeats + 1) } else { (number + 1, 0) };
        }
    }

    fn attempt(&self, scene: u32, number: u32, queue: &Queue<'a>) -> Result<Vec<Sample>> {
        let Walk { tools, dataset, reporter, .. } = self.walk;
        let assets = RecordingAssets::new(tools.assets);
        let attempt = Attempt { tools, dataset, scene: SceneId(scene), number, assets };
        let mut builder = attempt.place()?;
        let report = attempt.settle(&mut builder)?;
        let frozen = Arc::new(builder.freeze(attempt.scene, number, report)?);
        let losses = Arc::new(Losses::default());
        let start =
            |_: &SceneContext| Ok(Samples { scene: Arc::clone(&frozen), names: self.names.to_vec(), all: Vec::new() });
        let (samples, of_scene) = self.walk.scene(&attempt, &frozen, &losses, queue, start)?;
        self.left_out.lock().extend(losses.all());
        reporter.event(&scene_event(&frozen));
        let of_scene = of_scene.only(self.names);
        let mut samples = samples.all;
        for sample in &mut samples {
            sample.products.extend(of_scene.clone().without(&sample.products))?;
        }
        Ok(samples)
    }
}

/// Keeps the views of a scene.
struct Samples {
    scene: Arc<Scene>,
    names: Vec<String>,
    all: Vec<Sample>,
}

impl Sink for Samples {
    fn view(&mut self, _: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()> {
        let (scene, view) = (Arc::clone(&self.scene), Arc::clone(view));
        self.all.push(Sample { scene, view, products: products.only(&self.names) });
        Ok(())
    }
}

/// What came of a scene.
type SceneSamples = Result<Option<Vec<Sample>>>;

/// Scenes that are made in any order, and taken in theirs. Nobody begins a scene that is too far ahead.
struct Order {
    state: Mutex<OrderState>,
    moved: Condvar,
    ahead: u32,
}

struct OrderState {
    /// The next scene to begin, and the next one to be taken.
    next: u32,
    taken: u32,
    done: BTreeMap<u32, SceneSamples>,
    is_closed: bool,
}

impl Order {
    fn new(first: u32, ahead: u32) -> Self {
        let state = OrderState { next: first, taken: first, done: BTreeMap::new(), is_closed: false };
        Self { state: Mutex::new(state), moved: Condvar::new(), ahead }
    }

    /// The next scene to make; none if there is no more.
    fn begin(&self, end: u32) -> Option<u32> {
        let mut state = self.state.lock();
        while !state.is_closed && state.next < end && state.next >= state.taken.saturating_add(self.ahead) {
            self.moved.wait(&mut state);
        }
        let scene = (!state.is_closed && state.next < end).then_some(state.next)?;
        state.next += 1;
        Some(scene)
    }

    fn put(&self, scene: u32, samples: SceneSamples) {
        self.state.lock().done.insert(scene, samples);
        self.moved.notify_all();
    }

    /// Waits for a scene.
    fn take(&self, scene: u32) -> SceneSamples {
        let mut state = self.state.lock();
        let samples = loop {
            match state.done.remove(&scene) {
                Some(samples) => break samples,
                None => self.moved.wait(&mut state),
            }
        };
        state.taken = scene + 1;
        self.moved.notify_all();
        samples
    }
}

/// Begins no more scenes when it is dropped, and gives up those in the making.
struct Closing<'a>(&'a Order, &'a Stop);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.state.lock().is_closed = true;
        self.1.cancel();
        self.0.moved.notify_all();
    }
}

/// Samples as an iterator, made on threads of its own while the caller works. Dropping it ends the work.
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
        let (sender, samples) = sync_channel(WAITING);
        let stop = options.stop.clone();
        let thread = thread::spawn(move || {
            generate(&recipe, &options, &*reporter, &mut |sample| {
                // Nobody wants more once the iterator is gone.
                sender.send(sample).map_err(|_| Error::new("the samples are no longer wanted"))
            })
        });
        Self { samples: Some(samples), thread: Some(thread), stop, result: Generated::default() }
    }

    /// Scenes that failed, and what stages left out; complete once the iterator has ended.
    pub fn result(&self) -> &Generated {
        &self.result
    }
}

impl Iterator for Generator {
    type Item = Result<Sample>;

    fn next(&mut self) -> Option<Result<Sample>> {
        if let Some(sample) = self.samples.as_ref().and_then(|samples| samples.recv().ok()) {
            return Some(Ok(sample));
        }
        self.samples = None;
        match self.thread.take()?.join() {
            Ok(Ok(result)) => {
                self.result = result;
                None
            }
            Ok(Err(error)) => Some(Err(error)),
            Err(_) => Some(Err(Error::new("the thread that makes samples panicked"))),
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
