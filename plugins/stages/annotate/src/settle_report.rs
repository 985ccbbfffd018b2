//! The result of the physics simulation.

use syntable_model::prelude::*;
use syntable_model::product::standard::SETTLE_REPORT;
use syntable_model::scene;

/// Number of objects in the scene, and the report of the settler: residual speed, maximum penetration, maximum distance
/// of collision shapes from hollows of the meshes, and removed objects.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SettleReport {}

config!(SettleReport => dyn SceneAnnotator, "settle_report");

impl SceneAnnotator for SettleReport {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![SETTLE_REPORT]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        products.put(SETTLE_REPORT, Value::of(&Report::from(cx.scene))?)
    }
}

/// The product `settle_report`.
#[derive(Serialize)]
struct Report<'a> {
    objects: usize,
    attempt: u32,
    simulated_s: f64,
    residual_speed_m_s: f64,
    residual_angular_speed_rad_s: f64,
    deepest_penetration_m: f64,
    collision_deviation_m: f64,
    respawned: u32,
    removed: Vec<Removal<'a>>,
    removed_distractors: u32,
    spare: u32,
}

/// A removed object.
#[derive(Serialize)]
struct Removal<'a> {
    spawn: u32,
    /// Pool and name.
    asset: String,
    reason: &'a str,
}

impl<'a> From<&'a Scene> for Report<'a> {
    fn from(scene: &'a Scene) -> Self {
        let report = &scene.settle;
        Self {
            objects: scene.objects().len(),
            attempt: scene.attempt,
            simulated_s: report.simulated_s,
            residual_speed_m_s: report.residual_speed_m_s,
            residual_angular_speed_rad_s: report.residual_angular_speed_rad_s,
            deepest_penetration_m: report.deepest_penetration_m,
            collision_deviation_m: report.collision_deviation_m,
            respawned: report.respawned,
            removed: report.removed.iter().map(Removal::from).collect(),
            removed_distractors: report.removed_distractors,
            spare: report.spare,
        }
    }
}

impl<'a> From<&'a scene::Removal> for Removal<'a> {
    fn from(removal: &'a scene::Removal) -> Self {
        Self { spawn: removal.spawn, asset: removal.asset.to_string(), reason: &removal.reason }
    }
}

register!(SettleReport);
