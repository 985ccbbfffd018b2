//! The time and disk space that a recipe needs on this machine, measured on its first scenes.
//!
//! The scenes are made in memory, one at a time, by the code of a run. The first scene also loads assets and kernels, so
//! its extra time counts once. A run has several scenes in progress; `Pace::of` has the model of their speed.

use crate::cache::DiskCache;
use crate::run::making::times::Times;
use crate::run::options::RunOptions;
use crate::run::progress::{Event, Reporter};
use crate::run::stop::Stop;
use crate::run::{making::sessions, run, run_timed};
use crate::workers;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};
use syntable_model::store::{MemStore, Store};
use syntable_recipe::message::Message;
use syntable_recipe::{Component, Recipe};

/// Without a requested number of scenes, a measurement ends after the first scene behind this time.
const LONG_ENOUGH: Duration = Duration::from_secs(10);
/// Maximum number of scenes of such a measurement, without the first.
const MOST_SCENES: u32 = 16;

/// How to measure a recipe.
pub struct ForecastOptions {
    /// Number of scenes to measure, besides the first, which warms up; `None`: as many as ten seconds allow, but at
    /// least one.
    pub measured: Option<u32>,
    /// Number of threads of the run.
    pub threads: usize,
    /// Run code that the recipe brings: native libraries by a path beside it, and programs. It is code of the recipe's author.
    pub allow_code: bool,
    /// Cache of results that later runs can use.
    pub cache: DiskCache,
    /// Ends the work early on request.
    pub stop: Stop,
}

/// The limit of a run's speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The cores of the processor.
    Cores,
    /// The devices that render.
    RenderDevice,
    /// The duration of a single scene: the steps of a scene wait for each other.
    SceneSteps,
}

/// Time and disk space of a run of a recipe, extrapolated from measured scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// Number of scenes of the run.
    pub scenes: u32,
    /// Views per scene.
    pub views_per_scene: u32,
    /// Number of threads of the run.
    pub threads: usize,
    /// Bytes on disk of each scene.
    pub scene_bytes: u64,
    /// Components of a mixture that no measured scene was made by, or only one with cold caches: the forecast is rough.
    pub unmeasured: Vec<String>,
    /// The time.
    pub pace: Pace,
}

/// The speed of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Pace {
    /// Number of measured scenes.
    pub measured: u32,
    /// Whether the first scene was measured, with the time for loading, because the recipe has no other.
    pub is_cold: bool,
    /// Smallest and largest number of objects in a measured scene.
    pub objects: [u32; 2],
    /// Time for steps that happen once: opening pools and devices, loading assets and kernels, s.
    pub start_s: f64,
    /// Time per scene while several are in progress, s.
    pub scene_s: f64,
    /// Time of all scenes, with the start, s.
    pub total_s: f64,
    /// The same if all scenes were like the fastest and like the slowest measured scene, s.
    pub total_range_s: [f64; 2],
    /// The limit of the speed.
    pub bound: Bound,
    /// Working time of each stage in a scene that is made alone, s.
    pub stages: BTreeMap<String, f64>,
}

/// The resources of a run that several scenes share.
#[derive(Debug, Clone, Copy)]
struct Lanes {
    scenes: u32,
    /// Threads that can work at the same time.
    cores: usize,
    /// Number of scenes in progress.
    in_flight: usize,
}

/// The state of a measurement after a scene, since its start.
#[derive(Debug, Clone, Default)]
struct Tick {
    /// Index of the component that made the scene.
    component: usize,
    wall_s: f64,
    /// Time of all threads of the process; `None` if the system does not measure it.
    cores_s: Option<f64>,
    stages: BTreeMap<String, f64>,
    objects: u32,
}

/// The cost of a scene that is made alone, s.
#[derive(Debug, Clone, Default)]
struct SceneCost {
    component: usize,
    wall: f64,
    cores: f64,
    /// Time that the scene holds the devices that render; 0 if each scene in progress has a session.
    device: f64,
    stages: BTreeMap<String, f64>,
    objects: u32,
}

/// Measures the first scenes of a recipe in memory. No file is written, except in the cache.
///
/// # Errors
/// If the recipe cannot be run, all measured scenes fail, or the work was asked to stop.
pub fn forecast(recipe: &Recipe, options: &ForecastOptions, reporter: &dyn Reporter) -> Result<Forecast> {
    let (store, times) = (Arc::new(MemStore::default()), Times::default());
    let all = recipe.dataset.scenes;
    let wanted = options.measured.unwrap_or(MOST_SCENES).saturating_add(1).min(all);
    let (stop, start) = (options.stop.nested(), Instant::now());
    let watch = Stopwatch {
        recipe,
        start,
        cores: cores_s(),
        times: &times,
        budget: options.measured.is_none().then_some(LONG_ENOUGH),
        stop: &stop,
        ticks: Mutex::default(),
        reporter,
    };
    let of = |scenes: u32| RunOptions {
        scenes: Some(0..scenes),
        scenes_in_flight: Some(1),
        allow_code: options.allow_code,
        ..RunOptions::new(Arc::clone(&store) as Arc<dyn Store>, options.threads, options.cache.clone())
    };
    let made = run_timed(recipe, &RunOptions { stop: stop.clone(), ..of(wanted) }, &watch, &times);
    let ticks = watch.ticks.into_inner();
    if options.stop.is_requested() || !stop.is_requested() {
        made?;
    }
    let made = ticks.len() as u32;
    if made == 0 {
        return Err(Error::new("no scene could be measured, since all failed").help("see the warnings above"));
    }
    // The run that ended early has not written the files of the whole dataset.
    run(recipe, &RunOptions { stop: options.stop.clone(), ..of(made) }, &Hushed(reporter))?;
    let bytes: u64 = store.files().values().map(|file| file.len() as u64).sum();
    let lanes = Lanes {
        scenes: all,
        cores: options.threads.min(workers::available()).max(1),
        in_flight: sessions::scenes_in_flight(recipe, options.threads, all as usize),
    };
    let components: Vec<(f64, &Component)> = recipe.components.weights().collect();
    let sessions: Vec<Option<usize>> =
        components.iter().map(|(_, component)| component.render.max_sessions()).collect();
    let weights: Vec<f64> = components.iter().map(|(weight, _)| *weight).collect();
    let costs = SceneCost::all(&ticks, &sessions);
    let warm = |component: usize| costs.iter().filter(|cost| cost.component == component).nth(1).is_some();
    let is_rough = |(index, (weight, _)): &(usize, &(f64, &Component))| *weight > 0.0 && !warm(*index);
    let unmeasured = components.iter().enumerate().filter(is_rough).map(|(_, (_, component))| component.id.clone());
    Ok(Forecast {
        scenes: all,
        views_per_scene: recipe.dataset.views_per_scene,
        threads: options.threads,
        scene_bytes: bytes / u64::from(made),
        unmeasured: unmeasured.filter(|id| !id.is_empty()).collect(),
        pace: Pace::of(&costs, &weights, lanes),
    })
}

impl Forecast {
    /// Number of images per hour after the start.
    pub fn images_per_hour(&self) -> f64 {
        3600.0 * f64::from(self.views_per_scene) / self.pace.scene_s
    }

    /// Bytes on disk of all scenes.
    pub fn total_bytes(&self) -> u64 {
        self.scene_bytes.saturating_mul(u64::from(self.scenes))
    }
}

impl Pace {
    /// The speed of a run from the costs of scenes that were made one after the other, and the weights of the components.
    /// The first scene of a component warms up, unless the component has no other.
    ///
    /// The slowest of three lanes sets the speed: all cores, all render sessions, or all scenes in progress. A scene in
    /// progress takes at least as long as a scene alone.
    fn of(costs: &[SceneCost], weights: &[f64], lanes: Lanes) -> Self {
        let first = |cost: &SceneCost| costs.iter().position(|other| other.component == cost.component);
        let is_warm = |(index, cost): &(usize, &SceneCost)| first(cost) != Some(*index);
        let mut warm: Vec<&SceneCost> = costs.iter().enumerate().filter(is_warm).map(|(_, cost)| cost).collect();
        let is_cold = warm.is_empty();
        if is_cold {
            warm = costs.iter().collect();
        }
        let (mut mean, mut start_s, mut total_weight) = (SceneCost::default(), 0.0, 0.0);
        for (component, weight) in weights.iter().enumerate() {
            let Some(cold) = costs.iter().find(|cost| cost.component == component) else { continue };
            let mut own: Vec<&SceneCost> = warm.iter().copied().filter(|cost| cost.component == component).collect();
            if own.is_empty() {
                own.push(cold);
            }
            let own = SceneCost::mean(&own);
            start_s += (cold.wall - own.wall).max(0.0);
            mean.add(&own, *weight);
            total_weight += weight;
        }
        let mean = mean.times(1.0 / total_weight);
        let (scene_s, bound) = mean.shared(lanes);
        let total_s = start_s + mean.total(lanes);
        let totals = warm.iter().map(|cost| start_s + cost.total(lanes));
        let objects = warm.iter().map(|cost| cost.objects);
        Self {
            measured: warm.len() as u32,
            is_cold,
            objects: objects.fold([u32::MAX, 0], |[low, high], it| [low.min(it), high.max(it)]),
            start_s,
            scene_s,
            total_s,
            total_range_s: totals.fold([total_s; 2], |[low, high], it| [low.min(it), high.max(it)]),
            bound,
            stages: mean.stages,
        }
    }
}

impl SceneCost {
    /// The costs of the scenes between the states of a measurement. `sessions` has the number of render sessions of each
    /// component, if it is limited.
    fn all(ticks: &[Tick], sessions: &[Option<usize>]) -> Vec<Self> {
        let mut before = Tick { cores_s: Some(0.0), ..Tick::default() };
        let mut costs = Vec::new();
        for after in ticks {
            let wall = after.wall_s - before.wall_s;
            let cores = after.cores_s.zip(before.cores_s).map_or(wall, |(after, before)| after - before);
            let since = |(stage, seconds): (&String, &f64)| {
                (stage.clone(), seconds - before.stages.get(stage).copied().unwrap_or(0.0))
            };
            let stages: BTreeMap<String, f64> = after.stages.iter().map(since).collect();
            let rendering: f64 = ["render.load", "render"].iter().filter_map(|stage| stages.get(*stage)).sum();
            let sessions = sessions.get(after.component).copied().flatten();
            let device = sessions.map_or(0.0, |sessions| rendering / sessions.max(1) as f64);
            costs.push(Self { component: after.component, wall, cores, device, stages, objects: after.objects });
            before = after.clone();
        }
        costs
    }

    fn mean(all: &[&Self]) -> Self {
        let mut sum = Self::default();
        all.iter().for_each(|cost| sum.add(cost, 1.0));
        sum.times(1.0 / all.len() as f64)
    }

    fn add(&mut self, other: &Self, weight: f64) {
        self.wall += weight * other.wall;
        self.cores += weight * other.cores;
        self.device += weight * other.device;
        for (stage, seconds) in &other.stages {
            *self.stages.entry(stage.clone()).or_default() += weight * seconds;
        }
    }

    fn times(mut self, factor: f64) -> Self {
        self.stages.values_mut().for_each(|seconds| *seconds *= factor);
        Self { wall: factor * self.wall, cores: factor * self.cores, device: factor * self.device, ..self }
    }

    /// Time per scene if several are in progress, and what limits it.
    fn shared(&self, lanes: Lanes) -> (f64, Bound) {
        let all = [
            (self.cores / lanes.cores as f64, Bound::Cores),
            (self.device, Bound::RenderDevice),
            (self.wall / lanes.in_flight as f64, Bound::SceneSteps),
        ];
        all.into_iter().fold((0.0, Bound::Cores), |slowest, lane| if lane.0 > slowest.0 { lane } else { slowest })
    }

    /// Time of all scenes if each is like this one.
    fn total(&self, lanes: Lanes) -> f64 {
        let lane = (self.cores / lanes.cores as f64).max(self.device);
        let rounds = f64::from(lanes.scenes.div_ceil(lanes.in_flight as u32));
        // The slowest lane waits for the rest of one scene.
        (self.wall + f64::from(lanes.scenes.saturating_sub(1)) * lane).max(rounds * self.wall)
    }
}

/// Notes the times after each scene, and ends the measurement in time.
struct Stopwatch<'a> {
    recipe: &'a Recipe,
    start: Instant,
    /// Time of the cores at the start.
    cores: Option<f64>,
    times: &'a Times,
    budget: Option<Duration>,
    stop: &'a Stop,
    ticks: Mutex<Vec<Tick>>,
    reporter: &'a dyn Reporter,
}

impl Reporter for Stopwatch<'_> {
    fn event(&self, event: &Event) {
        Hushed(self.reporter).event(event);
        let &Event::Scene { scene, objects, .. } = event else { return };
        let stages = self.times.all().into_iter().map(|(stage, worked)| (stage, worked.seconds)).collect();
        let cores_s = cores_s().zip(self.cores).map(|(now, start)| now - start);
        let mut ticks = self.ticks.lock();
        let (component, _) = self.recipe.component_of(scene);
        ticks.push(Tick { component, wall_s: self.start.elapsed().as_secs_f64(), cores_s, stages, objects });
        let measured = ticks[ticks.len() - 1].wall_s - ticks[0].wall_s;
        if self.budget.is_some_and(|budget| ticks.len() > 1 && measured >= budget.as_secs_f64()) {
            self.stop.cancel();
        }
    }

    fn message(&self, message: &Message) {
        self.reporter.message(message);
    }
}

/// Passes on what concerns the recipe, and not the progress of a run.
struct Hushed<'a>(&'a dyn Reporter);

impl Reporter for Hushed<'_> {
    fn event(&self, event: &Event) {
        if let Event::Message(_) | Event::Working { .. } | Event::Attempt { .. } = event {
            self.0.event(event);
        }
    }
}

/// Time of all threads of this process so far, s.
#[cfg(unix)]
fn cores_s() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn cores_s() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times after scenes with these costs: wall, cores and device, s.
    fn ticks(costs: &[[f64; 3]]) -> Vec<Tick> {
        let mut tick = Tick { cores_s: Some(0.0), ..Tick::default() };
        let mut after = |[wall, cores, device]: &[f64; 3]| {
            tick.wall_s += wall;
            tick.cores_s = tick.cores_s.map(|before| before + cores);
            *tick.stages.entry("render".into()).or_default() += device;
            tick.objects += 1;
            tick.clone()
        };
        costs.iter().map(&mut after).collect()
    }

    #[test]
    fn the_slowest_lane_sets_the_speed() {
        let of = |cost: [f64; 3], sessions: Option<usize>, lanes: Lanes| {
            Pace::of(&SceneCost::all(&ticks(&[[9.0, 20.0, 7.0], cost]), &[sessions]), &[1.0], lanes)
        };
        let lanes = Lanes { scenes: 100, cores: 4, in_flight: 4 };
        // 12 s of work on 4 cores are 3 s; the first scene took 5 s more than the second.
        let made = of([4.0, 12.0, 2.0], None, lanes);
        assert_eq!((made.bound, made.scene_s, made.start_s, made.total_s), (Bound::Cores, 3.0, 5.0, 5.0 + 4.0 + 297.0));
        assert_eq!((made.measured, made.objects, made.stages["render"]), (1, [2, 2], 2.0));
        // Two cards take 2 s of every scene each, the cores 1 s.
        let made = of([4.0, 4.0, 3.0], Some(2), lanes);
        assert_eq!((made.bound, made.scene_s), (Bound::RenderDevice, 1.5));
        // A scene that waits for 8 s leaves its core to three others.
        let made = of([8.0, 1.0, 0.5], None, lanes);
        assert_eq!((made.bound, made.scene_s, made.total_s), (Bound::SceneSteps, 2.0, 201.0));
        // Five scenes on four threads take two rounds.
        let made = of([8.0, 1.0, 0.5], None, Lanes { scenes: 5, ..lanes });
        assert_eq!((made.total_s, made.total_range_s), (1.0 + 16.0, [17.0; 2]));
    }

    #[test]
    fn all_scenes_after_the_first_are_averaged() {
        let lanes = Lanes { scenes: 10, cores: 2, in_flight: 2 };
        let of = |costs: &[[f64; 3]], lanes| Pace::of(&SceneCost::all(&ticks(costs), &[None]), &[1.0], lanes);
        let made = of(&[[30.0, 30.0, 0.0], [1.0, 2.0, 0.0], [3.0, 6.0, 0.0]], lanes);
        assert_eq!((made.measured, made.scene_s, made.total_range_s), (2, 2.0, [28.0 + 10.0, 28.0 + 30.0]));
        assert_eq!((made.start_s, made.objects, made.is_cold), (28.0, [2, 3], false));
        let made = of(&[[30.0, 30.0, 0.0]], Lanes { scenes: 1, in_flight: 1, ..lanes });
        assert_eq!((made.measured, made.start_s, made.total_s, made.is_cold), (1, 0.0, 30.0, true));
    }

    #[test]
    fn components_count_by_their_weights() {
        let mut ticks = ticks(&[[10.0, 2.0, 0.0], [20.0, 6.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [6.0, 6.0, 0.0]]);
        [0, 1, 0, 0, 1].into_iter().zip(&mut ticks).for_each(|(component, tick)| tick.component = component);
        let lanes = Lanes { scenes: 100, cores: 1, in_flight: 1 };
        let made = Pace::of(&SceneCost::all(&ticks, &[None, None]), &[3.0, 1.0, 4.0], lanes);
        // Both components warmed up: 8 s and 14 s. The third made no scene, so three quarters of all cost 2 s, the others 6 s.
        assert_eq!((made.start_s, made.scene_s, made.measured), (22.0, 3.0, 3));
        assert_eq!((made.total_s, made.total_range_s), (22.0 + 300.0, [22.0 + 200.0, 22.0 + 600.0]));
    }
}
