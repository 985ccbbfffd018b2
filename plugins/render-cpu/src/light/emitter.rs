//! Bodies that glow: their triangles as lights, sampled by area in proportion to what they emit.

use crate::vec3::{Rgb, Vec3};
use std::f32::consts::PI;

/// A body with glowing triangles. Both sides glow.
#[derive(Clone, Debug)]
pub(crate) struct Emitter {
    /// Of the body.
    pub instance: u32,
    triangles: Vec<Glowing>,
    /// Sums of the triangles' shares.
    sums: Vec<f32>,
    /// Density per square metre by the mesh's triangle; 0 where it does not glow.
    densities: Vec<f32>,
    centre: Vec3,
    radius: f32,
    /// Luminance times area, nits m².
    power: f32,
}

/// A glowing triangle, world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glowing {
    /// Number in the mesh.
    pub primitive: u32,
    pub corners: [Vec3; 3],
    /// Mean emitted radiance, nits.
    pub radiance: Rgb,
}

/// A point of an emitter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterPoint {
    pub primitive: u32,
    /// Barycentric coordinates.
    pub u: f32,
    pub v: f32,
    pub position: Vec3,
    /// Unit normal, either side.
    pub normal: Vec3,
    /// Density per square metre.
    pub density: f32,
}

impl Emitter {
    /// None if nothing glows. `count` is the number of the mesh's triangles.
    pub fn new(instance: u32, triangles: Vec<Glowing>, count: usize) -> Option<Self> {
        let area = |t: &Glowing| {
            let [a, b, c] = t.corners;
            0.5 * (b - a).cross(c - a).length()
        };
        let powers: Vec<f64> =
            triangles.iter().map(|t| f64::from(area(t)) * f64::from(t.radiance.luminance())).collect();
        let total: f64 = powers.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut densities = vec![0.0; count];
        let (mut sum, mut sums) = (0.0, Vec::with_capacity(triangles.len()));
        let (mut low, mut high) = (Vec3::from([f32::INFINITY; 3]), Vec3::from([f32::NEG_INFINITY; 3]));
        for (triangle, power) in triangles.iter().zip(&powers) {
            sum += power;
            sums.push((sum / total) as f32);
            if *power > 0.0 {
                densities[triangle.primitive as usize] = (power / total / f64::from(area(triangle))) as f32;
            }
            for p in triangle.corners {
                low = Vec3 { x: low.x.min(p.x), y: low.y.min(p.y), z: low.z.min(p.z) };
                high = Vec3 { x: high.x.max(p.x), y: high.y.max(p.y), z: high.z.max(p.z) };
            }
        }
        if let Some(last) = sums.last_mut() {
            *last = 1.0;
        }
        let (centre, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        Some(Self { instance, triangles, sums, densities, centre, radius, power: total as f32 })
    }

    /// A point, by two numbers in [0, 1).
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> EmitterPoint {
        let i = self.sums.partition_point(|&sum| sum <= u).min(self.sums.len() - 1);
        let before = if i == 0 { 0.0 } else { self.sums[i - 1] };
        let u = ((u - before) / (self.sums[i] - before).max(1e-30)).clamp(0.0, 1.0);
        let triangle = &self.triangles[i];
        let [a, b, c] = triangle.corners;
        let root = u.sqrt();
        let (u, v) = (root * (1.0 - v), root * v);
        let across = (b - a).cross(c - a);
        EmitterPoint {
            primitive: triangle.primitive,
            u,
            v,
            position: a + (b - a) * u + (c - a) * v,
            normal: across.normalized_or(Vec3::ZERO),
            density: self.densities[triangle.primitive as usize],
        }
    }

    /// Density of sampling a point of a triangle, per square metre.
    #[inline]
    pub fn density(&self, primitive: u32) -> f32 {
        self.densities[primitive as usize]
    }

    /// An estimate of the irradiance at a point, unshadowed: never 0 where there may be some.
    #[inline]
    pub fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let to = self.centre - p;
        let distance2 = to.dot(to);
        let nearest = distance2.max(0.25 * self.radius * self.radius).max(1e-12);
        let lift = (n.dot(to) / nearest.sqrt() + self.radius / nearest.sqrt()).clamp(0.0, 1.0);
        // A closed convex body shows a quarter of its surface on the average.
        (0.25 * self.power / nearest).min(PI * self.power / (self.radius * self.radius).max(1e-12)) * lift
    }
}
