//! What paths meet: lights, nothing, or surfaces.

use super::{DRAW, GUIDE_BOUNCES, PathTracer, Strategy, TOUCHING, deposit, heuristic, is_light};
use crate::batch::{Batch, get, load, set};
use crate::real::{Int, Mask, Real, max};
use crate::sampler::Sampler;
use crate::vec3::Vec3;

impl PathTracer<'_> {
    /// Ends the paths that meet a light or nothing: their hits become infinite, and if they are many they are squeezed
    /// out. Gives the number of paths that are left, ended ones included.
    #[inline(always)]
    pub(super) fn meet_lights<T: Real>(&self, batch: &mut Batch, alive: usize, bounce: u32) -> usize {
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
    pub(super) fn look_up(&self, batch: &mut Batch, alive: usize, bounce: u32) {
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
            if self.has_guides() && bounce <= GUIDE_BOUNCES {
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
}
