//! One attempt at a scene: the inputs of its stages, and their random numbers. Runs, generators and previews compose
//! and render scenes with it.

use crate::pools::{AssetStore, RecordingAssets};
use crate::run::dataset::draws::{PoseDraws, SceneDraws, in_words};
use crate::run::making::times::Times;
use crate::run::making::view_conditions::{ConditionTest, Verdict};
use crate::run::panics::caught;
use crate::run::stop::{Stop, StopReason};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::context::{Cache, Context, Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::geometry::Pose;
use syntable_model::limits::CANVAS_PIXELS;
use syntable_model::product::standard::COVERAGE;
use syntable_model::product::{Framing, KeyId, Lighting, Products, ScenePart};
use syntable_model::random::Stream;
use syntable_model::scene::{
    Camera, InstanceId, Moment, Optics, Scene, SceneBuilder, SceneId, SettleReport, View, ViewId,
};
use syntable_model::stage::{Atlas, Bodies, DatasetInfo, LightSampler, RenderRequest, RenderSession, Window};
use syntable_prepare::RayScene;
use syntable_recipe::plan::{Plan, Producer};
use syntable_recipe::{Chosen, Component, OnFailure, Recipe};

/// Inputs shared by the stages of all scenes.
#[derive(Clone, Copy)]
pub struct Tools<'a> {
    pub recipe: &'a Recipe,
    pub assets: &'a AssetStore<'a>,
    pub cache: &'a dyn Cache,
    pub workers: &'a dyn Workers,
    pub log: &'a dyn Log,
    /// Measures the working time of stages.
    pub times: &'a Times,
    pub stop: &'a Stop,
}

impl Tools<'_> {
    /// An error once a stop was requested.
    pub fn running(&self) -> Result<()> {
        let stopped = |reason: StopReason| Err(Error::stopped(format!("stopped by {reason}")));
        self.stop.requested().map_or(Ok(()), stopped)
    }
}

/// One attempt at a scene, with its own random numbers.
pub struct Attempt<'a> {
    pub tools: Tools<'a>,
    /// The component of the recipe that makes the scene.
    pub component: &'a Component,
    pub dataset: &'a DatasetInfo,
    pub scene: SceneId,
    pub number: u32,
    pub assets: RecordingAssets<'a>,
    /// The random decisions that the journal records.
    pub draws: Mutex<SceneDraws>,
}

impl<'a> Attempt<'a> {
    /// An attempt at a scene.
    pub fn new(tools: Tools<'a>, dataset: &'a DatasetInfo, (scene, number): (u32, u32)) -> Self {
        let (_, component) = tools.recipe.component_of(scene);
        let assets = RecordingAssets::new(tools.assets, &component.pools);
        Self { tools, component, dataset, scene: SceneId(scene), number, assets, draws: Mutex::default() }
    }
}

impl Attempt<'_> {
    /// The random numbers of a stage. They depend on the dataset's name as well as its seed, so that splits are
    /// independent.
    fn stream(&self, stage: &str) -> Stream {
        let DatasetInfo { seed, name, .. } = self.dataset;
        Stream::root(*seed).child(name).child(stage).at(u64::from(self.scene.0)).at(u64::from(self.number))
    }

    /// Records the alternative that a scene or a view takes.
    fn note_choice(&self, stage: &str, alternative: Option<u32>) {
        if let Some(alternative) = alternative {
            self.draws.lock().choices.entry(stage.to_owned()).or_default().push(alternative);
        }
    }

    /// Runs a stage that draws random numbers and assets.
    fn sample<T>(&self, stage: &str, stream: Stream, work: impl FnOnce(&Context) -> Result<T>) -> Result<T> {
        self.tools.running()?;
        let Tools { cache, workers, log, .. } = self.tools;
        let context = Context { stream, assets: &self.assets, cache, workers, log };
        let result = self.tools.times.of(stage, || work(&context));
        // A refused asset stops the work, and causes other errors.
        self.tools.assets.refused()?;
        result
    }

    /// Places the bodies.
    pub fn place(&self) -> Result<SceneBuilder> {
        let mut builder = SceneBuilder::new(self.scene, self.number);
        for (id, placers) in &self.component.place {
            let stage = format!("place.{id}");
            let Chosen { stage: placer, stream, alternative } = placers.draw(self.stream(&stage));
            self.note_choice(&stage, alternative);
            let place = || self.sample(&stage, stream, |context| placer.place(&mut builder, context));
            self.assets.during(self.tools.log, place)?;
        }
        Ok(builder)
    }

    /// Lets the bodies come to rest.
    pub fn settle(&self, builder: &mut SceneBuilder) -> Result<SettleReport> {
        let Chosen { stage: settler, stream, alternative } = self.component.settle.draw(self.stream("settle"));
        self.note_choice("settle", alternative);
        self.sample("settle", stream, |context| settler.settle(builder, context))
    }

    /// Samples camera and lights of a view. All cameras of a rig share its pose, its moment and its lights.
    pub fn view(&self, scene: &Arc<Scene>, id: ViewId) -> Result<View> {
        let component = self.component;
        let pose_id = component.rig.pose(id);
        let moment = caught("views", || component.views.moment(scene, pose_id))?;
        let scene = &*scene.at(moment);
        let of_pose = |stage: &str| self.stream(stage).at(u64::from(pose_id.0));
        let shell = || caught("views", || component.views.shell(scene));
        let draw =
            |stream: Stream| self.sample("views", stream, |context| component.views.pose(scene, pose_id, context));
        let optics = |world_from_camera: Pose| {
            let Optics { intrinsics, distortion, lens, exposure } =
                self.sample("camera", of_pose("camera"), |context| {
                    component.camera.optics(scene, &world_from_camera, context)
                })?;
            Ok((Camera { intrinsics, distortion, lens, world_from_camera }, exposure))
        };
        let world_from_rig = match &component.conditions {
            None => draw(of_pose("views"))?,
            Some(conditions) => {
                let trees = || Ok(RayScene::new(scene, |object| self.tools.assets.tree(object)));
                let rays = self.tools.times.of("views.conditions", trees)?;
                let target = caught("views", || Ok(component.views.target(scene, pose_id)))?;
                let test = ConditionTest { conditions, scene, rays: &rays, center: shell()?.center, target };
                let cameras = |world_from_rig: &Pose| -> Result<Vec<Camera>> {
                    let poses = component.rig.poses().into_iter();
                    poses.map(|rig_from_camera| Ok(optics(world_from_rig * rig_from_camera)?.0)).collect()
                };
                let draw = |number| match number {
                    0 => draw(of_pose("views")),
                    _ => draw(of_pose("views").child("draw").at(u64::from(number))),
                };
                self.accepted(&test, id, draw, cameras)?
            }
        };
        let rig = component.rig.view(id);
        let (reference, exposure) = optics(world_from_rig)?;
        let (camera, exposure) = match &rig {
            None => (reference, exposure),
            Some(rig) => optics(world_from_rig * rig.rig_from_camera)?,
        };
        let shell = shell()?;
        let mut lights = scene.lights.clone();
        for (light, samplers) in &component.lights {
            let stage = format!("lights.{light}");
            // Alternatives agree on it.
            let once = samplers.all().any(LightSampler::once_per_scene);
            let stream = if once { self.stream(&stage) } else { of_pose(&stage) };
            let Chosen { stage: sampler, stream, alternative } = samplers.draw(stream);
            let is_new = if once { id.0 == 0 } else { component.rig.is_first(id) };
            if is_new {
                self.note_choice(&stage, alternative);
            }
            let sample = || self.sample(&stage, stream, |context| sampler.lights(scene, &reference, &shell, context));
            lights.extend(self.assets.during(self.tools.log, sample)?);
        }
        Ok(View { id, moment, camera, exposure, lights, rig })
    }

    /// The first drawn pose whose cameras all meet the conditions, or else the best one, or an error. The draws count with the first
    /// view of a pose.
    fn accepted(
        &self,
        test: &ConditionTest,
        view: ViewId,
        draw: impl Fn(u32) -> Result<Pose>,
        cameras: impl Fn(&Pose) -> Result<Vec<Camera>>,
    ) -> Result<Pose> {
        let count = |draws: &PoseDraws| {
            if self.component.rig.is_first(view) {
                self.draws.lock().poses.add(draws);
            }
        };
        let mut draws = PoseDraws::default();
        let mut best: Option<(Verdict, Pose)> = None;
        for number in 0..test.conditions.attempts {
            let drawn = draw(number)?;
            // A kind that draws no random numbers gives the same pose again.
            if number == 1 && best.as_ref().is_some_and(|(_, first)| *first == drawn) {
                break;
            }
            draws.drawn += 1;
            let cameras = cameras(&drawn)?;
            let verdict = self.tools.times.of("views.conditions", || {
                cameras
                    .iter()
                    .map(|camera| test.verdict(camera))
                    .try_fold(Verdict::Accepted, |worst, verdict| Ok(worst.min(verdict?)))
            })?;
            let Verdict::Refused(condition, _) = verdict else {
                count(&draws);
                return Ok(drawn);
            };
            *draws.refused.entry(condition).or_default() += 1;
            if best.as_ref().is_none_or(|(other, _)| verdict > *other) {
                best = Some((verdict, drawn));
            }
        }
        match best.filter(|_| test.conditions.on_failure == OnFailure::Best) {
            Some((_, pose)) => {
                draws.unmet.extend((0..self.component.rig.cameras()).map(|camera| view.0 + camera));
                count(&draws);
                Ok(pose)
            }
            None => {
                let poses = if draws.drawn == 1 { "the pose does not meet" } else { "no pose meets" };
                let message = format!(
                    "view {}: {poses} [views.conditions]; {} drawn, refused by {}",
                    view.0,
                    draws.drawn,
                    in_words(&draws.refused)
                );
                Err(Error::unlucky(message).help(
                    "relax the conditions that refuse most poses, change the poses of [views], or set `on_failure = \"best\"`",
                ))
            }
        }
    }

    /// The random numbers of the sensors of a plan.
    pub fn sensing(&self, plan: &Plan, view: ViewId) -> BTreeMap<String, Stream> {
        let sensors = plan.per_view.iter().filter(|it| matches!(*it.producer, Producer::Sensor(_)));
        sensors.map(|it| (it.stage.clone(), self.stream(&it.stage).at(u64::from(view.0)))).collect()
    }

    /// Renders the products of a plan for a view. Some products show the next view, such as those for optical flow.
    pub fn render_view(
        &self,
        plan: &Plan,
        session: &mut PosedSession,
        (view, next): (&View, Option<&View>),
        products: &mut Products,
    ) -> Result<()> {
        let mut rendered = Products::new();
        let mut atlas = None;
        let scene = session.scene;
        let furniture: Vec<InstanceId> = scene.furniture().iter().map(|body| body.id).collect();
        for (framing, wants) in plan.by_framing() {
            let view = framing.view(view, next);
            let session = session.at(view.moment, &self.tools)?;
            let stream = self.stream("render").at(u64::from(view.id.0));
            let mut request = RenderRequest::new(&view, &wants, stream, self.tools.workers);
            request.cache = self.tools.cache;
            let of_part = || plan.denoiser.as_ref().is_some_and(|stage| stage.of_parts.contains(&framing));
            let denoised = match framing.part() {
                Some(ScenePart::Objects(lighting)) => {
                    let atlas = match &mut atlas {
                        Some(atlas) => atlas,
                        none => none.insert(Atlas::of(rendered.get(COVERAGE)?)),
                    };
                    request = request.of_objects(atlas, lighting);
                    of_part()
                }
                Some(part) => {
                    let (bodies, background) = match part {
                        ScenePart::Furniture(Lighting::Alone) => (Bodies::Only(&furniture), true),
                        ScenePart::Furniture(Lighting::InScene) => (Bodies::Seen(&furniture), true),
                        ScenePart::Background => (Bodies::Only(&[]), true),
                        ScenePart::Foreground | ScenePart::Objects(_) => (Bodies::Foreground, false),
                    };
                    request = request.of(Window::of(&view.camera.intrinsics), bodies);
                    request.background = background;
                    of_part()
                }
                None => {
                    request = request.of(Window::canvas(&view.camera.intrinsics, framing.canvas()), Bodies::All);
                    framing == Framing::IMAGE
                }
            };
            check_pixels(request.size, framing)?;
            request.denoiser = plan.denoiser.as_ref().filter(|_| denoised).and_then(|stage| match &*stage.producer {
                Producer::Denoiser(denoiser) => Some(&**denoiser),
                _ => None,
            });
            let mut made = Products::new();
            self.tools.times.of("render", || session.render(&request, &mut made))?;
            provided(&wants, &made).map_err(|error| error.context("render"))?;
            for key in wants {
                made.rename(key, key.framed(framing))?;
            }
            rendered.extend(made)?;
        }
        keep(plan, rendered, products)
    }
}

/// A session that has loaded a scene, and the moment of the scene that the session shows.
pub struct PosedSession<'s> {
    session: &'s mut dyn RenderSession,
    /// The loaded scene.
    scene: &'s Arc<Scene>,
    moment: Moment,
}

impl<'s> PosedSession<'s> {
    /// Wraps a session that has loaded a scene.
    pub fn new(session: &'s mut dyn RenderSession, scene: &'s Arc<Scene>) -> Self {
        Self { session, scene, moment: scene.moment }
    }

    /// The session, prepared for the scene at a moment.
    fn at(&mut self, moment: Moment, tools: &Tools) -> Result<&mut dyn RenderSession> {
        if self.scene.moves() && moment != self.moment {
            let scene = self.scene.at(moment);
            tools.times.of("render.load", || self.session.pose(&scene, tools.workers))?;
            self.moment = moment;
        }
        Ok(self.session)
    }

    /// Whether the session shows a different moment than after loading.
    pub fn has_moved(&self) -> bool {
        self.moment != self.scene.moment
    }
}

/// Refuses a canvas or an atlas that no memory can hold.
fn check_pixels([width, height]: [u32; 2], framing: Framing) -> Result<()> {
    let most = CANVAS_PIXELS.most;
    if u64::from(width) * u64::from(height) <= most {
        return Ok(());
    }
    let (what, help) = match framing.objects() {
        None => (format!("`({framing})`"), "ask for a smaller canvas or fewer sub-pixels, or set"),
        Some(_) => ("the windows around the objects of a view".to_owned(), "place fewer objects, or set"),
    };
    Err(Error::new(format!("{what} has {width} × {height} pixels, more than the limit of {most}"))
        .help(format!("{help} a lower resolution in [camera]")))
}

/// Checks that a stage made all products that it declares, and no others.
pub fn provided(declared: &[KeyId], made: &Products) -> Result<()> {
    if let Some(key) = declared.iter().find(|key| !made.contains(*key)) {
        return Err(Error::new(format!("it declares to provide `{key}` but did not")));
    }
    let is_declared = |key: &KeyId| declared.iter().any(|other| other.product_id() == key.product_id());
    match made.keys().into_iter().find(|key| !is_declared(key)) {
        Some(key) => Err(Error::new(format!("it provides `{key}` without declaring it"))),
        None => Ok(()),
    }
}

/// Adds the products of a stage. If another stage replaces a product, the original stays under its own key.
pub fn keep(plan: &Plan, mut made: Products, products: &mut Products) -> Result<()> {
    for &[product, original] in &plan.replaced {
        // The stage that replaces a product runs after the original was kept.
        if !products.contains(&original) {
            made.rename(product, original)?;
        }
    }
    products.extend(made)
}
