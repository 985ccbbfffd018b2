//! Points on a hemisphere above a support.

use nalgebra::{Point3, Vector3};
use std::f64::consts::TAU;
use syntable_model::random::Stream;
use syntable_model::scene::Support;

/// Azimuths all around, radians.
pub const ALL_AROUND: [f64; 2] = [0.0, TAU];

/// Elevations above the horizon that span the upper hemisphere, degrees.
pub const HEMISPHERE_DEG: [f64; 2] = [0.0, 90.0];

/// The center of the hemispheres: `offset` meters above the center of the support.
pub fn center(support: &Support, offset: f64) -> Point3<f64> {
    support.center() + Vector3::new(0.0, 0.0, offset)
}

/// A unit vector, uniform over the part of the upper hemisphere between two elevations in degrees and two azimuths in radians.
///
/// The paper's formula, all around: azimuth 2πu, polar angle acos(1 − v), where `1 − v` = sin(elevation) is uniform. For the whole
/// hemisphere, v is in [0, 1).
pub fn direction(elevation_deg: [f64; 2], azimuth: [f64; 2], stream: &mut Stream) -> Vector3<f64> {
    let (u, v) = (stream.unit(), stream.unit());
    let [low, high] = elevation_deg.map(|degrees| libm::sin(degrees.to_radians()));
    let cos_polar = high - v * (high - low);
    let sin_polar = (1.0 - cos_polar * cos_polar).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(azimuth[0] + (azimuth[1] - azimuth[0]) * u);
    Vector3::new(sin_polar * cos, sin_polar * sin, cos_polar)
}
