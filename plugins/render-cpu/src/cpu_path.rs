//! `cpu_path`: the path tracer as a stage.

use crate::labels::{LabelCaster, Labels};
use crate::path::{PathTracer, Strategy};
use crate::world::{Caches, World};
use std::sync::Arc;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, COVERAGE, DEPTH, INSTANCE, NORMAL, OBJECT_DEPTHS};
use syntable_model::product::{BitPlane, ObjectDepths};
use syntable_model::stage::{Bodies, Window};
use syntable_simd::Processor;
use syntable_transport::film::{Film, Statistics};
use syntable_transport::light::Lights;
use syntable_transport::{PathTracing, RayCamera, path_tracing_kind};

path_tracing_kind! {
    /// Path tracing on the CPU: soft shadows, global illumination, glossy surfaces. Unbiased, and the same image on any number
    /// of threads.
    CpuPath
}

impl Config for CpuPath {
    type Stage = dyn Renderer;
    const KIND: &'static str = "cpu_path";
    const RENAMED: &[(&str, &str)] = &[("clamp_nits", "max_indirect_luminance_nits"), ("roughen", "regularize")];
    const EXAMPLE: &'static str = "samples_per_pixel = 64\nmax_bounces = 8";

    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        Ok(Box::new(CpuPathRenderer::new(self.0)))
    }
}

/// The renderer of [`CpuPath`]; state shared by its sessions.
pub struct CpuPathRenderer {
    options: PathTracing,
    caches: Arc<Caches>,
}

/// A session of [`CpuPathRenderer`].
pub struct CpuPathSession {
    options: PathTracing,
    strategy: Strategy,
    processor: Processor,
    caches: Arc<Caches>,
    world: Option<World>,
    statistics: Statistics,
}

impl CpuPathRenderer {
    /// Builds the renderer. The options must be within the limits of their schema.
    pub fn new(options: PathTracing) -> Self {
        Self { options, caches: Arc::default() }
    }

    /// Opens a session of the concrete type.
    pub fn session(&self) -> CpuPathSession {
        CpuPathSession {
            options: self.options.clone(),
            strategy: Strategy::Combined,
            processor: Processor::detect(),
            caches: self.caches.clone(),
            world: None,
            statistics: Statistics::default(),
        }
    }
}

impl Renderer for CpuPathRenderer {
    fn offers(&self) -> Vec<KeyId> {
        let mut keys = keys![DEPTH, INSTANCE, COVERAGE, OBJECT_DEPTHS, NORMAL, ALBEDO];
        keys.extend(Film::offers());
        keys
    }

    fn open(&self, _index: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(self.session()))
    }

    fn cost(&self) -> String {
        self.options.cost()
    }
}

impl CpuPathSession {
    /// Counts since the session was opened.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    #[cfg(test)]
    pub(crate) fn with_strategy(mut self, strategy: Strategy) -> Self {
        self.strategy = strategy;
        self
    }

    #[cfg(test)]
    pub(crate) fn portable(mut self) -> Self {
        self.processor = Processor::portable();
        self
    }

    /// Renders the window of a request, whatever its bodies.
    fn render_world(&self, world: &World, request: &RenderRequest, frame: &mut Products) -> Result<Statistics> {
        let wants = |key: KeyId| request.wants.contains(&key);
        let camera = RayCamera::new(&request.view.camera, request.window);
        let Window { width, height, .. } = request.window;
        let bits = |key: Key<BitPlane>| wants(key.id()).then(|| BitPlane::new(width, height, world.scene.objects));
        let color = |key: Key<Plane<[f32; 3]>>| wants(key.id()).then(|| Plane::from_fn(width, height, |_, _| [0.0; 3]));
        let mut labels = Labels {
            depth: wants(DEPTH.id()).then(|| Plane::from_fn(width, height, |_, _| f32::INFINITY)),
            instance: wants(INSTANCE.id()).then(|| Plane::from_fn(width, height, |_, _| InstanceId::BACKGROUND)),
            normal: color(NORMAL),
            albedo: color(ALBEDO),
            coverage: bits(COVERAGE),
            coverage_before_support: bits(COVERAGE.before_support()),
            object_depths: wants(OBJECT_DEPTHS.id()).then(Vec::new),
        };
        let traces = Film::offers().into_iter().any(wants);
        // Surfaces that show the environment have its color.
        let projects = labels.albedo.is_some() && world.scene.materials.has_projections;
        let lights = match traces || projects {
            true => Lights::new(&request.view.lights, &world.scene, &self.caches.scene)?,
            false => Lights::default(),
        };
        if labels.any() {
            let (window, blended) = (request.window, self.options.blended_labels);
            let caster = LabelCaster::new(world, &camera, window, blended, lights.projection.as_ref());
            caster.cast(&mut labels, request.workers);
        }
        labels.put(request.window, frame)?;
        match traces {
            true => self.trace(world, &lights, request, &camera, frame),
            false => Ok(Statistics::default()),
        }
    }

    /// Traces paths for the products that need them.
    fn trace(
        &self,
        world: &World,
        lights: &Lights,
        request: &RenderRequest,
        camera: &RayCamera,
        frame: &mut Products,
    ) -> Result<Statistics> {
        let tracer = PathTracer::new(world, lights, camera, self.options.settings(), request.stream.seed());
        let tracer = tracer.with(self.strategy, self.processor);
        let tracer = tracer.with_guides(Film::wants_guides(request.wants));
        let film = Film::trace(&tracer, request.window, &self.options.budget(), request.workers)?;
        film.put(request.wants, camera, request.workers, frame)?;
        Ok(film.statistics)
    }
}

impl RenderSession for CpuPathSession {
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        // The last scene is let go first, so that two are never held at once.
        self.world = None;
        self.world = Some(World::new(scene, &self.caches, workers));
        Ok(())
    }

    fn render(&mut self, request: &RenderRequest, frame: &mut Products) -> Result<()> {
        let world = self.world.as_ref().ok_or_else(not_loaded)?;
        let statistics = match request.bodies {
            Bodies::All => self.render_world(world, request, frame)?,
            _ => self.render_world(&world.with_bodies(&request.bodies)?, request, frame)?,
        };
        self.statistics.add(&statistics);
        Ok(())
    }
}

impl Labels {
    fn any(&self) -> bool {
        self.depth.is_some()
            || self.instance.is_some()
            || self.normal.is_some()
            || self.albedo.is_some()
            || self.coverage.is_some()
            || self.coverage_before_support.is_some()
            || self.object_depths.is_some()
    }

    fn put(self, window: Window, frame: &mut Products) -> Result<()> {
        fn one<T: syntable_model::product::Product>(frame: &mut Products, key: Key<T>, plane: Option<T>) -> Result<()> {
            plane.map_or(Ok(()), |plane| frame.put(key, plane))
        }
        one(frame, DEPTH, self.depth)?;
        one(frame, INSTANCE, self.instance)?;
        one(frame, NORMAL, self.normal)?;
        one(frame, ALBEDO, self.albedo)?;
        one(frame, COVERAGE, self.coverage)?;
        one(frame, COVERAGE.before_support(), self.coverage_before_support)?;
        let depths = self.object_depths.map(|hits| ObjectDepths::from_hits(window.width, window.height, hits));
        one(frame, OBJECT_DEPTHS, depths)
    }
}

fn not_loaded() -> Error {
    Error::new("no scene was loaded before rendering").help("call `load` first")
}

register!(CpuPath);
