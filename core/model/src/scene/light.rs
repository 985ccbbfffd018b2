//! Lights: emitters with shape. Radiance is linear Rec. 709 with luminance in nits (see [`crate::photometry`]).

use super::EnvironmentMap;
use crate::geometry::{Point3, Rotation3, Vector3};
use std::f64::consts::PI;
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
    /// A window: a rectangle that shows an environment through its panes, one-sided.
    Window(WindowLight),
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
        let sin = libm::sin(self.half_angle);
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

impl EnvironmentLight {
    /// Radiance from a unit direction, nits.
    pub fn radiance(&self, direction: &Vector3<f64>) -> [f64; 3] {
        let texel = self.map.radiance(&(self.map_from_world() * direction));
        std::array::from_fn(|channel| self.scale[channel] * texel[channel])
    }

    /// Irradiance on an unoccluded plane with a unit normal, lux.
    pub fn irradiance(&self, normal: &Vector3<f64>) -> [f64; 3] {
        let sum = self.map.irradiance(&(self.map_from_world() * normal));
        std::array::from_fn(|channel| self.scale[channel] * sum[channel])
    }

    fn map_from_world(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), -self.rotation)
    }
}

/// A window as a light: a rectangle of panes in a frame. A pane shows the environment behind it as if it were far away:
/// its radiance depends on the direction alone. So the visible part of the environment moves with the viewer, the sky
/// lights the floor, and the ground lights the ceiling. Frame and bars have a radiance of their own, and let nothing
/// through.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowLight {
    /// Center, world, meters.
    pub center: Point3<f64>,
    /// From the center to the midpoint of one edge, meters.
    pub half_u: Vector3<f64>,
    /// From the center to the midpoint of a neighboring edge, meters; at right angles to `half_u`. Light is emitted on
    /// the side of `half_u × half_v`.
    pub half_v: Vector3<f64>,
    /// The environment behind the panes.
    pub view: EnvironmentLight,
    /// Numbers of panes along `half_u` and `half_v`, at least 1.
    pub panes: [u32; 2],
    /// Width of the frame along the four edges, meters.
    pub frame_m: f64,
    /// Width of the bars between panes, meters.
    pub bar_m: f64,
    /// Radiance of frame and bars, nits.
    pub frame_radiance: [f64; 3],
}

impl WindowLight {
    /// The rectangle, with a radiance.
    pub fn rect(&self, radiance: [f64; 3]) -> RectLight {
        RectLight { center: self.center, half_u: self.half_u, half_v: self.half_v, radiance }
    }

    /// Extents of the panes along `half_u` (axis 0) or `half_v` (axis 1), meters from the center, in ascending order. A
    /// point is in a pane if both of its coordinates are in one. None where frame and bars leave no room.
    pub fn spans(&self, axis: usize) -> Vec<[f64; 2]> {
        let half = [&self.half_u, &self.half_v][axis].norm() - self.frame_m;
        let count = self.panes[axis].max(1);
        let pitch = 2.0 * half / f64::from(count);
        let edge = |number: u32| {
            let bar = if number == 0 || number == count { 0.0 } else { self.bar_m / 2.0 };
            (f64::from(number) * pitch - half, bar)
        };
        let span = |number: u32| {
            let ((low, before), (high, after)) = (edge(number), edge(number + 1));
            [low + before, high - after]
        };
        (0..count).map(span).filter(|[low, high]| low < high).collect()
    }

    /// The panes, as rectangles with a radiance of 0.
    pub fn glass(&self) -> Vec<RectLight> {
        let (u, v) = (self.half_u.normalize(), self.half_v.normalize());
        let pane = |[left, right]: [f64; 2], [low, high]: [f64; 2]| RectLight {
            center: self.center + u * ((left + right) / 2.0) + v * ((low + high) / 2.0),
            half_u: u * ((right - left) / 2.0),
            half_v: v * ((high - low) / 2.0),
            radiance: [0.0; 3],
        };
        let columns = self.spans(0);
        let row = |y: [f64; 2]| columns.iter().map(move |&x| pane(x, y)).collect::<Vec<_>>();
        self.spans(1).into_iter().flat_map(row).collect()
    }

    /// Radiance at a point of the window towards a viewer who sees it in a unit direction, nits.
    pub fn radiance(&self, point: &Point3<f64>, direction: &Vector3<f64>) -> [f64; 3] {
        let from_center = point - self.center;
        let is_inside = |axis: usize| {
            let at = from_center.dot(&[&self.half_u, &self.half_v][axis].normalize());
            self.spans(axis).iter().any(|&[low, high]| (low..=high).contains(&at))
        };
        if is_inside(0) && is_inside(1) { self.view.radiance(direction) } else { self.frame_radiance }
    }

    /// The rectangle of one radiance that emits the same flux.
    pub fn mean(&self) -> RectLight {
        let glass: f64 = self.glass().iter().map(|pane| pane.half_u.norm() * pane.half_v.norm()).sum();
        let fraction = glass / (self.half_u.norm() * self.half_v.norm());
        let outside = -self.half_u.cross(&self.half_v).normalize();
        let through = self.view.irradiance(&outside);
        let mean = |channel: usize| through[channel] / PI * fraction + self.frame_radiance[channel] * (1.0 - fraction);
        self.rect([0, 1, 2].map(mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_has_its_panes_and_its_mean() {
        // Columns look along +x in the middle; the upper half of the map is bright.
        let texels = (0..64 * 32).map(|i| if i < 64 * 16 { [1.0, 0.5, 0.25] } else { [0.0; 3] }).collect();
        let map = Arc::new(EnvironmentMap::new("half", 64, 32, texels).expect("sound"));
        let window = WindowLight {
            center: Point3::new(-2.0, 0.5, 1.5),
            half_u: Vector3::new(0.0, 0.5, 0.0),
            half_v: Vector3::new(0.0, 0.0, 0.8),
            view: EnvironmentLight { map, scale: [10.0; 3], rotation: 0.4 },
            panes: [2, 3],
            frame_m: 0.1,
            bar_m: 0.05,
            frame_radiance: [2.0; 3],
        };
        let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-12, "{got}, not {want}");
        let spans = window.spans(0);
        assert_eq!((spans.len(), window.spans(1).len(), window.glass().len()), (2, 3, 6));
        near(spans[0][0], -0.4);
        near(spans[0][1], -0.025);
        near(spans[1][0], 0.025);
        // Of 1 m × 1.6 m, frame and bars leave 0.75 m × 1.3 m.
        let glass: f64 = window.glass().iter().map(|pane| 4.0 * pane.half_u.norm() * pane.half_v.norm()).sum();
        near(glass, 0.75 * 1.3);
        let seen = |y: f64, z: f64, direction: Vector3<f64>| {
            window.radiance(&Point3::new(-2.0, 0.5 + y, 1.5 + z), &direction.normalize())
        };
        let (up, down) = (Vector3::new(-1.0, 0.1, 0.5), Vector3::new(-1.0, 0.1, -0.5));
        assert_eq!(seen(0.2, 0.0, up), [10.0, 5.0, 2.5]);
        assert_eq!(seen(0.2, 0.0, down), [0.0; 3]);
        assert_eq!(seen(0.0, 0.0, up), [2.0; 3], "a bar");
        assert_eq!(seen(0.45, 0.0, up), [2.0; 3], "the frame");
        // A vertical pane gets half of what a bright sphere would give.
        let (mean, fraction) = (window.mean().radiance, 0.75 * 1.3 / 1.6);
        for (channel, bright) in [10.0, 5.0, 2.5].into_iter().enumerate() {
            let want = fraction * bright / 2.0 + (1.0 - fraction) * 2.0;
            assert!((mean[channel] / want - 1.0).abs() < 3e-3, "{mean:?}");
        }
        // Bars wider than the window leave no glass.
        assert!(WindowLight { bar_m: 2.0, ..window }.glass().is_empty());
    }
}
