//! Depth images in millimeters.

use syntable_formats::depth::DepthSource;
use syntable_formats::encode::png::{PngImage, Rounding, depth_image};
use syntable_model::prelude::*;

/// How to store what a depth image cannot hold.
const DEEPER: &str = "the layout has whole millimeters; also write depth with npy or exr";

/// 16-bit depth along the optical axis in whole millimeters, rounded to the nearest; 0 without a surface or measurement.
pub fn image(source: DepthSource, products: &Products, log: &dyn Log) -> Result<PngImage> {
    Ok(depth_image(products.get(source.key())?, 1.0, Rounding::Nearest, (log, DEEPER)))
}
