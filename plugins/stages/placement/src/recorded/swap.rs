//! Other objects at the places of recorded ones.

use crate::material::always;
use crate::resting::{RestingPose, RestingShapes};
use std::sync::Arc;
use syntable_model::geometry::{Aabb, Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, Object};

/// An object may be larger than the recorded one by this, meters.
const LARGER_M: f64 = 0.01;

/// An object has at least this fraction of the width, the length and the height of the recorded one.
const SMALLEST: f64 = 0.6;

/// An object that carries others may be lower than the recorded one by this, meters.
const LOWER_M: f64 = 0.01;

/// The base of a carried object is within this distance of the top of the object below it, meters.
const CARRIES_WITHIN_M: f64 = 0.015;

/// Maximum number of objects drawn for one place.
const MAX_TRIES: u64 = 50;

/// Replaces some recorded objects by others, which stand upright at the same places.
///
/// An object replaces the recorded one if it is at most 1 cm wider, longer and higher, and at least 0.6 times as wide, long and
/// high. If another object rests on the recorded one, it is at most 1 cm lower. If none of 50 drawn objects fits, the recorded object
/// stays.
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

/// The place of a recorded object in the world.
pub struct Place {
    bounds: Aabb,
    /// Minimum width, length and height of another object, meters.
    least: Vector3<f64>,
}

impl Place {
    /// The place of one of several objects with some bounds in the world.
    pub fn among(all: &[Aabb], number: usize) -> Self {
        let bounds = all[number];
        let is_above = |other: &Aabb| {
            let is_over = (0..2).all(|axis| other.min[axis] < bounds.max[axis] && bounds.min[axis] < other.max[axis]);
            is_over && (other.min.z - bounds.max.z).abs() <= CARRIES_WITHIN_M
        };
        let mut least = bounds.size() * SMALLEST;
        if all.iter().enumerate().any(|(i, other)| i != number && is_above(other)) {
            least.z = bounds.size().z - LOWER_M;
        }
        Self { bounds, least }
    }

    fn fits(&self, size: &Vector3<f64>) -> bool {
        let most = self.bounds.size().add_scalar(LARGER_M);
        (0..3).all(|axis| (self.least[axis]..=most[axis]).contains(&size[axis]))
    }
}

impl Swap {
    /// Draws the object at the place of another. None if the other stays.
    pub fn draw(
        &self,
        place: &Place,
        shapes: &RestingShapes,
        stream: &Stream,
        context: &Context,
    ) -> Result<Option<Swapped>> {
        if !stream.child("swap").chance(self.probability) {
            return Ok(None);
        }
        for number in 0..MAX_TRIES {
            let mut stream = stream.child("other").at(number);
            let (asset, object) = context.assets.draw_object(&self.from, &mut stream)?;
            let shape = shapes.of(&object, context.cache);
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.uniform(0.0, std::f64::consts::TAU));
            let rotation = yaw * RestingPose::Upright.draw(shape.of_asset(), &mut stream);
            let turned = Pose::from_parts(Vector3::zeros().into(), rotation);
            let own = Aabb::of(shape.corners().map(|p| turned * p));
            if place.fits(&own.size()) {
                let base = |bounds: &Aabb| Point3::new(bounds.center().x, bounds.center().y, bounds.min.z);
                let to = base(&place.bounds) - base(&own);
                return Ok(Some(Swapped { asset, object, world_from_body: Pose::from_parts(to.into(), rotation) }));
            }
        }
        Ok(None)
    }
}
