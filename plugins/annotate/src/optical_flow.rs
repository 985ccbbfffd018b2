//! Where the points of an image are in the next view.

use crate::keypoints::pixel;
use syntable_model::geometry::{Point3, Rotation3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, FLOW, FLOW_VISIBILITY};
use syntable_model::scene::{Camera, Rays};

/// Optical flow and correspondences from each view to the next one of its scene, in which nothing moves but the camera.
///
/// `flow` has for every pixel the displacement (u, v) of the point that its center shows: its pixel in the next view less its
/// own, px, distortion included, also where the next view does not show it. `flow_visibility` is 2 where the next view shows
/// the point, 1 where the point is within its image but hidden, and 0 where there is no displacement or where it leads out of
/// the image: the pixel shows nothing, the point is behind the next camera, or the view is the last one. A point is hidden
/// where all four pixels whose centers surround it in the next view show something nearer by more than `tolerance_m`: on a
/// plane, one of the four is always at least as far as the point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpticalFlow {
    /// How far behind the surface that the next view shows a point may be and still count as seen, meters.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance_m: f64,
}

impl Default for OpticalFlow {
    fn default() -> Self {
        Self { tolerance_m: 0.002 }
    }
}

impl Config for OpticalFlow {
    type Stage = dyn Annotator;
    const KIND: &'static str = "optical_flow";
    const EXAMPLE: &'static str = "tolerance_m = 0.002";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for OpticalFlow {
    fn reads(&self) -> Vec<KeyId> {
        keys![DEPTH, DEPTH.of_next_view()]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![FLOW, FLOW_VISIBILITY]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (depth, next_depth) = (products.get(DEPTH)?, products.get(DEPTH.of_next_view())?);
        let [width, height] = [depth.width(), depth.height()];
        let mut flow = vec![[0.0; 2]; depth.data().len()];
        let mut visibility = vec![0; depth.data().len()];
        if let Some(next) = cx.next {
            let next_from_this = next.camera.world_from_camera.inverse() * cx.view.camera.world_from_camera;
            let step = Step {
                from: cx.view.camera.rays(),
                to: &next.camera,
                turn: next_from_this.rotation.to_rotation_matrix(),
                start: next_from_this.translation.vector.into(),
                depth: next_depth,
                tolerance_m: self.tolerance_m,
            };
            let row = width as usize;
            let rows = depth.data().chunks(row).zip(flow.chunks_mut(row)).zip(visibility.chunks_mut(row));
            let mut points = Vec::with_capacity(row);
            for (y, ((depths, flow), visibility)) in (0..).zip(rows) {
                step.points(y, depths, &mut points);
                for ((x, point), (flow, seen)) in (0..).zip(&points).zip(flow.iter_mut().zip(visibility)) {
                    if let Some(found) = step.follow([x, y], point) {
                        (*flow, *seen) = found;
                    }
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
    /// From the axes of this camera to those of the next.
    turn: Rotation3<f64>,
    /// The center of this camera in the frame of the next, meters.
    start: Point3<f64>,
    /// Depth of the next view.
    depth: &'a Plane<f32>,
    tolerance_m: f64,
}

impl Step<'_> {
    /// The points that the pixels of a row show, in the frame of the next camera, meters; behind it where a pixel shows none.
    fn points(&self, y: u32, depths: &[f32], points: &mut Vec<Point3<f64>>) {
        points.clear();
        points.extend((0..).zip(depths).map(|(x, &depth)| match self.from.at(x, y) {
            Some((right, down)) if depth.is_finite() && depth > 0.0 => {
                self.start + self.turn * Vector3::new(right, down, 1.0) * f64::from(depth)
            }
            _ => Point3::new(0.0, 0.0, -1.0),
        }));
    }

    /// Displacement of the point that a pixel shows, and whether the next view shows it; none if there is no such point.
    #[inline]
    fn follow(&self, [x, y]: [u32; 2], point: &Point3<f64>) -> Option<([f32; 2], u8)> {
        let to = pixel(self.to, point)?;
        let flow = [to[0] - (f64::from(x) + 0.5), to[1] - (f64::from(y) + 0.5)].map(|along| along as f32);
        Some((flow, if !self.to.intrinsics.contains(to) { 0 } else { 2 - u8::from(self.is_hidden(to, point.z)) }))
    }

    #[inline]
    fn is_hidden(&self, [u, v]: [f64; 2], depth_m: f64) -> bool {
        let around = |at: f64, edge: u32| {
            let after = (at + 0.5) as u32;
            [after.saturating_sub(1), after.min(edge - 1)]
        };
        let (columns, rows) = (around(u, self.depth.width()), around(v, self.depth.height()));
        let is_nearer = |x: u32, y: u32| {
            let there = f64::from(*self.depth.at(x, y));
            there > 0.0 && there < depth_m - self.tolerance_m
        };
        rows.iter().all(|&y| columns.iter().all(|&x| is_nearer(x, y)))
    }
}

register!(OpticalFlow);
