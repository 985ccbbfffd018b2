//! Options of the form `[low, high]`.

use syntable_model::error::ConfigError;

/// Rejects `[low, high]` unless low ≤ high. The limits of each bound are in the schema.
pub fn check_order(key: &str, [low, high]: [f64; 2]) -> Result<(), ConfigError> {
    if low <= high {
        return Ok(());
    }
    Err(ConfigError::new(key, format!("`{key} = [{low}, {high}]` is empty")).help("write the smaller bound first"))
}
