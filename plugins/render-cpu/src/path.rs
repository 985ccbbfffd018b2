//! The path tracer: light that reaches the camera, by sampling paths from the camera.
//!
//! At every surface a light is sampled and a scattered direction is sampled; both estimates of direct light are
//! combined by multiple importance sampling with the power heuristic (Veach, 1997). Faint paths end at random.

use crate::bvh::Ray;
use crate::camera::RayCamera;
use crate::light::Lights;
use crate::sampler::{PixelSeed, Sampler};
use crate::vec3::{Rgb, Vec3, max, min};
use crate::world::{Cone, World};

/// A light is seen if nothing is closer by more than this share of its distance: lamps may lie flat on a ceiling.
const TOUCHING: f32 = 1e-4;

/// How fast the cone of a path widens after a diffuse bounce, metres a metre: textures seen by bounced light are
/// read coarsely, which leaves their mean and takes their noise.
const DIFFUSE_SPREAD: f32 = 0.25;

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
    pub samples: u32,
    pub max_bounces: u32,
    /// Bounces after which paths may be ended at random.
    pub roulette_from: u32,
    /// Largest luminance that one connection to a light may bring by scattering, nits.
    pub clamp: f32,
    pub strategy: Strategy,
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
    /// Sums two counts.
    pub fn add(&mut self, other: &Self) {
        self.paths += other.paths;
        self.rays += other.rays;
        self.shadow_rays += other.shadow_rays;
    }
}

/// A view of a scene, ready to trace.
pub(crate) struct PathTracer<'a> {
    pub world: &'a World,
    pub lights: &'a Lights,
    pub camera: &'a RayCamera,
    pub settings: Settings,
    /// Seed of the picture.
    pub seed: u64,
}

impl PathTracer<'_> {
    /// Mean radiance over a pixel's area, nits.
    pub fn pixel(&self, x: u32, y: u32, statistics: &mut Statistics) -> [f32; 3] {
        let seed = PixelSeed::new(self.seed, x, y);
        let mut sum = [0.0_f64; 3];
        for sample in 0..self.settings.samples {
            let mut sampler = seed.sample(sample);
            let [u, v] = sampler.pair();
            let ray = self.camera.ray(f64::from(x) + f64::from(u), f64::from(y) + f64::from(v));
            let radiance =
                self.trace(Vec3::from(ray.origin), Vec3::from(ray.direction).normalized(), sampler, statistics);
            for (sum, value) in sum.iter_mut().zip(radiance.array()) {
                *sum += f64::from(value);
            }
        }
        sum.map(|value| (value / f64::from(self.settings.samples.max(1))) as f32)
    }

    /// Radiance that arrives along a ray.
    pub fn trace(&self, origin: Vec3, direction: Vec3, mut sampler: Sampler, statistics: &mut Statistics) -> Rgb {
        let Settings { samples, max_bounces, roulette_from, clamp, strategy } = self.settings;
        let (mut origin, mut direction) = (origin, direction);
        let (mut radiance, mut throughput) = (Rgb::ZERO, Rgb::ONE);
        // Normal and density of the last scattering; none for the camera.
        let mut last: Option<(Vec3, f32)> = None;
        // Samples of a pixel share its area, so that each may see finer than it.
        let sharpness = max(1.0 / (samples as f32).sqrt(), 0.25);
        let mut cone = Cone { width: 0.0, spread: self.camera.pixel_angle * sharpness };
        statistics.paths += 1;

        for bounce in 0..=max_bounces {
            statistics.rays += 1;
            let ray = Ray { origin: origin.array(), direction: direction.array() };
            let hit = self.world.closest(&ray, f32::INFINITY);
            let reach = hit.map_or(f32::INFINITY, |hit| hit.t * (1.0 + TOUCHING));
            if let Some(light) = self.lights.intersect(origin, direction, reach) {
                let weight = match (last, strategy) {
                    (None, _) => 1.0,
                    (Some((normal, pdf)), Strategy::Combined) => {
                        heuristic(pdf, self.lights.pdf(origin, normal, &light))
                    }
                    #[cfg(test)]
                    (Some(_), Strategy::Scattering) => 1.0,
                    #[cfg(test)]
                    (Some(_), Strategy::Lights) => 0.0,
                };
                let limit = if last.is_some() { clamp } else { f32::INFINITY };
                radiance += limited(throughput * light.radiance * weight, limit);
                break;
            }
            let Some(hit) = hit else { break };

            cone.width += cone.spread * hit.t;
            let surface = self.world.surface(&hit, origin, direction, hit.t, cone.width);
            if !surface.emission.is_black() {
                let limit = if last.is_some() { clamp } else { f32::INFINITY };
                radiance += limited(throughput * surface.emission, limit);
            }
            if bounce == max_bounces {
                break;
            }
            let Some(bsdf) = surface.bsdf(-direction) else { break };
            let normal = surface.shading.z;
            origin = surface.departure();

            if let Some(light) = self.lights.sample(origin, normal, sampler.pair()) {
                let wi = surface.shading.to_local(light.direction);
                if wi.z > 1e-6 && light.direction.dot(surface.face) > 0.0 {
                    let (value, pdf) = bsdf.evaluate(wi);
                    let weight = match strategy {
                        Strategy::Combined => heuristic(light.pdf, pdf),
                        #[cfg(test)]
                        Strategy::Lights => 1.0,
                        #[cfg(test)]
                        Strategy::Scattering => 0.0,
                    };
                    let factor = surface.terminator(light.direction) * weight / light.pdf;
                    let contribution = limited(throughput * value * light.radiance * factor, clamp);
                    if contribution.max_component() > 0.0 && !self.lights.hide(origin, light.direction, light.distance)
                    {
                        statistics.shadow_rays += 1;
                        let ray = Ray { origin: origin.array(), direction: light.direction.array() };
                        if !self.world.occluded(&ray, light.distance * (1.0 - TOUCHING)) {
                            radiance += contribution;
                        }
                    }
                }
            }

            let Some(scattered) = bsdf.sample(sampler.pair()) else { break };
            direction = surface.shading.to_world(scattered.wi);
            if direction.dot(surface.face) <= 0.0 {
                break;
            }
            throughput *= scattered.weight * surface.terminator(direction);
            if bounce + 1 >= roulette_from {
                let survival = min(throughput.max_component(), 0.95);
                if sampler.coin(1) >= survival {
                    break;
                }
                throughput *= 1.0 / survival;
            }
            last = Some((normal, scattered.pdf));
            let rough = surface.substance.roughness;
            cone.spread += if scattered.specular { rough * rough * DIFFUSE_SPREAD } else { DIFFUSE_SPREAD };
        }
        radiance
    }
}

/// Power heuristic with exponent two.
#[inline(always)]
fn heuristic(own: f32, other: f32) -> f32 {
    // As a quotient, so that squares of large densities cannot overflow.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

/// A colour with its luminance limited.
#[inline(always)]
fn limited(color: Rgb, limit: f32) -> Rgb {
    if limit == f32::INFINITY {
        return color;
    }
    let luminance = color.luminance();
    if luminance > limit { color * (limit / luminance) } else { color }
}
