//! Lights: emitters with shape. Radiance is linear Rec. 709 with luminance in nits (see [`crate::photometry`]).

use super::EnvironmentMap;
use crate::geometry::{Point3, Vector3};
use std::sync::Arc;

/// A light of a view or scene. Lights are seen by the camera, but are no bodies: label rays pass through them. Emissive
/// bodies are lights too, but the renderer finds them in the scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Light {
    /// A sphere that emits evenly.
    Sphere(SphereLight),
    /// A rectangle that emits evenly, one-sided.
    Rect(RectLight),
    /// A disk that emits evenly, one-sided.
    Disk(DiskLight),
    /// Light from far away, such as the sun's.
    Directional(DirectionalLight),
    /// Light from all around, where no body is in the way.
    Environment(EnvironmentLight),
}

/// A sphere that emits the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Center, world, meters.
    pub center: Point3<f64>,
    /// Radius, meters.
    pub radius: f64,
    /// Emitted radiance, nits.
    pub radiance: [f64; 3],
}

/// A rectangle that emits the same radiance everywhere on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectLight {
    /// Center, world, meters.
    pub center: Point3<f64>,
    /// From the center to the midpoint of one edge, meters.
    pub half_u: Vector3<f64>,
    /// From the center to the midpoint of a neighboring edge, meters; at right angles to `half_u`.
    pub half_v: Vector3<f64>,
    /// Emitted radiance on the side of `half_u × half_v`, nits.
    pub radiance: [f64; 3],
}

impl RectLight {
    /// The four corners, counter-clockwise seen from the lit side.
    pub fn corners(&self) -> [Point3<f64>; 4] {
        let (c, u, v) = (self.center, self.half_u, self.half_v);
        [c - u - v, c + u - v, c + u + v, c - u + v]
    }

    /// Unit normal of the emitting side.
    pub fn normal(&self) -> Vector3<f64> {
        self.half_u.cross(&self.half_v).normalize()
    }
}

/// A disk that emits the same radiance everywhere on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiskLight {
    /// Center, world, meters.
    pub center: Point3<f64>,
    /// Unit normal of the emitting side.
    pub normal: Vector3<f64>,
    /// Radius, meters.
    pub radius: f64,
    /// Emitted radiance, nits.
    pub radiance: [f64; 3],
}

/// Light from a small round patch of the sky, infinitely far away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionalLight {
    /// Unit vector from the scene towards the center of the light.
    pub towards: Vector3<f64>,
    /// Half of the angle under which the light is seen, radians: 0.00465 for the sun.
    pub half_angle: f64,
    /// Illuminance on a plane that faces the light, lux.
    pub irradiance: [f64; 3],
}

impl DirectionalLight {
    /// Radiance of the patch, nits: `E = π L sin² a`.
    pub fn radiance(&self) -> [f64; 3] {
        let sin = self.half_angle.sin();
        self.irradiance.map(|e| e / (std::f64::consts::PI * sin * sin))
    }
}

/// Light from all around.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvironmentLight {
    /// Its radiance by direction.
    pub map: Arc<EnvironmentMap>,
    /// Nits of a texel of one.
    pub scale: [f64; 3],
    /// Turn of the map about world z, counter-clockwise seen from above, radians.
    pub rotation: f64,
}
