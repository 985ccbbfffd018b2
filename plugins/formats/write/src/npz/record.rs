//! Names in NumPy archives.

/// Extension of an archive.
pub const ARCHIVE: &str = "npz";
/// Name of the array of the instances' ids.
pub const IDS: &str = "ids";
