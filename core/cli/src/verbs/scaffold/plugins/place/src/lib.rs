//! Placer `object_tower`: objects above each other in the middle of a support.

use syntable_model::geometry::{Translation3, UnitQuaternion};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, DropZone, Motion, Role};

/// Places objects in a column above the middle of a support.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectTower {
    /// Object pools to draw from.
    from: ObjectPools,
    /// Name of the support. If left out, it is the first that a step sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Number of objects; 1 to 20.
    #[serde(default = "three")]
    #[schemars(extend("minimum" = 1, "maximum" = 20))]
    count: IntDist,
}

fn three() -> IntDist {
    IntDist::Constant(3)
}

impl Config for ObjectTower {
    type Stage = dyn Placer;
    const KIND: &'static str = "object_tower";
    const EXAMPLE: &'static str = "from = [\"objects\"]\ncount = 3";
    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.count.within("count", 1, 20)?;
        Ok(Box::new(self))
    }
}

impl Placer for ObjectTower {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Needs(Part::support(self.support.as_ref()))])
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let support = scene.support(self.support.as_ref())?.clone();
        let mut height = support.height();
        // Each quantity has its own stream, so that one more object does not change the others.
        for k in 0..self.count.draw(&mut context.stream.child("count")).max(0) as u64 {
            let (asset, object) = context.assets.draw_object(&self.from, &mut context.stream.child("asset").at(k))?;
            let bounds = object.mesh.bounds();
            let center = support.center();
            let pose = Pose::from_parts(
                Translation3::new(center.x, center.y, height - bounds.min.z),
                UnitQuaternion::identity(),
            );
            height += bounds.size().z + 0.002;
            let body = BodyDraft::new(asset, object, pose, Role::Object, Motion::Dynamic);
            // The settler keeps the objects that stay on the support, and drops again the ones that fall off.
            scene.drop_body(body, DropZone::on(support.clone()));
        }
        Ok(())
    }
}
register!(ObjectTower);
