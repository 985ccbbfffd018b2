//! How a scene came to rest.

use syntable_model::prelude::*;
use syntable_model::product::standard::SETTLE_REPORT;
use syntable_model::scene::Removal;

/// Residual speed, deepest penetration and removed objects of the scene, as the settler reported them, and the number
/// of objects that stayed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SettleReport {}

impl Config for SettleReport {
    type Stage = dyn Annotator;
    const KIND: &'static str = "settle_report";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, Invalid> {
        Ok(Box::new(self))
    }
}

impl Annotator for SettleReport {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![SETTLE_REPORT]
    }

    fn annotate(&self, site: &Site, frame: &mut Frame) -> Result<()> {
        let report = &site.scene.settle;
        let record = Value::record([
            ("objects", (site.scene.objects().len() as i64).into()),
            ("attempt", site.scene.attempt.into()),
            ("simulated_s", report.simulated_s.into()),
            ("residual_speed_m_s", report.residual_speed_m_s.into()),
            ("residual_spin_rad_s", report.residual_spin_rad_s.into()),
            ("deepest_penetration_m", report.deepest_penetration_m.into()),
            ("dropped_again", report.dropped_again.into()),
            ("removed", report.removed.iter().map(removal).collect::<Vec<_>>().into()),
        ]);
        frame.put(SETTLE_REPORT, record)
    }
}

fn removal(removal: &Removal) -> Value {
    Value::record([
        ("spawn", removal.spawn.into()),
        ("asset", removal.asset.to_string().into()),
        ("reason", removal.reason.as_str().into()),
    ])
}

register!(SettleReport);
