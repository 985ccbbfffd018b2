//! The collision shape of one object, in engine units.

use crate::units;
use parry3d::mass_properties::MassProperties;
use parry3d::math::Pose;
use parry3d::shape::{Compound, SharedShape};
use syntable_convex::ConvexHull;
use syntable_model::error::{Error, Result};

/// Convex parts in the body frame.
pub struct CollisionShape {
    /// Each part on its own: single colliders settle better than one compound collider.
    pub parts: Vec<SharedShape>,
    /// All parts as one shape, for measurements.
    pub whole: SharedShape,
    /// Mass properties at the density of water.
    pub water: MassProperties,
}

impl CollisionShape {
    /// Builds the shape from hulls in meters. Fails if there is none, or if their mass is zero or not finite.
    pub fn new(hulls: &[ConvexHull]) -> Result<Self> {
        let parts: Vec<SharedShape> =
            hulls.iter().filter_map(|hull| Some(SharedShape::new(hull.polyhedron(units::PER_METER)?))).collect();
        let whole = match &parts[..] {
            [] => {
                return Err(
                    Error::new("no collision shape can be made of its mesh").help("check its size and its faces")
                );
            }
            [one] => one.clone(),
            many => SharedShape::new(Compound::new(many.iter().map(|part| (Pose::IDENTITY, part.clone())).collect())),
        };
        let water = whole.mass_properties(1000.0 / units::PER_METER.powi(3));
        let is_usable = water.mass() > 0.0
            && water.mass().is_finite()
            && water.local_com.is_finite()
            && water.inv_principal_inertia.is_finite();
        if !is_usable {
            return Err(Error::new(format!("its collision shape has no usable mass: {} kg of water", water.mass()))
                .help("check its size"));
        }
        Ok(Self { parts, whole, water })
    }

    /// Mass properties for a mass in kg, of uniform density.
    pub fn with_mass(&self, kg: f64) -> MassProperties {
        let mut properties = self.water;
        properties.set_mass(kg as f32, true);
        properties
    }

    /// Bounding box at a pose.
    pub fn bounds(&self, pose: &Pose) -> parry3d::bounding_volume::Aabb {
        self.whole.compute_aabb(pose)
    }
}
