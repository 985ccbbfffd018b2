//! Estimated mass of objects whose source states no mass.

use std::ops::RangeInclusive;
use syntable_model::scene::{MassOrigin, MassProperties, Object, Topology};

/// Density of household objects, kg/m³, over the volume that the surface encloses: between a full carton of juice
/// (1000) and an empty box (50), as most objects are partly hollow.
pub const DENSITY_KG_M3: f64 = 400.0;
/// Minimum and maximum of estimated masses, kg.
pub const MASS_KG: RangeInclusive<f64> = 0.005..=20.0;

/// Estimated mass, kg, of an object with a volume in m³: [`DENSITY_KG_M3`] times the volume, clamped to [`MASS_KG`].
/// A volume that is not a number gives the minimum.
pub fn estimate_kg(volume_m3: f64) -> f64 {
    let mass = volume_m3 * DENSITY_KG_M3;
    if mass.is_nan() { *MASS_KG.start() } else { mass.clamp(*MASS_KG.start(), *MASS_KG.end()) }
}

/// Mass of an object that is scaled by a factor, kg, and its origin. An estimated mass is estimated again for the new
/// size. A known mass belongs to a material, which scaling does not change: it grows with the cube of the factor.
pub fn scaled_kg(object: &Object, factor: f64) -> (f64, MassOrigin) {
    let MassProperties { kg, origin, .. } = object.mass;
    match origin {
        MassOrigin::Estimated if factor != 1.0 => {
            (estimate_kg(Topology::of(&object.mesh).solid_volume() * factor.powi(3)), origin)
        }
        _ => (kg * factor.powi(3), origin),
    }
}

/// The mass, kept within [`MASS_KG`] if it is an estimate.
pub fn within_estimates(mass: MassProperties) -> MassProperties {
    match mass.origin {
        MassOrigin::Estimated => mass.with_kg(mass.kg.clamp(*MASS_KG.start(), *MASS_KG.end()), mass.origin),
        _ => mass,
    }
}

#[cfg(test)]
mod tests {
    use super::estimate_kg;

    #[test]
    fn masses_are_density_times_volume_within_limits() {
        // A mug of 0.3 liter, a crumb, a wardrobe.
        for (volume, mass) in [(3e-4, 0.12), (1e-9, 0.005), (0.0, 0.005), (1.0, 20.0), (f64::NAN, 0.005)] {
            assert!((estimate_kg(volume) - mass).abs() < 1e-12, "{volume}");
        }
    }
}
