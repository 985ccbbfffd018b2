//! Positions of the points of an image in the next view.

use crate::keypoints::pixel;
use std::collections::BTreeMap;
use syntable_model::geometry::{Point3, Rotation3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, FLOW, FLOW_VISIBILITY, INSTANCE};
use syntable_model::scene::{Body, Camera, Rays};

/// Optical flow and correspondences from each view to the next view of its scene, from the motion of the camera and of
/// scripted bodies.
///
/// `flow` is the displacement (u, v) of the point at the pixel center: its position in the next view minus its position
/// in this view, pixels, with lens distortion, also for points that the next view does not show. `flow_visibility` is 2
/// for visible points, 1 for points that are in the next image but hidden, and 0 for points outside it and for pixels
/// without displacement: the pixel shows no body, the point is behind the next camera, or the view is the last one. A
/// point is hidden if all four pixels whose centers surround it in the next view show a surface nearer by more than
/// `tolerance_m`: on a plane, at least one of the four is no nearer than the point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpticalFlow {
    /// Maximum distance of a visible point behind the surface that the next view shows, meters.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance_m: f64,
}

impl Default for OpticalFlow {
    fn default() -> Self {
        Self { tolerance_m: 0.002 }
    }
}

config!(OpticalFlow => dyn ViewAnnotator, "optical_flow", "tolerance_m = 0.002");

impl ViewAnnotator for OpticalFlow {
    fn reads(&self) -> Vec<KeyId> {
        keys![DEPTH, DEPTH.of_next_view(), INSTANCE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![FLOW, FLOW_VISIBILITY]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (depth, next_depth) = (products.get(DEPTH)?, products.get(DEPTH.of_next_view())?);
        let [width, height] = [depth.width(), depth.height()];
        let mut flow = vec![[0.0; 2]; depth.data().len()];
        let mut visibility = vec![0; depth.data().len()];
        let camera = &cx.view.camera;
        if let Some(next) = cx.next {
            // A point moves with its body.
            let step = |next_world_from_world: Pose| {
                let next_from_this =
                    next.camera.world_from_camera.inverse() * next_world_from_world * camera.world_from_camera;
                Step {
                    from: camera.rays(),
                    to: &next.camera,
                    turn: next_from_this.rotation.to_rotation_matrix(),
                    start: next_from_this.translation.vector.into(),
                    depth: next_depth,
                    tolerance_m: self.tolerance_m,
                }
            };
            let motion = |body: &Body| body.pose_at(next.moment) * body.world_from_body.inverse();
            let scripted = cx.scene.bodies().iter().filter(|body| body.trajectory.is_some());
            let moving: BTreeMap<InstanceId, Step> = scripted.map(|body| (body.id, step(motion(body)))).collect();
            let (ids, step) = (products.get(INSTANCE)?, step(Pose::identity()));
            let row = width as usize;
            let rows = depth.data().chunks(row).zip(flow.chunks_mut(row)).zip(visibility.chunks_mut(row));
            for (y, ((depths, flow), visibility)) in (0..).zip(rows) {
                let [mut columns, mut rows, mut next_depths] = step.row(y, depths);
                let with_motion = (0..width).filter(|_| !moving.is_empty());
                for (x, step) in with_motion.filter_map(|x| Some((x, moving.get(ids.at(x, y))?))) {
                    let x = x as usize;
                    let place = step.point(x as u32, y, depths[x]);
                    [columns[x], rows[x], next_depths[x]] = place.unwrap_or([f64::NAN; 3]);
                }
                for ((x, flow), (u, v)) in (0..width as i32).zip(flow).zip(columns.iter().zip(&rows)) {
                    let along = |to: f64, from: f64| if to.is_nan() { 0.0 } else { (to - (from + 0.5)) as f32 };
                    *flow = [along(*u, f64::from(x)), along(*v, f64::from(y))];
                }
                for (((u, v), depth_m), seen) in columns.iter().zip(&rows).zip(&next_depths).zip(visibility) {
                    *seen = step.visibility([*u, *v], *depth_m);
                }
            }
        }
        products.put(FLOW, Plane::from_vec(width, height, flow))?;
        products.put(FLOW_VISIBILITY, Plane::from_vec(width, height, visibility))
    }
}

/// From a view to the next one.
struct Step<'a> {
    from: Rays<'a>,
    to: &'a Camera,
    /// Rotation from the axes of this camera to the axes of the next.
    turn: Rotation3<f64>,
    /// The center of this camera in the frame of the next, meters.
    start: Point3<f64>,
    /// Depth of the next view.
    depth: &'a Plane<f32>,
    tolerance_m: f64,
}

impl Step<'_> {
    /// Positions in the next camera of the points that a row of pixels shows: columns, rows and depths, each for all
    /// pixels so that several are computed at once. NaN where a pixel shows no point or the camera does not see it.
    fn row(&self, y: u32, depths: &[f32]) -> [Vec<f64>; 3] {
        let (right, down) = self.from.row(y);
        let shown = |&depth: &f32| if depth.is_finite() && depth > 0.0 { f64::from(depth) } else { f64::NAN };
        let depths: Vec<f64> = depths.iter().map(shown).collect();
        let [x, y, mut z]: [Vec<f64>; 3] = std::array::from_fn(|axis| {
            let ([a, b, c], start) = ([0, 1, 2].map(|of| self.turn[(axis, of)]), self.start[axis]);
            let rays = right.iter().zip(&down).zip(&depths);
            rays.map(|((right, down), depth)| start + (a * right + b * down + c) * depth).collect()
        });
        // A point behind the camera has no position either.
        z.iter_mut().for_each(|z| *z = if *z > 0.0 { *z } else { f64::NAN });
        if self.to.distortion.is_some() {
            let place = |((&x, &y), &z): ((&f64, &f64), &f64)| {
                if z.is_nan() { None } else { pixel(self.to, &Point3::new(x, y, z)) }
            };
            let places = x.iter().zip(&y).zip(&z).map(|point| place(point).unwrap_or([f64::NAN; 2]));
            let (columns, rows) = places.map(|[u, v]| (u, v)).unzip();
            return [columns, rows, z];
        }
        // As in `Camera::project`.
        let project = |focal: f64, side: Vec<f64>, center: f64| {
            side.iter().zip(&z).map(|(side, z)| focal * side / z + center).collect()
        };
        let k = &self.to.intrinsics;
        [project(k.fx, x, k.cx), project(k.fy, y, k.cy), z]
    }

    /// Like [`Self::row`], for the point that one pixel shows; `None` if it shows no point or the camera does not see
    /// it.
    fn point(&self, x: u32, y: u32, depth: f32) -> Option<[f64; 3]> {
        let (right, down) = self.from.at(x, y).filter(|_| depth.is_finite() && depth > 0.0)?;
        let point = self.start + self.turn * Vector3::new(right, down, 1.0) * f64::from(depth);
        let [u, v] = pixel(self.to, &point)?;
        Some([u, v, point.z])
    }

    /// Whether the next view shows a point, by its pixel and depth there: 2 if it does, 1 if the point is hidden, 0
    /// outside the image.
    #[inline]
    fn visibility(&self, to: [f64; 2], depth_m: f64) -> u8 {
        if self.to.intrinsics.contains(to) { 2 - u8::from(self.is_hidden(to, depth_m)) } else { 0 }
    }

    #[inline]
    fn is_hidden(&self, [u, v]: [f64; 2], depth_m: f64) -> bool {
        let is_nearer = |x: u32, y: u32| {
            let there = f64::from(*self.depth.at(x, y));
            there > 0.0 && there < depth_m - self.tolerance_m
        };
        let around = |at: f64, edge: u32| {
            let after = (at + 0.5) as u32;
            [after.saturating_sub(1), after.min(edge - 1)]
        };
        let all_around = || {
            let (columns, rows) = (around(u, self.depth.width()), around(v, self.depth.height()));
            rows.iter().all(|&y| columns.iter().all(|&x| is_nearer(x, y)))
        };
        // The pixel of the point is one of the four, and most points are visible.
        is_nearer(u as u32, v as u32) && all_around()
    }
}

register!(OpticalFlow);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::{Distortion, Intrinsics};

    #[test]
    fn rows_are_as_point_by_point() {
        let intrinsics = Intrinsics { width: 40, height: 30, fx: 50.0, fy: 60.0, cx: 20.5, cy: 14.0 };
        let lens = Distortion::brown_conrady([-0.28, 0.09, -0.01], [0.001, -0.0007]);
        let camera = |distortion| Camera { distortion, ..Camera::pinhole(intrinsics, Pose::identity()) };
        let mut stream = Stream::root(5);
        let depth = Plane::from_fn(40, 30, |x, y| match (x + y) % 13 {
            0 => f32::INFINITY,
            1 => 0.0,
            _ => stream.uniform(0.1, 2.0) as f32,
        });
        for (from, to) in [(None, None), (Some(lens), None), (None, Some(lens))].map(|(a, b)| (camera(a), camera(b))) {
            let step = Step {
                from: from.rays(),
                to: &to,
                turn: Rotation3::from_euler_angles(0.3, -0.2, 0.1),
                // Some points are behind the next camera.
                start: Point3::new(0.1, -0.2, -0.7),
                depth: &depth,
                tolerance_m: 0.0,
            };
            let mut shown = 0;
            for (y, depths) in (0..).zip(depth.data().chunks(40)) {
                let [columns, rows, next_depths] = step.row(y, depths);
                for (x, &depth) in depths.iter().enumerate() {
                    let (right, down) = step.from.at(x as u32, y).expect("a direction");
                    let point = step.start + step.turn * Vector3::new(right, down, 1.0) * f64::from(depth);
                    let place = if depth.is_finite() && depth > 0.0 { pixel(&to, &point) } else { None };
                    match place {
                        Some(place) => assert_eq!(([columns[x], rows[x]], next_depths[x]), (place, point.z)),
                        None => assert!(columns[x].is_nan() && rows[x].is_nan()),
                    }
                    shown += usize::from(place.is_some());
                }
            }
            assert!((300..900).contains(&shown), "{shown}");
        }
    }
}
