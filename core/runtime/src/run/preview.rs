//! Single views of a recipe that changes, made one after the other in memory, without a dataset.
//!
//! An image is a pure function of recipe, seed, scene and view. A [`Previewer`] therefore keeps everything that a
//! changed recipe shares with the earlier one: stages with the same options and their data (loaded assets, collision
//! shapes, trees), and scenes at rest with the same pools, placers and settler. Images with equal [`Pass::key`] are
//! equal.

use crate::cache::DiskCache;
use crate::pools::{AssetStore, Loaded};
use crate::run::dataset::loss::Loss;
use crate::run::decisions::inputs;
use crate::run::making::attempt::{Attempt, PosedSession, Tools};
use crate::run::making::frames::Frames;
use crate::run::making::losses::Losses;
use crate::run::making::recovery::{Attempts, Recovery, SceneAttempts};
use crate::run::making::stages::{self, annotate, run_in_scene};
use crate::run::making::times::Times;
use crate::run::panics;
use crate::run::progress::{Event, Reporter, Warnings};
use crate::run::stop::Stop;
use crate::workers::{Pool, Stoppable};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};
use syntable_model::context::{DatasetContext, Log};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::product::{Products, ViewMoment};
use syntable_model::registry::Slot;
use syntable_model::scene::{Intrinsics, Scene, View, ViewId};
use syntable_model::stage::{DatasetInfo, RenderSession};
use syntable_recipe::plan::Plan;
use syntable_recipe::{CatalogLock, CatalogNames, Component, Parts, Recipe};

/// Slots that determine a scene at rest.
const OF_SCENE: [Slot; 3] = [Slot::Assets, Slot::Place, Slot::Settle];
/// Slots that determine an image, besides the slots of its scene.
const OF_IMAGE: [Slot; 7] =
    [Slot::Camera, Slot::Views, Slot::Lights, Slot::Render, Slot::Denoise, Slot::Sensor, Slot::Annotate];

/// Makes views, and keeps stages and scenes for the next recipe.
pub struct Previewer {
    pool: Pool,
    cache: DiskCache,
    current: Option<(Recipe, Parts)>,
    loaded: Arc<Loaded>,
    session: Option<PreviewSession>,
    composed: BTreeMap<u32, Composed>,
    /// Notes about this machine that were reported.
    noted: BTreeSet<String>,
}

/// An open session, and the scene that it has loaded.
struct PreviewSession {
    render: Option<Digest>,
    session: Box<dyn RenderSession>,
    loaded: Option<Arc<Scene>>,
}

/// The results of the attempts to compose a scene.
struct Composed {
    key: Digest,
    attempts: BTreeMap<u32, Result<Arc<Scene>>>,
}

/// The requested form of every view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// Names of products of the view. The recipe must be loaded with them as
    /// [`wanted`](syntable_recipe::Overrides::wanted).
    pub products: Vec<String>,
    /// Maximum width of images, px. A larger image is rendered with fewer pixels, and shows the same.
    pub width: u32,
    /// Run code that the recipe brings: native libraries by a path beside it, and programs. It is code of the recipe's author.
    pub allow_code: bool,
}

impl Previewer {
    /// A previewer without a recipe.
    pub fn new(threads: usize, cache: DiskCache) -> Result<Self> {
        Ok(Self {
            pool: Pool::new(threads)?,
            cache,
            current: None,
            loaded: Arc::default(),
            session: None,
            composed: BTreeMap::new(),
            noted: BTreeSet::new(),
        })
    }

    /// Replaces the recipe. Keeps the stages and scenes that are the same in both.
    pub fn set(&mut self, mut recipe: Recipe) -> Result<()> {
        let parts = Parts::of(&recipe)?;
        if let Some((earlier, before)) = self.current.take() {
            let tables: BTreeMap<String, String> =
                earlier.assets.iter().map(|(name, pool)| (name.clone(), pool.table.clone())).collect();
            recipe.keep_stages(earlier, |part| parts.agree(&before, part));
            let same = |pool: &str| recipe.assets.get(pool).is_some_and(|pool| parts.agree(&before, &pool.table));
            self.loaded.keep(|pool| tables.get(pool) == recipe.assets.get(pool).map(|pool| &pool.table) && same(pool));
        }
        self.current = Some((recipe, parts));
        Ok(())
    }

    /// Opens the pools of the recipe, to make views of it.
    pub fn pass<'p>(
        &'p mut self,
        wanted: &Wanted,
        reporter: &'p dyn Reporter,
        log: &'p Warnings<'p>,
        stop: &'p Stop,
    ) -> Result<Pass<'p>> {
        let Some((recipe, parts)) = &self.current else { return Err(Error::new("no recipe has been loaded yet")) };
        recipe.ready(wanted.allow_code)?;
        for message in recipe.choices.iter().cloned().chain(inputs::emulated(recipe)?) {
            if self.noted.insert(message.clone()) {
                reporter.event(&Event::Note { message });
            }
        }
        let assets = AssetStore::open_for_run(recipe, log)?.with(Arc::clone(&self.loaded));
        let catalogs = assets.catalogs();
        let work = |component| PassWork::of(recipe, component, (parts, wanted), &catalogs);
        let source = PassSource {
            recipe,
            assets,
            components: recipe.components.all().map(work).collect(),
            width: wanted.width,
            workers: Stoppable { workers: &self.pool, stop },
            cache: &self.cache,
            times: Times::default(),
            log,
            reporter,
            stop,
        };
        Ok(Pass { source, session: &mut self.session, composed: &mut self.composed, losses: Vec::new() })
    }
}

/// Views of one recipe, in progress.
pub struct Pass<'p> {
    source: PassSource<'p>,
    session: &'p mut Option<PreviewSession>,
    composed: &'p mut BTreeMap<u32, Composed>,
    losses: Vec<Loss>,
}

/// The inputs of all attempts of a pass.
struct PassSource<'p> {
    recipe: &'p Recipe,
    assets: AssetStore<'p>,
    /// The work on the scenes of each component.
    components: Vec<PassWork>,
    width: u32,
    workers: Stoppable<'p>,
    cache: &'p DiskCache,
    times: Times,
    log: &'p dyn Log,
    reporter: &'p dyn Reporter,
    stop: &'p Stop,
}

/// The work on the scenes of a component.
struct PassWork {
    plan: Plan,
    info: DatasetInfo,
    render: Option<Digest>,
    /// Digests of everything that determines scenes and images, except their numbers.
    keys: (Digest, Digest),
}

impl PassWork {
    fn of(
        recipe: &Recipe,
        component: &Component,
        (parts, wanted): (&Parts, &Wanted),
        catalogs: &BTreeMap<String, CatalogNames>,
    ) -> Self {
        let hasher =
            Hasher::new("scenes of a preview").text(&recipe.dataset.seed.to_string()).text(&recipe.dataset.name);
        let hasher = catalogs.iter().fold(parts.hash(hasher, component, &OF_SCENE), |hasher, (pool, names)| {
            hasher.text(pool).text(&CatalogLock::of(names).digest)
        });
        let scene_key = hasher.finish();
        let hasher = Hasher::new("image of a preview").digest(scene_key).number(f64::from(wanted.width));
        let hasher = wanted.products.iter().fold(hasher, |hasher, product| hasher.text(product));
        let image_key = parts.hash(hasher, component, &OF_IMAGE).finish();
        let plan = component.plan.part(wanted.products.iter().map(String::as_str), false).on(&*component.render);
        let render = parts.get(&component.table(Slot::Render.name()));
        Self { plan, info: recipe.info_of(component), render, keys: (scene_key, image_key) }
    }
}

impl Pass<'_> {
    /// Digest of everything that determines a view of a scene. Equal keys have equal products.
    pub fn key(&self, scene: u32, view: u32) -> Digest {
        let numbers = Hasher::new("view of a preview").digest(self.source.work(scene).keys.1);
        numbers.number(f64::from(scene)).number(f64::from(view)).finish()
    }

    /// Makes views of a scene in the given order, and passes each to `each` at once, with the time that it took. As in a
    /// run, a failed attempt is followed by the next one, which begins with the first view again.
    ///
    /// # Errors
    /// If the scene fails, or the pass was asked to stop.
    pub fn scene(&mut self, scene: u32, views: &[u32], each: &mut dyn FnMut(u32, &Products, Duration)) -> Result<()> {
        let Self { source, session, composed, losses } = self;
        let attempts =
            SceneAttempts { tools: source.tools(), reporter: source.reporter, scene, first: 0, is_present: false };
        let mut latest = 0;
        let attempt = |number| {
            latest = number;
            source.attempt((scene, number), views, session, composed, each)
        };
        let made = match panics::quiet(|| attempts.make(attempt, Ok)) {
            Ok(Attempts { made: Some(of_attempt), .. }) => Ok(of_attempt),
            Ok(Attempts { mut errors, .. }) => Err(errors.pop().unwrap_or_else(|| Error::new("the scene failed"))),
            Err(error) => {
                // The error ends a run, which returns it. A preview continues.
                if !source.stop.is_requested() {
                    let error = error.to_string();
                    source.reporter.event(&Event::Attempt { scene, attempt: latest, error, last: true });
                }
                Err(error)
            }
        };
        losses.extend(made?);
        Ok(())
    }

    /// Reports the working times of stages. Returns the data that stages omitted from the images of this pass, summed
    /// as in a run. Failed attempts do not count.
    pub fn end(self) -> Vec<Loss> {
        self.source.reporter.event(&Event::Stages { stages: self.source.times.all() });
        Loss::sum(self.losses)
    }
}

impl PassSource<'_> {
    /// The work on a scene.
    fn work(&self, scene: u32) -> &PassWork {
        &self.components[self.recipe.component_of(scene).0]
    }

    fn tools(&self) -> Tools<'_> {
        Tools {
            recipe: self.recipe,
            assets: &self.assets,
            cache: self.cache,
            workers: &self.workers,
            log: self.log,
            times: &self.times,
            stop: self.stop,
        }
    }

    /// One attempt at some views of a scene. Returns the data that stages omitted.
    fn attempt(
        &self,
        (scene, number): (u32, u32),
        views: &[u32],
        session: &mut Option<PreviewSession>,
        composed: &mut BTreeMap<u32, Composed>,
        each: &mut dyn FnMut(u32, &Products, Duration),
    ) -> Result<Vec<Loss>> {
        let (tools, work) = (self.tools(), self.work(scene));
        let attempt = Attempt::new(tools, &work.info, (scene, number));
        let frozen = compose(composed, work.keys.0, &attempt, self.reporter)?;
        let of_dataset = DatasetContext::new(&work.info, &self.workers, self.log).with_cache(self.cache);
        let (mut of_scene, losses) = (Products::new(), Losses::default());
        for stage in &work.plan.before_views {
            run_in_scene(&self.times, &losses, stage, &of_dataset.scene(&frozen), &[], &mut of_scene)?;
        }
        let mut frames = Frames::new(&work.plan, &of_scene, (&self.times, &losses));
        let count = self.recipe.dataset.views_per_scene;
        let needs_next = work.plan.rendered.iter().any(|key| key.framing.moment() != ViewMoment::Own);
        for &id in views {
            tools.running()?;
            let start = Instant::now();
            let sampled = |id: u32| attempt.view(&frozen, ViewId(id)).map(|view| smaller(view, self.width));
            let view = sampled(id)?;
            let after = id + attempt.component.rig.cameras();
            let next = (needs_next && after < count).then(|| sampled(after)).transpose()?;
            let shown = frozen.at(view.moment);
            let mut products = frames.products(&of_dataset.scene(&shown), view.moment)?;
            if !work.plan.rendered.is_empty() {
                let rendered = self.render(&attempt, &frozen, (&view, next.as_ref()), session, &mut products);
                if let Err(error) = rendered {
                    // The next attempt or pass opens a session again.
                    *session = None;
                    return Err(error);
                }
            }
            let of_view = of_dataset.scene(&shown).view(&view).before(next.as_ref());
            let sensing = attempt.sensing(&work.plan, view.id);
            annotate(&self.times, &losses, &work.plan, &of_view, &sensing, &mut products)?;
            stages::check(&self.recipe.checks, &products).map_err(|error| error.context(format!("view {id}")))?;
            each(id, &products, start.elapsed());
            self.reporter.event(&Event::Image { scene, view: id });
        }
        Ok(losses.all())
    }

    /// Renders a view in the session, which keeps the scene for the next view.
    fn render(
        &self,
        attempt: &Attempt,
        frozen: &Arc<Scene>,
        views: (&View, Option<&View>),
        session: &mut Option<PreviewSession>,
        products: &mut Products,
    ) -> Result<()> {
        let work = self.work(attempt.scene.0);
        let session = opened(session, attempt.component, work.render)?;
        // The session keeps the scene alive, so no other scene can have its address.
        if !session.loaded.as_ref().is_some_and(|loaded| Arc::ptr_eq(loaded, frozen)) {
            session.loaded = None;
            self.times.of("render.load", || session.session.load(frozen, &self.workers))?;
            session.loaded = Some(Arc::clone(frozen));
        }
        let mut posed = PosedSession::new(&mut *session.session, frozen);
        let rendered = attempt.render_view(&work.plan, &mut posed, views, products);
        if posed.has_moved() {
            session.loaded = None;
        }
        rendered
    }
}

/// The session of the renderer, opened if necessary.
fn opened<'s>(
    session: &'s mut Option<PreviewSession>,
    component: &Component,
    render: Option<Digest>,
) -> Result<&'s mut PreviewSession> {
    let opened = match session.take().filter(|session| session.render == render) {
        Some(session) => session,
        None => {
            let session = panics::caught("render", || component.render.open(0))?;
            PreviewSession { render, session, loaded: None }
        }
    };
    Ok(session.insert(opened))
}

/// The scene of an attempt at rest, or the error of composing it. Both are kept as long as the key stays the same.
fn compose(
    all: &mut BTreeMap<u32, Composed>,
    key: Digest,
    attempt: &Attempt,
    reporter: &dyn Reporter,
) -> Result<Arc<Scene>> {
    let own = all.entry(attempt.scene.0).or_insert_with(|| Composed { key, attempts: BTreeMap::new() });
    if own.key != key {
        *own = Composed { key, attempts: BTreeMap::new() };
    }
    if let Some(known) = own.attempts.get(&attempt.number) {
        return known.clone();
    }
    let made = panics::unwound(|| {
        let mut builder = attempt.place()?;
        let report = attempt.settle(&mut builder)?;
        builder.freeze(report).map(Arc::new)
    });
    if let Ok(scene) = &made {
        let (objects, removed) = (scene.objects().len() as u32, scene.settle.removed.len() as u32);
        reporter.event(&Event::Scene { scene: scene.id.0, objects, removed });
    }
    // Other errors come from outside, or end the attempts.
    if made.as_ref().err().is_none_or(|error| Recovery::of(error) == Recovery::NextAttempt) {
        own.attempts.insert(attempt.number, made.clone());
    }
    made
}

/// A view with a limited width in pixels and the same field of view.
fn smaller(mut view: View, width: u32) -> View {
    let Intrinsics { width: w, height: h, fx, fy, cx, cy } = view.camera.intrinsics;
    if w > width {
        let height = (u64::from(h) * u64::from(width) + u64::from(w) / 2) / u64::from(w);
        let height = (height as u32).max(1);
        let (x, y) = (f64::from(width) / f64::from(w), f64::from(height) / f64::from(h));
        view.camera.intrinsics = Intrinsics { width, height, fx: fx * x, fy: fy * y, cx: cx * x, cy: cy * y };
    }
    view
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::{Point3, Pose};
    use syntable_model::scene::{Camera, Exposure, Moment};

    #[test]
    fn a_smaller_view_sees_the_same() {
        let intrinsics = Intrinsics { width: 641, height: 479, fx: 500.0, fy: 510.0, cx: 300.0, cy: 250.5 };
        let camera = Camera { intrinsics, distortion: None, lens: None, world_from_camera: Pose::identity() };
        let view = View {
            id: ViewId(0),
            moment: Moment::START,
            camera,
            exposure: Exposure::Fixed { ev100: 8.0 },
            lights: Vec::new(),
            rig: None,
        };
        let small = smaller(view.clone(), 160).camera.intrinsics;
        assert_eq!((small.width, small.height), (160, 120));
        for p in [[0.1, 0.2, 1.0], [-0.3, 0.05, 0.7], [0.0, 0.0, 2.0]].map(Point3::from) {
            let ([u, v], [a, b]) = (intrinsics.project(&p), small.project(&p));
            assert!((u / 641.0 - a / 160.0).abs() < 1e-12 && (v / 479.0 - b / 120.0).abs() < 1e-12, "{p}");
        }
        assert_eq!(smaller(view.clone(), 641).camera.intrinsics, intrinsics);
        assert_eq!(smaller(view, 5000).camera.intrinsics, intrinsics);
    }
}
