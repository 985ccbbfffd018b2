//! Other objects at the places of recorded ones.

use crate::material::always;
use crate::resting::{RestingPose, RestingShapes};
use std::sync::Arc;
use syntable_model::geometry::{Aabb, Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, Object};

/// An object may be larger than the recorded one by this, meters.
const LARGER_M: f64 = 0.01;

/// Maximum number of objects drawn for one place.
const MAX_TRIES: u64 = 50;

/// Replaces some recorded objects by others, which stand upright at the same places.
///
/// An object that is at most 1 cm wider, longer and higher than the recorded one takes its place. If none of 50 drawn objects is,
/// the recorded object stays.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// Pools of the other objects.
    from: ObjectPools,
    /// Probability that an object is replaced.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
}

/// An object at a pose.
pub struct Swapped {
    /// Its asset.
    pub asset: AssetRef,
    /// The object.
    pub object: Arc<Object>,
    /// Its pose.
    pub world_from_body: Pose,
}

impl Swap {
    /// Draws the object at the place of another with these bounds in the world. None if the other stays.
    pub fn draw(
        &self,
        bounds: &Aabb,
        shapes: &RestingShapes,
        stream: &Stream,
        context: &Context,
    ) -> Result<Option<Swapped>> {
        if !stream.child("swap").chance(self.probability) {
            return Ok(None);
        }
        let room = bounds.size().add_scalar(LARGER_M);
        for number in 0..MAX_TRIES {
            let mut stream = stream.child("other").at(number);
            let (asset, object) = context.assets.draw_object(&self.from, &mut stream)?;
            let shape = shapes.of(&object, context.cache);
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.uniform(0.0, std::f64::consts::TAU));
            let rotation = yaw * RestingPose::Upright.draw(shape.of_asset(), &mut stream);
            let turned = Pose::from_parts(Vector3::zeros().into(), rotation);
            let own = Aabb::of(shape.corners().map(|p| turned * p));
            if own.size().iter().zip(room.iter()).all(|(own, room)| own <= room) {
                let base = |bounds: &Aabb| Point3::new(bounds.center().x, bounds.center().y, bounds.min.z);
                let to = base(bounds) - base(&own);
                return Ok(Some(Swapped { asset, object, world_from_body: Pose::from_parts(to.into(), rotation) }));
            }
        }
        Ok(None)
    }
}
