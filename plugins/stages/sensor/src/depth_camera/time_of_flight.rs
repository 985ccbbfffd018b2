//! Depth from the travel time of light.

use super::parameters::TimeOfFlightParameters;
use super::surface::{Hit, NEIGHBORS, Surface};
use super::{Camera, passes};
use syntable_model::photometry::luminance;
use syntable_model::product::Plane;
use syntable_model::random::Stream;

/// Reflectance of the surface that noise parameters refer to.
const REFERENCE: f64 = 0.95;
/// Softness of the limit of dim light: standard deviation of its natural logarithm.
const SOFT: f64 = 0.1;

/// The light that returns from a hit: `ρ cos θ / (0.95 R²)`.
fn signal(hit: &Hit, albedo: &Plane<[f32; 3]>) -> f64 {
    let reflectance = luminance(albedo.at(hit.at[0], hit.at[1]).map(f64::from)).clamp(0.0, 1.0);
    let range = hit.depth * hit.slant;
    reflectance * hit.cosine / (REFERENCE * range * range)
}

/// The measured depth of a hit, meters; none without a measurement.
///
/// Up to one half of a pixel at an edge can see the other side. The light of both sides adds up, with the phase of
/// their mean distance, weighted by light: a flying pixel (Lefloch et al. in Time-of-Flight and Depth Imaging, LNCS
/// 8200, 2013). This holds for steps that are short compared with the wavelength of the modulation.
pub fn measured(
    flight: &TimeOfFlightParameters,
    camera: &Camera,
    surface: &Surface,
    albedo: &Plane<[f32; 3]>,
    hit: &Hit,
    stream: &mut Stream,
) -> Option<f64> {
    let (mut range, mut light) = (hit.depth * hit.slant, signal(hit, albedo));
    let edges = surface.edges(hit.at);
    if edges != 0 {
        if stream.chance(camera.common.edge_loss) {
            return None;
        }
        if stream.chance(flight.flying_pixels) {
            let sides: Vec<[i64; 2]> =
                NEIGHBORS.iter().filter(|(bit, _)| edges & bit != 0).map(|(_, step)| *step).collect();
            let [dx, dy] = sides[stream.below(sides.len() as u64) as usize];
            let fraction = stream.uniform(0.0, 0.5);
            light *= 1.0 - fraction;
            let other = [(i64::from(hit.at[0]) + dx) as u32, (i64::from(hit.at[1]) + dy) as u32];
            if let Some(other) = surface.hit(other) {
                let added = fraction * signal(&other, albedo);
                if light + added > 0.0 {
                    range = (light * range + added * other.depth * other.slant) / (light + added);
                }
                light += added;
            }
        }
    }
    let weakest = flight.reach_reflectance / (REFERENCE * flight.reach_m * flight.reach_m);
    if light <= 0.0 || !passes(libm::log(light / weakest) / SOFT, stream) {
        return None;
    }
    let [floor, shot, background] = [flight.floor_mm, flight.shot_mm, flight.background_mm].map(|mm| mm / 1000.0);
    let variance = floor * floor + shot * shot / light + (background / light) * (background / light);
    Some((range + camera.noise * variance.sqrt() * stream.normal()) / hit.slant)
}
