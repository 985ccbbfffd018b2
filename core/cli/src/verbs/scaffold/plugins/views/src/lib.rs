//! View sampler `top_view`: cameras that look straight down.

use syntable_model::geometry::{Point3, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::ViewId;

/// Cameras above the middle of the tabletop that look straight down, at random heights and random angles about the
/// vertical.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TopView {
    /// Smallest and largest height above the tabletop, meters.
    #[schemars(inner(range(min = 0.1, max = 10.0)))]
    height_m: [f64; 2],
}

impl Default for TopView {
    fn default() -> Self {
        Self { height_m: [0.8, 1.2] }
    }
}

impl Config for TopView {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "top_view";
    const EXAMPLE: &'static str = "height_m = [0.8, 1.2]";
    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        let [low, high] = self.height_m;
        if low > high {
            let message = format!("the smallest height, {low}, is above the largest, {high}");
            return Err(ConfigError::new("height_m", message).help("write the smaller number first"));
        }
        Ok(Box::new(self))
    }
}

impl ViewSampler for TopView {
    fn pose(&self, scene: &Scene, _: ViewId, context: &Context) -> Result<Pose> {
        // Each quantity has its own stream. The streams differ from view to view.
        let height = context.stream.child("height").uniform(self.height_m[0], self.height_m[1]);
        let direction = context.stream.child("up").direction();
        let center: Point3<f64> = scene.support(None)?.center();
        // The image's top points along the horizontal part of a uniform direction.
        Ok(look_at(center + Vector3::z() * height, center, Vector3::new(direction.x, direction.y, 0.0)))
    }

    fn shell(&self, scene: &Scene) -> Result<Shell> {
        Ok(Shell { center: scene.support(None)?.center(), radius: self.height_m })
    }
}
register!(TopView);
