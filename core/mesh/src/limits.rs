//! Limits that readers check before they allocate.

use syntable_model::error::{Error, Result};

/// Maximum size of a file that is read, bytes.
pub const MAX_FILE_BYTES: u64 = 4 << 30;
/// Maximum number of triangles, and of vertices, of a model, with instances expanded.
pub const MAX_TRIANGLES: usize = 16_000_000;

/// Refuses a model with more than [`MAX_TRIANGLES`].
pub fn check_triangles(count: usize) -> Result<()> {
    if count > MAX_TRIANGLES {
        return Err(Error::new(format!("the model has more than {MAX_TRIANGLES} triangles"))
            .help("simplify the mesh before use"));
    }
    Ok(())
}

/// Refuses an image with no pixels, more than `max_side` pixels along a side or more than `max_pixels` in total.
pub(crate) fn check_pixels(width: u64, height: u64, max_side: u64, max_pixels: u64) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::new(format!("an image of {width} x {height} pixels is empty")));
    }
    if width > max_side || height > max_side || width * height > max_pixels {
        return Err(Error::new(format!(
            "{width} x {height} pixels are more than the limit of {max_side} per side and {max_pixels} in total"
        ))
        .help("downscale the image"));
    }
    Ok(())
}
