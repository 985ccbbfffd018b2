//! Stages that sleep, count and break promises.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use syntable_model::check::{Check, LabelFault};
use syntable_model::left_out::LeftOut;
use syntable_model::prelude::*;
use syntable_model::registry::{Choice, Choose, Entry, Registry};
use syntable_model::scene::{
    Asset, AssetClass, Camera, Catalog, CatalogEntry, Light, Moment, Optics, Role, SettleReport, SphereLight, ViewId,
};
use syntable_model::stage::{
    Accepts, DatasetAnnotator, DeviceClass, Finish, Input, Output, RecordedScene, RenderDevice, RenderRequest,
    RenderSession, Replacement, SceneAnnotator, SceneWriter, ViewProducts,
};
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::{Event, Quiet, Reporter};
use syntable_runtime::run::{RunOptions, RunOutcome};
use syntable_testing::scenes;

products! {
    /// Light of a view: 1.
    pub const LIGHT: Key<Value> = view("light");
    /// Light before it was doubled.
    pub const LIGHT_RAW: Key<Value> = view("light_raw");
    /// 100 times the scene plus the view.
    pub const THOUGHT: Key<Value> = view("thought");
    /// Thoughts of all views.
    pub const TRACK: Key<Value> = scene("track");
    /// Nothing of note of a scene.
    pub const GLANCE: Key<Value> = scene("glance");
    /// Number of scenes, and sum of all thoughts.
    pub const TOTAL: Key<Value> = dataset("total");
    /// The moment, in seconds.
    pub const TICK: Key<Value> = frame("tick").unit("s");
}

fn sleep(ms: u32) {
    std::thread::sleep(Duration::from_millis(ms.into()));
}

/// Options of all these kinds: each uses a part.
macro_rules! kind {
    ($(#[$doc:meta])* $name:ident, $stage:path, $kind:literal $(, $option:ident: $type:ty)*) => {
        $(#[$doc])*
        #[derive(Debug, Default, Clone, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(
                /// An option.
                $option: $type,
            )*
        }
        impl Config for $name {
            type Stage = dyn $stage;
            const KIND: &'static str = $kind;
            const EXAMPLE: &'static str = "";
            fn build(self) -> Result<Box<dyn $stage>, ConfigError> {
                Ok(Box::new(self))
            }
        }
    };
}

kind!(/** Places a box on a table. */ Boxes, Placer, "boxes", sleep_ms: u32);
kind!(/** Lifts everything by a third of a millimeter. */ Lift, Settler, "rapier", tally: usize);
kind!(/** A small camera. */ Small, CameraModel, "pinhole");
kind!(/** One pose, and each second several views. */ Fixed, ViewSampler, "hemisphere_shell",
    bends: bool, views_per_second: u32);
kind!(/** Looks in a random direction. */ Wander, ViewSampler, "wander");
kind!(/** Places two boxes on a table. */ Pair, Placer, "pair");
kind!(/** A light for a view or a scene. */ Bulb, LightSampler, "bulb", nits: u32, once: bool);
kind!(/** Renders nothing, slowly, on one device. */ Sleeper, Renderer, "sleeper", sleep_ms: u32, tally: usize);
kind!(/** Renders as `sleeper` does. */ Drowsy, Renderer, "drowsy", tally: usize);
kind!(/** Doubles the light. */ Doubler, Sensor, "doubler");
kind!(/** Thinks about each view. */ Thinker, ViewAnnotator, "thinker",
    sleep_ms: u32, panics: bool, undeclared: bool, silent: bool, missing: bool, missing_later: bool, stumbles: bool,
    contradicts: bool);
kind!(/** Tells the time, once per moment. */ Clock, FrameAnnotator, "clock", tally: usize);
kind!(/** Collects the thoughts of all views. */ Tracker, SceneAnnotator, "tracker");
kind!(/** Leaves out one of three things of a scene. */ Careless, SceneAnnotator, "careless");
kind!(/** Sums the thoughts of all scenes. */ Summer, DatasetAnnotator, "summer", fails_at: i64, overlooks: i64);
kind!(/** Thinks as [`Thinker`] does. */ Echo, ViewAnnotator, "echo");
kind!(/** Offers the names that a file lists, one per line. */ Names, AssetSource, "names", list: String);
kind!(/** Writes products as JSON. */ Lines, Writer<Scenes>, "lines",
    include: Vec<ProductName>, end: String, breaks_at: usize, one_path: bool, said_path: String);

impl Placer for Boxes {
    fn place(&self, scene: &mut SceneBuilder, _: &Context) -> Result<()> {
        sleep(self.sleep_ms);
        scenes::add_table(scene);
        let cube = scenes::object("cube", scenes::box_mesh([0.1; 3]), [0.5; 3]);
        scene.add(scenes::body(cube, [0.0, 0.0, 0.05], Role::Object));
        Ok(())
    }
}

impl Settler for Lift {
    fn settle(&self, scene: &mut SceneBuilder, _: &Context) -> Result<SettleReport> {
        SETTLED[self.tally].fetch_add(1, Ordering::SeqCst);
        let bodies: Vec<_> = scene.bodies().map(|(handle, body)| (handle, body.world_from_body)).collect();
        for (handle, mut pose) in bodies {
            pose.translation.vector.z += 0.001 / 3.0;
            scene.set_pose(handle, pose);
        }
        Ok(SettleReport::default())
    }
}

fn view() -> View {
    scenes::view([0.0, -1.0, 1.0], [0.0; 3], [4, 3], 60.0)
}

impl CameraModel for Small {
    fn optics(&self, _: &Scene, _: &Pose, _: &Context) -> Result<Optics> {
        let View { camera, exposure, .. } = view();
        Ok(Optics { intrinsics: camera.intrinsics, distortion: camera.distortion, lens: camera.lens, exposure })
    }
}

impl ViewSampler for Fixed {
    fn moment(&self, _: &Scene, view: ViewId) -> Result<Moment> {
        Moment::from_seconds(view.0.checked_div(self.views_per_second).unwrap_or(0).into())
    }
    fn pose(&self, _: &Scene, _: ViewId, _: &Context) -> Result<Pose> {
        Ok(view().camera.world_from_camera)
    }
    fn shell(&self, scene: &Scene) -> Result<Shell> {
        assert!(!self.bends, "the shell is bent");
        Ok(Shell { center: scene.support(None)?.center(), radius: [1.0, 2.0] })
    }
}

impl ViewSampler for Wander {
    fn pose(&self, _: &Scene, _: ViewId, context: &Context) -> Result<Pose> {
        let x = context.stream.clone().uniform(-4.0, 4.0);
        Ok(scenes::view([0.0, -1.0, 1.0], [x, 0.0, 0.0], [4, 3], 60.0).camera.world_from_camera)
    }
    fn shell(&self, scene: &Scene) -> Result<Shell> {
        Ok(Shell { center: scene.support(None)?.center(), radius: [1.0, 2.0] })
    }
}

impl Placer for Pair {
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        Boxes::default().place(scene, context)?;
        let cube = scenes::object("cube", scenes::box_mesh([0.1; 3]), [0.5; 3]);
        scene.add(scenes::body(cube, [0.5, 0.0, 0.05], Role::Object));
        Ok(())
    }
}

impl LightSampler for Bulb {
    fn lights(&self, _: &Scene, _: &Camera, _: &Shell, _: &Context) -> Result<Vec<Light>> {
        let radiance = [f64::from(self.nits); 3];
        Ok(vec![Light::Sphere(SphereLight { center: [0.0, 0.0, 3.0].into(), radius: 0.1, radiance })])
    }
    fn once_per_scene(&self) -> bool {
        self.once
    }
}

/// Views rendered, by the option `tally`: tests run at the same time.
static RENDERED: [AtomicU32; TALLIES] = [const { AtomicU32::new(0) }; TALLIES];
/// Scenes settled, likewise.
static SETTLED: [AtomicU32; TALLIES] = [const { AtomicU32::new(0) }; TALLIES];
/// Moments annotated, likewise.
static TICKS: [AtomicU32; TALLIES] = [const { AtomicU32::new(0) }; TALLIES];
const TALLIES: usize = 24;

/// Renderings of a scene that must fail with an error, by tally and scene.
static FAULTS: Mutex<BTreeMap<(usize, u32), (u32, Error)>> = Mutex::new(BTreeMap::new());

/// Makes the next renderings of a scene fail.
pub fn fail_next(tally: usize, scene: u32, times: u32, error: Error) {
    FAULTS.lock().expect("faults").insert((tally, scene), (times, error));
}

/// Number of injected failures that have not happened yet.
pub fn failures_left(tally: usize, scene: u32) -> u32 {
    FAULTS.lock().expect("faults").get(&(tally, scene)).map_or(0, |(times, _)| *times)
}

pub struct Counters;
impl Counters {
    pub fn rendered(tally: usize) -> u32 {
        RENDERED[tally].load(Ordering::SeqCst)
    }
    pub fn ticks(tally: usize) -> u32 {
        TICKS[tally].load(Ordering::SeqCst)
    }
    /// Scenes settled and views rendered.
    pub fn both(tally: usize) -> [u32; 2] {
        [&SETTLED, &RENDERED].map(|counts| counts[tally].load(Ordering::SeqCst))
    }
}

impl Renderer for Sleeper {
    fn offers(&self) -> Vec<KeyId> {
        keys![LIGHT]
    }
    fn max_sessions(&self) -> Option<usize> {
        Some(1)
    }
    fn devices(&self) -> Result<Vec<RenderDevice>> {
        let card = CARDS.lock().expect("cards").get(&self.tally).cloned();
        let class = if card.is_some() { DeviceClass::Card } else { DeviceClass::Processor };
        Ok(vec![RenderDevice::new(card.unwrap_or_else(|| "the processor".into()), class)])
    }
    fn open(&self, index: usize) -> Result<Box<dyn RenderSession>> {
        assert_eq!(index, 0, "there is one device");
        Ok(Box::new(Asleep(self.clone(), None)))
    }
    fn cost(&self) -> String {
        format!("{} ms", self.sleep_ms)
    }
}

impl Renderer for Drowsy {
    fn offers(&self) -> Vec<KeyId> {
        keys![LIGHT]
    }
    fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(Asleep(Sleeper { sleep_ms: 0, tally: self.tally }, None)))
    }
    fn cost(&self) -> String {
        "0 ms".to_owned()
    }
}

/// Chooses `sleeper` or `drowsy`.
#[derive(Debug, Default, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Either {
    /// An option.
    tally: usize,
}

/// The choice of [`Either`].
pub static CHOSEN: Mutex<Result<&str, &str>> = Mutex::new(Ok("sleeper"));

impl Config for Either {
    type Stage = dyn Renderer;
    const KIND: &'static str = "either";
    const EXAMPLE: &'static str = "";
    const CHOOSE: Option<Choose> = Some(|_| match *CHOSEN.lock().expect("chosen") {
        Ok(kind) => Ok(Choice { kind, reason: "it slept well".to_owned() }),
        Err(message) => Err(Error::new(message).help("wake up")),
    });
    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        Ok(Box::new(Drowsy { tally: self.tally }))
    }
}

/// Cards that renderers have, by tally.
static CARDS: Mutex<BTreeMap<usize, String>> = Mutex::new(BTreeMap::new());

/// Gives a renderer a card, or removes it.
pub fn put_card(tally: usize, name: Option<&str>) {
    let mut cards = CARDS.lock().expect("cards");
    match name {
        Some(name) => drop(cards.insert(tally, name.to_owned())),
        None => drop(cards.remove(&tally)),
    }
}

struct Asleep(Sleeper, Option<Arc<Scene>>);
impl RenderSession for Asleep {
    fn load(&mut self, scene: &Arc<Scene>, _: &dyn syntable_model::context::Workers) -> Result<()> {
        self.1 = Some(scene.clone());
        Ok(())
    }
    fn render(&mut self, request: &RenderRequest, products: &mut Products) -> Result<()> {
        let scene = self.1.as_ref().expect("loaded").id.0;
        if let Some((times, error)) = FAULTS.lock().expect("faults").get_mut(&(self.0.tally, scene))
            && *times > 0
        {
            *times -= 1;
            return Err(error.clone());
        }
        RENDERED[self.0.tally].fetch_add(1, Ordering::SeqCst);
        sleep(self.0.sleep_ms);
        if request.wants.is_empty() { Ok(()) } else { products.put(LIGHT, Value::Int(1)) }
    }
}

impl Sensor for Doubler {
    fn reads(&self) -> Vec<KeyId> {
        keys![LIGHT_RAW]
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![LIGHT]
    }
    fn replaces(&self) -> Vec<Replacement> {
        vec![Replacement { product: LIGHT.id(), original: LIGHT_RAW.id(), of_parts: false }]
    }
    fn sense(&self, _: &ViewContext, _: &Stream, products: &mut Products) -> Result<()> {
        let &Value::Int(light) = products.get(LIGHT_RAW)? else { return Err(Error::new("no light")) };
        products.put(LIGHT, Value::Int(2 * light))
    }
}

impl ViewAnnotator for Thinker {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![THOUGHT]
    }
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        sleep(self.sleep_ms);
        assert!(!self.panics, "too much to think about");
        if self.undeclared {
            products.get(LIGHT)?;
        }
        if self.missing || (self.missing_later && cx.scene_id.0 > 0) {
            return Err(Error::new("the library is not there"));
        }
        if self.silent {
            return Ok(());
        }
        if self.stumbles && cx.scene.attempt == 0 && cx.scene_id.0 % 2 == 1 {
            return Err(Error::unlucky("stumbled"));
        }
        let thought = i64::from(100 * cx.scene_id.0 + cx.view_id.0);
        let wrong = self.contradicts && cx.scene_id.0 == 1 && cx.view_id.0 == 1;
        products.put(THOUGHT, Value::Int(if wrong { -1 } else { thought }))
    }
}

impl FrameAnnotator for Clock {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![TICK]
    }
    fn annotate(&self, cx: &FrameContext, products: &mut Products) -> Result<()> {
        TICKS[self.tally].fetch_add(1, Ordering::SeqCst);
        products.put(TICK, Value::Float(cx.moment.seconds()))
    }
}

/// The condition that every view must meet.
const POSITIVE: Check = Check {
    name: "thoughts_are_positive",
    doc: "No thought is negative.",
    reads: || keys![THOUGHT],
    finds_subject: Check::ALWAYS,
    faults: |products| match products.get(THOUGHT)? {
        Value::Int(thought) if *thought < 0 => Ok(vec![LabelFault::new(format!("a thought is {thought}"))]),
        _ => Ok(Vec::new()),
    },
};

impl ViewAnnotator for Echo {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![THOUGHT]
    }
    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        products.put(THOUGHT, Value::Int(-1))
    }
}

impl AssetSource for Names {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }
    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let text = std::fs::read_to_string(&self.list).map_err(|error| Error::new(error.to_string()))?;
        let entry = |name: &str| CatalogEntry::new(name, "thing");
        Ok(Catalog { entries: text.lines().map(entry).collect() })
    }
    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        Err(Error::new(format!("nobody draws `{name}`")))
    }
}

impl SceneAnnotator for Tracker {
    fn reads(&self) -> Vec<KeyId> {
        keys![THOUGHT]
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![TRACK]
    }
    fn annotate(&self, _: &SceneContext, views: &[ViewProducts], products: &mut Products) -> Result<()> {
        let thoughts = views.iter().map(|view| view.products.get(THOUGHT).cloned()).collect::<Result<Vec<_>>>()?;
        products.put(TRACK, Value::List(thoughts))
    }
}

impl SceneAnnotator for Careless {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![GLANCE]
    }
    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        cx.log.left_out(&LeftOut::new(1, 3, "things were overlooked"));
        products.put(GLANCE, Value::from(0_i64))
    }
}

impl DatasetAnnotator for Summer {
    fn reads(&self) -> Vec<KeyId> {
        keys![THOUGHT]
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![TOTAL]
    }
    fn annotate(
        &self,
        cx: &DatasetContext,
        scenes: &mut dyn Iterator<Item = Result<RecordedScene>>,
        products: &mut Products,
    ) -> Result<()> {
        let (mut count, mut sum) = (0_i64, 0_i64);
        for scene in scenes {
            count += 1;
            sum += scene?.view_values.iter().filter_map(|view| view["thought"].as_i64()).sum::<i64>();
        }
        if self.fails_at > 0 && count >= self.fails_at {
            return Err(Error::unlucky("the sum is too large"));
        }
        cx.log.left_out(&LeftOut::new(self.overlooks as usize, count as usize, "scenes were overlooked"));
        products.put(TOTAL, Value::record([("scenes", count.into()), ("sum", sum.into())]))
    }
}

impl Writer<Scenes> for Lines {
    fn reads(&self) -> Vec<Input> {
        Input::included(&self.include, Accepts::Any)
    }
    fn scene(&self, cx: &SceneContext, output: Output) -> Result<Box<dyn SceneWriter<Scenes>>> {
        output.write_shard(format!("{} {}\n", cx.scene_id.0, heights(cx.scene)).as_bytes())?;
        Ok(Box::new(LinesScene(output, self.one_path)))
    }
    fn paths(&self, _: &FileOf) -> Result<Vec<String>> {
        Ok(Some(self.said_path.clone()).filter(|path| !path.is_empty()).into_iter().collect())
    }
    fn finish_options(&self) -> &'static [&'static str] {
        &["end", "breaks_at"]
    }
    fn finish(&self, _: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        if self.breaks_at > 0 && finish.scenes().len() >= self.breaks_at {
            return Err(Error::new("too many scenes for me"));
        }
        let text = text(products, |_| true);
        let name = if self.end.is_empty() { "dataset.json" } else { &self.end };
        finish.write(&format!("{}/{name}", finish.id()), |file| {
            for &scene in finish.scenes() {
                std::io::copy(&mut finish.shard(scene)?, file).map_err(|error| Error::new(error.to_string()))?;
            }
            file.write_all(text.as_bytes()).map_err(|error| Error::new(error.to_string()))
        })
    }
}

/// The heights of the bodies, bit by bit.
fn heights(scene: &Scene) -> String {
    let heights = scene.bodies().iter().map(|body| body.world_from_body.translation.vector.z.to_bits().to_string());
    heights.collect::<Vec<_>>().join(",")
}

struct LinesScene(Output, bool);
impl SceneWriter<Scenes> for LinesScene {
    fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()> {
        let name = format!("{}/{:06}_{:04}.json", self.0.id(), cx.scene_id.0, cx.view_id.0);
        self.0.write(&name, text(products, |_| true).as_bytes())
    }
    fn close(self: Box<Self>, cx: &SceneContext, products: &Products) -> Result<()> {
        let name = match self.1 {
            true => "all/scenes.json".to_owned(),
            false => format!("{}/{:06}.json", self.0.id(), cx.scene_id.0),
        };
        self.0.write(&name, text(products, |_| true).as_bytes())
    }
}

fn text(products: &Products, keep: impl Fn(&KeyId) -> bool) -> String {
    let values: BTreeMap<String, Value> = products
        .keys()
        .iter()
        .filter(|key| keep(key))
        .map(|key| (key.to_string(), products.value(key).expect("there")))
        .collect();
    serde_json::to_string(&values).expect("plain data")
}

pub fn registry() -> Registry {
    macro_rules! entries {
        ($($name:ident),*) => { [$(Entry::of::<$name>("kit", "0.0.0")),*] };
    }
    let entries = entries![
        Boxes, Lift, Small, Fixed, Sleeper, Drowsy, Either, Doubler, Thinker, Clock, Tracker, Careless, Summer, Lines,
        Names, Wander, Pair, Bulb
    ];
    Registry::new(entries).and_then(|registry| registry.with_checks([Arc::new(POSITIVE) as _])).expect("no clash")
}

/// The same kinds, with [`Thinker`] and [`Echo`] as two crates register them.
pub fn rivals(thinker: &'static str, echo: &'static str) -> Registry {
    let own = registry();
    let others = own.entries().iter().filter(|entry| entry.kind != Thinker::KIND).cloned();
    let rivals = [Entry::of::<Thinker>(thinker, "0.0.0"), Entry::of::<Echo>(echo, "0.0.0")];
    Registry::new(others.chain(rivals)).expect("no clash").with_stock(["syntable-annotate"])
}

/// Runs a recipe of these kinds.
pub fn run(recipe: &str, out: &Path, threads: usize) -> Result<RunOutcome> {
    run_scenes(recipe, out, threads, None)
}

/// Runs some scenes of a recipe.
pub fn run_scenes(recipe: &str, out: &Path, threads: usize, scenes: Option<Range<u32>>) -> Result<RunOutcome> {
    run_with(recipe, RunOptions { scenes, ..options(out, threads) }, &Quiet)
}

/// Options of a run.
pub fn options(out: &Path, threads: usize) -> RunOptions {
    RunOptions::new(out, threads, DiskCache::new(out.join("../cache")))
}

/// Runs a recipe with options.
pub fn run_with(recipe: &str, options: RunOptions, reporter: &dyn Reporter) -> Result<RunOutcome> {
    let source = Source::embedded("test.toml", recipe);
    let (recipe, _) = syntable_recipe::load(&registry(), source, &Overrides::of_process(Vec::new()))
        .unwrap_or_else(|report| panic!("{report}"));
    syntable_runtime::run::run(&recipe, &options, reporter)
}

/// Counts events, and runs an action at one of them.
pub struct AtEvent<'a> {
    pub number: u32,
    pub act: &'a (dyn Fn() + Sync),
    pub seen: AtomicU32,
}

impl Reporter for AtEvent<'_> {
    fn event(&self, event: &Event) {
        if matches!(event, Event::Image { .. } | Event::Scene { .. } | Event::Started { .. })
            && self.seen.fetch_add(1, Ordering::SeqCst) == self.number
        {
            (self.act)();
        }
    }
}
