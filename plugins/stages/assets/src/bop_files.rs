//! Names and units of the model files of BOP.

use std::path::Path;
use syntable_mesh::format::Unit;
use syntable_mesh::scan::name_of;

/// Meters per millimeter, the unit of BOP.
pub(crate) const MILLIMETER_M: f64 = 1e-3;

/// The unit of a PLY file: the millimeter if it is named as in BOP.
pub(crate) fn unit_of(file: &Path) -> Unit {
    match model_id(&name_of(file)) {
        Some(_) => Unit { name: "millimeter, as in BOP", meters: MILLIMETER_M },
        None => Unit::METER,
    }
}

/// The number in `obj_000001.ply`.
pub(crate) fn model_id(file: &str) -> Option<u64> {
    let digits = file.strip_prefix("obj_")?.strip_suffix(".ply")?;
    (digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| digits.parse().ok()).flatten()
}
