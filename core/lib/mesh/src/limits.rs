//! Limits on the resources of one asset, checked while it is read.
//!
//! Readers ask the [`Budget`] of their [`AssetRoot`](crate::root::AssetRoot) before they allocate. A small file that
//! expands to a huge asset is therefore refused, and the error names the limit and the option that changes it.

use std::sync::atomic::{AtomicU64, Ordering};
use syntable_model::error::{Error, Result};
use syntable_model::limits::IMAGE_PIXELS;
use syntable_model::stage::AssetLimits;

/// Used and permitted resources of one asset.
#[derive(Debug, Default)]
pub struct Budget {
    limits: AssetLimits,
    bytes: AtomicU64,
    pixels: AtomicU64,
}

impl Budget {
    /// An unused budget.
    pub fn new(limits: AssetLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Reserves bytes of a file or of its decoded content.
    pub fn bytes(&self, count: u64) -> Result<()> {
        let limit = self.limits.megabytes;
        match take(&self.bytes, count, limit.saturating_mul(1_000_000)) {
            Some(()) => Ok(()),
            None => Err(over("its files and their decoded content", "megabytes", limit, "make the files smaller")),
        }
    }

    /// Number of bytes that can still be reserved.
    pub fn bytes_left(&self) -> u64 {
        self.limits.megabytes.saturating_mul(1_000_000).saturating_sub(self.bytes.load(Ordering::Relaxed))
    }

    /// Reserves an image. Refuses an image without pixels, or with more than `max_side` pixels along a side.
    pub fn image(&self, width: u64, height: u64, max_side: u64) -> Result<()> {
        if width == 0 || height == 0 {
            return Err(Error::new(format!("an image of {width} x {height} pixels is empty")));
        }
        if width > max_side || height > max_side {
            let message = format!("{width} x {height} pixels are more than the limit of {max_side} per side");
            return Err(Error::new(message).help("downscale the image"));
        }
        if width * height > IMAGE_PIXELS.most {
            let message =
                format!("{width} x {height} pixels are more than the limit of {} in one image", IMAGE_PIXELS.most);
            return Err(Error::new(message).help("downscale the image"));
        }
        let limit = self.limits.megapixels;
        match take(&self.pixels, width * height, limit.saturating_mul(1_000_000)) {
            Some(()) => Ok(()),
            None => Err(over(
                &format!("with {width} x {height} pixels, its images"),
                "megapixels",
                limit,
                "downscale the images",
            )),
        }
    }

    /// Refuses a mesh with too many triangles in total. Reserves nothing.
    pub fn triangles(&self, total: usize) -> Result<()> {
        match total as u64 <= self.limits.triangles {
            true => Ok(()),
            false => Err(over("its mesh", "triangles", self.limits.triangles, "simplify the mesh")),
        }
    }

    /// Number of triangles that a mesh with `total` triangles may still get.
    pub fn triangles_left(&self, total: usize) -> usize {
        usize::try_from(self.limits.triangles).unwrap_or(usize::MAX).saturating_sub(total)
    }

    /// Refuses a mesh with more vertices in total than its triangles can use. Reserves nothing.
    pub fn vertices(&self, total: usize) -> Result<()> {
        self.triangles(total.div_ceil(3))
    }

    /// Maximum number of bytes of an image of this asset in a decoder.
    pub fn image_bytes(&self) -> u64 {
        self.limits.megapixels.saturating_mul(1_000_000).min(IMAGE_PIXELS.most).saturating_mul(8)
    }
}

/// Adds to the used amount, unless the sum exceeds the limit.
fn take(taken: &AtomicU64, count: u64, limit: u64) -> Option<()> {
    let add = |taken: u64| taken.checked_add(count).filter(|&sum| sum <= limit);
    taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).ok().map(|_| ())
}

fn over(what: &str, unit: &str, limit: u64, or: &str) -> Error {
    Error::new(format!("the asset is too large: {what} would exceed the limit of {limit} {unit}"))
        .help(format!("raise the pool's `limits = {{ {unit} = {limit} }}`, or {or}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_adds_up_to_the_limit() {
        let budget = Budget::new(AssetLimits { triangles: 10, megapixels: 1, megabytes: 2 });
        assert!(budget.bytes(1_500_000).is_ok() && budget.bytes(500_000).is_ok());
        let error = budget.bytes(1).expect_err("one too many").to_string();
        assert!(error.contains("limit of 2 megabytes (raise the pool's `limits = { megabytes = 2 }`"), "{error}");
        assert!(budget.bytes(u64::MAX).is_err() && budget.bytes(0).is_ok());
        assert!(budget.image(1000, 999, 1000).is_ok() && budget.image(10, 100, 1000).is_ok());
        assert!(budget.image(1, 1, 1000).expect_err("full").to_string().contains("1 megapixels"));
        assert!(budget.image(1001, 1, 1000).expect_err("wide").to_string().contains("per side"));
        assert!(budget.image(16_384, 8_193, 16_384).expect_err("large").to_string().contains("in one image"));
        assert!(budget.image(0, 1, 1000).is_err());
        assert!(budget.triangles(10).is_ok() && budget.triangles(11).is_err());
        assert!(budget.vertices(30).is_ok() && budget.vertices(31).is_err());
    }
}
