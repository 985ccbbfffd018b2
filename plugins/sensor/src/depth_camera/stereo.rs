//! Depth from two pictures.

use super::models::Matching;
use super::surface::{Hit, Surface};
use super::{Camera, steepness};
use crate::grid::filled;
use syntable_model::context::Workers;
use syntable_model::product::Plane;
use syntable_model::random::Stream;

/// Growth of noise with the angle: 0.0001 over 0.0012 + 0.0019 (1 − 0.4)², of Nguyen et al. at 1 m.
const ANGLE: f64 = 0.053;

/// Which pixels the right camera does not see: something nearer is in its way, or they lie outside its picture.
///
/// Every row is drawn into the right picture, where a point of inverse depth w lies `f b w` pixels farther left; the
/// nearest wins. A pixel is hidden if what won is nearer by more than a pixel of disparity.
pub fn hidden(depth: &Plane<f32>, focal_px: f64, baseline_m: f64, workers: &dyn Workers) -> Plane<bool> {
    let (width, height) = (depth.width(), depth.height());
    filled(workers, [width, height], |y, row: &mut [bool]| {
        let shift = |x: usize| {
            let z = f64::from(*depth.at(x as u32, y));
            (z.is_finite() && z > 0.0).then(|| focal_px * baseline_m / z)
        };
        // The cells left and right of where a pixel comes to lie; none beside the picture.
        let cells = |x: usize, shift: f64| {
            let at = x as f64 - shift;
            (at >= -0.5).then(|| [at.floor(), at.ceil()].map(|cell| cell.max(0.0) as usize))
        };
        let mut nearest = vec![0.0_f64; width as usize];
        for x in 0..row.len() {
            let Some(shift) = shift(x) else { continue };
            for cell in cells(x, shift).into_iter().flatten() {
                nearest[cell] = nearest[cell].max(shift);
            }
        }
        for (x, hidden) in row.iter_mut().enumerate() {
            let Some(shift) = shift(x) else { continue };
            *hidden = cells(x, shift).is_none_or(|cells| cells.iter().all(|&cell| nearest[cell] > shift + 1.0));
        }
    })
}

/// The depth that is measured of what is seen, m, with a standard normal number; none without measurement.
pub fn measured(
    matching: &Matching,
    camera: &Camera,
    surface: &Surface,
    hit: &Hit,
    normal: f64,
    stream: &mut Stream,
) -> Option<f64> {
    if surface.edges(hit.at) != 0 && stream.chance(camera.shared.edge_loss) {
        return None;
    }
    let scale = matching.focal_length_px * matching.baseline_m;
    let steep = steepness(hit.angle());
    let sigma = camera.noise * matching.disparity_noise_px * (1.0 + ANGLE * steep * steep);
    let mut disparity = scale / hit.depth + sigma * normal;
    if matching.disparity_step_px > 0.0 {
        disparity = (disparity / matching.disparity_step_px).round() * matching.disparity_step_px;
    }
    (disparity > 0.0).then(|| scale / disparity)
}
