//! The lights of a view: choosing one, sampling it, meeting it.
//!
//! Lights are of three sorts. Shapes are opaque where they shine: a path that meets one ends there, and it hides what is
//! behind it; the back of a rectangle or disk is not there at all. Bodies that glow are met as bodies. Distant lights
//! are met by what meets nothing else.
//!
//! A light is chosen in proportion to what it could give at the point unshadowed.

mod convert;
mod disk;
mod distant;
mod emitter;
mod rect;
mod sky;
mod sphere;
#[cfg(test)]
mod tests;

pub(crate) use emitter::{Emitter, Glowing};
pub(crate) use sky::Sky;

use crate::bvh::Hit;
use crate::real::{Int as _, Mask, Real, inverse};
use crate::vec3::{Rgb, Vec3};
use crate::world::World;
use disk::Disk;
use distant::Distant;
use rect::Rect;
use sphere::Sphere;

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Towards<T: Real> {
    /// Unit length.
    pub direction: Vec3<T>,
    /// To the light's surface, metres.
    pub distance: T,
    /// Density per steradian.
    pub pdf: T,
    /// Whether there is such a direction.
    pub valid: T::Mask,
}

/// Where a ray meets a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightHit<T: Real> {
    /// Whether it does.
    pub met: T::Mask,
    /// Metres.
    pub distance: T,
    /// Number of the light.
    index: T::Int,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Sphere(Sphere),
    Rect(Rect),
    Disk(Disk),
}

/// All lights of a view.
#[derive(Default)]
pub(crate) struct Lights<'a> {
    shapes: Vec<Shape>,
    distant: Vec<Distant>,
    emitters: &'a [Emitter],
    /// For what a glowing body emits at a point.
    world: Option<&'a World>,
}

impl Lights<'_> {
    /// Number of lights.
    #[inline(always)]
    fn count(&self) -> usize {
        self.shapes.len() + self.emitters.len() + self.distant.len()
    }

    /// Whether there is no light.
    pub fn is_empty(&self) -> bool {
        self.count() == 0
    }

    /// Whether what meets nothing may find light.
    #[inline(always)]
    pub fn has_distant(&self) -> bool {
        !self.distant.is_empty()
    }

    /// Importance of a light; the only light's is one. (No closures here or where this is called: they would not be
    /// compiled for the processor's lanes.)
    #[inline(always)]
    fn importance<T: Real>(&self, light: usize, p: Vec3<T>, n: Vec3<T>) -> T {
        if self.count() == 1 {
            return T::splat(1.0);
        }
        if let Some(shape) = self.shapes.get(light) {
            return shape.importance(p, n);
        }
        let (p, n) = (Lanes::of(p), Lanes::of(n));
        let mut out = [0.0; 8];
        self.importance_by_lane(light - self.shapes.len(), &p, &n, &mut out[..T::WIDTH]);
        T::load(&out)
    }

    /// Importance of a light that is no shape; they count from 0.
    #[inline(never)]
    fn importance_by_lane(&self, light: usize, p: &Lanes, n: &Lanes, out: &mut [f32]) {
        for (lane, out) in out.iter_mut().enumerate() {
            *out = match self.emitters.get(light) {
                Some(emitter) => emitter.importance(p.get(lane), n.get(lane)),
                None => self.distant[light - self.emitters.len()].importance(n.get(lane)),
            };
        }
    }

    /// Samples a light for a point with unit normal `n`, in proportion to what it could give there unshadowed. Also
    /// gives the light's radiance.
    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, [mut u, v]: [T; 2]) -> (Towards<T>, Rgb<T>) {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let (mut total, mut importance, mut chosen) = (zero, zero, T::Int::splat(u32::MAX));
        if self.count() == 1 {
            (total, importance, chosen) = (one, one, T::Int::splat(0));
        } else {
            for index in 0..self.count() {
                let own = self.importance(index, p, n);
                // One pass: the newcomer takes over with its share of the total so far, and `u` stays uniform.
                let shines = own.gt(zero);
                total = total + own;
                let share = own / total;
                let taken = shines & u.lt(share);
                let rescaled = T::pick(taken, u / share, (u - share) / (one - share));
                u = T::pick(shines, rescaled, u);
                importance = T::pick(taken, own, importance);
                chosen = T::Int::pick(taken, T::Int::splat(index as u32), chosen);
            }
            u = u.smaller(T::splat(1.0 - f32::EPSILON));
        }
        let mut sampled = Towards { direction: n, distance: zero, pdf: one, valid: T::Mask::splat(false) };
        let mut radiance = Vec3::all(zero);
        for (index, shape) in self.shapes.iter().enumerate() {
            let mine = chosen.equals(T::Int::splat(index as u32));
            if mine.any() {
                let own = shape.sample(p, [u, v]);
                sampled = Towards {
                    direction: Vec3::pick(mine, own.direction, sampled.direction),
                    distance: T::pick(mine, own.distance, sampled.distance),
                    pdf: T::pick(mine, own.pdf, sampled.pdf),
                    valid: mine & own.valid | sampled.valid,
                };
                radiance = Vec3::pick(mine, Vec3::broadcast(shape.radiance()), radiance);
            }
        }
        if self.shapes.len() < self.count() {
            self.sample_others(p, chosen, [u, v], &mut sampled, &mut radiance);
        }
        sampled.pdf = sampled.pdf * (importance / total.larger(T::splat(f32::MIN_POSITIVE)));
        sampled.valid = sampled.valid & sampled.pdf.gt(zero) & sampled.pdf.lt(T::splat(f32::INFINITY));
        (sampled, radiance)
    }

    /// Samples glowing bodies and distant lights in the lanes that chose one.
    #[inline(never)]
    fn sample_others<T: Real>(
        &self,
        p: Vec3<T>,
        chosen: T::Int,
        [u, v]: [T; 2],
        sampled: &mut Towards<T>,
        radiance: &mut Rgb<T>,
    ) {
        let (p, u, v, mut choice) = (Lanes::of(p), lanes(u), lanes(v), [0_u32; 8]);
        chosen.store(&mut choice);
        let (mut directions, mut distances, mut pdfs, mut valid) =
            (Lanes::of(sampled.direction), lanes(sampled.distance), lanes(sampled.pdf), [0.0_f32; 8]);
        let mut light = Lanes::of(*radiance);
        for lane in 0..T::WIDTH {
            let Some(number) = (choice[lane] as usize).checked_sub(self.shapes.len()) else { continue };
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
                    let hit = Hit {
                        t: distance,
                        u: point.u,
                        v: point.v,
                        primitive: point.primitive,
                        instance: emitter.instance,
                    };
                    light.set(lane, self.world.map_or(Rgb::ZERO, |world| world.emission(&hit, point.position)));
                }
            } else if let Some(distant) = self.distant.get(number.wrapping_sub(self.emitters.len())) {
                let (direction, pdf) = distant.sample(uv);
                directions.set(lane, direction);
                (distances[lane], pdfs[lane], valid[lane]) = (f32::INFINITY, pdf, 1.0);
                light.set(lane, distant.seen(direction).0);
            }
        }
        *sampled = Towards {
            direction: directions.load(),
            distance: T::load(&distances),
            pdf: T::load(&pdfs),
            valid: sampled.valid | T::load(&valid).gt(T::splat(0.5)),
        };
        *radiance = light.load();
    }

    /// Density with which [`Self::sample`] finds the direction of a hit on a shape. Also gives the light's radiance.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, hit: &LightHit<T>) -> (T, Rgb<T>) {
        let zero = T::splat(0.0);
        let (mut total, mut pdf, mut radiance) = (zero, zero, Vec3::all(zero));
        for index in 0..self.count() {
            let mine = hit.met & hit.index.equals(T::Int::splat(index as u32));
            let own = self.importance(index, p, n);
            total = total + own;
            if let Some(shape) = self.shapes.get(index)
                && mine.any()
            {
                pdf = T::pick(mine, own * shape.pdf(p, hit.distance), pdf);
                radiance = Vec3::pick(mine, Vec3::broadcast(shape.radiance()), radiance);
            }
        }
        (pdf * inverse(total.larger(T::splat(f32::MIN_POSITIVE))), radiance)
    }

    /// Density with which [`Self::sample`] finds a point of a body that glows, from `p` with normal `n`; `cos` is that of
    /// the ray with the triangle's normal.
    pub fn body_pdf(&self, p: Vec3, n: Vec3, hit: &Hit, cos: f32) -> f32 {
        let Some(number) = self.emitters.iter().position(|emitter| emitter.instance == hit.instance) else {
            return 0.0;
        };
        let share = self.share(p, n, self.shapes.len() + number);
        share * self.emitters[number].density(hit.primitive) * hit.t * hit.t / cos.abs().max(1e-6)
    }

    /// Light from distant lights along a direction that meets nothing, each times a weight of its density of being
    /// sampled at `p` with normal `n`.
    pub fn distant(&self, p: Vec3, n: Vec3, direction: Vec3, weight: impl Fn(f32) -> f32) -> Rgb {
        let first = self.shapes.len() + self.emitters.len();
        self.distant.iter().enumerate().fold(Rgb::ZERO, |sum, (number, distant)| {
            let (radiance, pdf) = distant.seen(direction);
            if radiance.is_black() {
                return sum;
            }
            sum + radiance * weight(pdf * self.share(p, n, first + number))
        })
    }

    /// Probability of choosing a light.
    fn share(&self, p: Vec3, n: Vec3, light: usize) -> f32 {
        let total: f32 = (0..self.count()).map(|index| self.importance::<f32>(index, p, n)).sum();
        self.importance::<f32>(light, p, n) / total.max(f32::MIN_POSITIVE)
    }

    /// The first light that a ray with a unit direction meets closer than `to`.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>, to: T) -> LightHit<T> {
        let mut first = LightHit { met: T::Mask::splat(false), distance: to, index: T::Int::splat(u32::MAX) };
        for (index, shape) in self.shapes.iter().enumerate() {
            let distance = shape.intersect(origin, direction);
            let nearer = distance.lt(first.distance);
            first = LightHit {
                met: first.met | nearer,
                distance: T::pick(nearer, distance, first.distance),
                index: T::Int::pick(nearer, T::Int::splat(index as u32), first.index),
            };
        }
        first
    }

    /// Whether a light hides what lies at distance `to`, which may be a light itself.
    #[inline(always)]
    pub fn hide<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>, to: T) -> T::Mask {
        if !self.shapes.is_empty() && self.count() > 1 {
            self.intersect(origin, direction, to * (1.0_f32 - 1e-4)).met
        } else {
            T::Mask::splat(false)
        }
    }
}

impl Shape {
    #[inline(always)]
    fn radiance(&self) -> Rgb {
        match self {
            Self::Sphere(sphere) => sphere.radiance,
            Self::Rect(rect) => rect.radiance,
            Self::Disk(disk) => disk.radiance,
        }
    }

    #[inline(always)]
    fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        match self {
            Self::Sphere(sphere) => sphere.importance(p, n),
            Self::Rect(rect) => rect.importance(p, n),
            Self::Disk(disk) => disk.importance(p, n),
        }
    }

    #[inline(always)]
    fn sample<T: Real>(&self, p: Vec3<T>, uv: [T; 2]) -> Towards<T> {
        match self {
            Self::Sphere(sphere) => sphere.sample(p, uv),
            Self::Rect(rect) => rect.sample(p, uv),
            Self::Disk(disk) => disk.sample(p, uv),
        }
    }

    #[inline(always)]
    fn pdf<T: Real>(&self, p: Vec3<T>, distance: T) -> T {
        match self {
            Self::Sphere(sphere) => sphere.pdf(p),
            Self::Rect(rect) => rect.pdf(p, distance),
            Self::Disk(disk) => disk.pdf(p, distance),
        }
    }

    /// Distance to the lit surface; infinite if the ray misses it.
    #[inline(always)]
    fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        match self {
            Self::Sphere(sphere) => sphere.intersect(origin, direction),
            Self::Rect(rect) => rect.intersect(origin, direction),
            Self::Disk(disk) => disk.intersect(origin, direction),
        }
    }
}

/// A number of every lane.
fn lanes<T: Real>(x: T) -> [f32; 8] {
    let mut lanes = [0.0; 8];
    x.store(&mut lanes);
    lanes
}

/// A vector of every lane.
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
