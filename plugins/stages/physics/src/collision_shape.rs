//! The collision shape of one object, in engine units.

use crate::decompose::ConvexParts;
use crate::units;
use parry3d::math::Pose;
use parry3d::shape::{Compound, SharedShape};
use std::sync::atomic::{AtomicBool, Ordering};
use syntable_model::error::{Error, Result};

/// Convex parts in the body frame.
pub struct CollisionShape {
    /// Each part on its own: single colliders settle better than one compound collider.
    pub parts: Vec<SharedShape>,
    /// All parts as one shape, for measurements.
    pub whole: SharedShape,
    /// How far the parts may be from the mesh in its hollows, meters.
    pub deviation_m: f32,
    /// Whether the excessive deviation was reported.
    told: AtomicBool,
}

impl CollisionShape {
    /// Builds the shape from hulls in meters. Fails without hulls.
    pub fn new(ConvexParts { hulls, deviation_m }: &ConvexParts) -> Result<Self> {
        let parts: Vec<SharedShape> =
            hulls.iter().filter_map(|hull| Some(SharedShape::new(hull.polyhedron(units::PER_METER)?))).collect();
        let whole = match &parts[..] {
            [] => {
                return Err(
                    Error::unlucky("no collision shape can be made of its mesh").help("check its size and its faces")
                );
            }
            [one] => one.clone(),
            many => SharedShape::new(Compound::new(many.iter().map(|part| (Pose::IDENTITY, part.clone())).collect())),
        };
        Ok(Self { parts, whole, deviation_m: *deviation_m, told: AtomicBool::new(false) })
    }

    /// Whether this is the first call.
    pub fn is_first_time(&self) -> bool {
        !self.told.swap(true, Ordering::Relaxed)
    }

    /// Bounding box at a pose.
    pub fn bounds(&self, pose: &Pose) -> parry3d::bounding_volume::Aabb {
        self.whole.compute_aabb(pose)
    }
}
