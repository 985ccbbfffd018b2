//! How much of an object an image shows.

use super::Value;
use crate::error::Result;
use serde::Serialize;

/// Pixels of an object's silhouette: an entry of the product `visibility`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PixelCounts {
    /// Of the whole silhouette, beyond the image as well.
    pub all: u64,
    /// In the image.
    pub in_frame: u64,
    /// In the image, at pixels with a depth.
    pub valid: u64,
    /// That show the object.
    pub visible: u64,
    /// Box of the whole silhouette: x, y, width and height from the image's top-left corner.
    pub silhouette: [i32; 4],
}

#[derive(Serialize)]
struct CountsRecord {
    px_count_all: u64,
    px_count_in_frame: u64,
    px_count_valid: u64,
    px_count_visib: u64,
    visib_fract: f64,
    outside_fract: f64,
    truncated: bool,
    silhouette_box: [i32; 4],
}

impl PixelCounts {
    /// The counts with what follows from them.
    pub fn record(&self) -> Result<Value> {
        let share = |part: u64| if self.all == 0 { 0.0 } else { part as f64 / self.all as f64 };
        Value::of(&CountsRecord {
            px_count_all: self.all,
            px_count_in_frame: self.in_frame,
            px_count_valid: self.valid,
            px_count_visib: self.visible,
            visib_fract: share(self.visible),
            outside_fract: share(self.all.saturating_sub(self.in_frame)),
            truncated: self.all > self.in_frame,
            silhouette_box: self.silhouette,
        })
    }
}
