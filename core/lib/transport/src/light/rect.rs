//! Rectangle lights: near ones are sampled uniformly in solid angle (Ureña, Fajardo and King, EGSR 2013), far ones by
//! area.

use super::LightSample;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::Deref;
use syntable_prepare::RectLight;
use syntable_simd::functions::{acos, sin_cos_turns};
use syntable_simd::{Mask as _, Real, at_least, at_most, complement, inverse, max, min};
use syntable_simd::{Vec3, vec3};

/// A rectangle light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect<'a>(pub &'a RectLight);

impl Deref for Rect<'_> {
    type Target = RectLight;

    #[inline(always)]
    fn deref(&self) -> &RectLight {
        self.0
    }
}

/// From this squared distance, in squared diagonals, the rectangle is sampled by area: its solid angle is then small
/// and its density in solid angle nearly even, while the spherical construction loses digits.
const FAR: f32 = 6.0;

/// The rectangle seen from a point, projected on the unit sphere around it.
struct Spherical<T> {
    x: [T; 2],
    y: [T; 2],
    /// Negative: minus the distance to the plane.
    z: T,
    b0: T,
    b1: T,
    k: T,
    solid_angle: T,
}

impl Rect<'_> {
    /// Coordinates of `p - center` along the edges, and its height over the emitting side.
    #[inline(always)]
    fn local<T: Real>(&self, p: Vec3<T>) -> Vec3<T> {
        let d = p - Vec3::broadcast(self.center);
        vec3(d.dot(Vec3::broadcast(self.x)), d.dot(Vec3::broadcast(self.y)), d.dot(Vec3::broadcast(self.normal)))
    }

    #[inline(always)]
    fn is_far<T: Real>(&self, local: Vec3<T>) -> T::Mask {
        let [a, b] = self.half;
        local.dot(local).gt(T::splat(FAR * 4.0 * (a * a + b * b)))
    }

    #[inline(always)]
    fn area(&self) -> f32 {
        4.0 * self.half[0] * self.half[1]
    }

    #[inline(always)]
    fn spherical<T: Real>(&self, local: Vec3<T>) -> Spherical<T> {
        let [a, b] = self.half;
        let x = [-local.x - a, -local.x + a];
        let y = [-local.y - b, -local.y + b];
        let z = -local.z;
        // Edge planes' normals have two components each, so that the angles between them are products.
        let z2 = z * z;
        let sine = |c: T| c * inverse((z2 + c * c).sqrt());
        let (sx, sy) = ([sine(x[0]), sine(x[1])], [sine(y[0]), sine(y[1])]);
        let (g0, g1) = (acos(sy[0] * sx[1]), acos(-sx[1] * sy[1]));
        let (g2, g3) = (acos(sy[1] * sx[0]), acos(-sx[0] * sy[0]));
        let k = T::splat(2.0 * PI) - g2 - g3;
        Spherical { x, y, z, b0: -sy[0], b1: sy[1], k, solid_angle: at_least(g0 + g1 - k, 1e-6) }
    }

    #[inline(always)]
    pub fn sample<T: Real>(&self, p: Vec3<T>, [u, v]: [T; 2]) -> LightSample<T> {
        let local = self.local(p);
        let far = self.is_far(local);
        let [a, b] = self.half;
        let mut to = vec3((u * 2.0_f32 - 1.0_f32) * a - local.x, (v * 2.0_f32 - 1.0_f32) * b - local.y, -local.z);
        let mut solid_angle = T::splat(1.0);
        if (!far).any() {
            let spherical = self.spherical(local);
            to = Vec3::select(far, to, spherical.point(u, v));
            solid_angle = spherical.solid_angle;
        }
        let distance2 = to.dot(to);
        let distance = distance2.sqrt();
        let by_area = distance2 * distance / at_least(local.z * self.area(), 1e-30);
        let direction =
            Vec3::broadcast(self.x) * to.x + Vec3::broadcast(self.y) * to.y + Vec3::broadcast(self.normal) * to.z;
        LightSample {
            direction: direction * inverse(distance),
            distance,
            pdf: T::select(far, by_area, inverse(solid_angle)),
            valid: local.z.gt(T::splat(0.0)),
        }
    }

    /// Density of [`Self::sample`] for a direction that hits the emitting side at a distance.
    #[inline(always)]
    pub fn pdf<T: Real>(&self, p: Vec3<T>, distance: T) -> T {
        let local = self.local(p);
        let far = self.is_far(local);
        let mut pdf = distance * distance * distance / at_least(local.z * self.area(), 1e-30);
        if (!far).any() {
            pdf = T::select(far, pdf, inverse(self.spherical(local).solid_angle));
        }
        T::select(local.z.gt(T::splat(0.0)), pdf, T::splat(0.0))
    }

    /// Distance to the emitting side; infinite if the ray misses it.
    #[inline(always)]
    pub fn intersect<T: Real>(&self, origin: Vec3<T>, direction: Vec3<T>) -> T {
        let falling = -direction.dot(Vec3::broadcast(self.normal));
        let local = self.local(origin);
        let t = local.z / falling;
        let x = (local.x + t * direction.dot(Vec3::broadcast(self.x))).abs();
        let y = (local.y + t * direction.dot(Vec3::broadcast(self.y))).abs();
        let zero = T::splat(0.0);
        let is_hit = falling.gt(zero) & local.z.gt(zero) & x.le(T::splat(self.half[0])) & y.le(T::splat(self.half[1]));
        T::select(is_hit, t, T::splat(f32::INFINITY))
    }

    /// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
    #[inline(always)]
    pub fn importance<T: Real>(&self, p: Vec3<T>, n: Vec3<T>) -> T {
        let to = Vec3::broadcast(self.center) - p;
        let height = -to.dot(Vec3::broadcast(self.normal));
        let distance2 = at_least(to.dot(to), 1e-20);
        let [a, b] = self.half;
        let reach = (a * a + b * b).sqrt();
        let per_distance = inverse(distance2.sqrt());
        let cosine = at_least(at_most((n.dot(to) + reach) * per_distance, 1.0), 0.0);
        // Area times cosine over squared distance; close up, at most the whole hemisphere.
        let form_factor = at_most(height * (self.area() * FRAC_1_PI) * per_distance / distance2, 1.0);
        at_least(form_factor, 0.0) * cosine * (PI * self.luminance)
    }
}

impl<T: Real> Spherical<T> {
    /// A point of the rectangle, relative to the eye, in the rectangle's axes.
    #[inline(always)]
    fn point(&self, u: T, v: T) -> Vec3<T> {
        let (sin, cos) = sin_cos_turns((u * self.solid_angle + self.k) * (0.5 * FRAC_1_PI));
        let f = (cos * self.b0 - self.b1) / at_least(sin.abs(), 1e-7).copysign(sin);
        let c = at_most(inverse((f * f + self.b0 * self.b0).sqrt()), 1.0).copysign(f);
        let clamp = |x: T, [low, high]: [T; 2]| min(max(x, low), high);
        let x = clamp(-(c * self.z) / at_least(complement(c * c), 1e-12).sqrt(), self.x);
        let d2 = x * x + self.z * self.z;
        let h0 = self.y[0] / (d2 + self.y[0] * self.y[0]).sqrt();
        let h1 = self.y[1] / (d2 + self.y[1] * self.y[1]).sqrt();
        let h = h0 + v * (h1 - h0);
        let h2 = h * h;
        let y = clamp(h * (d2 / at_least(complement(h2), 1e-6)).sqrt(), self.y);
        vec3(x, T::select(h2.lt(T::splat(1.0 - 1e-6)), y, self.y[1]), self.z)
    }
}
