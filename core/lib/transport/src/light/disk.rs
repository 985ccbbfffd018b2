//! Disk lights, sampled by area.

use super::LightSample;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::Deref;
use syntable_prepare::DiskLight;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Basis, Vec3, vec3};
use syntable_simd::{Real, at_least, at_most, inverse};

/// A disk light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disk<'a>(pub &'a DiskLight);

impl Deref for Disk<'_> {
    type Target = DiskLight;

    #[inline(always)]
    fn deref(&self) -> &DiskLight {
        self.0
    }
}

impl Disk<'_> {
    fn area(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Height of a point over the emitting side.
    #[inline(always)]
    fn height<T: Real>(&self, p: Vec3<T>) -> T {
        (p - Vec3::broadcast(self.center)).dot(Vec3::broadcast(self.normal))
    }

    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, [u, v]: [T; 2]) -> LightSample<T> {
        let (sin, cos) = sin_cos_turns(v);
        let r = u.sqrt() * self.radius;
        let basis = Basis::around(Vec3::<T>::broadcast(self.normal));
        let to = Vec3::broadcast(self.center) + basis.to_world(vec3(r * cos, r * sin, T::splat(0.0))) - p;
        let distance = to.length();
        let direction = to * inverse(at_least(distance, 1e-20));
        LightSample { direction, distance, pdf: self.pdf(p, distance), valid: self.height(p).gt(T::splat(0.0)) }
    }

    /// Density of [`Self::sample`] for a direction that hits the emitting side at a distance.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, distance: T) -> T {
        let height = self.height(p);
        let pdf = distance * distance * distance / at_least(height * self.area(), 1e-30);
        T::select(height.gt(T::splat(0.0)), pdf, T::splat(0.0))
    }

    /// Distance to the emitting side; infinite if the ray misses it.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        let falling = -direction.dot(Vec3::broadcast(self.normal));
        let height = self.height(origin);
        let t = height / falling;
        let at = origin + direction * t - Vec3::broadcast(self.center);
        let zero = T::splat(0.0);
        let inside = at.dot(at).le(T::splat(self.radius * self.radius));
        T::select(falling.gt(zero) & height.gt(zero) & inside, t, T::splat(f32::INFINITY))
    }

    /// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
    #[inline(always)]
    pub fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        let to = Vec3::broadcast(self.center) - p;
        let height = self.height(p);
        let distance2 = at_least(to.dot(to), 1e-20);
        let per_distance = inverse(distance2.sqrt());
        let cosine = at_least(at_most((n.dot(to) + self.radius) * per_distance, 1.0), 0.0);
        let form_factor = at_most(height * (self.area() * FRAC_1_PI) * per_distance / distance2, 1.0);
        at_least(form_factor, 0.0) * cosine * (PI * self.luminance)
    }
}
