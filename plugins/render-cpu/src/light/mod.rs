//! The lights of a view: choosing one, sampling it, meeting it.
//!
//! Lights are opaque where they shine: a path that meets one ends there, and a light hides what is behind it. The back
//! of a rectangle is not there at all.

mod rect;
mod sphere;
#[cfg(test)]
mod tests;

use crate::vec3::{Rgb, Vec3};
use rect::Rect;
use sphere::Sphere;
use syntable_model::error::{Error, Result};
use syntable_model::scene;

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampled {
    /// Unit length.
    pub direction: Vec3,
    /// To the light's surface, metres.
    pub distance: f32,
    /// Density per steradian.
    pub pdf: f32,
    /// Towards the point, nits.
    pub radiance: Rgb,
}

/// Where a ray meets a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightHit {
    /// Metres.
    pub distance: f32,
    pub radiance: Rgb,
    index: usize,
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
                    (Shape::Sphere(Sphere { centre, radius, radiance: color(sphere.radiance) }), sphere.radiance)
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
                    };
                    (Shape::Rect(shape), rect.radiance)
                }
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

    /// Samples a light for a point with unit normal `n`, in proportion to what it could give there unshadowed.
    #[inline]
    pub fn sample(&self, p: Vec3, n: Vec3, [mut u, v]: [f32; 2]) -> Option<Sampled> {
        let mut total = 0.0;
        let mut chosen = (None, 0.0);
        for shape in &self.0 {
            let importance = shape.importance(p, n);
            if importance > 0.0 {
                // One pass: the newcomer takes over with its share of the total so far, and `u` stays uniform.
                total += importance;
                let share = importance / total;
                if u < share {
                    chosen = (Some(shape), importance);
                    u /= share;
                } else {
                    u = (u - share) / (1.0 - share);
                }
            }
        }
        let u = if u < 1.0 { u } else { 1.0 - f32::EPSILON };
        let mut sampled = chosen.0?.sample(p, [u, v])?;
        sampled.pdf *= chosen.1 / total;
        Some(sampled)
    }

    /// Density with which [`Self::sample`] finds the direction of a hit.
    #[inline]
    pub fn pdf(&self, p: Vec3, n: Vec3, hit: &LightHit) -> f32 {
        let total: f32 = self.0.iter().map(|shape| shape.importance(p, n)).sum();
        let Some(shape) = self.0.get(hit.index) else { return 0.0 };
        let importance = shape.importance(p, n);
        if importance > 0.0 { shape.pdf(p, hit.distance) * (importance / total) } else { 0.0 }
    }

    /// The first light that a ray with a unit direction meets closer than `to`.
    #[inline]
    pub fn intersect(&self, origin: Vec3, direction: Vec3, to: f32) -> Option<LightHit> {
        let mut first: Option<LightHit> = None;
        for (index, shape) in self.0.iter().enumerate() {
            let limit = first.map_or(to, |hit| hit.distance);
            if let Some(distance) = shape.intersect(origin, direction)
                && distance < limit
            {
                first = Some(LightHit { distance, radiance: shape.radiance(), index });
            }
        }
        first
    }

    /// Whether a light hides what lies at distance `to`, which may be a light itself.
    #[inline]
    pub fn hide(&self, origin: Vec3, direction: Vec3, to: f32) -> bool {
        self.0.len() > 1 && self.intersect(origin, direction, to * (1.0 - 1e-4)).is_some()
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
    fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        match self {
            Self::Sphere(sphere) => sphere.importance(p, n),
            Self::Rect(rect) => rect.importance(p, n),
        }
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, uv: [f32; 2]) -> Option<Sampled> {
        match self {
            Self::Sphere(sphere) => sphere.sample(p, uv),
            Self::Rect(rect) => rect.sample(p, uv),
        }
    }

    #[inline(always)]
    fn pdf(&self, p: Vec3, distance: f32) -> f32 {
        match self {
            Self::Sphere(sphere) => sphere.pdf(p),
            Self::Rect(rect) => rect.pdf(p, distance),
        }
    }

    #[inline(always)]
    fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
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
