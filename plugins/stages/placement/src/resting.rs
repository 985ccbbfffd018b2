//! Poses in which objects rest, and their shapes in them.

use crate::footprint::Footprint;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use syntable_mesh::resting::RestingShape;
use syntable_model::context::Cache;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::Object;

/// Points of a shape within this distance of its highest point are its top, meters.
const TOP_M: f64 = 0.0015;

/// The pose in which an object is put down, up to its yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RestingPose {
    /// The stable pose whose up direction is nearest to the +z axis of the object's file: cans and bottles stand.
    Upright,
    /// The pose of the object's file: its +z axis points up.
    AsModeled,
    /// A stable pose, drawn by its probability.
    StablePose,
}

impl RestingPose {
    /// Its name in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Upright => "upright",
            Self::AsModeled => "as_modeled",
            Self::StablePose => "stable_pose",
        }
    }

    /// Draws the rotation of an object whose yaw is 0.
    pub fn draw(self, shape: &RestingShape, stream: &mut Stream) -> UnitQuaternion<f64> {
        let up = match self {
            Self::AsModeled => None,
            Self::Upright => shape.upright(),
            Self::StablePose => shape.stable(stream.unit()),
        };
        up.map_or_else(UnitQuaternion::identity, |up| turned_up(&Vector3::from(up)))
    }
}

/// The smallest rotation that turns a direction of a body upwards.
fn turned_up(up: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(up, &Vector3::z()).unwrap_or_else(half_turn)
}

/// The shapes of the objects that a step has placed so far.
#[derive(Debug, Default)]
pub struct RestingShapes(Mutex<BTreeMap<Digest, Arc<RestingShape>>>);

impl Clone for RestingShapes {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl RestingShapes {
    /// The shape of an object. Objects of one asset share it, whatever their sizes.
    pub fn of(&self, object: &Object, cache: &dyn Cache) -> ResizedShape {
        let (own, factor) = object.at_own_size();
        let known = |shapes: &Self| {
            let shapes = shapes.0.lock().unwrap_or_else(PoisonError::into_inner);
            shapes.get(&own.digest).cloned()
        };
        let shape = known(self).unwrap_or_else(|| {
            let shape = Arc::new(cached(own, cache));
            let mut shapes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(shapes.entry(own.digest).or_insert(shape))
        });
        ResizedShape { shape, factor }
    }
}

/// The shape from the cache between runs, or computed.
fn cached(object: &Object, cache: &dyn Cache) -> RestingShape {
    let key = RestingShape::key(object);
    cache.get("resting-shapes", key).and_then(|bytes| RestingShape::decode(&bytes)).unwrap_or_else(|| {
        let shape = RestingShape::of(object);
        cache.put("resting-shapes", key, &shape.encode());
        shape
    })
}

/// The shape of an object at its size.
#[derive(Debug, Clone)]
pub struct ResizedShape {
    shape: Arc<RestingShape>,
    factor: f64,
}

impl ResizedShape {
    /// The shape of the asset, for its poses.
    pub fn of_asset(&self) -> &RestingShape {
        &self.shape
    }

    /// The footprint at a pose.
    pub fn footprint(&self, world_from_body: &Pose) -> Footprint {
        Footprint::of(self.corners().map(|p| world_from_body * p))
    }

    /// The footprint of its highest points at a pose: the outline that the next object of a stack stands on.
    pub fn top(&self, world_from_body: &Pose) -> Footprint {
        let high = self.footprint(world_from_body).high;
        Footprint::of(self.corners().map(|p| world_from_body * p).filter(|p| p.z >= high - TOP_M))
    }

    /// The corners of its convex hull, body frame, meters.
    pub fn corners(&self) -> impl Iterator<Item = Point3<f64>> {
        self.shape.corners.iter().map(|p| Point3::from(p.map(|x| f64::from(x) * self.factor)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_turn_upwards() {
        for up in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.36, 0.48, -0.8]] {
            assert!((turned_up(&Vector3::from(up)) * Vector3::from(up) - Vector3::z()).norm() < 1e-9, "{up:?}");
        }
    }
}
