//! View sampler `time_lapse`: one camera, several moments.

use syntable_model::geometry::{Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::{Moment, ViewId};

/// A camera above the main support that looks down. Views follow each other in time.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TimeLapse {
    /// Height of the camera above the support, meters.
    #[schemars(range(min = 0.1, max = 100.0))]
    height_m: f64,
    /// Time from one view to the next, seconds.
    #[schemars(range(min = 0.0, max = 1000.0))]
    interval_s: f64,
}

impl Default for TimeLapse {
    fn default() -> Self {
        Self { height_m: 1.0, interval_s: 1.0 }
    }
}

impl Config for TimeLapse {
    type Stage = dyn ViewSampler;
    const KIND: &'static str = "time_lapse";
    const EXAMPLE: &'static str = "height_m = 1.0\ninterval_s = 0.5";
    fn build(self) -> Result<Box<dyn ViewSampler>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ViewSampler for TimeLapse {
    fn moment(&self, _: &Scene, view: ViewId) -> Result<Moment> {
        Moment::from_seconds(self.interval_s * f64::from(view.0))
    }

    fn pose(&self, scene: &Scene, _: ViewId, _: &Context) -> Result<Pose> {
        let target = scene.support(None)?.center();
        Ok(look_at(target + self.height_m * Vector3::z(), target, Vector3::y()))
    }

    fn shell(&self, scene: &Scene) -> Result<Shell> {
        Ok(Shell { center: scene.support(None)?.center(), radius: [self.height_m; 2] })
    }
}
register!(TimeLapse);
