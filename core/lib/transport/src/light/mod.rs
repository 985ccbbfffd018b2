//! The lights of a view: selecting one, sampling it, intersecting it.
//!
//! Lights have three types. Area lights are opaque where they emit: a path that hits one ends there, and the light
//! occludes the background; the back of a rectangle or disk is invisible. Emissive bodies are hit as bodies. Distant
//! lights are hit by rays that hit nothing else.
//!
//! A light is selected in proportion to an estimate of its unshadowed irradiance at the point.
//!
//! A window is a rectangle whose radiance depends on position and direction. It is sampled and hit like any rectangle,
//! from nearby points uniformly in solid angle. Its density ignores the pattern, whose contrast is small.

mod disk;
mod rect;
mod sphere;
#[cfg(test)]
mod tests;

use crate::path::TOUCHING;
use disk::Disk;
use rect::Rect;
use sphere::Sphere;
use syntable_model::error::Result;
use syntable_model::scene;
use syntable_prepare::{
    AreaLight, EmissiveBody, EmitterPoint, LightTable, NO_WINDOW, PreparedScene, ProjectedEnvironment, RectLight,
    SceneCache, SurfacePoint,
};
use syntable_simd::{Int as _, Mask, Real, inverse};
use syntable_simd::{Rgb, Vec3};

/// A sampled direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample<T: Real> {
    /// Unit length.
    pub direction: Vec3<T>,
    /// Distance to the light's surface, meters.
    pub distance: T,
    /// Density per steradian.
    pub pdf: T,
    /// Whether the sample is valid.
    pub valid: T::Mask,
}

/// Hit of a ray on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightHit<T: Real> {
    /// Whether the ray hits a light.
    pub is_hit: T::Mask,
    /// Distance along the ray, meters.
    pub distance: T,
    /// Number of the light.
    index: T::Int,
}

/// A light with a shape.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a>(pub &'a AreaLight);

/// All lights of a view.
#[derive(Default)]
pub struct Lights<'a> {
    table: LightTable,
    emitters: &'a [EmissiveBody],
    /// Scene with the emission of bodies.
    scene: Option<&'a PreparedScene>,
    /// Environment for surfaces that show it; `None` without such a surface or without an environment.
    pub projection: Option<ProjectedEnvironment>,
}

impl<'a> Lights<'a> {
    /// Checks and converts the lights of a view; the emissive bodies of the scene are lights too.
    pub fn new(lights: &[scene::Light], scene: &'a PreparedScene, cache: &SceneCache) -> Result<Self> {
        let table = LightTable::new(lights, cache)?;
        let projection = match scene.materials.has_projections {
            true => ProjectedEnvironment::new(lights, &table),
            false => None,
        };
        Ok(Self { table, emitters: &scene.emitters, scene: Some(scene), projection })
    }

    /// Lights without a scene.
    #[cfg(test)]
    pub fn alone(lights: &[scene::Light]) -> Result<Self> {
        Ok(Self { table: LightTable::new(lights, &SceneCache::default())?, ..Self::default() })
    }
}

impl Lights<'_> {
    /// Number of lights.
    #[inline(always)]
    fn count(&self) -> usize {
        self.table.area.len() + self.emitters.len() + self.table.distant.len()
    }

    /// Whether the view has no light.
    pub fn is_empty(&self) -> bool {
        self.count() == 0
    }

    /// Whether the view has distant lights.
    #[inline(always)]
    pub fn has_distant(&self) -> bool {
        !self.table.distant.is_empty()
    }

    /// Importance of a light; 1 for a single light. (No closures in this function or its callers: they would not be
    /// compiled for the processor's lanes.)
    #[inline(always)]
    fn importance<T: Real>(&self, light: usize, p: Vec3<T>, n: Vec3<T>) -> T {
        if self.count() == 1 {
            return T::splat(1.0);
        }
        if let Some(light) = self.table.area.get(light) {
            return Shape(light).importance(p, n);
        }
        let (p, n) = (Lanes::of(p), Lanes::of(n));
        let mut out = [0.0; 8];
        self.importance_by_lane(light - self.table.area.len(), &p, &n, &mut out[..T::WIDTH]);
        T::load(&out)
    }

    /// Importance of a light without a shape, numbered from 0.
    #[inline(never)]
    fn importance_by_lane(&self, light: usize, p: &Lanes, n: &Lanes, out: &mut [f32]) {
        for (lane, out) in out.iter_mut().enumerate() {
            *out = match self.emitters.get(light) {
                Some(emitter) => emitter.importance(p.get(lane), n.get(lane)),
                None => self.table.distant[light - self.emitters.len()].importance(n.get(lane)),
            };
        }
    }

    /// Samples a light for a point with unit normal `n`, in proportion to its potential unshadowed contribution.
    /// Returns the light's radiance, too, which for a window is black in directions below the horizon of the normal.
    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, [mut u, v]: [T; 2]) -> (LightSample<T>, Rgb<T>) {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let (mut total, mut importance, mut chosen) = (zero, zero, T::Int::splat(u32::MAX));
        if self.count() == 1 {
            (total, importance, chosen) = (one, one, T::Int::splat(0));
        } else {
            for index in 0..self.count() {
                let own = self.importance(index, p, n);
                // One pass: a later light replaces the selection with its fraction of the total so far, and `u` stays
                // uniform.
                let shines = own.gt(zero);
                total = total + own;
                let probability = own / total;
                let taken = shines & u.lt(probability);
                let rescaled = T::select(taken, u / probability, (u - probability) / (one - probability));
                u = T::select(shines, rescaled, u);
                importance = T::select(taken, own, importance);
                chosen = T::Int::select(taken, T::Int::splat(index as u32), chosen);
            }
            u = u.smaller(T::splat(1.0 - f32::EPSILON));
        }
        let mut sampled = LightSample { direction: n, distance: zero, pdf: one, valid: T::Mask::splat(false) };
        let mut radiance = Vec3::all(zero);
        for (index, light) in self.table.area.iter().enumerate() {
            let shape = Shape(light);
            let mine = chosen.equals(T::Int::splat(index as u32));
            if mine.any() {
                let own = shape.sample(p, [u, v]);
                let emitted = match light {
                    AreaLight::Rect(rect) if rect.window != NO_WINDOW => {
                        // Light from below the point's horizon has no effect.
                        let useful = mine & own.valid & n.dot(own.direction).gt(zero);
                        self.window_radiance(rect, p, own.direction, own.distance, useful.to_bits())
                    }
                    _ => Vec3::broadcast(light.radiance()),
                };
                sampled = LightSample {
                    direction: Vec3::select(mine, own.direction, sampled.direction),
                    distance: T::select(mine, own.distance, sampled.distance),
                    pdf: T::select(mine, own.pdf, sampled.pdf),
                    valid: mine & own.valid | sampled.valid,
                };
                radiance = Vec3::select(mine, emitted, radiance);
            }
        }
        if self.table.area.len() < self.count() {
            self.sample_others(p, chosen, [u, v], &mut sampled, &mut radiance);
        }
        sampled.pdf = sampled.pdf * (importance / total.larger(T::splat(f32::MIN_POSITIVE)));
        sampled.valid = sampled.valid & sampled.pdf.gt(zero) & sampled.pdf.lt(T::splat(f32::INFINITY));
        (sampled, radiance)
    }

    /// Samples emissive bodies and distant lights in the lanes that chose one.
    #[inline(never)]
    fn sample_others<T: Real>(
        &self,
        p: Vec3<T>,
        chosen: T::Int,
        [u, v]: [T; 2],
        sampled: &mut LightSample<T>,
        radiance: &mut Rgb<T>,
    ) {
        let (p, u, v, mut choice) = (Lanes::of(p), lanes(u), lanes(v), [0_u32; 8]);
        chosen.store(&mut choice);
        let (mut directions, mut distances, mut pdfs, mut valid) =
            (Lanes::of(sampled.direction), lanes(sampled.distance), lanes(sampled.pdf), [0.0_f32; 8]);
        let mut light = Lanes::of(*radiance);
        for lane in 0..T::WIDTH {
            let Some(number) = (choice[lane] as usize).checked_sub(self.table.area.len()) else { continue };
            let uv = [u[lane], v[lane]];
            if let Some(emitter) = self.emitters.get(number) {
                let point = emitter.sample(uv);
                let to = point.position - p.get(lane);
                let distance = to.length();
                let direction = to.normalized_or(Vec3::ZERO);
                let cos = direction.dot(point.normal).abs();
                if cos > 1e-6 && distance > 0.0 {
                    directions.set(lane, direction);
                    (distances[lane], pdfs[lane], valid[lane]) =
                        (distance, point.density * distance * distance / cos, 1.0);
                    let EmitterPoint { primitive, u, v, position, .. } = point;
                    let on_body = SurfacePoint { instance: emitter.instance, primitive, u, v };
                    let emission = self.scene.map_or(Rgb::ZERO, |scene| scene.emission(&on_body, position));
                    light.set(lane, emission);
                }
            } else if let Some(distant) = self.table.distant.get(number.wrapping_sub(self.emitters.len())) {
                let (direction, pdf) = distant.sample(uv);
                directions.set(lane, direction);
                (distances[lane], pdfs[lane], valid[lane]) = (f32::INFINITY, pdf, 1.0);
                light.set(lane, distant.radiance(direction).0);
            }
        }
        *sampled = LightSample {
            direction: directions.load(),
            distance: T::load(&distances),
            pdf: T::load(&pdfs),
            valid: sampled.valid | T::load(&valid).gt(T::splat(0.5)),
        };
        *radiance = light.load();
    }

    /// Radiance of a window in some lanes, at a distance along a direction from `p`.
    #[inline(never)]
    fn window_radiance<T: Real>(
        &self,
        rect: &RectLight,
        p: Vec3<T>,
        direction: Vec3<T>,
        distance: T,
        mut lanes_left: u32,
    ) -> Rgb<T> {
        let (points, directions, mut out) =
            (Lanes::of(p + direction * distance), Lanes::of(direction), Lanes([[0.0; 8]; 3]));
        let pattern = &self.table.windows[rect.window as usize];
        while lanes_left != 0 {
            let lane = lanes_left.trailing_zeros() as usize & 7;
            lanes_left &= lanes_left - 1;
            out.set(lane, pattern.radiance(rect, points.get(lane), directions.get(lane)));
        }
        out.load()
    }

    /// Density with which [`Self::sample`] finds the direction of a hit on a shape. Returns the light's radiance, too.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, direction: Vec3<T>, hit: &LightHit<T>) -> (T, Rgb<T>) {
        let zero = T::splat(0.0);
        let (mut total, mut pdf, mut radiance) = (zero, zero, Vec3::all(zero));
        for index in 0..self.count() {
            let mine = hit.is_hit & hit.index.equals(T::Int::splat(index as u32));
            let own = self.importance(index, p, n);
            total = total + own;
            if let Some(light) = self.table.area.get(index)
                && mine.any()
            {
                let shape = Shape(light);
                pdf = T::select(mine, own * shape.pdf(p, hit.distance), pdf);
                let emitted = match light {
                    AreaLight::Rect(rect) if rect.window != NO_WINDOW => {
                        self.window_radiance(rect, p, direction, hit.distance, mine.to_bits())
                    }
                    _ => Vec3::broadcast(light.radiance()),
                };
                radiance = Vec3::select(mine, emitted, radiance);
            }
        }
        (pdf * inverse(total.larger(T::splat(f32::MIN_POSITIVE))), radiance)
    }

    /// Density with which [`Self::sample`] finds a point of an emissive body, at a distance from `p` with normal `n`;
    /// `cos` is the cosine between the ray and the triangle's normal.
    pub fn body_pdf(&self, p: Vec3, n: Vec3, point: &SurfacePoint, distance: f32, cos: f32) -> f32 {
        let Some(number) = self.emitters.iter().position(|emitter| emitter.instance == point.instance) else {
            return 0.0;
        };
        let probability = self.selection_probability(p, n, self.table.area.len() + number);
        probability * self.emitters[number].density(point.primitive) * distance * distance / cos.abs().max(1e-6)
    }

    /// Radiance of distant lights along a direction that hits nothing, each times a weight of its density of being
    /// sampled at `p` with normal `n`.
    pub fn distant(&self, p: Vec3, n: Vec3, direction: Vec3, weight: impl Fn(f32) -> f32) -> Rgb {
        let first = self.table.area.len() + self.emitters.len();
        self.table.distant.iter().enumerate().fold(Rgb::ZERO, |sum, (number, distant)| {
            let (radiance, pdf) = distant.radiance(direction);
            if radiance.is_black() {
                return sum;
            }
            sum + radiance * weight(pdf * self.selection_probability(p, n, first + number))
        })
    }

    /// Probability of selecting a light.
    fn selection_probability(&self, p: Vec3, n: Vec3, light: usize) -> f32 {
        let total: f32 = (0..self.count()).map(|index| self.importance::<f32>(index, p, n)).sum();
        self.importance::<f32>(light, p, n) / total.max(f32::MIN_POSITIVE)
    }

    /// The first light that a ray with a unit direction hits closer than `to`.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>, to: T) -> LightHit<T> {
        let mut first = LightHit { is_hit: T::Mask::splat(false), distance: to, index: T::Int::splat(u32::MAX) };
        for (index, light) in self.table.area.iter().enumerate() {
            let shape = Shape(light);
            let distance = shape.intersect(origin, direction);
            let nearer = distance.lt(first.distance);
            first = LightHit {
                is_hit: first.is_hit | nearer,
                distance: T::select(nearer, distance, first.distance),
                index: T::Int::select(nearer, T::Int::splat(index as u32), first.index),
            };
        }
        first
    }

    /// Whether a light occludes a target at distance `to`. The target may be a light itself.
    #[inline(always)]
    pub fn occlude<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>, to: T) -> T::Mask {
        if !self.table.area.is_empty() && self.count() > 1 {
            self.intersect(origin, direction, to * (1.0_f32 - TOUCHING)).is_hit
        } else {
            T::Mask::splat(false)
        }
    }
}

impl Shape<'_> {
    /// An upper estimate of the irradiance at a point with unit normal `n`, unshadowed, up to a factor.
    #[inline(always)]
    pub fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        match self.0 {
            AreaLight::Sphere(sphere) => Sphere(sphere).importance(p, n),
            AreaLight::Rect(rect) => Rect(rect).importance(p, n),
            AreaLight::Disk(disk) => Disk(disk).importance(p, n),
        }
    }

    /// Samples a direction from a point.
    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, uv: [T; 2]) -> LightSample<T> {
        match self.0 {
            AreaLight::Sphere(sphere) => Sphere(sphere).sample(p, uv),
            AreaLight::Rect(rect) => Rect(rect).sample(p, uv),
            AreaLight::Disk(disk) => Disk(disk).sample(p, uv),
        }
    }

    /// Density of [`Self::sample`] for a direction that hits the light at a distance.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, distance: T) -> T {
        match self.0 {
            AreaLight::Sphere(sphere) => Sphere(sphere).pdf(p),
            AreaLight::Rect(rect) => Rect(rect).pdf(p, distance),
            AreaLight::Disk(disk) => Disk(disk).pdf(p, distance),
        }
    }

    /// Distance to the lit surface; infinite if the ray misses it.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        match self.0 {
            AreaLight::Sphere(sphere) => Sphere(sphere).intersect(origin, direction),
            AreaLight::Rect(rect) => Rect(rect).intersect(origin, direction),
            AreaLight::Disk(disk) => Disk(disk).intersect(origin, direction),
        }
    }
}

/// The number of every lane.
fn lanes<T: Real>(x: T) -> [f32; 8] {
    let mut lanes = [0.0; 8];
    x.store(&mut lanes);
    lanes
}

/// The vector of every lane.
struct Lanes([[f32; 8]; 3]);

impl Lanes {
    #[inline(always)]
    fn of<T: Real>(v: Vec3<T>) -> Self {
        Self([lanes(v.x), lanes(v.y), lanes(v.z)])
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Vec3 {
        Vec3::from(self.0.map(|row| row[lane]))
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, v: Vec3) {
        let [x, y, z] = &mut self.0;
        (x[lane], y[lane], z[lane]) = (v.x, v.y, v.z);
    }

    #[inline(always)]
    fn load<T: Real>(&self) -> Vec3<T> {
        let [x, y, z] = &self.0;
        Vec3 { x: T::load(x), y: T::load(y), z: T::load(z) }
    }
}
