//! No physics.

use syntable_model::context::Context;
use syntable_model::prelude::*;
use syntable_model::scene::SettleReport;

/// Leaves every body where its placer put it: no gravity, no collisions, nothing is removed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoPhysics {}

impl Config for NoPhysics {
    type Stage = dyn Settler;
    const KIND: &'static str = "none";
    const EXAMPLE: &'static str = "";

    fn build(self) -> Result<Box<dyn Settler>, ConfigError> {
        Ok(Box::new(self))
    }
}
register!(NoPhysics);

impl Settler for NoPhysics {
    fn settle(&self, _: &mut SceneBuilder, _: &Context) -> Result<SettleReport> {
        Ok(SettleReport::default())
    }
}
