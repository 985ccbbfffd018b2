//! `cpu_path`: the renderer of everyone without a GPU.

use crate::cache::SceneCache;
use crate::camera::RayCamera;
use crate::labels::{LabelCaster, Labels};
use crate::light::Lights;
use crate::path::{PathTracer, PixelSums, Settings, Statistics, Strategy};
use crate::picture::{Budget, Picture};
use crate::world::World;
use std::sync::Arc;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::BitPlane;
use syntable_model::product::standard::{
    ALBEDO, ALBEDO_MEAN, COVERAGE, COVERAGE_BEFORE_SUPPORT, COVERAGE_BEFORE_SUPPORT_WIDE, COVERAGE_WIDE, DEPTH,
    INSTANCE, NORMAL, NORMAL_MEAN, RADIANCE, RADIANCE_GLOSS, RADIANCE_GLOSS_VARIANCE, RADIANCE_UNTINTED,
    RADIANCE_UNTINTED_VARIANCE, RADIANCE_VARIANCE, RENDER_REPORT,
};

/// What is gathered on the way for denoisers.
const OF_GUIDES: [KeyId; 6] = [
    ALBEDO_MEAN.id(),
    NORMAL_MEAN.id(),
    RADIANCE_GLOSS.id(),
    RADIANCE_GLOSS_VARIANCE.id(),
    RADIANCE_UNTINTED.id(),
    RADIANCE_UNTINTED_VARIANCE.id(),
];

/// Path tracing on the processor: soft shadows, light that bounces, glossy surfaces. Unbiased, and the same picture on
/// any number of threads. Needs no GPU.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CpuPath {
    /// Paths traced for every pixel. Noise falls with the square root; powers of two are spread most evenly.
    #[schemars(range(min = 1, max = 1_048_576))]
    pub samples_per_pixel: u32,
    /// How often light may be scattered between lamp and camera; 1 is direct light alone.
    #[schemars(range(min = 0, max = 256))]
    pub max_bounces: u32,
    /// Bounces after which a faint path may be ended at random, which costs a little noise and saves much time.
    #[schemars(range(min = 1, max = 257))]
    pub russian_roulette_from: u32,
    /// Largest luminance that one connection of a path to a light may bring by scattering, nits. Removes rare bright
    /// specks, and some true light with them; without it the picture is unbiased.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub clamp_nits: Option<f64>,
    /// Least perceptual roughness of surfaces that light meets on its way to a rough one (Kaplanyan and Dachsbacher,
    /// "Path Space Regularization", 2013). Bright specks come from lamps that a rough surface sees in a smooth one; with
    /// 0.3 or so, such caustics are blurred rather than speckled, and nothing is lost. What the camera sees directly or
    /// in mirrors stays as it is. 0 leaves all as it is.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughen: f64,
    /// Noise at which a square of 16 × 16 pixels gets no more samples: the standard error over the luminance, such as
    /// 0.02. `samples_per_pixel` is then the most that a pixel gets. Without it, all get as many.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub noise: Option<f64>,
    /// Seconds that a picture may take; `samples_per_pixel` is then the most that a pixel gets. How many fit depends on
    /// the machine and on what else it does, so that such pictures are not the same twice; `render_report` tells how
    /// many they were.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub time_s: Option<f64>,
}

impl Default for CpuPath {
    fn default() -> Self {
        Self {
            samples_per_pixel: 64,
            max_bounces: 8,
            russian_roulette_from: 3,
            clamp_nits: None,
            roughen: 0.0,
            noise: None,
            time_s: None,
        }
    }
}

impl Config for CpuPath {
    type Stage = dyn Renderer;
    const KIND: &'static str = "cpu_path";
    const EXAMPLE: &'static str = "samples_per_pixel = 64\nmax_bounces = 8";

    fn build(self) -> Result<Box<dyn Renderer>, Invalid> {
        Ok(Box::new(CpuPathRenderer::new(self)?))
    }
}

/// The renderer of [`CpuPath`]; what its sessions share.
pub struct CpuPathRenderer {
    options: CpuPath,
    settings: Settings,
    budget: Budget,
    cache: Arc<SceneCache>,
}

/// A session of [`CpuPathRenderer`].
pub struct CpuPathSession {
    settings: Settings,
    budget: Budget,
    cache: Arc<SceneCache>,
    world: Option<World>,
    statistics: Statistics,
}

impl CpuPathRenderer {
    /// Builds the renderer.
    pub fn new(options: CpuPath) -> Result<Self, Invalid> {
        let clamp = match options.clamp_nits {
            Some(nits) if nits <= 0.0 || nits.is_nan() => {
                return Err(Invalid::new("clamp_nits", format!("`clamp_nits = {nits}` leaves no light"))
                    .help("give a luminance above 0, or leave the key out to clamp nothing"));
            }
            Some(nits) => nits as f32,
            None => f32::INFINITY,
        };
        if options.samples_per_pixel == 0 {
            return Err(Invalid::new("samples_per_pixel", "`samples_per_pixel = 0` makes no picture")
                .help("give at least 1; leave `radiance` and `rgb` out of the writers to render labels alone"));
        }
        for (key, value) in [("noise", options.noise), ("time_s", options.time_s)] {
            if let Some(value) = value.filter(|value| *value <= 0.0 || !value.is_finite()) {
                return Err(Invalid::new(key, format!("`{key} = {value}` is never reached"))
                    .help(format!("give a number above 0, or leave `{key}` out")));
            }
        }
        if !(0.0..=1.0).contains(&options.roughen) {
            return Err(Invalid::new("roughen", format!("`roughen = {}` is outside 0 to 1", options.roughen)));
        }
        let budget = Budget { samples: options.samples_per_pixel, noise: options.noise, seconds: options.time_s };
        let settings = Settings {
            samples: options.samples_per_pixel,
            max_bounces: options.max_bounces,
            roulette_from: options.russian_roulette_from.max(1),
            clamp,
            roughen: options.roughen as f32,
            strategy: Strategy::Combined,
            one_lane: false,
        };
        Ok(Self { options, settings, budget, cache: Arc::new(SceneCache::new()) })
    }

    /// Opens a session of the concrete type.
    pub fn session(&self) -> CpuPathSession {
        CpuPathSession {
            settings: self.settings,
            budget: self.budget,
            cache: self.cache.clone(),
            world: None,
            statistics: Statistics::default(),
        }
    }
}

impl Renderer for CpuPathRenderer {
    fn offers(&self) -> Vec<KeyId> {
        keys![
            RADIANCE,
            DEPTH,
            INSTANCE,
            COVERAGE,
            COVERAGE_BEFORE_SUPPORT,
            COVERAGE_WIDE,
            COVERAGE_BEFORE_SUPPORT_WIDE,
            NORMAL,
            ALBEDO,
            NORMAL_MEAN,
            ALBEDO_MEAN,
            RADIANCE_VARIANCE,
            RADIANCE_GLOSS,
            RADIANCE_GLOSS_VARIANCE,
            RADIANCE_UNTINTED,
            RADIANCE_UNTINTED_VARIANCE,
            RENDER_REPORT
        ]
    }

    fn open(&self, _index: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(self.session()))
    }

    fn cost(&self) -> String {
        let CpuPath { samples_per_pixel, max_bounces, .. } = self.options;
        format!(
            "{samples_per_pixel} paths a pixel of up to {max_bounces} bounces; labels cost less than one path a pixel"
        )
    }
}

impl CpuPathSession {
    /// What was traced since the session was opened.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    #[cfg(test)]
    pub(crate) fn with_strategy(mut self, strategy: Strategy) -> Self {
        self.settings.strategy = strategy;
        self
    }

    #[cfg(test)]
    pub(crate) fn one_lane(mut self) -> Self {
        self.settings.one_lane = true;
        self
    }

    /// Traces paths for whatever they are wanted for.
    fn picture(&mut self, request: &RenderRequest, camera: &RayCamera, frame: &mut Frame) -> Result<()> {
        let Some(world) = &self.world else { return Err(not_loaded()) };
        let lights = Lights::new(&request.view.lights, world, &self.cache)?;
        let tracer = PathTracer::new(world, &lights, camera, self.settings, request.stream.seed());
        let guides = request.wants.iter().any(|want| OF_GUIDES.contains(want));
        let tracer = tracer.with_guides(guides);
        let (width, height) = size(request);
        let picture = Picture::trace(&tracer, width, height, &self.budget, request.workers);
        self.statistics.add(&picture.statistics);
        let workers = request.workers;
        for &want in request.wants {
            if want == RADIANCE.id() {
                frame.put(RADIANCE, picture.radiance(workers))?;
            } else if want == RADIANCE_VARIANCE.id() {
                frame.put(RADIANCE_VARIANCE, picture.plane(workers, 0.0, |sums| sums.variance() as f32))?;
            } else if want == ALBEDO_MEAN.id() {
                frame.put(ALBEDO_MEAN, picture.plane(workers, [0.0; 3], PixelSums::mean_albedo))?;
            } else if want == NORMAL_MEAN.id() {
                let mean = |sums: &PixelSums| camera.turned(sums.mean_normal().into()).array();
                frame.put(NORMAL_MEAN, picture.plane(workers, [0.0; 3], mean))?;
            } else if want == RADIANCE_GLOSS.id() {
                frame.put(RADIANCE_GLOSS, picture.plane(workers, [0.0; 3], |sums| sums.gloss.mean(sums.samples)))?;
            } else if want == RADIANCE_GLOSS_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.gloss.variance(sums.samples);
                frame.put(RADIANCE_GLOSS_VARIANCE, picture.plane(workers, 0.0, variance))?;
            } else if want == RADIANCE_UNTINTED.id() {
                frame.put(
                    RADIANCE_UNTINTED,
                    picture.plane(workers, [0.0; 3], |sums| sums.untinted.mean(sums.samples)),
                )?;
            } else if want == RADIANCE_UNTINTED_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.untinted.variance(sums.samples);
                frame.put(RADIANCE_UNTINTED_VARIANCE, picture.plane(workers, 0.0, variance))?;
            } else if want == RENDER_REPORT.id() {
                frame.put(RENDER_REPORT, picture.report(workers))?;
            }
        }
        Ok(())
    }
}

impl RenderSession for CpuPathSession {
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        // The last scene is let go first, so that two are never held at once.
        self.world = None;
        self.world = Some(World::new(scene, &self.cache, workers));
        Ok(())
    }

    fn render(&mut self, request: &RenderRequest, frame: &mut Frame) -> Result<()> {
        let wants = |key: KeyId| request.wants.contains(&key);
        let camera = RayCamera::new(&request.view.camera);
        let (width, height) = size(request);
        {
            let world = self.world.as_ref().ok_or_else(not_loaded)?;
            let bits = |key: Key<BitPlane>, margin: [u32; 2]| {
                wants(key.id()).then(|| BitPlane::new(width, height, margin, world.objects))
            };
            let color =
                |key: Key<Plane<[f32; 3]>>| wants(key.id()).then(|| Plane::from_fn(width, height, |_, _| [0.0; 3]));
            let mut labels = Labels {
                depth: wants(DEPTH.id()).then(|| Plane::from_fn(width, height, |_, _| f32::INFINITY)),
                instance: wants(INSTANCE.id()).then(|| Plane::from_fn(width, height, |_, _| InstanceId::BACKGROUND)),
                normal: color(NORMAL),
                albedo: color(ALBEDO),
                coverage: bits(COVERAGE, [0, 0]),
                coverage_before_support: bits(COVERAGE_BEFORE_SUPPORT, [0, 0]),
                coverage_wide: bits(COVERAGE_WIDE, [width, height]),
                coverage_before_support_wide: bits(COVERAGE_BEFORE_SUPPORT_WIDE, [width, height]),
            };
            if labels.any() {
                LabelCaster::new(world, &camera, width, height).cast(&mut labels, request.workers);
            }
            labels.put(frame)?;
        }
        let of_paths = [RADIANCE.id(), RADIANCE_VARIANCE.id(), RENDER_REPORT.id()];
        if of_paths.into_iter().chain(OF_GUIDES).any(wants) { self.picture(request, &camera, frame) } else { Ok(()) }
    }
}

impl Labels {
    fn any(&self) -> bool {
        let bits =
            [&self.coverage, &self.coverage_before_support, &self.coverage_wide, &self.coverage_before_support_wide];
        self.depth.is_some()
            || self.instance.is_some()
            || self.normal.is_some()
            || self.albedo.is_some()
            || bits.iter().any(|plane| plane.is_some())
    }

    fn put(self, frame: &mut Frame) -> Result<()> {
        fn one<T: syntable_model::product::Product>(frame: &mut Frame, key: Key<T>, plane: Option<T>) -> Result<()> {
            plane.map_or(Ok(()), |plane| frame.put(key, plane))
        }
        one(frame, DEPTH, self.depth)?;
        one(frame, INSTANCE, self.instance)?;
        one(frame, NORMAL, self.normal)?;
        one(frame, ALBEDO, self.albedo)?;
        one(frame, COVERAGE, self.coverage)?;
        one(frame, COVERAGE_BEFORE_SUPPORT, self.coverage_before_support)?;
        one(frame, COVERAGE_WIDE, self.coverage_wide)?;
        one(frame, COVERAGE_BEFORE_SUPPORT_WIDE, self.coverage_before_support_wide)
    }
}

fn size(request: &RenderRequest) -> (u32, u32) {
    (request.view.camera.intrinsics.width, request.view.camera.intrinsics.height)
}

fn not_loaded() -> Error {
    Error::new("no scene was loaded before rendering").help("call `load` first")
}

register!(CpuPath);
