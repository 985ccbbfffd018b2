//! Rectangle lights: near ones sampled uniformly in solid angle (Ureña, Fajardo and King, EGSR 2013), far ones by area.

use super::Sampled;
use crate::approx::{acos, sin_cos_turns};
use crate::vec3::{Rgb, Vec3, max, min};
use std::f32::consts::{FRAC_1_PI, PI};

/// A one-sided rectangle that shines evenly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    pub centre: Vec3,
    /// Unit vectors along the edges and out of the lit side.
    pub x: Vec3,
    pub y: Vec3,
    pub normal: Vec3,
    /// Half lengths of the edges.
    pub half: [f32; 2],
    pub radiance: Rgb,
}

/// From this squared distance, in squared diagonals, the rectangle is sampled by area: its solid angle is then small
/// and its density in solid angle nearly even, while the spherical construction loses digits.
const FAR: f32 = 6.0;

/// The rectangle seen from a point, projected on the unit sphere around it.
struct Spherical {
    x0: f32,
    x1: f32,
    y0: f32,
    y1: f32,
    /// Negative: minus the distance to the plane.
    z0: f32,
    b0: f32,
    b1: f32,
    k: f32,
    solid_angle: f32,
}

impl Rect {
    /// Coordinates of `p - centre` along the edges, and its height over the lit side.
    #[inline(always)]
    fn local(&self, p: Vec3) -> Vec3 {
        let d = p - self.centre;
        Vec3 { x: d.dot(self.x), y: d.dot(self.y), z: d.dot(self.normal) }
    }

    #[inline(always)]
    fn is_far(&self, local: Vec3) -> bool {
        let [a, b] = self.half;
        local.dot(local) > FAR * 4.0 * (a * a + b * b)
    }

    #[inline(always)]
    fn area(&self) -> f32 {
        4.0 * self.half[0] * self.half[1]
    }

    #[inline(always)]
    fn spherical(&self, local: Vec3) -> Spherical {
        let [a, b] = self.half;
        let (x0, x1, y0, y1, z0) = (-a - local.x, a - local.x, -b - local.y, b - local.y, -local.z);
        // Edge planes' normals have two components each, so that the angles between them are products.
        let z2 = z0 * z0;
        let inverse = |c: f32| 1.0 / (z2 + c * c).sqrt();
        let (sy0, sx1, sy1, sx0) = (y0 * inverse(y0), x1 * inverse(x1), y1 * inverse(y1), x0 * inverse(x0));
        let (g0, g1) = (acos(sy0 * sx1), acos(-sx1 * sy1));
        let (g2, g3) = (acos(sy1 * sx0), acos(-sx0 * sy0));
        let k = 2.0 * PI - g2 - g3;
        Spherical { x0, x1, y0, y1, z0, b0: -sy0, b1: sy1, k, solid_angle: max(g0 + g1 - k, 1e-6) }
    }

    #[inline]
    pub fn sample(&self, p: Vec3, [u, v]: [f32; 2]) -> Option<Sampled> {
        let local = self.local(p);
        if local.z <= 0.0 {
            return None;
        }
        let (to, pdf) = if self.is_far(local) {
            let [a, b] = self.half;
            let to = Vec3 { x: a * (2.0 * u - 1.0) - local.x, y: b * (2.0 * v - 1.0) - local.y, z: -local.z };
            let d2 = to.dot(to);
            (to, d2 * d2.sqrt() / (local.z * self.area()))
        } else {
            let s = self.spherical(local);
            (s.point(u, v), 1.0 / s.solid_angle)
        };
        let distance = to.length();
        let direction = (self.x * to.x + self.y * to.y + self.normal * to.z) * (1.0 / distance);
        Some(Sampled { direction, distance, pdf, radiance: self.radiance })
    }

    /// Density of [`Self::sample`] for a direction that meets the lit side at a distance.
    #[inline]
    pub fn pdf(&self, p: Vec3, distance: f32) -> f32 {
        let local = self.local(p);
        if local.z <= 0.0 {
            return 0.0;
        }
        if self.is_far(local) {
            distance * distance * distance / (local.z * self.area())
        } else {
            1.0 / self.spherical(local).solid_angle
        }
    }

    /// Distance to the lit side.
    #[inline]
    pub fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let falling = -direction.dot(self.normal);
        let local = self.local(origin);
        if falling <= 0.0 || local.z <= 0.0 {
            return None;
        }
        let t = local.z / falling;
        let inside = (local.x + t * direction.dot(self.x)).abs() <= self.half[0]
            && (local.y + t * direction.dot(self.y)).abs() <= self.half[1];
        inside.then_some(t)
    }

    /// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
    #[inline]
    pub fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let to = self.centre - p;
        let height = -to.dot(self.normal);
        if height <= 0.0 {
            return 0.0;
        }
        let d2 = to.dot(to);
        let [a, b] = self.half;
        let reach = (a * a + b * b).sqrt();
        let distance = d2.sqrt();
        let lift = max(min((n.dot(to) + reach) / distance, 1.0), 0.0);
        // Area times cosine over squared distance; close up, no more than the whole hemisphere.
        let share = min(self.area() * height * FRAC_1_PI / (distance * d2), 1.0);
        self.radiance.luminance() * PI * share * lift
    }
}

impl Spherical {
    /// A point of the rectangle, relative to the eye, in the rectangle's axes.
    #[inline(always)]
    fn point(&self, u: f32, v: f32) -> Vec3 {
        let (sin, cos) = sin_cos_turns((u * self.solid_angle + self.k) * (0.5 * FRAC_1_PI));
        let f = (cos * self.b0 - self.b1) / if sin.abs() > 1e-7 { sin } else { 1e-7_f32.copysign(sin) };
        let c = (1.0 / (f * f + self.b0 * self.b0).sqrt()).copysign(f).clamp(-1.0, 1.0);
        let x = (-(c * self.z0) / max(1.0 - c * c, 1e-12).sqrt()).clamp(self.x0, self.x1);
        let d2 = x * x + self.z0 * self.z0;
        let h0 = self.y0 / (d2 + self.y0 * self.y0).sqrt();
        let h1 = self.y1 / (d2 + self.y1 * self.y1).sqrt();
        let h = h0 + v * (h1 - h0);
        let h2 = h * h;
        let y = if h2 < 1.0 - 1e-6 { (h * (d2 / (1.0 - h2)).sqrt()).clamp(self.y0, self.y1) } else { self.y1 };
        Vec3 { x, y, z: self.z0 }
    }
}
