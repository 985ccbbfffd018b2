//! Light from infinitely far away: the sun and the sky. One direction at a time.

use super::sky::Sky;
use crate::approx::{acos, atan2_turns, sin_cos_turns};
use crate::vec3::{Basis, Rgb, Vec3, vec3};
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

/// A light without a place.
#[derive(Clone, Debug)]
pub(super) enum Distant {
    /// A round patch of even radiance.
    Cone(Cone),
    /// A picture of all directions.
    Sky(PlacedSky),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// Unit vector towards the middle.
    pub axis: Vec3,
    /// Sine of half the angle, and one minus its cosine.
    pub sin: f32,
    pub height: f32,
    pub radiance: Rgb,
    /// Luminance of the illuminance on a plane that faces it, lux.
    pub illuminance: f32,
}

#[derive(Clone, Debug)]
pub(super) struct PlacedSky {
    pub sky: Arc<Sky>,
    pub scale: Rgb,
    /// Sine and cosine of the turn about z.
    pub turn: (f32, f32),
    /// Mean luminance.
    pub luminance: f32,
}

impl Distant {
    /// A direction and its density per steradian.
    #[inline]
    pub fn sample(&self, uv: [f32; 2]) -> (Vec3, f32) {
        match self {
            Self::Cone(cone) => {
                let t = uv[0] * cone.height;
                let sin = (t * (2.0 - t)).max(0.0).sqrt();
                let (s, c) = sin_cos_turns(uv[1]);
                (Basis::around(cone.axis).to_world(vec3(sin * c, sin * s, 1.0 - t)), 1.0 / (TAU * cone.height))
            }
            Self::Sky(placed) => {
                let ([u, v], density) = placed.sky.sample(uv);
                let (sin_theta, cos_theta) = sin_cos_turns(0.5 * v);
                let (s, c) = sin_cos_turns(0.5 - u);
                let local = vec3(sin_theta * c, sin_theta * s, cos_theta);
                let (sin, cos) = placed.turn;
                let direction = vec3(cos * local.x - sin * local.y, sin * local.x + cos * local.y, local.z);
                (direction, per_steradian(density, sin_theta))
            }
        }
    }

    /// Radiance from a unit direction, and the density of sampling it.
    #[inline]
    pub fn seen(&self, direction: Vec3) -> (Rgb, f32) {
        match self {
            Self::Cone(cone) => {
                let across = cone.axis.cross(direction);
                let met = direction.dot(cone.axis) > 0.0 && across.dot(across) <= cone.sin * cone.sin;
                if met { (cone.radiance, 1.0 / (TAU * cone.height)) } else { (Rgb::ZERO, 0.0) }
            }
            Self::Sky(placed) => {
                let (sin, cos) = placed.turn;
                let local =
                    vec3(cos * direction.x + sin * direction.y, cos * direction.y - sin * direction.x, direction.z);
                let u = 0.5 - atan2_turns(local.y, local.x);
                let v = acos(local.z) * FRAC_1_PI;
                let sin_theta = (1.0 - local.z * local.z).max(0.0).sqrt();
                let density = per_steradian(placed.sky.density([u, v]), sin_theta);
                (placed.sky.radiance([u, v]) * placed.scale, density)
            }
        }
    }

    /// An upper estimate of the irradiance on a plane with unit normal `n`, unshadowed.
    #[inline]
    pub fn importance(&self, n: Vec3) -> f32 {
        match self {
            Self::Cone(cone) => cone.illuminance * (n.dot(cone.axis) + cone.sin).clamp(0.0, 1.0),
            Self::Sky(placed) => PI * placed.luminance,
        }
    }
}

/// A density over the unit square of a map as one per steradian: dω = 2π² sin θ du dv.
#[inline]
fn per_steradian(density: f32, sin_theta: f32) -> f32 {
    density / (TAU * PI * sin_theta.max(1e-6))
}
