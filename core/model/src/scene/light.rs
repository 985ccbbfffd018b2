//! Lights: emitters with shape. Radiance is linear Rec. 709 with luminance in nits (see [`crate::photometry`]).

use crate::geometry::{Point3, Vector3};

/// A light of a view or scene. Lights are seen by the camera, but are no bodies: label rays pass through them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// A glowing ball.
    Sphere(SphereLight),
    /// A glowing rectangle, one-sided.
    Rect(RectLight),
}

/// A sphere that emits the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Centre, world, metres.
    pub centre: Point3<f64>,
    /// Radius, metres.
    pub radius: f64,
    /// Emitted radiance, nits.
    pub radiance: [f64; 3],
}

/// A rectangle that emits the same radiance everywhere on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectLight {
    /// Centre, world, metres.
    pub centre: Point3<f64>,
    /// From the centre to the middle of one edge, metres.
    pub half_u: Vector3<f64>,
    /// From the centre to the middle of a neighbouring edge, metres; at right angles to `half_u`.
    pub half_v: Vector3<f64>,
    /// Emitted radiance on the side of `half_u × half_v`, nits.
    pub radiance: [f64; 3],
}

impl RectLight {
    /// The four corners, counter-clockwise seen from the lit side.
    pub fn corners(&self) -> [Point3<f64>; 4] {
        let (c, u, v) = (self.centre, self.half_u, self.half_v);
        [c - u - v, c + u - v, c + u + v, c - u + v]
    }

    /// Unit normal of the emitting side.
    pub fn normal(&self) -> Vector3<f64> {
        self.half_u.cross(&self.half_v).normalize()
    }
}
