//! The lights of a view: choosing one, sampling it, meeting it.
//!
//! Lights are opaque where they shine: a path that meets one ends there, and a light hides what is behind it. The back
//! of a rectangle is not there at all.

mod rect;
mod sphere;
#[cfg(test)]
mod tests;

use crate::real::{Int as _, Mask, Real, inverse};
use crate::vec3::{Rgb, Vec3};
use rect::Rect;
use sphere::Sphere;
use syntable_model::error::{Error, Result};
use syntable_model::scene;

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
}

/// All lights of a view.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights(Vec<Shape>);

impl Lights {
    /// Checks and converts; lights without radiance are left out.
    pub fn new(lights: &[scene::Light]) -> Result<Self> {
        let mut shapes = Vec::new();
        for (number, light) in lights.iter().enumerate() {
            let name = |what: String| Error::new(format!("light {number}: {what}"));
            let (shape, radiance) = match light {
                scene::Light::Sphere(sphere) => {
                    if !(sphere.radius > 0.0 && sphere.radius.is_finite() && finite(sphere.centre.coords.as_ref())) {
                        return Err(name(format!("a sphere at {} of radius {} m", sphere.centre, sphere.radius))
                            .help("give it a finite place and a radius above 0"));
                    }
                    let (centre, radius) = (vector(sphere.centre.coords.as_ref()), sphere.radius as f32);
                    (
                        Shape::Sphere(Sphere {
                            centre,
                            radius,
                            radiance: color(sphere.radiance),
                            luminance: color(sphere.radiance).luminance(),
                        }),
                        sphere.radiance,
                    )
                }
                scene::Light::Rect(rect) => {
                    let (u, v) = (rect.half_u.norm(), rect.half_v.norm());
                    let upright = rect.half_u.dot(&rect.half_v).abs() <= 1e-4 * u * v;
                    if !(u > 0.0 && v > 0.0 && upright && (u + v).is_finite() && finite(rect.centre.coords.as_ref())) {
                        return Err(name(format!(
                            "a rectangle with half edges {:?} and {:?}",
                            rect.half_u, rect.half_v
                        ))
                        .help("give it two edges at right angles, neither of length 0"));
                    }
                    let shape = Rect {
                        centre: vector(rect.centre.coords.as_ref()),
                        x: vector((rect.half_u / u).as_ref()),
                        y: vector((rect.half_v / v).as_ref()),
                        normal: vector(rect.normal().as_ref()),
                        half: [u as f32, v as f32],
                        radiance: color(rect.radiance),
                        luminance: color(rect.radiance).luminance(),
                    };
                    (Shape::Rect(shape), rect.radiance)
                }
                other => return Err(name(format!("{other:?} is not rendered"))),
            };
            if !radiance.iter().all(|&x| x >= 0.0 && (x as f32).is_finite()) {
                return Err(
                    name(format!("a radiance of {radiance:?} nits")).help("radiance is finite and not negative")
                );
            }
            if radiance != [0.0; 3] {
                shapes.push(shape);
            }
        }
        Ok(Self(shapes))
    }

    /// Samples a light for a point with unit normal `n`, in proportion to what it could give there unshadowed. Also
    /// gives the light's radiance.
    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, [mut u, v]: [T; 2]) -> (Towards<T>, Rgb<T>) {
        let zero = T::splat(0.0);
        let (mut total, mut importance, mut chosen) = (zero, zero, T::Int::splat(u32::MAX));
        if let [_] = self.0[..] {
            (total, importance, chosen) = (T::splat(1.0), T::splat(1.0), T::Int::splat(0));
        } else {
            for (index, shape) in self.0.iter().enumerate() {
                // One pass: the newcomer takes over with its share of the total so far, and `u` stays uniform.
                let own = shape.importance(p, n);
                let shines = own.gt(zero);
                total = total + own;
                let share = own / total;
                let taken = shines & u.lt(share);
                let rescaled = T::pick(taken, u / share, (u - share) / (T::splat(1.0) - share));
                u = T::pick(shines, rescaled, u);
                importance = T::pick(taken, own, importance);
                chosen = T::Int::pick(taken, T::Int::splat(index as u32), chosen);
            }
            u = u.smaller(T::splat(1.0 - f32::EPSILON));
        }
        let mut sampled = Towards { direction: n, distance: zero, pdf: T::splat(1.0), valid: T::Mask::splat(false) };
        let mut radiance = Vec3::all(zero);
        for (index, shape) in self.0.iter().enumerate() {
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
        sampled.pdf = sampled.pdf * (importance / total.larger(T::splat(f32::MIN_POSITIVE)));
        sampled.valid = sampled.valid & sampled.pdf.gt(zero) & sampled.pdf.lt(T::splat(f32::INFINITY));
        (sampled, radiance)
    }

    /// Density with which [`Self::sample`] finds the direction of a hit. Also gives the light's radiance.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, n: Vec3<T>, hit: &LightHit<T>) -> (T, Rgb<T>) {
        let zero = T::splat(0.0);
        let (mut total, mut pdf, mut radiance) = (zero, zero, Vec3::all(zero));
        for (index, shape) in self.0.iter().enumerate() {
            let mine = hit.met & hit.index.equals(T::Int::splat(index as u32));
            let own = if self.0.len() == 1 { T::splat(1.0) } else { shape.importance(p, n) };
            total = total + own;
            if mine.any() {
                pdf = T::pick(mine, own * shape.pdf(p, hit.distance), pdf);
                radiance = Vec3::pick(mine, Vec3::broadcast(shape.radiance()), radiance);
            }
        }
        (pdf * inverse(total.larger(T::splat(f32::MIN_POSITIVE))), radiance)
    }

    /// The first light that a ray with a unit direction meets closer than `to`.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>, to: T) -> LightHit<T> {
        let mut first = LightHit { met: T::Mask::splat(false), distance: to, index: T::Int::splat(u32::MAX) };
        for (index, shape) in self.0.iter().enumerate() {
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
        if self.0.len() > 1 {
            self.intersect(origin, direction, to * (1.0_f32 - 1e-4)).met
        } else {
            T::Mask::splat(false)
        }
    }

    /// Whether there is no light.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Shape {
    #[inline(always)]
    fn radiance(&self) -> Rgb {
        match self {
            Self::Sphere(sphere) => sphere.radiance,
            Self::Rect(rect) => rect.radiance,
        }
    }

    #[inline(always)]
    fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        match self {
            Self::Sphere(sphere) => sphere.importance(p, n),
            Self::Rect(rect) => rect.importance(p, n),
        }
    }

    #[inline(always)]
    fn sample<T: Real>(&self, p: Vec3<T>, uv: [T; 2]) -> Towards<T> {
        match self {
            Self::Sphere(sphere) => sphere.sample(p, uv),
            Self::Rect(rect) => rect.sample(p, uv),
        }
    }

    #[inline(always)]
    fn pdf<T: Real>(&self, p: Vec3<T>, distance: T) -> T {
        match self {
            Self::Sphere(sphere) => sphere.pdf(p),
            Self::Rect(rect) => rect.pdf(p, distance),
        }
    }

    /// Distance to the lit surface; infinite if the ray misses it.
    #[inline(always)]
    fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        match self {
            Self::Sphere(sphere) => sphere.intersect(origin, direction),
            Self::Rect(rect) => rect.intersect(origin, direction),
        }
    }
}

fn finite(x: &[f64; 3]) -> bool {
    x.iter().all(|&x| (x as f32).is_finite())
}

fn vector(x: &[f64; 3]) -> Vec3 {
    Vec3::from(x.map(|x| x as f32))
}

fn color(x: [f64; 3]) -> Rgb {
    Rgb::from(x.map(|x| x as f32))
}
