//! Options of the form `[low, high]`.

use syntable_model::error::Invalid;

/// Rejects `[low, high]` unless low ≤ high. The limits of each bound are in the schema.
pub fn check_order(key: &str, [low, high]: [f64; 2]) -> Result<(), Invalid> {
    if low <= high {
        return Ok(());
    }
    Err(Invalid::new(key, format!("`{key} = [{low}, {high}]` is empty")).help("write the smaller bound first"))
}
