//! The path tracer: light that reaches the camera, by sampling paths from the camera.
//!
//! At every surface a light is sampled and a scattered direction is sampled; both estimates of direct light are
//! combined by multiple importance sampling with the power heuristic (Veach, 1997). Faint paths end at random.
//!
//! Paths run in batches, bounce by bounce: first all rays are traced, then all surfaces looked up, then all scattering
//! computed in lanes, then all shadow rays traced; paths that ended are squeezed out after every step. A path's light
//! depends on its pixel and sample alone, not on its batch.

use crate::approx::sin_cos_turns;
use crate::batch::{BATCH, Batch, compress, get, load, set, store};
use crate::bsdf::{Bsdf, Layered, Substance, table};
use crate::bvh::Ray;
use crate::camera::RayCamera;
use crate::light::Lights;
use crate::real::{Int, Mask, Real, at_least, at_most, complement, inverse, max};
use crate::sampler::{Order, Sampler};
use crate::vec3::{Basis, Rgb, Vec3, vec3};
use crate::world::World;
use std::ops::Range;
use syntable_model::photometry::luminance;

/// A light is seen if nothing is closer by more than this share of its distance: lamps may lie flat on a ceiling.
const TOUCHING: f32 = 1e-4;

/// How fast the cone of a path widens after a diffuse bounce, metres a metre: textures seen by bounced light are
/// read coarsely, which leaves their mean and takes their noise.
const DIFFUSE_SPREAD: f32 = 0.25;

/// A scattering counts as rough from this α on.
const ROUGH: f32 = 0.1;

/// Number of the pair that chooses a place in the aperture; pair 0 chooses one in the pixel, later ones lights and
/// directions in turn.
const LENS: u32 = 1;

/// Numbers of the coins that draw layers, and that decide between reflection and passage; those of roulette are smaller.
const DRAW: u32 = 0x1000;
const PASSAGE: u32 = 0x2000;

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
    /// Whether guides for denoisers are gathered.
    guides: bool,
}

/// What was found of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelSums {
    pub samples: u32,
    pub radiance: [f64; 3],
    /// Of the luminance's square.
    pub square: f64,
    pub albedo: [f32; 3],
    /// World.
    pub normal: [f32; 3],
    /// Of the radiance that the first surface mirrored without colouring it, and of its luminance's square.
    pub gloss: [f32; 3],
    pub gloss_square: f32,
    /// Of the square of the rest's luminance.
    pub matte_square: f32,
}

impl PixelSums {
    /// Estimated variance of the mean luminance, nits².
    pub fn variance(&self) -> f64 {
        self.variance_of(luminance(self.radiance), self.square)
    }

    /// The same of what is mirrored without colour, and of the rest.
    pub fn variance_of_parts(&self) -> [f64; 2] {
        let gloss = luminance(self.gloss.map(f64::from));
        let matte = luminance(self.radiance) - gloss;
        [self.variance_of(gloss, self.gloss_square.into()), self.variance_of(matte, self.matte_square.into())]
    }

    /// Of a sum over the samples and that of its squares.
    fn variance_of(&self, sum: f64, square: f64) -> f64 {
        let n = f64::from(self.samples);
        let mean = sum / n;
        if self.samples > 1 { (square / n - mean * mean).max(0.0) / (n - 1.0) } else { f64::INFINITY }
    }
}

/// Whose turn it is: pixels of a tile, row by row, and their samples.
#[derive(Clone, Copy)]
struct Turn {
    pixel: usize,
    sample: u32,
}

impl<'a> PathTracer<'a> {
    /// `seed` is the picture's.
    pub fn new(world: &'a World, lights: &'a Lights<'a>, camera: &'a RayCamera, settings: Settings, seed: u64) -> Self {
        // Samples of a pixel share its area, so that each may see finer than it.
        let sharpness = (1.0 / (settings.samples as f32).sqrt()).max(0.25);
        let order = Order::new(seed, settings.samples);
        Self { world, lights, camera, settings, order, spread: camera.pixel_angle * sharpness, guides: false }
    }

    /// The same, gathering guides for denoisers.
    pub fn with_guides(self, guides: bool) -> Self {
        Self { guides, ..self }
    }

    /// Adds samples of every pixel of a tile [left, top, right, bottom], row by row.
    pub fn tile(&self, area: [u32; 4], samples: Range<u32>, sums: &mut [PixelSums], statistics: &mut Statistics) {
        #[cfg(target_arch = "x86_64")]
        {
            /// # Safety
            /// The processor has AVX2.
            #[target_feature(enable = "avx2")]
            unsafe fn eight(
                tracer: &PathTracer,
                area: [u32; 4],
                samples: Range<u32>,
                sums: &mut [PixelSums],
                statistics: &mut Statistics,
            ) {
                tracer.tile_in_lanes::<crate::real::Eight>(area, samples, sums, statistics);
            }
            if crate::real::has_eight() && !self.settings.one_lane {
                // SAFETY: just asked.
                return unsafe { eight(self, area, samples, sums, statistics) };
            }
        }
        self.tile_in_lanes::<f32>(area, samples, sums, statistics);
    }

    #[inline(always)]
    fn tile_in_lanes<T: Real>(
        &self,
        area: [u32; 4],
        samples: Range<u32>,
        sums: &mut [PixelSums],
        statistics: &mut Statistics,
    ) {
        let mut batch = Batch::new();
        let mut turn = Turn { pixel: 0, sample: samples.start };
        while turn.pixel < sums.len() {
            let first = turn;
            let count = self.start::<T>(&mut batch, area, &samples, &mut turn, sums.len());
            statistics.paths += count as u64;
            self.trace::<T>(&mut batch, count, statistics);
            // In the order of the samples, whatever the batches.
            let (mut pixel, mut sample) = (first.pixel, first.sample);
            for slot in 0..count {
                let (sum, radiance) = (&mut sums[pixel], batch.radiance[slot].map(f64::from));
                sum.samples += 1;
                let y = luminance(radiance);
                sum.square += y * y;
                for (sum, value) in sum.radiance.iter_mut().zip(radiance) {
                    *sum += value;
                }
                if self.guides {
                    for c in 0..3 {
                        sum.albedo[c] += batch.guides.albedo[slot][c];
                        sum.normal[c] += batch.guides.normal[slot][c];
                    }
                    let gloss = batch.guides.gloss(slot, batch.radiance[slot]);
                    sum.gloss.iter_mut().zip(gloss).for_each(|(sum, gloss)| *sum += gloss);
                    let y_gloss = luminance(gloss.map(f64::from));
                    sum.gloss_square += (y_gloss * y_gloss) as f32;
                    sum.matte_square += ((y - y_gloss) * (y - y_gloss)) as f32;
                }
                sample += 1;
                if sample == samples.end {
                    (pixel, sample) = (pixel + 1, samples.start);
                }
            }
        }
    }

    /// Fills a batch with camera rays; gives their number.
    #[inline(always)]
    fn start<T: Real>(
        &self,
        batch: &mut Batch,
        area: [u32; 4],
        samples: &Range<u32>,
        turn: &mut Turn,
        pixels: usize,
    ) -> usize {
        let [left, top, right, _] = area;
        let columns = (right - left) as usize;
        let (first, per_pixel) = (*turn, samples.len());
        let paths = &mut batch.paths;
        let mut count = 0;
        while count < BATCH && turn.pixel < pixels {
            let (x, y) = (left + (turn.pixel % columns) as u32, top + (turn.pixel / columns) as u32);
            let corner = self.camera.corner(x, y);
            let (seed, first) = self.order.pixel(x, y);
            let more = ((samples.end - turn.sample) as usize).min(BATCH - count);
            for i in count..count + more {
                set(&mut paths.origin, i, self.camera.origin());
                set(&mut paths.direction, i, corner);
                paths.seed[i] = seed;
                paths.index[i] = first + turn.sample + (i - count) as u32;
                paths.slot[i] = i as u32;
                batch.radiance[i] = [0.0; 3];
                if self.guides {
                    batch.guides.clear(i);
                }
            }
            count += more;
            turn.sample += more as u32;
            if turn.sample == samples.end {
                *turn = Turn { pixel: turn.pixel + 1, sample: samples.start };
            }
        }
        let [along_u, along_v] = self.camera.slopes().map(Vec3::<T>::broadcast);
        for at in (0..count).step_by(T::WIDTH) {
            let sampler = Sampler { seed: T::Int::load(&paths.seed[at..]), index: T::Int::load(&paths.index[at..]) };
            let [u, v] = sampler.pair(0);
            let mut direction = load::<T>(&paths.direction, at) + along_u * u + along_v * v;
            if self.camera.is_warped() {
                store(direction, &mut paths.direction, at);
                let (mut us, mut vs) = ([0.0; 8], [0.0; 8]);
                u.store(&mut us);
                v.store(&mut vs);
                for (lane, (u, v)) in us.into_iter().zip(vs).enumerate().take(T::WIDTH.min(count - at)) {
                    let pixel = first.pixel + ((first.sample - samples.start) as usize + at + lane) / per_pixel;
                    let (x, y) = (left + (pixel % columns) as u32, top + (pixel / columns) as u32);
                    // Where the lens sees nothing, no surface is met.
                    let seen = self.camera.warped(x, y, [u, v]).unwrap_or(Vec3::from([f32::NAN; 3]));
                    set(&mut paths.direction, at + lane, seen);
                }
                direction = load(&paths.direction, at);
            }
            if let Some(lens) = &self.camera.lens {
                let [r, turn] = sampler.pair(LENS);
                let (sin, cos) = sin_cos_turns(turn);
                let r = r.sqrt();
                let aside = Vec3::broadcast(lens.right) * (r * cos) + Vec3::broadcast(lens.down) * (r * sin);
                store(load::<T>(&paths.origin, at) + aside, &mut paths.origin, at);
                direction = direction * T::splat(lens.focus) - aside;
            }
            store(direction.normalized(), &mut paths.direction, at);
            store(Vec3::all(T::splat(1.0)), &mut paths.throughput, at);
            T::splat(0.0).store(&mut paths.width[at..]);
            T::splat(self.spread).store(&mut paths.spread[at..]);
            T::splat(0.0).store(&mut paths.roughen[at..]);
        }
        count
    }

    /// Traces a batch to its end.
    #[inline(always)]
    fn trace<T: Real>(&self, batch: &mut Batch, count: usize, statistics: &mut Statistics) {
        let mut alive = count;
        for bounce in 0..=self.settings.max_bounces {
            statistics.rays += alive as u64;
            for i in 0..alive {
                let ray = Ray {
                    origin: get(&batch.paths.origin, i).array(),
                    direction: get(&batch.paths.direction, i).array(),
                };
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
            alive = self.meet_lights::<T>(batch, alive, bounce);
            self.look_up(batch, alive, bounce);
            if bounce == self.settings.max_bounces || alive == 0 {
                return;
            }
            let shadows;
            (alive, shadows) = match self.world.is_layered {
                true => self.scatter::<T, true>(batch, alive, bounce),
                false => self.scatter::<T, false>(batch, alive, bounce),
            };
            statistics.shadow_rays += shadows as u64;
            for i in 0..shadows {
                let shadow = &batch.shadows;
                let ray = Ray { origin: get(&shadow.origin, i).array(), direction: get(&shadow.direction, i).array() };
                if !self.world.occluded(&ray, shadow.distance[i] * (1.0 - TOUCHING), shadow.coin[i]) {
                    deposit(&mut batch.radiance, shadow.slot[i], get(&shadow.contribution, i));
                    if self.guides && bounce == 0 {
                        deposit(&mut batch.guides.direct_gloss, shadow.slot[i], get(&shadow.gloss, i));
                    }
                }
            }
            if self.guides && bounce == 0 {
                batch.guides.first = batch.radiance;
            }
        }
    }

    /// Ends the paths that meet a light or nothing: their hits become infinite, and if they are many they are squeezed
    /// out. Gives the number of paths that are left, ended ones included.
    #[inline(always)]
    fn meet_lights<T: Real>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> usize {
        let mut left = 0;
        for at in (0..alive).step_by(T::WIDTH) {
            let active = T::load(&batch.numbers[at..]).lt(T::splat(alive as f32));
            let t = T::load(&batch.hits.t[at..]);
            let mut keep = active & t.lt(T::splat(f32::INFINITY));
            let mut met = T::Mask::splat(false);
            if !self.lights.is_empty() {
                let (origin, direction) = (load::<T>(&batch.paths.origin, at), load(&batch.paths.direction, at));
                let mut hit = self.lights.intersect(origin, direction, t * (1.0_f32 + TOUCHING));
                hit.met = hit.met & active;
                met = hit.met;
                if hit.met.any() {
                    let normal = load(&batch.paths.normal, at);
                    let (pdf, radiance) = self.lights.pdf(origin, normal, &hit);
                    let weight = self.found_by_chance(T::load(&batch.paths.pdf[at..]), pdf, bounce);
                    let found = load(&batch.paths.throughput, at) * radiance * weight;
                    let found = if bounce == 0 { found } else { self.limited(found) };
                    let sound = hit.met & is_light(found);
                    let (mut lanes, mut slots) = ([[0.0; 8]; 3], [0; 8]);
                    found.x.store(&mut lanes[0]);
                    found.y.store(&mut lanes[1]);
                    found.z.store(&mut lanes[2]);
                    T::Int::load(&batch.paths.slot[at..]).store(&mut slots);
                    let mut lanes_left = sound.to_bits();
                    while lanes_left != 0 {
                        let lane = lanes_left.trailing_zeros() as usize & 7;
                        lanes_left &= lanes_left - 1;
                        let found = Vec3::from(lanes.map(|row| row[lane]));
                        deposit(&mut batch.radiance, slots[lane], found);
                    }
                    keep = keep & !hit.met;
                }
            }
            T::pick(keep, t, T::splat(f32::INFINITY)).store(&mut batch.hits.t[at..]);
            if self.lights.has_distant() {
                let away = active & t.ge(T::splat(f32::INFINITY)) & !met;
                self.meet_distant(batch, at, away.to_bits(), bounce);
            }
            left += keep.to_bits().count_ones() as usize;
        }
        if left * 4 > alive * 3 {
            return alive;
        }
        let mut kept = 0;
        for at in (0..alive).step_by(T::WIDTH) {
            let keep = T::load(&batch.hits.t[at..]).lt(T::splat(f32::INFINITY));
            batch.paths.keep::<T>(keep, at, kept);
            batch.hits.keep::<T>(keep, at, kept);
            kept += keep.to_bits().count_ones() as usize;
        }
        kept
    }

    /// Weight of light that a scattered ray found, with the density of that and of sampling the light.
    #[inline(always)]
    fn found_by_chance<T: Real>(&self, scattered: T, sampled: T, bounce: u32) -> T {
        match self.settings.strategy {
            _ if bounce == 0 => T::splat(1.0),
            Strategy::Combined => heuristic(scattered, sampled),
            #[cfg(test)]
            Strategy::Scattering => T::splat(1.0),
            // What passed a surface can be found in no other way.
            #[cfg(test)]
            Strategy::Lights => T::pick(scattered.ge(T::splat(f32::INFINITY)), T::splat(1.0), T::splat(0.0)),
        }
    }

    /// Takes the light of distant lights in the lanes that meet nothing.
    #[inline(never)]
    fn meet_distant(&self, batch: &mut Batch, at: usize, mut away: u32, bounce: u32) {
        while away != 0 {
            let i = at + away.trailing_zeros() as usize;
            away &= away - 1;
            let paths = &batch.paths;
            let (origin, direction, normal) = (get(&paths.origin, i), get(&paths.direction, i), get(&paths.normal, i));
            let weight = |sampled: f32| self.found_by_chance(paths.pdf[i], sampled, bounce);
            let found = get(&paths.throughput, i) * self.lights.distant(origin, normal, direction, weight);
            let found = if bounce == 0 { found } else { self.limited(found) };
            if is_light(found) {
                deposit(&mut batch.radiance, batch.paths.slot[i], found);
            }
        }
    }

    /// Looks the surfaces at the hits up, and takes the light that they emit.
    #[inline(always)]
    fn look_up(&self, batch: &mut Batch, alive: usize, bounce: u32) {
        let paths = &mut batch.paths;
        for i in 0..alive {
            let hit = batch.hits.get(i);
            if hit.t == f32::INFINITY {
                continue;
            }
            let width = paths.width[i] + paths.spread[i] * hit.t;
            paths.width[i] = width;
            let draw = match self.world.is_layered {
                true => Sampler { seed: paths.seed[i], index: paths.index[i] }.coin(DRAW + bounce),
                false => 0.0,
            };
            let (origin, direction) = (get(&paths.origin, i), get(&paths.direction, i));
            let mut surface = self.world.surface(&hit, origin, direction, hit.t, width, draw);
            if self.guides && bounce <= GUIDE_BOUNCES {
                batch.guides.meet(paths.slot[i] as usize, &surface, bounce == GUIDE_BOUNCES);
            }
            let roughness = &mut surface.component.substance.roughness;
            *roughness = max(*roughness, paths.roughen[i]);
            batch.surfaces.set(i, &surface);
            let mut throughput = get(&paths.throughput, i);
            if self.world.is_layered {
                batch.surfaces.set_layers(i, &surface);
                throughput = throughput * surface.passage;
                set(&mut paths.throughput, i, throughput * surface.component.weight);
            }
            if !surface.emission.is_black() {
                let pdf = match bounce {
                    0 => 0.0,
                    _ => self.lights.body_pdf(origin, get(&paths.normal, i), &hit, surface.face.dot(direction)),
                };
                let weight = self.found_by_chance(paths.pdf[i], pdf, bounce);
                let found = throughput * surface.emission * weight;
                let found = if bounce == 0 { found } else { self.limited(found) };
                deposit(&mut batch.radiance, paths.slot[i], found);
            }
        }
    }

    /// Samples lights and scattered directions; gives the numbers of paths that go on and of shadow rays.
    #[inline(always)]
    fn scatter<T: Real, const LAYERED: bool>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> (usize, usize) {
        let Batch { paths, hits, surfaces, shadows, numbers, guides, .. } = batch;
        let split = self.guides && bounce == 0;
        let zero = T::splat(0.0);
        let (mut next, mut cast) = (0, 0);
        for at in (0..alive).step_by(T::WIDTH) {
            let active = T::load(&numbers[at..]).lt(T::splat(alive as f32));
            let active = active & T::load(&hits.t[at..]).lt(T::splat(f32::INFINITY));
            let sampler = Sampler { seed: T::Int::load(&paths.seed[at..]), index: T::Int::load(&paths.index[at..]) };
            let slot = T::Int::load(&paths.slot[at..]);
            let throughput: Rgb<T> = load(&paths.throughput, at);

            let (face, normal) = (load(&surfaces.face, at), load(&surfaces.normal, at));
            let shading = Basis::around(normal);
            let bent = T::load(&surfaces.bent[at..]).gt(zero);
            let mut wo = shading.to_local(-load::<T>(&paths.direction, at));
            let active = active & wo.z.gt(T::splat(1e-5));
            wo.z = at_least(wo.z, 1e-5);
            let substance = Substance {
                base_color: load(&surfaces.base_color, at),
                roughness: T::load(&surfaces.roughness[at..]),
                metallic: T::load(&surfaces.metallic[at..]),
                dielectric_f0: T::load(&surfaces.dielectric_f0[at..]),
            };
            let bsdf = Bsdf::new(&substance, wo, table());
            let layered = LAYERED.then(|| surfaces.layered(at, &substance, wo));
            let position = load(&surfaces.position, at);
            let origin = departure(position, face);

            if !self.lights.is_empty() {
                let (light, radiance) = self.lights.sample(origin, normal, sampler.pair(2 + 2 * bounce));
                let wi = shading.to_local(light.direction);
                let (value, pdf) = match &layered {
                    Some(layered) => layered.evaluate(&bsdf, wi),
                    None => bsdf.evaluate(wi),
                };
                let weight = match self.settings.strategy {
                    Strategy::Combined => heuristic(light.pdf, pdf),
                    #[cfg(test)]
                    Strategy::Lights => T::splat(1.0),
                    #[cfg(test)]
                    Strategy::Scattering => zero,
                };
                let factor = terminator(face, normal, bent, light.direction) * weight * inverse(light.pdf);
                let contribution = self.limited(throughput * value * radiance * factor);
                let above = wi.z.gt(T::splat(1e-6)) & light.direction.dot(face).gt(zero);
                let seen = !self.lights.hide(origin, light.direction, light.distance);
                let chosen = active & light.valid & above & is_light(contribution) & seen;
                compress(origin, chosen, &mut shadows.origin, cast);
                compress(light.direction, chosen, &mut shadows.direction, cast);
                compress(contribution, chosen, &mut shadows.contribution, cast);
                if split {
                    let share = gloss_share(&bsdf, layered.as_ref(), substance.metallic, wi);
                    compress(contribution * share, chosen, &mut shadows.gloss, cast);
                }
                light.distance.compress(chosen, &mut shadows.distance[cast..]);
                slot.compress(chosen, &mut shadows.slot[cast..]);
                if self.world.has_cutouts {
                    let coins = shadow_coin(sampler.seed, sampler.index, bounce);
                    coins.compress(chosen, &mut shadows.coin[cast..]);
                }
                cast += chosen.to_bits().count_ones() as usize;
            }

            let uv = sampler.pair(3 + 2 * bounce);
            let scattered = match &layered {
                Some(layered) => layered.sample(&bsdf, uv, sampler.coin(PASSAGE + bounce)),
                None => bsdf.sample(uv),
            };
            if split {
                let share = gloss_share(&bsdf, layered.as_ref(), substance.metallic, scattered.wi);
                let share = Vec3::pick(scattered.passes, Vec3::all(zero), share);
                guides.scatter(share, slot, active.to_bits());
            }
            let direction = shading.to_world(scattered.wi);
            let passes = scattered.passes;
            let bend = terminator(face, normal, bent & !passes, direction);
            let mut throughput = throughput * scattered.weight * bend;
            let ahead = T::pick(passes, -direction.dot(face), direction.dot(face));
            let mut going = active & scattered.valid & ahead.gt(zero) & is_light(throughput);
            let origin = match LAYERED {
                true => Vec3::pick(passes, departure(position, -face), origin),
                false => origin,
            };
            if bounce + 1 >= self.settings.roulette_from {
                let survival = at_most(throughput.max_component(), 0.95);
                going = going & sampler.coin(bounce).lt(survival);
                throughput = throughput * inverse(survival);
            }
            let rough = T::pick(scattered.specular, substance.roughness * substance.roughness, T::splat(1.0));
            let spread = T::load(&paths.spread[at..]) + rough * DIFFUSE_SPREAD;
            // From a rough scattering on, nothing is smoother than the option says.
            let roughen = T::load(&paths.roughen[at..]);
            let roughen = T::pick(rough.gt(T::splat(ROUGH)), T::splat(self.settings.roughen), roughen);
            let width = T::load(&paths.width[at..]);

            compress(origin, going, &mut paths.origin, next);
            compress(direction, going, &mut paths.direction, next);
            compress(throughput, going, &mut paths.throughput, next);
            compress(normal, going, &mut paths.normal, next);
            scattered.pdf.compress(going, &mut paths.pdf[next..]);
            width.compress(going, &mut paths.width[next..]);
            spread.compress(going, &mut paths.spread[next..]);
            roughen.compress(going, &mut paths.roughen[next..]);
            sampler.seed.compress(going, &mut paths.seed[next..]);
            sampler.index.compress(going, &mut paths.index[next..]);
            slot.compress(going, &mut paths.slot[next..]);
            next += going.to_bits().count_ones() as usize;
        }
        (next, cast)
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

/// Share of the light from `wi` that a surface mirrors without colouring it.
#[inline(always)]
fn gloss_share<T: Real>(bsdf: &Bsdf<T>, layered: Option<&Layered<T>>, metallic: T, wi: Vec3<T>) -> Rgb<T> {
    let [gloss, matte] = match layered {
        Some(layered) => layered.lobes(bsdf, wi).0,
        None => bsdf.lobes(wi).0,
    };
    let share = |gloss: T, matte: T| gloss * complement(metallic) * inverse(at_least(gloss + matte, 1e-20));
    vec3(share(gloss.x, matte.x), share(gloss.y, matte.y), share(gloss.z, matte.z))
}

/// Seeds the numbers of a ray for surfaces that cover in part.
#[inline(always)]
fn coin<I: Int>(seed: I, index: I, bounce: u32) -> I {
    seed ^ index.times(I::splat(0x9e37_79b1)) ^ I::splat((bounce + 1).wrapping_mul(0x85eb_ca77))
}

/// As [`coin`], for a ray to a light.
#[inline(always)]
fn shadow_coin<I: Int>(seed: I, index: I, bounce: u32) -> I {
    coin(seed, index, bounce + 0x1000)
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

/// How much of the light from `wi` a bent normal lets through: softens the edge where the faces of a smooth mesh turn
/// away from a light that their normals still see (Chiang, Li and Burley, SIGGRAPH 2019 talks).
#[inline(always)]
fn terminator<T: Real>(face: Vec3<T>, normal: Vec3<T>, bent: T::Mask, wi: Vec3<T>) -> T {
    let g = face.dot(wi) * inverse(at_least(normal.dot(wi) * normal.dot(face), 1e-6));
    let g = at_most(g, 1.0);
    T::pick(bent, g * (g + 1.0_f32 - g * g), T::splat(1.0))
}

/// Where scattered rays start: off the surface by more than rounding errors, on its side.
#[inline(always)]
fn departure<T: Real>(position: Vec3<T>, face: Vec3<T>) -> Vec3<T> {
    let largest = position.map(Real::abs).max_component();
    position + face * ((largest + 0.5_f32) * 4e-6_f32)
}
