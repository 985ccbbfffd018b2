//! `cpu_path`: the path tracer as a stage.

use crate::labels::{LabelCaster, Labels};
use crate::path::{PathTracer, Strategy, TileTracers};
use crate::world::{Caches, World};
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};
use syntable_model::context::{Serial, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DEPTH, INSTANCE, NORMAL, OBJECT_DEPTHS, RADIANCE,
};
use syntable_model::product::{BitPlane, ObjectDepths};
use syntable_model::stage::{Bodies, Tile, Window};
use syntable_simd::Processor;
use syntable_transport::components::{self, Light};
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
        components::offers()
    }

    fn open(&self, _index: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(self.session()))
    }

    fn label_surface(&self) -> LabelSurface {
        self.options.blended_labels.surface()
    }

    fn samples_per_pixel(&self) -> Option<u32> {
        Some(self.options.samples_per_pixel)
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

    /// Estimates direct light by one strategy. Images of all strategies converge to one image, so each verifies the others.
    pub fn with_strategy(mut self, strategy: Strategy) -> Self {
        self.strategy = strategy;
        self
    }

    /// Uses the instructions that every processor has. The images have the same bits.
    pub fn portable(mut self) -> Self {
        self.processor = Processor::portable();
        self
    }

    /// Renders the tiles of a request.
    fn render_tiles(
        &self,
        world: &World,
        light: Light,
        request: &RenderRequest,
        frame: &mut Products,
    ) -> Result<Statistics> {
        let ready = |tile: &Tile| -> Result<ReadyTile> {
            let world = match tile.bodies {
                Bodies::All => Cow::Borrowed(world),
                bodies => Cow::Owned(world.with_bodies(&bodies)?),
            };
            Ok(ReadyTile {
                at: tile.at,
                window: tile.window,
                world,
                camera: RayCamera::new(&request.view.camera, tile.window),
            })
        };
        let tiles: Vec<ReadyTile> = request.tiles.iter().map(ready).collect::<Result<_>>()?;
        let wants = |key: KeyId| request.wants.contains(&key);
        let traces = Film::offers().into_iter().any(wants);
        // Surfaces that show the environment take their color from it.
        let projects = wants(ALBEDO.id()) && world.scene.materials.has_projections;
        let mut lights = Vec::with_capacity(tiles.len());
        for tile in &tiles {
            lights.push(match traces || projects {
                true => Lights::new(&request.view.lights, &tile.world.scene, &self.caches.scene)?,
                false => Lights::default(),
            });
        }
        self.cast(&tiles, &lights, request, frame)?;
        match traces {
            true => self.trace(&tiles, light, &lights, request, frame),
            false => Ok(Statistics::default()),
        }
    }

    /// Casts the wanted labels.
    fn cast(
        &self,
        tiles: &[ReadyTile],
        lights: &[Lights],
        request: &RenderRequest,
        frame: &mut Products,
    ) -> Result<()> {
        let blended = self.options.blended_labels;
        let cast = |tile: &ReadyTile, lights: &Lights, workers: &dyn Workers| {
            let mut labels = Labels::wanted(request.wants, [tile.window.width, tile.window.height], tile.objects());
            if labels.any() {
                let projection = lights.projection.as_ref();
                LabelCaster::new(&tile.world, &tile.camera, tile.window, blended, projection)
                    .cast(&mut labels, workers);
            }
            labels
        };
        if let ([tile], [lights], Some(_)) = (tiles, lights, request.only_tile()) {
            return cast(tile, lights, request.workers).put(request.size, frame);
        }
        if request
            .wants
            .iter()
            .any(|key| [COVERAGE.id(), COVERAGE_BEFORE_SUPPORT.id(), OBJECT_DEPTHS.id()].contains(key))
        {
            return Err(Error::new("several tiles have no sets of objects").help("render them one by one"));
        }
        let cut: Vec<OnceLock<Labels>> = tiles.iter().map(|_| OnceLock::new()).collect();
        request.workers.run(tiles.len(), &|number| {
            cut[number].get_or_init(|| cast(&tiles[number], &lights[number], &Serial));
        });
        let mut all = Labels::wanted(request.wants, request.size, 0);
        for (tile, labels) in tiles.iter().zip(cut.into_iter().filter_map(OnceLock::into_inner)) {
            all.paste(tile.at, &labels);
        }
        all.put(request.size, frame)
    }

    /// Traces paths for the products that need them.
    fn trace(
        &self,
        tiles: &[ReadyTile],
        light: Light,
        lights: &[Lights],
        request: &RenderRequest,
        frame: &mut Products,
    ) -> Result<Statistics> {
        let guides = Film::wants_guides(request.wants);
        let mut tracers = Vec::with_capacity(tiles.len());
        for (tile, lights) in tiles.iter().zip(lights) {
            let settings = self.options.settings(light);
            let tracer = PathTracer::new(&tile.world, lights, &tile.camera, settings, request.stream.seed());
            let tracer = tracer.with(self.strategy, self.processor);
            tracers.push(tracer.with_guides(guides).with_background(request.background));
        }
        let budget = self.options.budget(light);
        let film = Film::trace(&TileTracers(tracers), request.size, &request.tiles, &budget, request.workers)?;
        // The frame rotation of a camera is the same for all windows.
        let camera = RayCamera::new(&request.view.camera, Window { x: 0, y: 0, width: 0, height: 0 });
        film.put(request.wants, &camera, request.workers, frame)?;
        Ok(film.statistics)
    }
}

/// A tile with the bodies that its rays meet.
struct ReadyTile<'a> {
    at: [u32; 2],
    window: Window,
    world: Cow<'a, World>,
    camera: RayCamera,
}

impl ReadyTile<'_> {
    fn objects(&self) -> usize {
        self.world.scene.objects
    }
}

impl RenderSession for CpuPathSession {
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        // The last scene is dropped first, so that two are never in memory at once.
        self.world = None;
        self.world = Some(World::new(scene, &self.caches, workers));
        Ok(())
    }

    fn pose(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        // The trees of the bodies stay alive until the new top level has them, whatever the caches keep.
        let before = self.world.take();
        self.world = Some(World::posed(scene, &self.caches, before.as_ref(), workers));
        Ok(())
    }

    fn render(&mut self, request: &RenderRequest, frame: &mut Products) -> Result<()> {
        let world = self.world.as_ref().ok_or_else(not_loaded)?;
        let statistics = components::render(request, RADIANCE, frame, |light, request, frame| {
            self.render_tiles(world, light, request, frame)
        })?;
        self.statistics.add(&statistics);
        Ok(())
    }
}

impl Labels {
    /// Empty planes of the wanted labels.
    fn wanted(wants: &[KeyId], [width, height]: [u32; 2], objects: usize) -> Self {
        let wants = |key: KeyId| wants.contains(&key);
        let bits = |key: Key<BitPlane>| wants(key.id()).then(|| BitPlane::new(width, height, objects));
        let color = |key: Key<Plane<[f32; 3]>>| wants(key.id()).then(|| Plane::from_fn(width, height, |_, _| [0.0; 3]));
        Self {
            depth: wants(DEPTH.id()).then(|| Plane::from_fn(width, height, |_, _| f32::INFINITY)),
            instance: wants(INSTANCE.id()).then(|| Plane::from_fn(width, height, |_, _| InstanceId::BACKGROUND)),
            normal: color(NORMAL),
            albedo: color(ALBEDO),
            coverage: bits(COVERAGE),
            coverage_before_support: bits(COVERAGE_BEFORE_SUPPORT),
            object_depths: wants(OBJECT_DEPTHS.id()).then(Vec::new),
        }
    }

    /// Pastes the planes of a tile.
    fn paste(&mut self, at: [u32; 2], tile: &Self) {
        fn one<T: Copy>(at: [u32; 2], plane: &mut Option<Plane<T>>, tile: &Option<Plane<T>>) {
            if let (Some(plane), Some(tile)) = (plane, tile) {
                plane.paste(at, tile);
            }
        }
        one(at, &mut self.depth, &tile.depth);
        one(at, &mut self.instance, &tile.instance);
        one(at, &mut self.normal, &tile.normal);
        one(at, &mut self.albedo, &tile.albedo);
    }

    fn any(&self) -> bool {
        self.depth.is_some()
            || self.instance.is_some()
            || self.normal.is_some()
            || self.albedo.is_some()
            || self.coverage.is_some()
            || self.coverage_before_support.is_some()
            || self.object_depths.is_some()
    }

    fn put(self, [width, height]: [u32; 2], frame: &mut Products) -> Result<()> {
        fn one<T: syntable_model::product::Product>(frame: &mut Products, key: Key<T>, plane: Option<T>) -> Result<()> {
            plane.map_or(Ok(()), |plane| frame.put(key, plane))
        }
        one(frame, DEPTH, self.depth)?;
        one(frame, INSTANCE, self.instance)?;
        one(frame, NORMAL, self.normal)?;
        one(frame, ALBEDO, self.albedo)?;
        one(frame, COVERAGE, self.coverage)?;
        one(frame, COVERAGE_BEFORE_SUPPORT, self.coverage_before_support)?;
        let depths = self.object_depths.map(|hits| ObjectDepths::from_hits(width, height, hits));
        one(frame, OBJECT_DEPTHS, depths)
    }
}

fn not_loaded() -> Error {
    Error::new("no scene was loaded before rendering").help("call `load` first")
}

register!(CpuPath);
