//! Placer `slider`: an object with scripted motion.

use syntable_model::geometry::{Translation3, UnitQuaternion};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Moment, Motion, Role, Trajectory};

/// Places an object in the middle of a support. It slides along world x for a while.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slider {
    /// Object pools to draw from.
    from: ObjectPools,
    /// Name of the support. Default: the first support that a step sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Speed along x, m/s.
    #[schemars(range(min = -10.0, max = 10.0))]
    speed_m_s: f64,
    /// Duration of the motion, seconds.
    #[schemars(range(min = 0.001, max = 1000.0))]
    duration_s: f64,
}

impl Config for Slider {
    type Stage = dyn Placer;
    const KIND: &'static str = "slider";
    const EXAMPLE: &'static str = "from = [\"objects\"]\nspeed_m_s = 0.1\nduration_s = 2";
    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Placer for Slider {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Needs(Part::support(self.support.as_ref()))])
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let center = scene.support(self.support.as_ref())?.center();
        let (asset, object) = context.assets.draw_object(&self.from, &mut context.stream.child("asset"))?;
        let start = Translation3::new(center.x, center.y, center.z - object.mesh.bounds().min.z);
        let way = Translation3::new(self.speed_m_s * self.duration_s, 0.0, 0.0);
        let pose = |at: Translation3<f64>| Pose::from_parts(at, UnitQuaternion::identity());
        let end = Moment::from_seconds(self.duration_s)?;
        let trajectory = Trajectory::new(vec![(Moment::START, pose(start)), (end, pose(way * start))])?;
        let body = BodyDraft::new(asset, object, pose(start), Role::Object, Motion::Fixed);
        scene.add(body.scripted(trajectory));
        Ok(())
    }
}
register!(Slider);
