//! Sensor `dead_pixels`: a camera with pixels that stay black.

use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

products! {
    /// The developed image, sRGB, with pixels that are black at random.
    pub const RGB_DEAD_PIXELS: Key<Plane<[u8; 3]>> = view("rgb_dead_pixels").semantic(Semantic::Color);
}

/// Blackens random pixels of the developed image.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DeadPixels {
    /// Probability that a pixel is black.
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
}

impl Default for DeadPixels {
    fn default() -> Self {
        Self { probability: 0.001 }
    }
}

impl Config for DeadPixels {
    type Stage = dyn Sensor;
    const KIND: &'static str = "dead_pixels";
    const EXAMPLE: &'static str = "probability = 0.01";
    fn build(self) -> Result<Box<dyn Sensor>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Sensor for DeadPixels {
    fn reads(&self) -> Vec<KeyId> {
        keys![RGB]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![RGB_DEAD_PIXELS]
    }

    fn sense(&self, _: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()> {
        let mut stream = stream.clone();
        let image = products.get(RGB)?.map(|&pixel| if stream.chance(self.probability) { [0; 3] } else { pixel });
        products.put(RGB_DEAD_PIXELS, image)
    }
}
register!(DeadPixels);
