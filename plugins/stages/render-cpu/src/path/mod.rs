//! The path tracer: computes the light that reaches the camera, with paths that start at the camera.
//!
//! At every surface an emitter is sampled and the BSDF is sampled; both estimates of direct light are combined by
//! multiple importance sampling with the power heuristic (Veach, 1997). Russian roulette ends faint paths.
//!
//! Paths run in batches, bounce by bounce: first all rays are traced, then all surfaces evaluated, then all scattering
//! computed in lanes, then all shadow rays traced; batches are compacted after every step. The radiance of a path
//! depends on its pixel and sample alone, not on its batch.
//!
//! A batch goes from `start` through `intersect` and `scatter`, bounce by bounce; `sums` accumulates per pixel.

mod cursor;
mod intersect;
mod scatter;
mod start;

use crate::batch::{BATCH, Batch, get};
use crate::world::{Passed, World};
use cursor::Cursor;
use parking_lot::Mutex;
use syntable_bvh::Ray;
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_prepare::SampleOrder;
use syntable_simd::{Int, Processor, Real, Simd, at_least, at_most, inverse};
use syntable_simd::{Rgb, Vec3};
use syntable_transport::film::{Statistics, Task, Tracer, guide_seed};
use syntable_transport::light::Lights;
use syntable_transport::path::{ALPHA_OF_BOUNCE, ALPHA_OF_SAMPLE, GUIDE_BOUNCES, TOUCHING};
use syntable_transport::{PixelSums, RayCamera, Settings};

/// Estimates of direct light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Both, combined by the power heuristic (Veach 1997, section 9.2.4).
    Combined,
    /// Emitter sampling alone.
    Emitters,
    /// BSDF sampling alone.
    Bsdf,
}

/// A view of a scene, ready to trace.
pub(crate) struct PathTracer<'a> {
    world: &'a World,
    lights: &'a Lights<'a>,
    camera: &'a RayCamera,
    settings: Settings,
    strategy: Strategy,
    /// Instruction set; tests compare them.
    processor: Processor,
    order: SampleOrder,
    /// Growth of a camera ray's cone, meters per meter.
    spread: f32,
    gather: Gather,
    /// Whether camera rays meet lights and sky.
    background: bool,
}

/// Data that paths gather.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gather {
    Light,
    /// Light, and denoising guides on the way.
    LightAndGuides,
    /// Guides only: paths end at the first surface that is not a mirror.
    Guides,
}

impl<'a> PathTracer<'a> {
    /// A tracer with the seed of the image.
    pub fn new(world: &'a World, lights: &'a Lights<'a>, camera: &'a RayCamera, settings: Settings, seed: u64) -> Self {
        let order = SampleOrder::new(seed, settings.samples);
        let spread = settings.spread(camera.pixel_angle);
        let strategy = if settings.shadows { Strategy::Combined } else { Strategy::Emitters };
        let (processor, gather) = (Processor::detect(), Gather::Light);
        Self { world, lights, camera, settings, strategy, processor, order, spread, gather, background: true }
    }

    /// The same tracer on another instruction set, and, if shadows are on, with other estimates of direct light.
    pub fn with(self, strategy: Strategy, processor: Processor) -> Self {
        let strategy = if self.settings.shadows { strategy } else { self.strategy };
        Self { strategy, processor, ..self }
    }

    /// The same tracer, with guides for denoisers.
    pub fn with_guides(self, guides: bool) -> Self {
        Self { gather: if guides { Gather::LightAndGuides } else { Gather::Light }, ..self }
    }

    /// The same tracer; `background` decides whether camera rays meet lights and sky.
    pub fn with_background(self, background: bool) -> Self {
        Self { background, ..self }
    }

    /// Whether guides are gathered.
    fn has_guides(&self) -> bool {
        self.gather != Gather::Light
    }

    /// The same tracer for guides only, with `samples` per pixel and a seed of its own.
    fn for_guides(&self, samples: u32) -> Self {
        let settings = Settings { samples, ..self.settings };
        let tracer = Self::new(self.world, self.lights, self.camera, settings, guide_seed(self.order.seed()));
        Self { gather: Gather::Guides, background: self.background, ..tracer }.with(self.strategy, self.processor)
    }

    #[inline(always)]
    fn trace_in_lanes<T: Real>(&self, task: &mut Task, statistics: &mut Statistics, workers: &dyn Workers) {
        let mut batch = Batch::new();
        let mut cursor = Cursor::first(task);
        while !cursor.is_over(task) {
            workers.check_stop();
            let first = cursor;
            let count = self.start::<T>(&mut batch, task, &mut cursor);
            match self.gather {
                Gather::Guides => self.follow_guides::<T>(&mut batch, count),
                _ => self.follow::<T>(&mut batch, count, statistics),
            }
            // In the order of the samples, independent of the batches.
            let mut cursor = first;
            for slot in 0..count {
                let sums: &mut PixelSums = &mut task.sums[cursor.pixel(task)];
                if self.gather != Gather::Guides {
                    sums.add(batch.radiance[slot]);
                    sums.hits += u32::from(batch.met[slot]);
                }
                if self.gather == Gather::LightAndGuides {
                    let (radiance, guides) = (batch.radiance[slot], &batch.guides);
                    sums.add_parts(radiance, guides.specular(slot, radiance), guides.albedo[slot]);
                }
                if self.has_guides() && batch.guides.count(slot) {
                    sums.add_guides(batch.guides.albedo[slot], batch.guides.normal[slot]);
                }
                cursor = cursor.after(task);
            }
        }
    }

    /// Follows the paths of a batch to their ends.
    #[inline(always)]
    fn follow<T: Real>(&self, batch: &mut Batch, count: usize, statistics: &mut Statistics) {
        statistics.paths += count as u64;
        let split = self.has_guides();
        let mut alive = count;
        for bounce in 0..=self.settings.max_bounces {
            statistics.rays += alive as u64;
            self.find_surfaces(batch, alive, bounce);
            alive = self.intersect_lights::<T>(batch, alive, bounce);
            self.evaluate_surfaces(batch, alive, bounce);
            if bounce == self.settings.max_bounces || alive == 0 {
                return;
            }
            let shadows;
            (alive, shadows) = self.scatter_all::<T>(batch, alive, bounce);
            statistics.shadow_rays += shadows as u64;
            for i in 0..shadows {
                let shadow = &batch.shadows;
                let ray = Ray { origin: get(&shadow.origin, i).array(), direction: get(&shadow.direction, i).array() };
                let to = shadow.distance[i] * (1.0 - TOUCHING);
                let passed = match self.settings.shadows {
                    true => self.world.visibility(&ray, to, shadow.alpha_seed[i]),
                    false => Some(Passed { transmittance: Rgb::ONE, panes: 0 }),
                };
                let Some(Passed { mut transmittance, panes }) = passed else { continue };
                // A path counts panes as bounces, and may end among them: then no other estimate finds the light.
                if panes > 0 && bounce + 1 + panes > self.settings.max_bounces {
                    transmittance = transmittance * (1.0 / shadow.weight[i]);
                }
                add_radiance(&mut batch.radiance, shadow.slot[i], get(&shadow.contribution, i) * transmittance);
                if split && bounce == 0 {
                    let specular = get(&shadow.specular, i) * transmittance;
                    add_radiance(&mut batch.guides.direct_specular, shadow.slot[i], specular);
                }
            }
            if split && bounce == 0 {
                batch.guides.first = batch.radiance;
            }
        }
    }

    /// Follows the paths of a batch until their guides are known. They do not count in the statistics: the light does
    /// not need them.
    #[inline(always)]
    fn follow_guides<T: Real>(&self, batch: &mut Batch, count: usize) {
        let mut alive = count;
        for bounce in 0..=GUIDE_BOUNCES {
            self.find_surfaces(batch, alive, bounce);
            alive = self.intersect_lights::<T>(batch, alive, bounce);
            self.evaluate_surfaces(batch, alive, bounce);
            if !batch.end_guided(alive) {
                return;
            }
            alive = self.scatter_all::<T>(batch, alive, bounce).0;
        }
    }

    /// Traces the rays of a batch.
    #[inline(always)]
    fn find_surfaces(&self, batch: &mut Batch, alive: usize, bounce: u32) {
        for i in 0..alive {
            let ray =
                Ray { origin: get(&batch.paths.origin, i).array(), direction: get(&batch.paths.direction, i).array() };
            let seed = match self.world.scene.has_cutouts {
                true => alpha_seed(batch.paths.seed[i], batch.paths.index[i], bounce),
                false => 0,
            };
            let hit = self.world.closest(&ray, batch.paths.near[i], seed, bounce == 0);
            if let Some(hit) = &hit {
                self.world.prefetch(hit);
            }
            batch.hits.set(i, hit);
        }
    }

    /// Scatters the paths of a batch, with layers only if the scene has any; returns the number of continuing paths and
    /// the number of shadow rays.
    #[inline(always)]
    fn scatter_all<T: Real>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> (usize, usize) {
        match self.world.scene.is_layered {
            true => self.scatter::<T, true>(batch, alive, bounce),
            false => self.scatter::<T, false>(batch, alive, bounce),
        }
    }

    /// A color with its luminance limited to the option `max_indirect_luminance_nits`.
    #[inline(always)]
    fn limit_luminance<T: Real>(&self, color: Rgb<T>) -> Rgb<T> {
        let limit = self.settings.max_indirect_luminance_nits;
        if limit == f32::INFINITY {
            return color;
        }
        color * at_most(T::splat(limit) / at_least(color.luminance(), 1e-30), 1.0)
    }
}

/// A tracer for each tile of an image.
pub(crate) struct TileTracers<'a>(pub Vec<PathTracer<'a>>);

impl TileTracers<'_> {
    /// Adds samples to the sums of squares of pixels, square by square over the workers.
    fn run(&self, tasks: Vec<Task>, workers: &dyn Workers) -> Statistics {
        let total = Mutex::new(Statistics::default());
        let tasks: Vec<_> = tasks.into_iter().map(Mutex::new).collect();
        workers.run(tasks.len(), &|number| {
            let mut statistics = Statistics::default();
            let task = &mut *tasks[number].lock();
            let tracer = &self.0[task.tile];
            tracer.processor.run(Trace { tracer, task, statistics: &mut statistics, workers });
            total.lock().add(&statistics);
        });
        total.into_inner()
    }
}

impl Tracer for TileTracers<'_> {
    fn has_guides(&self) -> bool {
        self.0.iter().any(PathTracer::has_guides)
    }

    fn trace(&self, tasks: Vec<Task>, workers: &dyn Workers) -> Result<Statistics> {
        Ok(self.run(tasks, workers))
    }

    fn trace_guides(&self, samples: u32, tasks: Vec<Task>, workers: &dyn Workers) -> Result<()> {
        // These paths do not count in the statistics: the light does not need them.
        TileTracers(self.0.iter().map(|tracer| tracer.for_guides(samples)).collect()).run(tasks, workers);
        Ok(())
    }
}

/// [`PathTracer::trace_in_lanes`] as a task.
struct Trace<'a, 'b> {
    tracer: &'a PathTracer<'a>,
    task: &'a mut Task<'b>,
    statistics: &'a mut Statistics,
    workers: &'a dyn Workers,
}

impl syntable_simd::Task for Trace<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.tracer.trace_in_lanes::<S::Real>(self.task, self.statistics, self.workers);
    }
}

/// Seed of a ray's random numbers for surfaces with partial coverage.
#[inline(always)]
fn alpha_seed<I: Int>(seed: I, index: I, bounce: u32) -> I {
    seed ^ index.times(I::splat(ALPHA_OF_SAMPLE)) ^ I::splat((bounce + 1).wrapping_mul(ALPHA_OF_BOUNCE))
}

/// Adds a contribution to the radiance of a path.
#[inline(always)]
fn add_radiance(radiance: &mut [[f32; 3]; BATCH], slot: u32, contribution: Vec3) {
    let sum = &mut radiance[slot as usize % BATCH];
    *sum = [sum[0] + contribution.x, sum[1] + contribution.y, sum[2] + contribution.z];
}

/// Whether a color is above black and finite.
#[inline(always)]
fn is_light<T: Real>(color: Rgb<T>) -> T::Mask {
    let sum = color.x + color.y + color.z;
    sum.gt(T::splat(0.0)) & sum.lt(T::splat(f32::INFINITY))
}

/// Power heuristic with exponent two (Veach 1997, section 9.2.4).
#[inline(always)]
fn power_heuristic<T: Real>(own: T, other: T) -> T {
    // As a quotient, so that squares of large densities cannot overflow.
    let ratio = other / own;
    inverse(ratio * ratio + 1.0_f32)
}
