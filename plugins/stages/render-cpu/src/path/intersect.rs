//! Intersections: paths that hit a light, nothing, or a surface.

use super::{PathTracer, Strategy, add_radiance, is_light, power_heuristic};
use crate::batch::{BATCH, Batch, get, load, set};
use syntable_prepare::Sampler;
use syntable_simd::Vec3;
use syntable_simd::{Int, Mask, Real, max};
use syntable_transport::path::{GUIDE_BOUNCES, LAYER_DIMENSION, TOUCHING};
use syntable_transport::surface::surface;

impl PathTracer<'_> {
    /// Ends the paths that hit a light or nothing: their hits become infinite, and if many paths end, the batch is
    /// compacted. Returns the number of paths left, including ended ones.
    #[inline(always)]
    pub(super) fn intersect_lights<T: Real>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> usize {
        let mut left = 0;
        let meets_lights = bounce > 0 || self.background;
        for at in (0..alive).step_by(T::WIDTH) {
            let active = T::load(&batch.numbers[at..]).lt(T::splat(alive as f32));
            let t = T::load(&batch.hits.t[at..]);
            let mut keep = active & t.lt(T::splat(f32::INFINITY));
            let mut is_hit = T::Mask::splat(false);
            if meets_lights && !self.lights.is_empty() {
                let (origin, direction) = (load::<T>(&batch.paths.origin, at), load(&batch.paths.direction, at));
                let mut hit = self.lights.intersect(origin, direction, t * (1.0_f32 + TOUCHING));
                hit.is_hit = hit.is_hit & active;
                is_hit = hit.is_hit;
                if hit.is_hit.any() {
                    let normal = load(&batch.paths.normal, at);
                    let (pdf, radiance) = self.lights.pdf(origin, normal, direction, &hit);
                    let weight = self.bsdf_sampled_weight(T::load(&batch.paths.pdf[at..]), pdf, bounce);
                    let contribution = load(&batch.paths.throughput, at) * radiance * weight;
                    let contribution = if bounce == 0 { contribution } else { self.limit_luminance(contribution) };
                    let sound = hit.is_hit & is_light(contribution);
                    let (mut lanes, mut slots) = ([[0.0; 8]; 3], [0; 8]);
                    contribution.x.store(&mut lanes[0]);
                    contribution.y.store(&mut lanes[1]);
                    contribution.z.store(&mut lanes[2]);
                    T::Int::load(&batch.paths.slot[at..]).store(&mut slots);
                    let mut lanes_left = sound.to_bits();
                    while lanes_left != 0 {
                        let lane = lanes_left.trailing_zeros() as usize & 7;
                        lanes_left &= lanes_left - 1;
                        let contribution = Vec3::from(lanes.map(|row| row[lane]));
                        add_radiance(&mut batch.radiance, slots[lane], contribution);
                    }
                    keep = keep & !hit.is_hit;
                }
            }
            T::select(keep, t, T::splat(f32::INFINITY)).store(&mut batch.hits.t[at..]);
            if meets_lights && self.lights.has_distant() {
                let away = active & t.ge(T::splat(f32::INFINITY)) & !is_hit;
                self.add_distant_lights(batch, at, away.to_bits(), bounce);
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

    /// Multiple-importance weight of a light that BSDF sampling hit, from its density and the density of emitter
    /// sampling.
    #[inline(always)]
    fn bsdf_sampled_weight<T: Real>(&self, bsdf: T, emitter: T, bounce: u32) -> T {
        match self.strategy {
            // No other estimate finds light that a camera ray meets, directly or behind panes.
            _ if bounce == 0 => T::splat(1.0),
            Strategy::Combined => power_heuristic(bsdf, emitter),
            Strategy::Bsdf => T::splat(1.0),
            // No other estimate finds light behind a transmitting surface.
            Strategy::Emitters => T::select(bsdf.ge(T::splat(f32::INFINITY)), T::splat(1.0), T::splat(0.0)),
        }
    }

    /// Adds the radiance of distant lights in the lanes that hit nothing.
    #[inline(never)]
    fn add_distant_lights(&self, batch: &mut Batch, at: usize, mut away: u32, bounce: u32) {
        while away != 0 {
            let i = at + away.trailing_zeros() as usize;
            away &= away - 1;
            let paths = &batch.paths;
            let (origin, direction, normal) = (get(&paths.origin, i), get(&paths.direction, i), get(&paths.normal, i));
            let weight = |sampled: f32| self.bsdf_sampled_weight(paths.pdf[i], sampled, bounce);
            let contribution = get(&paths.throughput, i) * self.lights.distant(origin, normal, direction, weight);
            let contribution = if bounce == 0 { contribution } else { self.limit_luminance(contribution) };
            if is_light(contribution) {
                add_radiance(&mut batch.radiance, batch.paths.slot[i], contribution);
            }
        }
    }

    /// Evaluates the surfaces at the hits, and adds what they emit.
    #[inline(always)]
    pub(super) fn evaluate_surfaces(&self, batch: &mut Batch, alive: usize, bounce: u32) {
        let paths = &mut batch.paths;
        for i in 0..alive {
            let hit = batch.hits.get(i);
            if hit.t == f32::INFINITY {
                continue;
            }
            if bounce == 0 {
                batch.met[paths.slot[i] as usize % BATCH] = true;
            }
            let width = paths.width[i] + paths.spread[i] * hit.t;
            paths.width[i] = width;
            let u = match self.world.scene.is_layered {
                true => Sampler { seed: paths.seed[i], index: paths.index[i] }.random(LAYER_DIMENSION + bounce),
                false => 0.0,
            };
            let (origin, direction) = (get(&paths.origin, i), get(&paths.direction, i));
            let projection = self.lights.projection.as_ref();
            let point = hit.point();
            let mut surface = surface(&self.world.scene, &point, origin, direction, hit.t, width, u, projection);
            if self.has_guides() && bounce <= GUIDE_BOUNCES {
                batch.guides.add_surface(paths.slot[i] as usize, &surface, bounce, bounce == GUIDE_BOUNCES);
            }
            let roughness = &mut surface.layer.parameters.roughness;
            if !surface.is_pane {
                *roughness = max(*roughness, paths.regularize[i]);
            }
            batch.surfaces.set(i, &surface);
            let mut throughput = get(&paths.throughput, i);
            if self.world.scene.is_layered {
                batch.surfaces.set_layers(i, &surface);
                throughput = throughput * surface.transmittance;
                set(&mut paths.throughput, i, throughput * surface.layer.weight);
            }
            if !surface.emission.is_black() {
                let pdf = match bounce {
                    0 => 0.0,
                    _ => {
                        self.lights.body_pdf(origin, get(&paths.normal, i), &point, hit.t, surface.face.dot(direction))
                    }
                };
                let weight = self.bsdf_sampled_weight(paths.pdf[i], pdf, bounce);
                let contribution = throughput * surface.emission * weight;
                let contribution = if bounce == 0 { contribution } else { self.limit_luminance(contribution) };
                add_radiance(&mut batch.radiance, paths.slot[i], contribution);
            }
        }
    }
}
