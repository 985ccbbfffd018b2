//! Environment maps: equirectangular images of radiance from all directions, recognized by their content.

use crate::format::ImageFormats;
use crate::limits::check_pixels;
use crate::root::read_file;
use std::path::Path;
use syntable_model::error::Result;
use syntable_model::scene::EnvironmentMap;

/// Maximum width and height, pixels.
pub const MAX_SIDE: usize = 32_768;
/// Maximum number of pixels.
pub const MAX_PIXELS: usize = 128 << 20;

/// Reads a file of any registered format. Errors name it; the map has the name of the file.
pub fn read(path: &Path) -> Result<EnvironmentMap> {
    let mut map = decode(&read_file(path)?).map_err(|error| error.in_file(path))?;
    map.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(map)
}

/// Decodes a map of any registered format. The map has no name.
pub fn decode(bytes: &[u8]) -> Result<EnvironmentMap> {
    ImageFormats::linked()?.decode_radiance(bytes)
}

/// Refuses an empty or too large map. Decoders call it before they allocate.
pub fn check_size(width: usize, height: usize) -> Result<()> {
    check_pixels(width as u64, height as u64, MAX_SIDE as u64, MAX_PIXELS as u64)
}
