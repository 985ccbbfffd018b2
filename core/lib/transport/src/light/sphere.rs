//! Sphere lights, sampled uniformly in the cone they fill.

use super::LightSample;
use std::f32::consts::{PI, TAU};
use std::ops::Deref;
use syntable_prepare::SphereLight;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Basis, Vec3, vec3};
use syntable_simd::{Mask, Real, at_least, at_most, complement, inverse};

/// A sphere light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere<'a>(pub &'a SphereLight);

impl Deref for Sphere<'_> {
    type Target = SphereLight;

    #[inline(always)]
    fn deref(&self) -> &SphereLight {
        self.0
    }
}

/// Cone of directions from a point to a sphere.
struct Cone<T: Real> {
    /// Unit vector to the center.
    axis: Vec3<T>,
    distance2: T,
    distance: T,
    /// 1 − cos of the half angle; 2 if the point is inside.
    height: T,
    inside: T::Mask,
}

impl Sphere<'_> {
    #[inline(always)]
    fn cone<T: Real>(&self, p: Vec3<T>) -> Cone<T> {
        let to_center = Vec3::broadcast(self.center) - p;
        let distance2 = to_center.dot(to_center);
        let r2 = self.radius * self.radius;
        let inside = distance2.le(T::splat(r2 * 1.0001));
        let distance = distance2.sqrt();
        let axis = to_center * inverse(at_least(distance, 1e-20));
        let sin2 = T::splat(r2) / at_least(distance2, 1e-30);
        let cos = at_least(complement(sin2), 0.0).sqrt();
        let height = T::select(inside, T::splat(2.0), sin2 / (cos + 1.0_f32));
        let axis = Vec3::select(inside, Vec3::broadcast(vec3(0.0, 0.0, 1.0)), axis);
        Cone { axis, distance2, distance, height, inside }
    }

    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, [u, v]: [T; 2]) -> LightSample<T> {
        let cone = self.cone(p);
        let t = u * cone.height;
        let cos = complement(t);
        let sin2 = at_least(t * (T::splat(2.0) - t), 0.0);
        let (s, c) = sin_cos_turns(v);
        let sin = sin2.sqrt();
        let direction = Basis::around(cone.axis).to_world(vec3(sin * c, sin * s, cos));
        let half2 = at_least(T::splat(self.radius * self.radius) - cone.distance2 * sin2, 0.0);
        let mut distance = cone.distance * cos - half2.sqrt();
        if cone.inside.any() {
            distance = T::select(cone.inside, self.intersect(p, direction), distance);
        }
        LightSample { direction, distance, pdf: inverse(cone.height * TAU), valid: T::Mask::splat(true) }
    }

    /// Density of [`Self::sample`] for any direction that hits the sphere.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>) -> T {
        inverse(self.cone(p).height * TAU)
    }

    /// Distance to the surface, from outside or from inside; infinite without a hit.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        let to_center = Vec3::broadcast(self.center) - origin;
        let along = to_center.dot(direction);
        let across = to_center - direction * along;
        let half2 = T::splat(self.radius * self.radius) - across.dot(across);
        let half = at_least(half2, 0.0).sqrt();
        let (near, far) = (along - half, along + half);
        let zero = T::splat(0.0);
        let t = T::select(near.gt(zero), near, far);
        T::select(half2.ge(zero) & t.gt(zero), t, T::splat(f32::INFINITY))
    }

    /// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
    #[inline(always)]
    pub fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        let to_center = Vec3::broadcast(self.center) - p;
        let distance2 = to_center.dot(to_center);
        let r2 = self.radius * self.radius;
        let per_distance = inverse(at_least(distance2, 1e-30).sqrt());
        let sin = at_most(per_distance * self.radius, 1.0);
        // The part above the horizon of a ball whose center is at this height over its distance.
        let cosine = at_least(at_most(n.dot(to_center) * per_distance + sin, 1.0), 0.0);
        let full = T::splat(PI * self.luminance);
        T::select(distance2.le(T::splat(r2 * 1.0001)), full, sin * sin * cosine * full)
    }
}
