//! The surfaces in front of a depth camera: depth, depth edges and angles of incidence.

use crate::image_filter::filled;
use syntable_model::context::Workers;
use syntable_model::geometry::Vector3;
use syntable_model::product::Plane;
use syntable_model::scene::Camera;

/// The four neighbors of a pixel, as bits and as steps.
pub const NEIGHBORS: [(u8, [i64; 2]); 4] = [(1, [1, 0]), (2, [-1, 0]), (4, [0, 1]), (8, [0, -1])];

/// The rendered surface.
pub struct Surface<'a> {
    camera: &'a Camera,
    depth: &'a Plane<f32>,
    normal: &'a Plane<[f32; 3]>,
    edges: Plane<u8>,
}

/// The surface point at a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Column and row of the pixel.
    pub at: [u32; 2],
    /// Distance along the optical axis, meters.
    pub depth: f64,
    /// Ratio of the distance along the ray to the depth.
    pub slant: f64,
    /// Cosine of the angle between ray and normal, in [0, 1].
    pub cosine: f64,
}

impl Hit {
    /// Angle of incidence, between ray and normal, radians.
    pub fn angle(&self) -> f64 {
        libm::acos(self.cosine)
    }
}

impl<'a> Surface<'a> {
    /// Finds the edges: neighbors whose depths differ by more than `step_m` beyond the slope of the surface.
    pub fn new(
        camera: &'a Camera,
        depth: &'a Plane<f32>,
        normal: &'a Plane<[f32; 3]>,
        step_m: f64,
        workers: &dyn Workers,
    ) -> Self {
        let edges = filled(workers, [depth.width(), depth.height()], |y, row: &mut [u8]| {
            for (x, edges) in row.iter_mut().enumerate() {
                let at = [x as i64, i64::from(y)];
                *edges = NEIGHBORS
                    .iter()
                    .filter(|(_, step)| is_edge(depth, at, *step, step_m))
                    .fold(0, |bits, (bit, _)| bits | bit);
            }
        });
        Self { camera, depth, normal, edges }
    }

    /// The edges of a pixel, as bits of [`NEIGHBORS`].
    pub fn edges(&self, [x, y]: [u32; 2]) -> u8 {
        *self.edges.at(x, y)
    }

    /// The surface point at the center of a pixel.
    pub fn hit(&self, at: [u32; 2]) -> Option<Hit> {
        let inverse = inverse(self.depth, at.map(i64::from)).filter(|w| *w > 0.0)?;
        self.facing(at, 1.0 / inverse)
    }

    /// The surface point at (x, y), pixels from the center of the first pixel. Depth is interpolated within a surface,
    /// where its inverse is linear; at edges, it is the depth of the nearest pixel.
    pub fn near(&self, x: f64, y: f64) -> Option<Hit> {
        let x = x.clamp(0.0, f64::from(self.depth.width() - 1));
        let y = y.clamp(0.0, f64::from(self.depth.height() - 1));
        let nearest = [x.round() as u32, y.round() as u32];
        let hit = self.hit(nearest)?;
        let (x0, y0) = (x as u32, y as u32);
        let (x1, y1) = ((x0 + 1).min(self.depth.width() - 1), (y0 + 1).min(self.depth.height() - 1));
        let corners = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]];
        let mut w = [0.0; 4];
        for (w, corner) in w.iter_mut().zip(corners) {
            match inverse(self.depth, corner.map(i64::from)) {
                Some(value) if value > 0.0 && self.edges(corner) == 0 => *w = value,
                _ => return Some(hit),
            }
        }
        let (tx, ty) = (x - f64::from(x0), y - f64::from(y0));
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        Some(Hit { depth: 1.0 / mix(mix(w[0], w[1], tx), mix(w[2], w[3], tx), ty), ..hit })
    }

    fn facing(&self, at: [u32; 2], depth: f64) -> Option<Hit> {
        let ray = self.camera.unproject(f64::from(at[0]) + 0.5, f64::from(at[1]) + 0.5)?;
        let slant = ray.norm();
        let normal = Vector3::from(self.normal.at(at[0], at[1]).map(f64::from));
        // Without a normal, incidence is normal.
        let cosine = if normal == Vector3::zeros() { 1.0 } else { (-normal.dot(&ray) / slant).clamp(0.0, 1.0) };
        Some(Hit { at, depth, slant, cosine })
    }
}

/// One over the depth of a pixel, 0 for the background; none outside the image.
fn inverse(depth: &Plane<f32>, [x, y]: [i64; 2]) -> Option<f64> {
    if !(0..i64::from(depth.width())).contains(&x) || !(0..i64::from(depth.height())).contains(&y) {
        return None;
    }
    let z = f64::from(*depth.at(x as u32, y as u32));
    Some(if z.is_finite() && z > 0.0 { 1.0 / z } else { 0.0 })
}

/// Whether a pixel and its neighbor have an edge between them.
///
/// On a plane the inverse depth is linear in the image. The difference to the neighbor beyond the slope on either side,
/// the smaller of both, is a step of the inverse depth; times both depths it is a step in meters.
fn is_edge(depth: &Plane<f32>, [x, y]: [i64; 2], [dx, dy]: [i64; 2], step_m: f64) -> bool {
    let at = |k: i64| inverse(depth, [x + k * dx, y + k * dy]);
    let (Some(here), Some(there)) = (at(0), at(1)) else { return false };
    if here == 0.0 || there == 0.0 {
        return here != there;
    }
    let rise = there - here;
    let known = |w: Option<f64>| w.filter(|w| *w > 0.0);
    let slopes = [known(at(-1)).map(|before| here - before), known(at(2)).map(|after| after - there)];
    let excess = slopes.into_iter().flatten().map(|slope| (rise - slope).abs()).reduce(f64::min).unwrap_or(rise.abs());
    excess / (here * there) > step_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Serial;
    use syntable_testing::scenes;

    fn camera() -> Camera {
        let mut camera = scenes::view([0.0, -1.0, 1.0], [0.0; 3], [40, 30], 60.0).camera;
        (camera.intrinsics.fx, camera.intrinsics.fy) = (50.0, 50.0);
        camera
    }

    /// Depth of the plane through (0, 0, 1) with slope `dz/dx` in the camera frame.
    fn tilted(slope: f64) -> Plane<f32> {
        Plane::from_fn(40, 30, |x, _| (1.0 / (1.0 - slope * (f64::from(x) + 0.5 - 20.0) / 50.0)) as f32)
    }

    #[test]
    fn a_steep_plane_has_no_edges_but_a_step_has_two_sides() {
        let (camera, normal) = (camera(), Plane::from_fn(40, 30, |_, _| [0.0, 0.0, -1.0]));
        for slope in [0.0, 1.0, 2.2] {
            let depth = tilted(slope);
            let surface = Surface::new(&camera, &depth, &normal, 0.02, &Serial);
            assert!(surface.edges.data().iter().all(|edges| *edges == 0), "slope {slope}");
        }
        let mut depth = tilted(0.5);
        (0..30).for_each(|y| (0..12).for_each(|x| depth.data_mut()[y * 40 + x] -= 0.05));
        depth.data_mut()[40 * 10 + 30] = f32::INFINITY;
        let surface = Surface::new(&camera, &depth, &normal, 0.02, &Serial);
        assert_eq!([10, 11, 12, 13].map(|x| surface.edges([x, 5])), [0, 1, 2, 0]);
        assert_eq!(surface.edges([30, 10]), 15);
        assert_eq!(surface.edges([29, 10]), 1);
        assert!(surface.hit([30, 10]).is_none());
    }

    #[test]
    fn between_pixels_a_plane_stays_a_plane() {
        let (camera, normal) = (camera(), Plane::from_fn(40, 30, |_, _| [0.0, 0.6, -0.8]));
        let depth = tilted(1.0);
        let surface = Surface::new(&camera, &depth, &normal, 0.02, &Serial);
        let hit = surface.near(24.7, 14.2).expect("seen");
        assert!((hit.depth - 1.0 / (1.0 - (25.2 - 20.0) / 50.0)).abs() < 1e-6, "{}", hit.depth);
        let ray = Vector3::<f64>::new(5.5 / 50.0, -0.5 / 50.0, 1.0);
        assert_eq!(hit.at, [25, 14]);
        assert!((hit.slant - ray.norm()).abs() < 1e-12);
        assert!((hit.cosine - (0.8 + 0.6 * 0.5 / 50.0) / ray.norm()).abs() < 1e-6);
    }
}
