//! The walk over a scene: annotators before its views, then of each moment and each view, and annotators after the
//! views. A [`ViewSink`] gets the products: a run writes files, a generator keeps samples.
//!
//! A scene's thread borrows a render session and hands each rendered view to the queue, which denoises, senses,
//! annotates and checks it while the next view is rendered. The sink gets views in order, and a walk reports the error
//! of its first failing view, so nothing depends on the scheduling.

use crate::run::making::attempt::{Attempt, PosedSession, Tools};
use crate::run::making::frames::Frames;
use crate::run::making::losses::Losses;
use crate::run::making::queue::Queue;
use crate::run::making::sessions::Sessions;
use crate::run::making::stages::{annotate, check, run_in_scene};
use crate::run::panics::unwound;
use crate::run::progress::{Event, Reporter};
use parking_lot::{Condvar, Mutex};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::context::{DatasetContext, SceneContext, ViewContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products};
use syntable_model::random::Stream;
use syntable_model::scene::{Scene, View, ViewId};
use syntable_model::stage::{DatasetInfo, ViewProducts};
use syntable_recipe::plan::Plan;

/// The event of a finished scene.
pub fn scene_event(scene: &Scene) -> Event {
    let (removed, objects) = (scene.settle.removed.len() as u32, scene.objects().len() as u32);
    Event::Scene { scene: scene.id.0, objects, removed }
}

/// Takes the views of a scene.
pub trait ViewSink: Send {
    /// Takes a view with all products of the plan. Views come in order.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn view(&mut self, cx: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()>;
}

/// The walk over scenes, without the scene.
#[derive(Clone, Copy)]
pub struct SceneWalk<'m> {
    pub tools: Tools<'m>,
    pub sessions: &'m Sessions<'m>,
    /// Checks of every view.
    pub checks: &'m [Arc<dyn LabelCheck>],
    pub reporter: &'m dyn Reporter,
    /// The dataset, with the number of views of the scene.
    pub dataset: &'m DatasetInfo,
    /// The products to compute.
    pub plan: &'m Plan,
}

impl<'m> SceneWalk<'m> {
    /// The context of a scene.
    pub fn context<'s>(&self, scene: &'s Scene) -> SceneContext<'s>
    where
        'm: 's,
    {
        let Tools { workers, log, cache, .. } = self.tools;
        DatasetContext::new(self.dataset, workers, log).with_cache(cache).scene(scene)
    }

    /// Walks over a frozen scene. `start` makes the sink before the first view is rendered. Returns the sink, and the
    /// products of the scene.
    ///
    /// # Errors
    /// The error of the first view that fails, or of a stage of the scene.
    pub fn scene<S: ViewSink + 'm>(
        self,
        core: &Attempt<'m>,
        scene: &Arc<Scene>,
        losses: &Arc<Losses>,
        queue: &Queue<'m>,
        start: impl FnOnce(&SceneContext) -> Result<S>,
    ) -> Result<(S, Products)> {
        let (cx, times) = (self.context(scene), self.tools.times);
        let mut products = Products::new();
        for stage in &self.plan.before_views {
            run_in_scene(times, losses, stage, &cx, &[], &mut products)?;
        }
        let views: Vec<Arc<View>> = (0..self.dataset.views_per_scene)
            .map(|number| core.view(scene, ViewId(number)).map(Arc::new))
            .collect::<Result<_>>()?;
        let line = Arc::new(ViewLine::new(start(&cx)?, losses));
        let frames = Frames::new(self.plan, &products, (times, losses));
        let (sink, kept) = self.render(core, scene, &views, line, (frames, queue))?;
        for stage in &self.plan.after_views {
            let lend = |it: &ViewProducts| ViewProducts {
                view: Arc::clone(&it.view),
                products: it.products.only(&stage.reads),
            };
            let lent: Vec<ViewProducts> = kept.iter().map(lend).collect();
            run_in_scene(times, losses, stage, &cx, &lent, &mut products)?;
        }
        Ok((sink, products))
    }

    /// Renders the views, and brings each to the sink. Returns the sink, and the products that annotators after the
    /// views read.
    fn render<S: ViewSink + 'm>(
        self,
        core: &Attempt<'m>,
        scene: &Arc<Scene>,
        views: &[Arc<View>],
        line: Arc<ViewLine<S>>,
        (mut frames, queue): (Frames, &Queue<'m>),
    ) -> Result<(S, Vec<ViewProducts>)> {
        // The next view of the same camera.
        let cameras = core.component.rig.cameras();
        let after = |view: &View| views.get((view.id.0 + cameras) as usize).cloned();
        let follow = |view: &Arc<View>, products: Products| {
            let sensing: BTreeMap<String, Stream> = core.sensing(self.plan, view.id);
            let (scene, line) = (scene.at(view.moment), Arc::clone(&line));
            let views = (Arc::clone(view), after(view));
            line.announce();
            queue.add(move || line.follow(self, &scene, views, products, &sensing));
        };
        let next = || if line.has_failed() { Ok(false) } else { self.tools.running().map(|()| true) };
        let mut before = |view: &View| frames.products(&self.context(&scene.at(view.moment)), view.moment);
        let render = || {
            if self.plan.rendered.is_empty() {
                // Without rendered products, the scene needs no session.
                return views.iter().try_for_each(|view| {
                    if next()? {
                        follow(view, before(view)?);
                    }
                    Ok(())
                });
            }
            // A session does not wait for annotators of moments, and their errors do not close it.
            let of_moments = views.iter().map(|view| before(view)).collect::<Result<Vec<Products>>>()?;
            self.sessions.with(|session| {
                self.tools.times.of("render.load", || session.load(scene, self.tools.workers))?;
                let mut posed = PosedSession::new(session, scene);
                for (view, mut products) in views.iter().zip(of_moments) {
                    if !next()? {
                        break;
                    }
                    core.render_view(self.plan, &mut posed, (view, after(view).as_deref()), &mut products)?;
                    follow(view, products);
                }
                Ok(())
            })
        };
        // Even after an error, the sink takes the views that were handed over.
        let rendered = unwound(render);
        // The attempt reports the first failing view. An error of the renderer is of a later one.
        let taken = line.join()?;
        rendered.map(|()| taken)
    }
}

/// The views of a scene on their way from the renderer to the sink, annotated in any order and taken in theirs.
struct ViewLine<S> {
    losses: Arc<Losses>,
    state: Mutex<ViewLineState<S>>,
    moved: Condvar,
}

struct ViewLineState<S> {
    /// Number of views that were handed over.
    announced: u32,
    /// The next view to take.
    next: u32,
    /// The error of the first failing view.
    failure: Option<Error>,
    /// `None` after the last view.
    sink: Option<S>,
    /// The products that annotators after the views read.
    kept: Vec<ViewProducts>,
}

impl<S: ViewSink> ViewLine<S> {
    fn new(sink: S, losses: &Arc<Losses>) -> Self {
        let state = ViewLineState { announced: 0, next: 0, failure: None, sink: Some(sink), kept: Vec::new() };
        Self { losses: Arc::clone(losses), state: Mutex::new(state), moved: Condvar::new() }
    }

    fn has_failed(&self) -> bool {
        self.state.lock().failure.is_some()
    }

    fn announce(&self) {
        self.state.lock().announced += 1;
    }

    /// Denoises, senses, annotates and checks a view, waits for its turn, and hands it to the sink.
    fn follow(
        &self,
        walk: SceneWalk,
        scene: &Scene,
        (view, next): (Arc<View>, Option<Arc<View>>),
        mut products: Products,
        sensing: &BTreeMap<String, Stream>,
    ) {
        let (plan, times) = (walk.plan, walk.tools.times);
        let cx = walk.context(scene).view(&view).before(next.as_deref());
        let make = || {
            annotate(times, &self.losses, plan, &cx, sensing, &mut products)?;
            times
                .of("checks", || check(walk.checks, &products))
                .map_err(|error| error.context(format!("view {}", view.id.0)))
        };
        let made = if self.has_failed() { Ok(()) } else { unwound(make) };
        let mut state = self.state.lock();
        while state.next != view.id.0 {
            self.moved.wait(&mut state);
        }
        if state.failure.is_none() {
            let taken = unwound(|| {
                made?;
                state.sink.as_mut().map_or(Ok(()), |sink| sink.view(&cx, &view, &products))?;
                state.kept.extend(kept(plan, &view, &products));
                walk.reporter.event(&Event::Image { scene: scene.id.0, view: view.id.0 });
                Ok(())
            });
            state.failure = taken.err();
        }
        state.next += 1;
        self.moved.notify_all();
    }

    /// Waits until the sink has taken all views that were handed over.
    fn join(&self) -> Result<(S, Vec<ViewProducts>)> {
        let mut state = self.state.lock();
        while state.next != state.announced {
            self.moved.wait(&mut state);
        }
        match (state.failure.take(), state.sink.take()) {
            (Some(error), _) => Err(error),
            (None, Some(sink)) => Ok((sink, std::mem::take(&mut state.kept))),
            (None, None) => unreachable!("a line is joined once"),
        }
    }
}

/// The products of a view and its moment that annotators after the views read.
fn kept(plan: &Plan, view: &Arc<View>, products: &Products) -> Option<ViewProducts> {
    let reads = plan.after_views.iter().flat_map(|stage| &stage.reads);
    let keys: Vec<KeyId> = reads.filter(|key| key.scope.comes_with_view()).copied().collect();
    let view = || ViewProducts { view: Arc::clone(view), products: products.only(&keys) };
    (!keys.is_empty()).then(view)
}
