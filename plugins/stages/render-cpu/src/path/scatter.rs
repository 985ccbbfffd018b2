//! Continuing paths: emitter sampling, BSDF sampling, compaction.

use super::{Gather, PathTracer, Strategy, alpha_seed, is_light, power_heuristic};
use crate::batch::{Batch, Guides, Paths, Shadows, compress, load};
use syntable_prepare::Sampler;
use syntable_simd::{Basis, Int, Mask, Real, Rgb, Vec3, at_least, at_most, complement, inverse, vec3};
use syntable_transport::bsdf::{Bsdf, BsdfParameters, BsdfSample, Layered, table};
use syntable_transport::path::{ALPHA_OF_SHADOW, DIFFUSE_SPREAD, GUIDE_BOUNCES, PASSAGE, PAST, ROUGH, SPLIT};

/// The surfaces of some lanes, ready to scatter.
struct Shading<T: Real> {
    /// Lanes that scatter.
    active: T::Mask,
    sampler: Sampler<T::Int>,
    slot: T::Int,
    throughput: Rgb<T>,
    position: Vec3<T>,
    /// Where rays on the side of `face` start.
    origin: Vec3<T>,
    face: Vec3<T>,
    normal: Vec3<T>,
    /// Around `normal`.
    basis: Basis<T>,
    /// Whether `normal` differs from `face`.
    perturbed: T::Mask,
    parameters: BsdfParameters<T>,
    bsdf: Bsdf<T>,
    /// For layered scenes.
    layered: Option<Layered<T>>,
    /// Lanes whose surface is a pane.
    pane: T::Mask,
    /// Direction of the ray, and its distance to the surface.
    direction: Vec3<T>,
    distance: T,
    /// Density of that direction; infinite while the path has only met glass.
    pdf: T,
}

/// Continuation of some paths.
struct Continuation<T: Real> {
    /// Lanes that continue.
    going: T::Mask,
    origin: Vec3<T>,
    direction: Vec3<T>,
    throughput: Rgb<T>,
    sample: BsdfSample<T>,
    /// Lanes that pass straight through a pane: only their throughput and the minimum distance of the next surface
    /// change.
    straight: T::Mask,
}

impl PathTracer<'_> {
    /// Samples emitters and BSDFs; returns the number of continuing paths and the number of shadow rays.
    #[inline(always)]
    pub(super) fn scatter<T: Real, const LAYERED: bool>(
        &self,
        batch: &mut Batch,
        alive: usize,
        bounce: u32,
    ) -> (usize, usize) {
        let (mut next, mut cast) = (0, 0);
        for at in (0..alive).step_by(T::WIDTH) {
            let shading = self.shading::<T, LAYERED>(batch, alive, at);
            let split = self.gather == Gather::LightAndGuides && bounce == 0;
            if !self.lights.is_empty() {
                cast = self.sample_emitters(&shading, &mut batch.shadows, cast, bounce, split);
            }
            let continuation = self.sample_bsdf::<T, LAYERED>(&shading, bounce);
            if self.has_guides() && bounce <= GUIDE_BOUNCES {
                self.keep_guides::<T, LAYERED>(&shading, &continuation.sample, &mut batch.guides, bounce);
            }
            next = self.compact(&shading, &continuation, &mut batch.paths, at, next);
        }
        (next, cast)
    }

    /// Loads the surfaces from `at` on.
    #[inline(always)]
    fn shading<T: Real, const LAYERED: bool>(&self, batch: &Batch, alive: usize, at: usize) -> Shading<T> {
        let Batch { paths, hits, surfaces, numbers, .. } = batch;
        let active = T::load(&numbers[at..]).lt(T::splat(alive as f32));
        let active = active & T::load(&hits.t[at..]).lt(T::splat(f32::INFINITY));
        let (face, normal) = (load(&surfaces.face, at), load(&surfaces.normal, at));
        let basis = Basis::around(normal);
        let direction = load::<T>(&paths.direction, at);
        let mut wo = basis.to_local(-direction);
        let active = active & wo.z.gt(T::splat(1e-5));
        wo.z = at_least(wo.z, 1e-5);
        let parameters = BsdfParameters {
            base_color: load(&surfaces.base_color, at),
            roughness: T::load(&surfaces.roughness[at..]),
            metallic: T::load(&surfaces.metallic[at..]),
            dielectric_f0: T::load(&surfaces.dielectric_f0[at..]),
        };
        let position = load(&surfaces.position, at);
        Shading {
            active,
            sampler: Sampler { seed: T::Int::load(&paths.seed[at..]), index: T::Int::load(&paths.index[at..]) },
            slot: T::Int::load(&paths.slot[at..]),
            throughput: load(&paths.throughput, at),
            position,
            origin: offset_ray_origin(position, face),
            face,
            normal,
            basis,
            perturbed: T::load(&surfaces.perturbed[at..]).gt(T::splat(0.0)),
            parameters,
            bsdf: Bsdf::new(&parameters, wo, table(), self.settings.dielectrics),
            layered: if LAYERED { Some(surfaces.layered(at, &parameters, wo)) } else { None },
            pane: match LAYERED {
                true => T::load(&surfaces.layers.pane[at..]).gt(T::splat(0.0)),
                false => T::Mask::splat(false),
            },
            direction,
            distance: T::load(&hits.t[at..]),
            pdf: T::load(&paths.pdf[at..]),
        }
    }

    /// Emitter sampling: adds shadow rays towards lights; returns their number so far. `split` also stores the specular
    /// fraction of their light.
    #[inline(always)]
    fn sample_emitters<T: Real>(
        &self,
        shading: &Shading<T>,
        shadows: &mut Shadows,
        cast: usize,
        bounce: u32,
        split: bool,
    ) -> usize {
        let Shading { sampler, origin, face, normal, bsdf, layered, .. } = shading;
        let (light, radiance) = self.lights.sample(*origin, *normal, sampler.pair(2 + 2 * bounce));
        let wi = shading.basis.to_local(light.direction);
        let (value, pdf) = match layered {
            Some(layered) => layered.evaluate(bsdf, wi),
            None => bsdf.evaluate(wi),
        };
        let weight = match self.strategy {
            Strategy::Combined => power_heuristic(light.pdf, pdf),
            Strategy::Emitters => T::splat(1.0),
            Strategy::Bsdf => T::splat(0.0),
        };
        let shadow_terminator = shadow_terminator(*face, *normal, shading.perturbed, light.direction);
        let factor = shadow_terminator * weight * inverse(light.pdf);
        let contribution = self.limit_luminance(shading.throughput * value * radiance * factor);
        let above = wi.z.gt(T::splat(1e-6)) & light.direction.dot(*face).gt(T::splat(0.0));
        let visible = !self.lights.occlude(*origin, light.direction, light.distance);
        let chosen = shading.active & light.valid & above & is_light(contribution) & visible;
        compress(*origin, chosen, &mut shadows.origin, cast);
        compress(light.direction, chosen, &mut shadows.direction, cast);
        compress(contribution, chosen, &mut shadows.contribution, cast);
        if self.world.scene.has_panes {
            weight.compress(chosen, &mut shadows.weight[cast..]);
        }
        if split {
            let fraction = specular_fraction(bsdf, layered.as_ref(), shading.parameters.metallic, wi);
            compress(contribution * fraction, chosen, &mut shadows.specular, cast);
        }
        light.distance.compress(chosen, &mut shadows.distance[cast..]);
        shading.slot.compress(chosen, &mut shadows.slot[cast..]);
        if self.world.scene.has_cutouts {
            let seeds = shadow_alpha_seed(sampler.seed, sampler.index, bounce);
            seeds.compress(chosen, &mut shadows.alpha_seed[cast..]);
        }
        cast + chosen.to_bits().count_ones() as usize
    }

    /// Stores values of a scattering for guides: the specular fraction at the first surface, and whether glass
    /// reflected.
    #[inline(always)]
    fn keep_guides<T: Real, const LAYERED: bool>(
        &self,
        shading: &Shading<T>,
        sample: &BsdfSample<T>,
        guides: &mut Guides,
        bounce: u32,
    ) {
        let active = shading.active.to_bits();
        if bounce == 0 && self.gather == Gather::LightAndGuides {
            let metallic = shading.parameters.metallic;
            let fraction = specular_fraction(&shading.bsdf, shading.layered.as_ref(), metallic, sample.wi);
            let fraction = Vec3::select(sample.transmitted, Vec3::all(T::splat(0.0)), fraction);
            guides.scatter(fraction, shading.slot, active);
        }
        if LAYERED {
            guides.reflect(shading.slot, active & sample.reflected.to_bits(), bounce);
        }
    }

    /// BSDF sampling: the next direction of every path, and Russian roulette.
    #[inline(always)]
    fn sample_bsdf<T: Real, const LAYERED: bool>(&self, shading: &Shading<T>, bounce: u32) -> Continuation<T> {
        let Shading { active, sampler, face, bsdf, layered, .. } = shading;
        let zero = T::splat(0.0);
        let uv = sampler.pair(3 + 2 * bounce);
        let sample = match layered {
            Some(layered) => {
                // Guides describe the surface behind glass, not the reflection.
                if self.gather == Gather::Guides {
                    layered.sample(bsdf, uv, T::splat(1.0 - f32::EPSILON), zero)
                } else {
                    let least = SPLIT.get(bounce as usize).copied().unwrap_or(0.0);
                    let least = T::select(shading.pdf.lt(T::splat(f32::INFINITY)), zero, T::splat(least));
                    layered.sample(bsdf, uv, passage(sampler, bounce), least)
                }
            }
            None => bsdf.sample(uv),
        };
        let transmitted = sample.transmitted;
        let straight = match LAYERED {
            true => transmitted & shading.pane,
            false => T::Mask::splat(false),
        };
        let direction = Vec3::select(straight, shading.direction, shading.basis.to_world(sample.wi));
        let shadow_terminator = shadow_terminator(*face, shading.normal, shading.perturbed & !transmitted, direction);
        let mut throughput = shading.throughput * sample.weight * shadow_terminator;
        let ahead = T::select(transmitted, -direction.dot(*face), direction.dot(*face));
        let mut going = *active & sample.valid & ahead.gt(zero) & is_light(throughput);
        let origin = match LAYERED {
            true => Vec3::select(transmitted, offset_ray_origin(shading.position, -*face), shading.origin),
            false => shading.origin,
        };
        if bounce + 1 >= self.settings.roulette_from {
            let survival = at_most(throughput.max_component(), 0.95);
            // Surfaces behind glass get as many samples as others, and guides.
            let through_glass = shading.pdf.ge(T::splat(f32::INFINITY)) & sample.pdf.ge(T::splat(f32::INFINITY));
            let survival = T::select(through_glass, T::splat(1.0), survival);
            going = going & sampler.random(bounce).lt(survival);
            throughput = throughput * inverse(survival);
        }
        Continuation { going, origin, direction, throughput, sample, straight }
    }

    /// Compaction: stores the continuing paths, from `next` on; returns their number so far.
    #[inline(always)]
    fn compact<T: Real>(
        &self,
        shading: &Shading<T>,
        continuation: &Continuation<T>,
        paths: &mut Paths,
        at: usize,
        next: usize,
    ) -> usize {
        let Continuation { going, origin, direction, throughput, sample, straight } = continuation;
        let (going, roughness) = (*going, shading.parameters.roughness);
        let alpha = T::select(sample.specular, roughness * roughness, T::splat(1.0));
        let old_spread = T::load(&paths.spread[at..]);
        let spread = old_spread + alpha * DIFFUSE_SPREAD;
        // After a rough bounce, every surface is at least as rough as the option `regularize`.
        let regularize = T::load(&paths.regularize[at..]);
        let regularize = T::select(alpha.gt(T::splat(ROUGH)), T::splat(self.settings.regularize), regularize);
        let mut width = T::load(&paths.width[at..]);
        let (mut origin, mut normal, mut pdf, mut near) = (*origin, shading.normal, sample.pdf, T::splat(0.0));
        if straight.any() {
            // The ray is unchanged, and so are the densities of lights that it may hit.
            let straight = *straight;
            origin = Vec3::select(straight, load(&paths.origin, at), origin);
            normal = Vec3::select(straight, load(&paths.normal, at), normal);
            pdf = T::select(straight, T::load(&paths.pdf[at..]), pdf);
            width = T::select(straight, width - old_spread * shading.distance, width);
            near = T::select(straight, shading.distance * (1.0_f32 + PAST) + PAST, near);
        }
        compress(origin, going, &mut paths.origin, next);
        compress(*direction, going, &mut paths.direction, next);
        compress(*throughput, going, &mut paths.throughput, next);
        compress(normal, going, &mut paths.normal, next);
        pdf.compress(going, &mut paths.pdf[next..]);
        near.compress(going, &mut paths.near[next..]);
        width.compress(going, &mut paths.width[next..]);
        spread.compress(going, &mut paths.spread[next..]);
        regularize.compress(going, &mut paths.regularize[next..]);
        shading.sampler.seed.compress(going, &mut paths.seed[next..]);
        shading.sampler.index.compress(going, &mut paths.index[next..]);
        shading.slot.compress(going, &mut paths.slot[next..]);
        next + going.to_bits().count_ones() as usize
    }
}

/// Fraction of the light from `wi` that a surface reflects specularly, without coloring it.
#[inline(always)]
fn specular_fraction<T: Real>(bsdf: &Bsdf<T>, layered: Option<&Layered<T>>, metallic: T, wi: Vec3<T>) -> Rgb<T> {
    let [specular, diffuse] = match layered {
        Some(layered) => layered.lobes(bsdf, wi).0,
        None => bsdf.lobes(wi).0,
    };
    let fraction =
        |specular: T, diffuse: T| specular * complement(metallic) * inverse(at_least(specular + diffuse, 1e-20));
    vec3(fraction(specular.x, diffuse.x), fraction(specular.y, diffuse.y), fraction(specular.z, diffuse.z))
}

/// Random number that decides between reflection and transmission, evenly distributed over the samples.
#[inline(always)]
fn passage<I: Int>(sampler: &Sampler<I>, bounce: u32) -> I::Real {
    let seed = sampler.seed ^ I::splat(PASSAGE);
    Sampler { seed, ..*sampler }.pair(bounce)[0]
}

/// Like [`alpha_seed`], for a shadow ray.
#[inline(always)]
fn shadow_alpha_seed<I: Int>(seed: I, index: I, bounce: u32) -> I {
    alpha_seed(seed, index, bounce + ALPHA_OF_SHADOW)
}

/// Factor on light from `wi` at a perturbed normal: softens the shadow edge where the faces of a smooth mesh turn away
/// from a light although their normals still face it (Chiang, Li and Burley, SIGGRAPH 2019 talks).
#[inline(always)]
fn shadow_terminator<T: Real>(face: Vec3<T>, normal: Vec3<T>, perturbed: T::Mask, wi: Vec3<T>) -> T {
    let g = face.dot(wi) * inverse(at_least(normal.dot(wi) * normal.dot(face), 1e-6));
    let g = at_most(g, 1.0);
    T::select(perturbed, g * (g + 1.0_f32 - g * g), T::splat(1.0))
}

/// Origin of scattered rays: moved off the surface by more than rounding errors, to the side of `face`.
#[inline(always)]
fn offset_ray_origin<T: Real>(position: Vec3<T>, face: Vec3<T>) -> Vec3<T> {
    let largest = position.map(Real::abs).max_component();
    position + face * ((largest + 0.5_f32) * 4e-6_f32)
}
