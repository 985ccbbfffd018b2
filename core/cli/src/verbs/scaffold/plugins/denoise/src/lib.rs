//! Denoiser `box_filter`: the mean of neighboring pixels of the same body.

use syntable_model::prelude::*;
use syntable_model::product::standard::{DENOISER, INSTANCE, RADIANCE, RADIANCE_NOISY};

/// Replaces each pixel by the mean of the pixels around it that show the same body, so outlines stay sharp.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BoxFilter {
    /// Number of pixels to each side that the mean covers.
    #[schemars(range(min = 1, max = 8))]
    radius_px: u32,
}

impl Default for BoxFilter {
    fn default() -> Self {
        Self { radius_px: 1 }
    }
}

impl Config for BoxFilter {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "box_filter";
    const EXAMPLE: &'static str = "radius_px = 1";
    fn build(self) -> Result<Box<dyn Denoiser>, ConfigError> {
        Ok(Box::new(self))
    }
}

// By default, a denoiser provides `RADIANCE` and `DENOISER`, and the rendered image keeps the key `RADIANCE_NOISY`.
impl Denoiser for BoxFilter {
    fn reads(&self) -> Vec<KeyId> {
        keys![RADIANCE_NOISY, INSTANCE]
    }

    fn denoise(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (noisy, bodies) = (products.get(RADIANCE_NOISY)?, products.get(INSTANCE)?);
        let (width, height, radius) = (noisy.width(), noisy.height(), self.radius_px);
        let mean = |x: u32, y: u32| {
            let (mut sum, mut count) = ([0.0; 3], 0.0);
            for row in y.saturating_sub(radius)..=(y + radius).min(height - 1) {
                for column in x.saturating_sub(radius)..=(x + radius).min(width - 1) {
                    if bodies.at(column, row) == bodies.at(x, y) {
                        let pixel = noisy.at(column, row);
                        sum = std::array::from_fn(|channel| sum[channel] + pixel[channel]);
                        count += 1.0;
                    }
                }
            }
            sum.map(|total: f32| total / count)
        };
        let smooth = Plane::from_fn(width, height, mean);
        products.put(RADIANCE, smooth)?;
        products.put(DENOISER, Value::record([("name", Self::KIND.into())]))
    }
}
register!(BoxFilter);
