//! Radiance of a lamp from its colour temperature.

use syntable_model::photometry::blackbody;

/// Radiance triple of the given luminance (nits) and colour temperature (kelvin).
pub fn radiance(luminance_nits: f64, kelvin: f64) -> [f64; 3] {
    blackbody(kelvin).map(|channel| channel * luminance_nits)
}
