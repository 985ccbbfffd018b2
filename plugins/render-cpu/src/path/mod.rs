//! The path tracer: light that reaches the camera, by sampling paths from the camera.
//!
//! At every surface a light is sampled and a scattered direction is sampled; both estimates of direct light are
//! combined by multiple importance sampling with the power heuristic (Veach, 1997). Faint paths end at random.
//!
//! Paths run in batches, bounce by bounce: first all rays are traced, then all surfaces looked up, then all scattering
//! computed in lanes, then all shadow rays traced; paths that ended are squeezed out after every step. A path's light
//! depends on its pixel and sample alone, not on its batch.
//!
//! A batch goes from `start` through `meet` and `scatter`, bounce by bounce; `sums` keeps what it found.

mod meet;
mod scatter;
mod start;
mod sums;

pub(crate) use start::{Task, place};
pub(crate) use sums::PixelSums;

use crate::batch::{BATCH, Batch, get};
use crate::bvh::Ray;
use crate::camera::RayCamera;
use crate::light::Lights;
use crate::real::{Int, Real, at_least, at_most, inverse};
use crate::sampler::Order;
use crate::vec3::{Rgb, Vec3};
use crate::world::World;

/// A light is seen if nothing is closer by more than this share of its distance: lamps may lie flat on a ceiling.
const TOUCHING: f32 = 1e-4;

/// Numbers of the coins that draw layers, and that decide between reflection and passage; those of roulette are smaller.
const DRAW: u32 = 0x1000;
const PASSAGE: u32 = 0x2000;

/// Sets the numbers of paths that are traced for guides alone apart.
const GUIDES: u64 = 0x5851_f42d_4c95_7f2d;

/// How many mirrors and panes guides for denoisers look through.
const GUIDE_BOUNCES: u32 = 2;

/// Which estimates of direct light are used; tests compare them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strategy {
    /// Both, combined.
    Combined,
    /// Lights are only sampled.
    #[cfg(test)]
    Lights,
    /// Lights are only found by scattered rays.
    #[cfg(test)]
    Scattering,
}

/// Options of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Samples a pixel that are planned, so that textures are read as finely as they can show.
    pub samples: u32,
    pub max_bounces: u32,
    /// Bounces after which paths may be ended at random.
    pub roulette_from: u32,
    /// Largest luminance that one connection to a light may bring by scattering, nits.
    pub clamp: f32,
    /// Least perceptual roughness of what a path meets after it was scattered by something rough.
    pub roughen: f32,
    pub strategy: Strategy,
    /// Whether paths are computed one at a time though the processor can do eight; tests compare them.
    pub one_lane: bool,
}

/// What was traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Paths started.
    pub paths: u64,
    /// Rays that looked for the first surface, camera rays included.
    pub rays: u64,
    /// Rays that asked whether a light is hidden.
    pub shadow_rays: u64,
}

impl Statistics {
    /// Adds other counts.
    pub fn add(&mut self, other: &Self) {
        self.paths += other.paths;
        self.rays += other.rays;
        self.shadow_rays += other.shadow_rays;
    }
}

/// A view of a scene, ready to trace.
pub(crate) struct PathTracer<'a> {
    world: &'a World,
    lights: &'a Lights<'a>,
    camera: &'a RayCamera,
    settings: Settings,
    order: Order,
    /// Width of a camera ray's cone, metres a metre.
    spread: f32,
    gather: Gather,
}

/// What paths are traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gather {
    Light,
    /// And guides for denoisers on the way.
    LightAndGuides,
    /// Guides alone: paths end at the first surface that is no mirror.
    Guides,
}

impl<'a> PathTracer<'a> {
    /// `seed` is the picture's.
    pub fn new(world: &'a World, lights: &'a Lights<'a>, camera: &'a RayCamera, settings: Settings, seed: u64) -> Self {
        // Samples of a pixel share its area, so that each may see finer than it.
        let sharpness = (1.0 / (settings.samples as f32).sqrt()).max(0.25);
        let order = Order::new(seed, settings.samples);
        Self { world, lights, camera, settings, order, spread: camera.pixel_angle * sharpness, gather: Gather::Light }
    }

    /// The same, gathering guides for denoisers.
    pub fn with_guides(self, guides: bool) -> Self {
        Self { gather: if guides { Gather::LightAndGuides } else { Gather::Light }, ..self }
    }

    /// Whether guides are gathered.
    pub fn has_guides(&self) -> bool {
        self.gather != Gather::Light
    }

    /// The same for guides alone, with so many samples a pixel and numbers of its own.
    pub fn for_guides(&self, samples: u32) -> Self {
        let settings = Settings { samples, ..self.settings };
        let tracer = Self::new(self.world, self.lights, self.camera, settings, self.order.seed() ^ GUIDES);
        Self { gather: Gather::Guides, ..tracer }
    }

    /// Adds samples to the sums of a tile.
    pub fn trace(&self, task: &Task, sums: &mut [PixelSums], statistics: &mut Statistics) {
        #[cfg(target_arch = "x86_64")]
        {
            /// # Safety
            /// The processor has AVX2.
            #[target_feature(enable = "avx2")]
            unsafe fn eight(tracer: &PathTracer, task: &Task, sums: &mut [PixelSums], statistics: &mut Statistics) {
                tracer.trace_in_lanes::<crate::real::Eight>(task, sums, statistics);
            }
            if crate::real::has_eight() && !self.settings.one_lane {
                // SAFETY: just asked.
                return unsafe { eight(self, task, sums, statistics) };
            }
        }
        self.trace_in_lanes::<f32>(task, sums, statistics);
    }

    #[inline(always)]
    fn trace_in_lanes<T: Real>(&self, task: &Task, sums: &mut [PixelSums], statistics: &mut Statistics) {
        let mut batch = Batch::new();
        let mut turn = task.first();
        while !task.is_over(turn) {
            let first = turn;
            let count = self.start::<T>(&mut batch, task, &mut turn);
            match self.gather {
                Gather::Guides => self.follow_guides::<T>(&mut batch, count),
                _ => self.follow::<T>(&mut batch, count, statistics),
            }
            // In the order of the samples, whatever the batches.
            let mut turn = first;
            for slot in 0..count {
                let sums = &mut sums[task.pixel(turn)];
                if self.gather != Gather::Guides {
                    sums.add(batch.radiance[slot]);
                }
                if self.gather == Gather::LightAndGuides {
                    let (radiance, guides) = (batch.radiance[slot], &batch.guides);
                    sums.add_parts(radiance, guides.gloss(slot, radiance), guides.albedo[slot]);
                }
                if self.has_guides() {
                    sums.add_guides(batch.guides.albedo[slot], batch.guides.normal[slot]);
                }
                turn = task.after(turn);
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
            alive = self.meet_lights::<T>(batch, alive, bounce);
            self.look_up(batch, alive, bounce);
            if bounce == self.settings.max_bounces || alive == 0 {
                return;
            }
            let shadows;
            (alive, shadows) = self.scatter_all::<T>(batch, alive, bounce);
            statistics.shadow_rays += shadows as u64;
            for i in 0..shadows {
                let shadow = &batch.shadows;
                let ray = Ray { origin: get(&shadow.origin, i).array(), direction: get(&shadow.direction, i).array() };
                if !self.world.occluded(&ray, shadow.distance[i] * (1.0 - TOUCHING), shadow.coin[i]) {
                    deposit(&mut batch.radiance, shadow.slot[i], get(&shadow.contribution, i));
                    if split && bounce == 0 {
                        deposit(&mut batch.guides.direct_gloss, shadow.slot[i], get(&shadow.gloss, i));
                    }
                }
            }
            if split && bounce == 0 {
                batch.guides.first = batch.radiance;
            }
        }
    }

    /// Follows the paths of a batch until they know their guides. They are not counted: the light does not need them.
    #[inline(always)]
    fn follow_guides<T: Real>(&self, batch: &mut Batch, count: usize) {
        let mut alive = count;
        for bounce in 0..=GUIDE_BOUNCES {
            self.find_surfaces(batch, alive, bounce);
            alive = self.meet_lights::<T>(batch, alive, bounce);
            self.look_up(batch, alive, bounce);
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
            let coin = match self.world.has_cutouts {
                true => coin(batch.paths.seed[i], batch.paths.index[i], bounce),
                false => 0,
            };
            let hit = self.world.closest(&ray, f32::INFINITY, coin);
            if let Some(hit) = &hit {
                self.world.prefetch(hit);
            }
            batch.hits.set(i, hit);
        }
    }

    /// Scatters the paths of a batch, with layers only if the scene has any; gives the numbers of paths that go on and of
    /// shadow rays.
    #[inline(always)]
    fn scatter_all<T: Real>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> (usize, usize) {
        match self.world.is_layered {
            true => self.scatter::<T, true>(batch, alive, bounce),
            false => self.scatter::<T, false>(batch, alive, bounce),
        }
    }

    /// A colour with its luminance limited.
    #[inline(always)]
    fn limited<T: Real>(&self, color: Rgb<T>) -> Rgb<T> {
        let limit = self.settings.clamp;
        if limit == f32::INFINITY {
            return color;
        }
        color * at_most(T::splat(limit) / at_least(color.luminance(), 1e-30), 1.0)
    }
}

/// Seeds the numbers of a ray for surfaces that cover in part.
#[inline(always)]
fn coin<I: Int>(seed: I, index: I, bounce: u32) -> I {
    seed ^ index.times(I::splat(0x9e37_79b1)) ^ I::splat((bounce + 1).wrapping_mul(0x85eb_ca77))
}

/// Adds light to a path's sum.
#[inline(always)]
fn deposit(radiance: &mut [[f32; 3]; BATCH], slot: u32, found: Vec3) {
    let sum = &mut radiance[slot as usize % BATCH];
    *sum = [sum[0] + found.x, sum[1] + found.y, sum[2] + found.z];
}

/// Whether a colour is more than black, and a number.
#[inline(always)]
fn is_light<T: Real>(color: Rgb<T>) -> T::Mask {
    let sum = color.x + color.y + color.z;
    sum.gt(T::splat(0.0)) & sum.lt(T::splat(f32::INFINITY))
}

/// Power heuristic with exponent two.
#[inline(always)]
fn heuristic<T: Real>(own: T, other: T) -> T {
    // As a quotient, so that squares of large densities cannot overflow.
    let ratio = other / own;
    inverse(ratio * ratio + 1.0_f32)
}
