//! The walk over a scene: what is made of it before its views, of each view, and after them. What becomes of the products is
//! up to a [`Sink`]: a run writes files, a generator keeps samples.
//!
//! A scene's thread borrows a render session and hands each rendered view to the queue, where it is denoised, sensed, annotated
//! and checked while the next view is rendered. The sink gets views in order, and the error of a walk is the error of its first
//! failing view, so nothing depends on the scheduling.

use crate::run::making::attempt::{self, PosedSession, Tools};
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
use syntable_model::product::{Name, Products, Scope};
use syntable_model::random::Stream;
use syntable_model::scene::{Scene, View, ViewId};
use syntable_model::stage::{DatasetInfo, ViewProducts};
use syntable_recipe::plan::Plan;

/// The event of a scene that is done.
pub fn scene_event(scene: &Scene) -> Event {
    let (removed, objects) = (scene.settle.removed.len() as u32, scene.objects().len() as u32);
    Event::Scene { scene: scene.id.0, objects, removed }
}

/// Takes what is made of a scene.
pub trait Sink: Send {
    /// Takes a view with all products of the plan. Views come in order.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn view(&mut self, cx: &ViewContext, view: &Arc<View>, products: &Products) -> Result<()>;
}

/// What walks over scenes have in common.
#[derive(Clone, Copy)]
pub struct Walk<'m> {
    pub tools: Tools<'m>,
    pub sessions: &'m Sessions<'m>,
    /// What must hold in every view.
    pub checks: &'m [Arc<dyn LabelCheck>],
    pub reporter: &'m dyn Reporter,
    /// The dataset, with the number of views of the scene.
    pub dataset: &'m DatasetInfo,
    /// What is computed.
    pub plan: &'m Plan,
}

impl<'m> Walk<'m> {
    /// The context of a scene.
    pub fn context<'s>(&self, scene: &'s Scene) -> SceneContext<'s>
    where
        'm: 's,
    {
        let Tools { workers, log, cache, .. } = self.tools;
        DatasetContext::new(self.dataset, workers, log).with_cache(cache).scene(scene)
    }

    /// Walks over a frozen scene. `start` makes the sink when the first view is to be rendered. Gives the sink, and the products
    /// of the scene.
    ///
    /// # Errors
    /// The error of the first view that fails, or of a stage of the scene.
    pub fn scene<S: Sink + 'm>(
        self,
        core: &attempt::Attempt<'m>,
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
        let (sink, kept) = self.render(core, scene, &views, line, (&products, queue))?;
        for stage in &self.plan.after_views {
            let reads: Vec<Name> = stage.reads.iter().map(|key| key.name).collect();
            let lent: Vec<ViewProducts> = kept
                .iter()
                .map(|view| ViewProducts { view: Arc::clone(&view.view), products: view.products.only(&reads) })
                .collect();
            run_in_scene(times, losses, stage, &cx, &lent, &mut products)?;
        }
        Ok((sink, products))
    }

    /// Renders the views, and sees each through to the sink. Gives the sink, and what annotators after the views read.
    fn render<S: Sink + 'm>(
        self,
        core: &attempt::Attempt<'m>,
        scene: &Arc<Scene>,
        views: &[Arc<View>],
        line: Arc<ViewLine<S>>,
        (of_scene, queue): (&Products, &Queue<'m>),
    ) -> Result<(S, Vec<ViewProducts>)> {
        let after = |view: &View| views.get(view.id.0 as usize + 1).cloned();
        let follow = |view: &Arc<View>, products: Products| {
            let sensing: BTreeMap<String, Stream> = core.sensing(self.plan, view.id);
            let (scene, line) = (scene.at(view.moment), Arc::clone(&line));
            let views = (Arc::clone(view), after(view));
            line.announce();
            queue.add(move || line.follow(self, &scene, views, products, &sensing));
        };
        let next = || if line.has_failed() { Ok(false) } else { self.tools.running().map(|()| true) };
        let render = || {
            if self.plan.rendered.is_empty() {
                // Nothing of it needs an image: neither does it need a session.
                return views.iter().try_for_each(|view| {
                    if next()? {
                        follow(view, of_scene.clone());
                    }
                    Ok(())
                });
            }
            self.sessions.with(|session| {
                self.tools.times.of("render.load", || session.load(scene, self.tools.workers))?;
                let mut posed = PosedSession::new(session, scene);
                for view in views {
                    if !next()? {
                        break;
                    }
                    let mut products = of_scene.clone();
                    core.render_view(self.plan, &mut posed, (view, after(view).as_deref()), &mut products)?;
                    follow(view, products);
                }
                Ok(())
            })
        };
        // Whatever becomes of it, views that were handed over are waited for: the sink still takes them.
        let rendered = unwound(render);
        // The first failing view speaks for the attempt; the renderer's own error is of a later one.
        let taken = line.join()?;
        rendered.map(|()| taken)
    }
}

/// The views of a scene on their way from the renderer to the sink: annotated at once, taken in order.
struct ViewLine<S> {
    losses: Arc<Losses>,
    state: Mutex<ViewLineState<S>>,
    moved: Condvar,
}

struct ViewLineState<S> {
    /// Views that were handed over.
    announced: u32,
    /// The next view to take.
    next: u32,
    /// The error of the first failing view.
    failure: Option<Error>,
    /// Gone once all views were taken.
    sink: Option<S>,
    /// What the annotators after the views read.
    kept: Vec<ViewProducts>,
}

impl<S: Sink> ViewLine<S> {
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

    /// Denoises, senses, annotates and checks a view, waits until it is its turn, and hands it to the sink.
    fn follow(
        &self,
        walk: Walk,
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

    /// Waits for all views that were handed over.
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

/// What annotators after the views read of a view.
fn kept(plan: &Plan, view: &Arc<View>, products: &Products) -> Option<ViewProducts> {
    let reads = plan.after_views.iter().flat_map(|stage| &stage.reads);
    let names: Vec<Name> = reads.filter(|key| key.scope == Scope::View).map(|key| key.name).collect();
    let view = || ViewProducts { view: Arc::clone(view), products: products.only(&names) };
    (!names.is_empty()).then(view)
}
