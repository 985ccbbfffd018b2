//! `cpu_path`: the path tracer as a stage.

use crate::camera::RayCamera;
use crate::film::{Budget, Film};
use crate::labels::{LabelCaster, Labels};
use crate::light::Lights;
use crate::path::{PathTracer, PixelSums, Settings, Statistics, Strategy};
use crate::world::{Caches, World};
use std::sync::Arc;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::BitPlane;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, DENOISE_ALBEDO, DENOISE_NORMAL, DEPTH, INSTANCE, NORMAL, RADIANCE, RADIANCE_DEMODULATED,
    RADIANCE_DEMODULATED_VARIANCE, RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE, RADIANCE_VARIANCE, RENDER_REPORT,
};
use syntable_model::stage::{Bodies, Window};
use syntable_prepare::labels::BlendedLabels;
use syntable_simd::Processor;

/// What is gathered on the way for denoisers.
const OF_GUIDES: [KeyId; 6] = [
    DENOISE_ALBEDO.id(),
    DENOISE_NORMAL.id(),
    RADIANCE_SPECULAR.id(),
    RADIANCE_SPECULAR_VARIANCE.id(),
    RADIANCE_DEMODULATED.id(),
    RADIANCE_DEMODULATED_VARIANCE.id(),
];

/// Path tracing on the CPU: soft shadows, global illumination, glossy surfaces. Unbiased, and the same image on any number
/// of threads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CpuPath {
    /// Paths per pixel. Noise falls with the square root; powers of two are stratified best.
    #[schemars(range(min = 1, max = 1_048_576))]
    pub samples_per_pixel: u32,
    /// Maximum path depth. 1 renders direct illumination only, 0 only what emits.
    #[schemars(range(min = 0, max = 256))]
    pub max_bounces: u32,
    /// Bounces after which Russian roulette may end faint paths: a little more noise in much less time.
    #[schemars(range(min = 1, max = 257))]
    pub russian_roulette_from: u32,
    /// Maximum luminance of one indirect contribution to a path, nits. Removes fireflies, and some true light with them;
    /// without it the image is unbiased.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_indirect_luminance_nits: Option<f64>,
    /// Minimum perceptual roughness of surfaces after the first rough bounce (path-space regularization, Kaplanyan and
    /// Dachsbacher, 2013). 0.3 or so blurs caustics, which are fireflies otherwise, without losing light; what the camera
    /// sees directly or in mirrors is unchanged. 0 disables it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub regularize: f64,
    /// How dielectrics divide light between gloss and color.
    pub dielectrics: Dielectrics,
    /// Reconstruction filter: how much the light counts that falls around the center of a pixel.
    pub pixel_filter: PixelFilter,
    /// Noise below which a tile of 16 × 16 pixels gets no more samples: the ratio of standard error to luminance, such as
    /// 0.02. `samples_per_pixel` is then the maximum. Without it, all pixels get as many.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub noise: Option<f64>,
    /// Time limit per image, seconds; `samples_per_pixel` is then the maximum. The number of samples depends on the
    /// machine and its load, so such images are not reproducible; `render_report` has the number.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_s: Option<f64>,
    /// How labels treat materials that blend by alpha (glTF `BLEND`, MTL `d`), such as thin glass: `shape` (the default)
    /// takes the surface as there wherever the alpha of its texture is one half or more, however transparent the material
    /// is as a whole; `coverage` only where it covers one half or more of what is behind it.
    pub blended_labels: BlendedLabels,
}

/// Model of a dielectric's two lobes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dielectrics {
    /// Light crosses the surface on its way in and out, and what microfacets reflect more than once is kept: white
    /// reflects all light (Kulla and Conty, 2017).
    #[default]
    EnergyConserving,
    /// The plain mix of glTF 2.0, appendix B.2: the Fresnel term of the half vector, once, and no multiple scattering. As
    /// viewers of glTF show it: light 10° above a smooth surface gives a half more.
    Gltf,
}

/// Reconstruction filter of pixels. Every pixel draws the positions of its own paths from it, so that the noise of
/// neighbors is independent, as denoisers need it (Shirley, 1991).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PixelFilter {
    /// Mean over the area of the pixel, as an ideal sensor sees it. Slanted edges have steps.
    Box,
    /// Weight that falls linearly to 0 one pixel from the center: edges are smooth, textures a little softer.
    #[default]
    Tent,
}

impl Default for CpuPath {
    fn default() -> Self {
        Self {
            samples_per_pixel: 64,
            max_bounces: 8,
            russian_roulette_from: 3,
            max_indirect_luminance_nits: None,
            regularize: 0.0,
            dielectrics: Dielectrics::default(),
            pixel_filter: PixelFilter::default(),
            noise: None,
            time_s: None,
            blended_labels: BlendedLabels::Shape,
        }
    }
}

impl Config for CpuPath {
    type Stage = dyn Renderer;
    const KIND: &'static str = "cpu_path";
    const RENAMED: &[(&str, &str)] = &[("clamp_nits", "max_indirect_luminance_nits"), ("roughen", "regularize")];
    const EXAMPLE: &'static str = "samples_per_pixel = 64\nmax_bounces = 8";

    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        Ok(Box::new(CpuPathRenderer::new(self)))
    }
}

/// The renderer of [`CpuPath`]; state shared by its sessions.
pub struct CpuPathRenderer {
    options: CpuPath,
    settings: Settings,
    budget: Budget,
    caches: Arc<Caches>,
}

/// A session of [`CpuPathRenderer`].
pub struct CpuPathSession {
    settings: Settings,
    budget: Budget,
    blended_labels: BlendedLabels,
    caches: Arc<Caches>,
    world: Option<World>,
    statistics: Statistics,
}

impl CpuPathRenderer {
    /// Builds the renderer. The options must be within the limits of their schema.
    pub fn new(options: CpuPath) -> Self {
        let max_indirect_luminance_nits = options.max_indirect_luminance_nits.map_or(f32::INFINITY, |nits| nits as f32);
        let budget = Budget { samples: options.samples_per_pixel, noise: options.noise, seconds: options.time_s };
        let settings = Settings {
            samples: options.samples_per_pixel,
            max_bounces: options.max_bounces,
            roulette_from: options.russian_roulette_from.max(1),
            max_indirect_luminance_nits,
            regularize: options.regularize as f32,
            filter: options.pixel_filter,
            dielectrics: options.dielectrics,
            strategy: Strategy::Combined,
            processor: Processor::detect(),
        };
        Self { options, settings, budget, caches: Arc::default() }
    }

    /// Opens a session of the concrete type.
    pub fn session(&self) -> CpuPathSession {
        CpuPathSession {
            settings: self.settings,
            budget: self.budget,
            blended_labels: self.options.blended_labels,
            caches: self.caches.clone(),
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
            NORMAL,
            ALBEDO,
            DENOISE_NORMAL,
            DENOISE_ALBEDO,
            RADIANCE_VARIANCE,
            RADIANCE_SPECULAR,
            RADIANCE_SPECULAR_VARIANCE,
            RADIANCE_DEMODULATED,
            RADIANCE_DEMODULATED_VARIANCE,
            RENDER_REPORT
        ]
    }

    fn open(&self, _index: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(self.session()))
    }

    fn cost(&self) -> String {
        let CpuPath { samples_per_pixel, max_bounces, .. } = self.options;
        format!(
            "{samples_per_pixel} paths per pixel of up to {max_bounces} bounces; labels cost less than one path per pixel"
        )
    }
}

impl CpuPathSession {
    /// Counts since the session was opened.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    #[cfg(test)]
    pub(crate) fn with_strategy(mut self, strategy: Strategy) -> Self {
        self.settings.strategy = strategy;
        self
    }

    #[cfg(test)]
    pub(crate) fn portable(mut self) -> Self {
        self.settings.processor = Processor::portable();
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
        };
        let of_paths = [RADIANCE.id(), RADIANCE_VARIANCE.id(), RENDER_REPORT.id()];
        let traces = of_paths.into_iter().chain(OF_GUIDES).any(wants);
        // Surfaces that show the environment have its color.
        let projects = labels.albedo.is_some() && world.scene.materials.has_projections;
        let lights = match traces || projects {
            true => Lights::new(&request.view.lights, &world.scene, &self.caches.scene)?,
            false => Lights::default(),
        };
        if labels.any() {
            let (window, blended) = (request.window, self.blended_labels);
            let caster = LabelCaster::new(world, &camera, window, blended, lights.projection.as_ref());
            caster.cast(&mut labels, request.workers);
        }
        labels.put(frame)?;
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
        let tracer = PathTracer::new(world, lights, camera, self.settings, request.stream.seed());
        let guides = request.wants.iter().any(|want| OF_GUIDES.contains(want));
        let tracer = tracer.with_guides(guides);
        let film = Film::trace(&tracer, request.window, &self.budget, request.workers);
        let workers = request.workers;
        for &want in request.wants {
            if want == RADIANCE.id() {
                frame.put(RADIANCE, film.radiance(workers))?;
            } else if want == RADIANCE_VARIANCE.id() {
                frame.put(RADIANCE_VARIANCE, film.plane(workers, 0.0, |sums| sums.variance() as f32))?;
            } else if want == DENOISE_ALBEDO.id() {
                frame.put(DENOISE_ALBEDO, film.plane(workers, [0.0; 3], PixelSums::mean_albedo))?;
            } else if want == DENOISE_NORMAL.id() {
                let mean = |sums: &PixelSums| camera.rotate_to_camera(sums.mean_normal().into()).array();
                frame.put(DENOISE_NORMAL, film.plane(workers, [0.0; 3], mean))?;
            } else if want == RADIANCE_SPECULAR.id() {
                frame.put(RADIANCE_SPECULAR, film.plane(workers, [0.0; 3], |sums| sums.specular.mean(sums.samples)))?;
            } else if want == RADIANCE_SPECULAR_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.specular.variance(sums.samples);
                frame.put(RADIANCE_SPECULAR_VARIANCE, film.plane(workers, 0.0, variance))?;
            } else if want == RADIANCE_DEMODULATED.id() {
                frame.put(
                    RADIANCE_DEMODULATED,
                    film.plane(workers, [0.0; 3], |sums| sums.demodulated.mean(sums.samples)),
                )?;
            } else if want == RADIANCE_DEMODULATED_VARIANCE.id() {
                let variance = |sums: &PixelSums| sums.demodulated.variance(sums.samples);
                frame.put(RADIANCE_DEMODULATED_VARIANCE, film.plane(workers, 0.0, variance))?;
            } else if want == RENDER_REPORT.id() {
                frame.put(RENDER_REPORT, film.report(workers))?;
            }
        }
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
    }

    fn put(self, frame: &mut Products) -> Result<()> {
        fn one<T: syntable_model::product::Product>(frame: &mut Products, key: Key<T>, plane: Option<T>) -> Result<()> {
            plane.map_or(Ok(()), |plane| frame.put(key, plane))
        }
        one(frame, DEPTH, self.depth)?;
        one(frame, INSTANCE, self.instance)?;
        one(frame, NORMAL, self.normal)?;
        one(frame, ALBEDO, self.albedo)?;
        one(frame, COVERAGE, self.coverage)?;
        one(frame, COVERAGE.before_support(), self.coverage_before_support)
    }
}

fn not_loaded() -> Error {
    Error::new("no scene was loaded before rendering").help("call `load` first")
}

register!(CpuPath);
