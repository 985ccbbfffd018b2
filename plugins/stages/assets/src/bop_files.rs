//! Names and units of the model files of BOP.

use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::Unit;
use syntable_mesh::scan::name_of;
use syntable_model::scene::EXTENT_M;

/// Meters per millimeter, the unit of BOP.
pub(crate) const MILLIMETER_M: f64 = 1e-3;

/// The unit of a PLY file that states none: the millimeter for a file named as in BOP, or for a mesh that would be
/// larger than any object in meters, but not in millimeters.
pub(crate) fn guess_unit(file: &Path, model: &Model) -> Unit {
    let extent = model.extent();
    let named = model_id(&name_of(file)).is_some();
    if named || (extent > *EXTENT_M.end() && extent * MILLIMETER_M <= *EXTENT_M.end()) {
        Unit { name: "millimeter, as in BOP", meters: MILLIMETER_M }
    } else {
        Unit::METER
    }
}

/// The number in `obj_000001.ply`.
pub(crate) fn model_id(file: &str) -> Option<u64> {
    let digits = file.strip_prefix("obj_")?.strip_suffix(".ply")?;
    (digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| digits.parse().ok()).flatten()
}
