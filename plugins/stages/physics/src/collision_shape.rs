//! The collision shape of one object, in engine units.

use crate::decompose::ConvexParts;
use crate::units;
use parry3d::math::Pose;
use parry3d::shape::{Compound, SharedShape};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use syntable_convex::Polyhedron;
use syntable_model::error::{Error, Result};

fn without_shape() -> Error {
    Error::unlucky("no collision shape can be made of its mesh").help("check its size and its faces")
}

/// Convex parts in the body frame.
pub struct CollisionShape {
    /// Each part on its own: single colliders settle better than one compound collider.
    pub parts: Vec<SharedShape>,
    /// All parts as one shape, for measurements.
    pub whole: SharedShape,
    /// How far the parts may be from the mesh in its hollows, meters.
    pub deviation_m: f32,
    /// Whether the excessive deviation was reported, of this shape or of the same one at another size.
    told: Arc<AtomicBool>,
}

impl CollisionShape {
    /// Builds the shape from hulls in meters. Fails without hulls.
    pub fn new(ConvexParts { hulls, deviation_m }: &ConvexParts) -> Result<Self> {
        let parts: Vec<SharedShape> = hulls.iter().filter_map(units::shape).collect();
        let whole = match &parts[..] {
            [] => return Err(without_shape()),
            [one] => one.clone(),
            many => SharedShape::new(Compound::new(many.iter().map(|part| (Pose::IDENTITY, part.clone())).collect())),
        };
        Ok(Self { parts, whole, deviation_m: *deviation_m, told: Arc::default() })
    }

    /// The shape at a smaller size: the hulls of the scaled parts, as thick as all hulls. Fails if a part has no hull.
    pub fn scaled(&self, factor: f32) -> Result<Self> {
        let scaled = |part: &SharedShape| {
            let points = Polyhedron::of(&**part)?.points();
            let points: Vec<[f32; 3]> =
                points.iter().map(|point| (*point * (factor / units::PER_METER)).to_array()).collect();
            units::hull(&points)
        };
        let hulls = self.parts.iter().map(scaled).collect::<Option<_>>().ok_or_else(without_shape)?;
        let shape = Self::new(&ConvexParts { hulls, deviation_m: self.deviation_m * factor })?;
        Ok(Self { told: Arc::clone(&self.told), ..shape })
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
