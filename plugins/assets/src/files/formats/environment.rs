//! Environment maps: pictures of light from all around, Radiance HDR or OpenEXR.

use super::{exr, hdr};
use crate::files::root::read_file;
use std::path::Path;
use syntable_model::error::{Error, Result};

/// Most pixels along one side.
pub const MAX_SIDE: usize = 32_768;
/// Most pixels of a map.
pub const MAX_PIXELS: usize = 128 << 20;

/// A picture of linear radiance, Rec. 709 primaries, row 0 at the top. Every texel is finite and not negative.
#[derive(Debug, Clone, PartialEq)]
pub struct RadianceMap {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

impl RadianceMap {
    /// Checks texels, row-major `[height, width]`. Negative ones, which resampling leaves behind, become zero; one that
    /// is not finite is an error that names its place.
    pub fn new(width: usize, height: usize, mut texels: Vec<[f32; 3]>) -> Result<Self> {
        if width == 0 || height == 0 || texels.len() != width * height {
            return Err(Error::new(format!("{} texels for {width} x {height}", texels.len())));
        }
        for (i, texel) in texels.iter_mut().enumerate() {
            if !texel.iter().all(|x| x.is_finite()) {
                return Err(Error::new(format!(
                    "non-finite radiance {texel:?} at column {}, row {}",
                    i % width,
                    i / width
                )));
            }
            *texel = texel.map(|x| x.max(0.0));
        }
        Ok(Self { width, height, texels })
    }

    /// Reads a file, known by its content. The error names it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::decode(&read_file(path)?).map_err(|error| error.in_file(path))
    }

    /// Decodes Radiance HDR or OpenEXR.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        if bytes.starts_with(exr::MAGIC) {
            exr::decode(bytes)
        } else if bytes.starts_with(b"#?") {
            hdr::decode(bytes)
        } else {
            Err(Error::new("not an environment map").help("Radiance HDR and OpenEXR are read"))
        }
    }

    /// Width, texels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, texels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Radiance, row-major `[height, width]`.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Mean over all texels and channels, each texel counted alike.
    pub fn mean(&self) -> f64 {
        self.texels.iter().flatten().map(|&x| f64::from(x)).sum::<f64>() / (3 * self.texels.len()) as f64
    }

    /// Largest channel of any texel.
    pub fn max(&self) -> f32 {
        self.texels.iter().flatten().fold(0.0, |max, &x| max.max(x))
    }
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
