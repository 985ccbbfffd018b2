//! Depth from two images.

use super::parameters::StereoParameters;
use super::surface::{Hit, Surface};
use super::{Camera, steepness};
use crate::image_filter::filled;
use syntable_model::context::Workers;
use syntable_model::product::Plane;
use syntable_model::random::Stream;

/// Growth of noise with the angle of incidence: 0.0001 over 0.0012 + 0.0019 (1 − 0.4)², from Nguyen et al. at 1 m.
const ANGLE: f64 = 0.053;

/// Pixels that the right camera does not see, because of a nearer surface or because they are outside its image.
///
/// Every row is projected into the right image, where a point of inverse depth w is `f b w` pixels farther left; the
/// nearest surface wins. A pixel is hidden if the winner is nearer by more than one pixel of disparity.
pub fn hidden(depth: &Plane<f32>, focal_px: f64, baseline_m: f64, workers: &dyn Workers) -> Plane<bool> {
    let (width, height) = (depth.width(), depth.height());
    filled(workers, [width, height], |y, row: &mut [bool]| {
        let shift = |x: usize| {
            let z = f64::from(*depth.at(x as u32, y));
            (z.is_finite() && z > 0.0).then(|| focal_px * baseline_m / z)
        };
        // The cells left and right of the projection of a pixel; none outside the image.
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

/// The measured depth of a hit, meters, given a standard normal number; none without a measurement.
pub fn measured(
    matching: &StereoParameters,
    camera: &Camera,
    surface: &Surface,
    hit: &Hit,
    normal: f64,
    stream: &mut Stream,
) -> Option<f64> {
    if surface.edges(hit.at) != 0 && stream.chance(camera.common.edge_loss) {
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
