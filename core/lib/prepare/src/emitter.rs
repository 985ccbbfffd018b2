//! Emissive bodies: their triangles as lights, sampled in proportion to area times luminance.

use std::f32::consts::PI;
use syntable_simd::{Rgb, Vec3};

/// A body with emissive triangles. Both sides emit.
#[derive(Clone, Debug)]
pub struct EmissiveBody {
    /// Index of the body in its scene.
    pub instance: u32,
    triangles: Vec<EmissiveTriangle>,
    /// Cumulative probabilities of the triangles.
    sums: Vec<f32>,
    /// Density per square meter by triangle of the mesh; 0 where it does not emit.
    densities: Vec<f32>,
    center: Vec3,
    radius: f32,
    /// Luminance times area, nits m².
    power: f32,
}

/// An emissive triangle, world.
#[derive(Clone, Copy, Debug)]
pub struct EmissiveTriangle {
    /// Index in the mesh.
    pub primitive: u32,
    /// World, meters.
    pub corners: [Vec3; 3],
    /// Mean emitted radiance, nits.
    pub radiance: Rgb,
}

/// A point of an emitter.
#[derive(Clone, Copy, Debug)]
pub struct EmitterPoint {
    /// Triangle of the mesh.
    pub primitive: u32,
    /// Weight of the triangle's second corner.
    pub u: f32,
    /// Weight of the triangle's third corner.
    pub v: f32,
    /// World, meters.
    pub position: Vec3,
    /// Unit normal, either side.
    pub normal: Vec3,
    /// Density per square meter.
    pub density: f32,
}

impl EmissiveBody {
    /// Builds the emitter. Returns `None` without emission. `count` is the number of triangles of the mesh.
    pub fn new(instance: u32, triangles: Vec<EmissiveTriangle>, count: usize) -> Option<Self> {
        let area = |t: &EmissiveTriangle| {
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
        let (center, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        Some(Self { instance, triangles, sums, densities, center, radius, power: total as f32 })
    }

    /// Samples a point with two numbers in [0, 1).
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

    /// Density of sampling a point of this triangle, per square meter.
    #[inline]
    pub fn density(&self, primitive: u32) -> f32 {
        self.densities[primitive as usize]
    }

    /// Emissive triangles.
    pub fn triangles(&self) -> &[EmissiveTriangle] {
        &self.triangles
    }

    /// Cumulative probabilities of [`Self::triangles`].
    pub fn cumulative(&self) -> &[f32] {
        &self.sums
    }

    /// Center and radius of a bounding sphere, world, meters.
    pub fn sphere(&self) -> (Vec3, f32) {
        (self.center, self.radius)
    }

    /// Luminance times area, nits m².
    pub fn power(&self) -> f32 {
        self.power
    }

    /// An estimate of the unshadowed irradiance at a point; above 0 wherever the irradiance may be.
    #[inline]
    pub fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let to = self.center - p;
        let distance2 = to.dot(to);
        let nearest = distance2.max(0.25 * self.radius * self.radius).max(1e-12);
        let cosine = (n.dot(to) / nearest.sqrt() + self.radius / nearest.sqrt()).clamp(0.0, 1.0);
        // A closed convex body shows a quarter of its surface on average.
        (0.25 * self.power / nearest).min(PI * self.power / (self.radius * self.radius).max(1e-12)) * cosine
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_simd::vec3;

    #[test]
    fn triangles_are_selected_by_power_and_sampled_by_area() {
        // Areas of 0.5 and 2 m², radiances of 12 and 1 nits: powers of 6 and 2.
        let triangle = |primitive, size: f32, radiance| EmissiveTriangle {
            primitive,
            corners: [vec3(0.0, 0.0, 1.0), vec3(size, 0.0, 1.0), vec3(0.0, size, 1.0)],
            radiance: Rgb::ONE * radiance,
        };
        let body = EmissiveBody::new(3, vec![triangle(1, 1.0, 12.0), triangle(4, 2.0, 1.0)], 6).expect("emits");
        assert!((body.power() - 8.0).abs() < 1e-5);
        assert_eq!(body.cumulative(), [0.75, 1.0]);
        assert_eq!(body.density(0), 0.0);
        assert!((body.density(1) - 0.75 / 0.5).abs() < 1e-6 && (body.density(4) - 0.25 / 2.0).abs() < 1e-6);
        // The mean of points that are spread evenly over a triangle is its centroid.
        let (mut mean, mut count) = ([0.0_f64; 2], 0.0);
        for i in 0..100 {
            for j in 0..100 {
                let point = body.sample([0.75 * (i as f32 + 0.5) / 100.0, (j as f32 + 0.5) / 100.0]);
                assert_eq!((point.primitive, point.position.z, point.normal), (1, 1.0, vec3(0.0, 0.0, 1.0)));
                mean = [mean[0] + f64::from(point.position.x), mean[1] + f64::from(point.position.y)];
                count += 1.0;
            }
        }
        assert!(mean.iter().all(|sum| (sum / count - 1.0 / 3.0).abs() < 2e-3), "{mean:?}");
        assert!(EmissiveBody::new(0, vec![triangle(0, 1.0, 0.0)], 1).is_none());
    }
}
