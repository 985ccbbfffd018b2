//! Depth from the time that light takes.

use super::models::Flight;
use super::surface::{Hit, NEIGHBOURS, Surface};
use super::{Camera, passes};
use syntable_model::photometry::luminance;
use syntable_model::product::Plane;
use syntable_model::random::Stream;

/// Reflectance of the surface that the noise is stated for.
const REFERENCE: f64 = 0.95;
/// How sharp the limit of weak light is: standard deviation of its logarithm.
const SOFT: f64 = 0.1;

/// The light that comes back from what is seen: `ρ cos θ / (0.95 R²)`.
fn signal(hit: &Hit, albedo: &Plane<[f32; 3]>) -> f64 {
    let reflectance = luminance(albedo.at(hit.at[0], hit.at[1]).map(f64::from)).clamp(0.0, 1.0);
    let range = hit.depth * hit.slant;
    reflectance * hit.cosine / (REFERENCE * range * range)
}

/// The depth that is measured of what is seen, m; none without measurement.
///
/// A pixel at an edge can see a share of the other side, up to one half. The light of both adds up, and its phase is
/// that of the mean distance, weighted by their light: a flying pixel (Lefloch et al. in Time-of-Flight and Depth Imaging, LNCS 8200, 2013), for steps that are short against the wavelength of the modulation.
pub fn measured(
    flight: &Flight,
    camera: &Camera,
    surface: &Surface,
    albedo: &Plane<[f32; 3]>,
    hit: &Hit,
    stream: &mut Stream,
) -> Option<f64> {
    let (mut range, mut light) = (hit.depth * hit.slant, signal(hit, albedo));
    let edges = surface.edges(hit.at);
    if edges != 0 {
        if stream.chance(camera.shared.edge_loss) {
            return None;
        }
        if stream.chance(flight.flying_pixels) {
            let sides: Vec<[i64; 2]> =
                NEIGHBOURS.iter().filter(|(bit, _)| edges & bit != 0).map(|(_, step)| *step).collect();
            let [dx, dy] = sides[stream.below(sides.len() as u64) as usize];
            let share = stream.uniform(0.0, 0.5);
            light *= 1.0 - share;
            let other = [(i64::from(hit.at[0]) + dx) as u32, (i64::from(hit.at[1]) + dy) as u32];
            if let Some(other) = surface.hit(other) {
                let added = share * signal(&other, albedo);
                if light + added > 0.0 {
                    range = (light * range + added * other.depth * other.slant) / (light + added);
                }
                light += added;
            }
        }
    }
    let weakest = flight.reach_reflectance / (REFERENCE * flight.reach_m * flight.reach_m);
    if light <= 0.0 || !passes((light / weakest).ln() / SOFT, stream) {
        return None;
    }
    let [floor, shot, background] = [flight.floor_mm, flight.shot_mm, flight.background_mm].map(|mm| mm / 1000.0);
    let variance = floor * floor + shot * shot / light + (background / light) * (background / light);
    Some((range + camera.noise * variance.sqrt() * stream.normal()) / hit.slant)
}
