//! Environment maps: pictures of light from all around, Radiance HDR or OpenEXR.

use super::{exr, hdr};
use crate::files::root::read_file;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::scene::EnvironmentMap;

/// Most pixels along one side.
pub const MAX_SIDE: usize = 32_768;
/// Most pixels of a map.
pub const MAX_PIXELS: usize = 128 << 20;

/// Reads a file, known by its content. The error names it; the map has the name of the file.
pub fn read(path: &Path) -> Result<EnvironmentMap> {
    let mut map = decode(&read_file(path)?).map_err(|error| error.in_file(path))?;
    map.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(map)
}

/// Decodes Radiance HDR or OpenEXR. The map has no name.
pub fn decode(bytes: &[u8]) -> Result<EnvironmentMap> {
    if bytes.starts_with(exr::MAGIC) {
        exr::decode(bytes)
    } else if bytes.starts_with(b"#?") {
        hdr::decode(bytes)
    } else {
        Err(Error::new("not an environment map").help("Radiance HDR and OpenEXR are read"))
    }
}

/// A map of texels, row-major `[height, width]`, after [`check_size`].
pub(super) fn map(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<EnvironmentMap> {
    EnvironmentMap::new("", width as u32, height as u32, texels)
}

/// Refuses a size before anything is allocated.
pub(super) fn check_size(width: usize, height: usize) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::new(format!("a map of {width} x {height} pixels has none")));
    }
    if width > MAX_SIDE || height > MAX_SIDE || width * height > MAX_PIXELS {
        return Err(Error::new(format!(
            "{width} x {height} pixels are more than the limit of {MAX_SIDE} a side and {MAX_PIXELS} in all"
        ))
        .help("shrink the map"));
    }
    Ok(())
}
