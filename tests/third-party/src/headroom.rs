//! Annotator `headroom`: a float image that no writer knows.

use syntable_model::prelude::*;
use syntable_model::product::standard::DEPTH;

products! {
    /// Depth of the farthest surface of the view minus the depth at the pixel center. 0 without a surface.
    pub const HEADROOM: Key<Plane<f32>> = view("headroom").semantic(Semantic::Depth).unit("m");
}

/// Measures the difference in depth to the view's farthest surface.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Headroom {}

impl Config for Headroom {
    type Stage = dyn ViewAnnotator;
    const KIND: &'static str = "headroom";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ViewAnnotator for Headroom {
    fn reads(&self) -> Vec<KeyId> {
        keys![DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![HEADROOM]
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let depth = products.get(DEPTH)?;
        let farthest = depth.data().iter().copied().filter(|depth| depth.is_finite()).fold(0.0, f32::max);
        let headroom = depth.map(|&depth| if depth.is_finite() { farthest - depth } else { 0.0 });
        products.put(HEADROOM, headroom)
    }
}
register!(Headroom);
