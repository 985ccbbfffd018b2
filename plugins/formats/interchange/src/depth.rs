//! Depth images in millimeters.

use syntable_formats::encode::png::{PngImage, Rounding, depth_image};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, DEPTH_SENSED};

/// How to store what a depth image cannot hold.
const DEEPER: &str = "the layout has whole millimeters; also write depth with npy or exr";

/// Source of the depth that is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthSource {
    /// Exact depth of the surfaces.
    #[default]
    Rendered,
    /// Measurements of a depth camera, with its noise and holes.
    Sensed,
}

impl DepthSource {
    fn key(self) -> Key<Plane<f32>> {
        match self {
            Self::Rendered => DEPTH,
            Self::Sensed => DEPTH_SENSED,
        }
    }

    /// The product of this source.
    pub fn input(self) -> Input {
        Input { option: Some("depth".into()), ..Input::of(self.key()) }
    }

    /// 16-bit depth along the optical axis in whole millimeters, rounded to the nearest; 0 without a surface.
    pub fn image(self, products: &Products, log: &dyn Log) -> Result<PngImage> {
        Ok(depth_image(products.get(self.key())?, 1.0, Rounding::Nearest, (log, DEEPER)))
    }
}
