//! Environment maps: equirectangular images of radiance from all directions, recognized by their content.

use crate::format::ImageFormats;
use crate::limits::Budget;
use crate::root::AssetRoot;
use std::path::Path;
use syntable_model::error::Result;
use syntable_model::scene::EnvironmentMap;

/// Maximum width and height, pixels.
pub const MAX_SIDE: u64 = 32_768;

/// Reads a file of any registered format. Errors name the file, and the map gets the file's name.
pub fn read(root: &AssetRoot, path: &Path) -> Result<EnvironmentMap> {
    let mut map = decode(&root.read(path)?, root.budget()).map_err(|error| error.in_file(path))?;
    map.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(map)
}

/// Decodes a map of any registered format. The map has no name.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<EnvironmentMap> {
    ImageFormats::linked()?.decode_radiance(bytes, budget)
}
