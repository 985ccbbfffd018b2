//! Settler `straight_drop`: objects fall straight down, without physics.

use syntable_model::geometry::{Aabb, Translation3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyHandle, Motion, SettleReport};

/// Moves each body straight down until its bounding box meets the main support or the box of a body below. It neither
/// tilts nor rolls a body, so a scene is ready in microseconds.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StraightDrop {
    /// Distance that remains between a body and its support, meters.
    #[schemars(range(min = 0.0, max = 0.1))]
    gap_m: f64,
}

impl Default for StraightDrop {
    fn default() -> Self {
        Self { gap_m: 0.001 }
    }
}

impl Config for StraightDrop {
    type Stage = dyn Settler;
    const KIND: &'static str = "straight_drop";
    const EXAMPLE: &'static str = "gap_m = 0.001";
    fn build(self) -> Result<Box<dyn Settler>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Settler for StraightDrop {
    fn settle(&self, scene: &mut SceneBuilder, _: &Context) -> Result<SettleReport> {
        let table = scene.support(None)?.height();
        let mut falling: Vec<(BodyHandle, Aabb)> = scene
            .bodies()
            .filter(|(_, body)| body.motion == Motion::Dynamic)
            .map(|(handle, body)| (handle, body.world_bounds()))
            .collect();
        // The lowest body lands first. The sort is stable, so equal heights keep the order of the placers.
        falling.sort_by(|(_, a), (_, b)| a.min.z.total_cmp(&b.min.z));
        let mut landed: Vec<Aabb> = Vec::new();
        for (handle, mut bounds) in falling {
            let below = landed.iter().filter(|other| overlap(other, &bounds)).map(|other| other.max.z);
            let move_m = below.fold(table, f64::max) + self.gap_m - bounds.min.z;
            if let Some(body) = scene.body(handle) {
                let pose = Translation3::new(0.0, 0.0, move_m) * body.world_from_body;
                scene.set_pose(handle, pose);
            }
            bounds.min.z += move_m;
            bounds.max.z += move_m;
            landed.push(bounds);
        }
        Ok(SettleReport::default())
    }
}
register!(StraightDrop);

/// Whether two boxes overlap, seen from above.
fn overlap(a: &Aabb, b: &Aabb) -> bool {
    (0..2).all(|axis| a.min[axis] < b.max[axis] && b.min[axis] < a.max[axis])
}
