//! Where paths go on: towards lights and in scattered directions.

use super::{Gather, PASSAGE, PathTracer, Strategy, coin, heuristic, is_light};
use crate::batch::{Batch, compress, load};
use crate::bsdf::{Bsdf, Layered, Substance, table};
use crate::real::{Int, Mask, Real, at_least, at_most, complement, inverse};
use crate::sampler::Sampler;
use crate::vec3::{Basis, Rgb, Vec3, vec3};

/// How fast the cone of a path widens after a diffuse bounce, metres a metre: textures seen by bounced light are
/// read coarsely, which leaves their mean and takes their noise.
const DIFFUSE_SPREAD: f32 = 0.25;

/// A scattering counts as rough from this α on.
const ROUGH: f32 = 0.1;

impl PathTracer<'_> {
    /// Samples lights and scattered directions; gives the numbers of paths that go on and of shadow rays.
    #[inline(always)]
    pub(super) fn scatter<T: Real, const LAYERED: bool>(
        &self,
        batch: &mut Batch,
        alive: usize,
        bounce: u32,
    ) -> (usize, usize) {
        let Batch { paths, hits, surfaces, shadows, numbers, guides, .. } = batch;
        let split = self.gather == Gather::LightAndGuides && bounce == 0;
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

/// As [`coin`], for a ray to a light.
#[inline(always)]
fn shadow_coin<I: Int>(seed: I, index: I, bounce: u32) -> I {
    coin(seed, index, bounce + 0x1000)
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
