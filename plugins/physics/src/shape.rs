//! The collision shape of one object, ready for the engine, in its units.

use crate::hull::Hull;
use crate::units;
use parry3d::mass_properties::MassProperties;
use parry3d::math::Pose;
use parry3d::shape::{Compound, SharedShape};
use syntable_model::error::{Error, Result};

/// Convex parts in the body frame.
pub struct CollisionShape {
    /// Each part on its own: one collider a part settles better than one compound collider.
    pub parts: Vec<SharedShape>,
    /// All parts in one: for measuring.
    pub whole: SharedShape,
    /// Mass properties at the density of water.
    pub water: MassProperties,
}

impl CollisionShape {
    /// Builds the shape.
    pub fn new(hulls: &[Hull]) -> Result<Self> {
        let parts: Vec<SharedShape> =
            hulls.iter().filter_map(|hull| Some(SharedShape::new(hull.polyhedron(units::PER_METRE)?))).collect();
        let whole = match &parts[..] {
            [] => {
                return Err(
                    Error::new("no collision shape can be made of its mesh").help("check its size and its faces")
                );
            }
            [one] => one.clone(),
            many => SharedShape::new(Compound::new(many.iter().map(|part| (Pose::IDENTITY, part.clone())).collect())),
        };
        let water = whole.mass_properties(1000.0 / units::PER_METRE.powi(3));
        let sound = water.mass() > 0.0
            && water.mass().is_finite()
            && water.local_com.is_finite()
            && water.inv_principal_inertia.is_finite();
        if !sound {
            return Err(Error::new(format!("its collision shape has no usable mass: {} kg of water", water.mass()))
                .help("check its size"));
        }
        Ok(Self { parts, whole, water })
    }

    /// Mass properties for a mass, kg, spread evenly over the parts.
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
