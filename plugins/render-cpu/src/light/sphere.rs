//! Sphere lights, sampled uniformly in the cone they fill.

use super::Sampled;
use crate::approx::sin_cos_turns;
use crate::vec3::{Basis, Rgb, Vec3, max, min, vec3};
use std::f32::consts::{PI, TAU};

/// A sphere that shines evenly, seen from outside and from within.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub centre: Vec3,
    pub radius: f32,
    pub radiance: Rgb,
}

/// What a point sees of a sphere.
struct Cone {
    /// Unit vector to the centre.
    axis: Vec3,
    distance: f32,
    /// 1 − cos of the half angle; 2 if the point is inside.
    height: f32,
}

impl Sphere {
    #[inline(always)]
    fn cone(&self, p: Vec3) -> Cone {
        let to_centre = self.centre - p;
        let d2 = to_centre.dot(to_centre);
        let r2 = self.radius * self.radius;
        let distance = d2.sqrt();
        if d2 > r2 * 1.0001 {
            let sin2 = r2 / d2;
            let cos = max(1.0 - sin2, 0.0).sqrt();
            Cone { axis: to_centre * (1.0 / distance), distance, height: sin2 / (1.0 + cos) }
        } else {
            Cone { axis: vec3(0.0, 0.0, 1.0), distance, height: 2.0 }
        }
    }

    /// Solid angle, sr.
    #[inline(always)]
    fn solid_angle(cone: &Cone) -> f32 {
        TAU * cone.height
    }

    #[inline]
    pub fn sample(&self, p: Vec3, [u, v]: [f32; 2]) -> Option<Sampled> {
        let cone = self.cone(p);
        let t = u * cone.height;
        let cos = 1.0 - t;
        let sin2 = max(t * (2.0 - t), 0.0);
        let (s, c) = sin_cos_turns(v);
        let sin = sin2.sqrt();
        let direction = Basis::around(cone.axis).to_world(vec3(sin * c, sin * s, cos));
        let distance = if cone.height < 2.0 {
            let r2 = self.radius * self.radius;
            cone.distance * cos - max(r2 - cone.distance * cone.distance * sin2, 0.0).sqrt()
        } else {
            self.intersect(p, direction)?
        };
        Some(Sampled { direction, distance, pdf: 1.0 / Self::solid_angle(&cone), radiance: self.radiance })
    }

    /// Density of [`Self::sample`] for any direction that meets the sphere.
    #[inline]
    pub fn pdf(&self, p: Vec3) -> f32 {
        1.0 / Self::solid_angle(&self.cone(p))
    }

    /// Distance to the surface, from outside or from within.
    #[inline]
    pub fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let to_centre = self.centre - origin;
        let along = to_centre.dot(direction);
        let across = to_centre - direction * along;
        let half2 = self.radius * self.radius - across.dot(across);
        if half2 < 0.0 {
            return None;
        }
        let half = half2.sqrt();
        let near = along - half;
        let t = if near > 0.0 { near } else { along + half };
        (t > 0.0).then_some(t)
    }

    /// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
    #[inline]
    pub fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let cone = self.cone(p);
        if cone.height >= 2.0 {
            return self.radiance.luminance() * PI;
        }
        let sin = min(self.radius / cone.distance, 1.0);
        // The part above the horizon of a ball whose centre is at this height over its distance.
        let lift = max(min(n.dot(cone.axis) + sin, 1.0), 0.0);
        self.radiance.luminance() * PI * sin * sin * lift
    }
}
