//! The options of the kind `rapier`.

use crate::settle::Settle;
use syntable_model::prelude::*;

/// Lets bodies fall and come to rest with the rapier3d rigid-body engine.
///
/// Objects collide as convex parts. The run ends early when everything sleeps. Then bodies off the tabletop are taken
/// out, and bodies that still move or are sunk deeper than a limit are dropped again or taken out, until no such body
/// is left. The scene's settle report tells speed, spin, depth and what was removed and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rapier {
    /// Longest simulated time, s, of the fall and of every later try; it ends early when everything sleeps.
    #[schemars(range(min = 0.01, max = 60.0))]
    pub(crate) duration_s: f64,
    /// Time step, s. Longer steps are faster and sink deeper.
    #[schemars(range(min = 0.0005, max = 0.04))]
    pub(crate) time_step_s: f64,
    /// Acceleration of gravity, m/s².
    #[schemars(range(min = 0.1, max = 30.0))]
    pub(crate) gravity_m_s2: f64,
    /// Collision shape of bodies.
    pub(crate) collision: Collision,
    /// Most convex parts of one body, for `collision = "decomposition"`; a few more can come about.
    #[schemars(range(min = 1, max = 256))]
    pub(crate) max_parts: u32,
    /// Voxels along the longest side of a mesh while it is decomposed.
    #[schemars(range(min = 8, max = 400))]
    pub(crate) resolution: u32,
    /// Volume by which a convex part may exceed what it covers, as a fraction of the whole hull's volume.
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub(crate) concavity: f64,
    /// Mass of dynamic bodies: `"real"`, the object's own, or `{ kg = 1.0 }` for all alike.
    pub(crate) mass: Mass,
    /// Coefficient of restitution of all contacts: 0 does not bounce, 1 bounces back fully.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(crate) restitution: f64,
    /// Damping of angular velocity, 1/s: stands in for rolling friction.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub(crate) angular_damping_per_s: f64,
    /// Which bodies are taken out for where they ended.
    pub(crate) remove: Remove,
    /// What happens to a body that exceeds a limit below.
    pub(crate) on_violation: OnViolation,
    /// How often one body is dropped again before it is taken out.
    #[schemars(range(max = 20))]
    pub(crate) max_drops: u32,
    /// Limit on the speed of a body's centre of mass, m/s.
    #[schemars(range(min = 0.0001, max = 10.0))]
    pub(crate) max_speed_m_s: f64,
    /// Limit on a body's angular speed, rad/s.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub(crate) max_spin_rad_s: f64,
    /// Limit on how deep two bodies may be in each other, m.
    #[schemars(range(min = 0.0005, max = 1.0))]
    pub(crate) max_penetration_m: f64,
}

/// Collision shape of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Collision {
    /// Convex parts: those that the object brings, or an approximate convex decomposition of its mesh.
    Decomposition,
    /// One convex hull a body, as in SynTable's released code: hollow things are closed.
    ConvexHull,
}

/// Mass of dynamic bodies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mass {
    /// The object's own.
    Real,
    /// The same for all, kg. SynTable's released code uses 1.
    Kg(f64),
}

/// Which bodies are taken out for where they ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Remove {
    /// Objects below the tabletop or beyond its width and length, judged by the middle of their bounding box.
    OffTabletop,
    /// None.
    Keep,
}

/// What happens to a body that exceeds a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnViolation {
    /// It is dropped again from above the pile with a new start pose; after `max_drops` tries it is taken out.
    DropAgain,
    /// It is taken out.
    Remove,
    /// It stays as it is, and the report tells.
    Keep,
}

impl Default for Rapier {
    fn default() -> Self {
        Self {
            duration_s: 5.0,
            time_step_s: 1.0 / 240.0,
            gravity_m_s2: 9.81,
            collision: Collision::Decomposition,
            max_parts: 16,
            resolution: 64,
            concavity: 0.01,
            mass: Mass::Real,
            restitution: 0.0,
            angular_damping_per_s: 0.5,
            remove: Remove::OffTabletop,
            on_violation: OnViolation::DropAgain,
            max_drops: 3,
            max_speed_m_s: 0.01,
            max_spin_rad_s: 0.1,
            max_penetration_m: 0.005,
        }
    }
}

impl Config for Rapier {
    type Stage = dyn Settler;
    const KIND: &'static str = "rapier";
    const EXAMPLE: &'static str = "\
duration_s = 5.0
remove = \"off_tabletop\"
on_violation = \"drop_again\"
max_penetration_m = 0.005
max_speed_m_s = 0.01";

    fn build(self) -> Result<Box<dyn Settler>, Invalid> {
        if let Mass::Kg(kg) = self.mass
            && !(0.001..=1000.0).contains(&kg)
        {
            return Err(Invalid::new("mass", format!("`kg = {kg:?}` is outside 0.001 to 1000")));
        }
        if self.time_step_s > self.duration_s {
            let Self { time_step_s, duration_s, .. } = self;
            return Err(Invalid::new(
                "time_step_s",
                format!("{time_step_s:?} is longer than `duration_s = {duration_s:?}`"),
            ));
        }
        Ok(Box::new(Settle::new(self)))
    }
}

syntable_model::register!(Rapier);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::registry::{ConstructError, Entry};

    const ENTRY: Entry = Entry::of::<Rapier>("syntable-physics", "0");

    #[test]
    fn the_example_and_the_released_variant_build() {
        for text in [
            "",
            Rapier::EXAMPLE,
            "collision = \"convex_hull\"\nmass = { kg = 1.0 }\non_violation = \"keep\"\ntime_step_s = 0.016666666666666666",
        ] {
            let built = ENTRY.construct_str(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
            // What is written back reads back the same.
            let again = ENTRY.construct_str(&built.options.to_string()).expect("reads back");
            assert_eq!(built.options, again.options);
        }
    }

    #[test]
    fn what_ranges_cannot_say_is_refused_by_key() {
        for (text, key) in [("mass = { kg = 0 }", "mass"), ("duration_s = 0.01\ntime_step_s = 0.02", "time_step_s")] {
            match ENTRY.construct_str(text) {
                Err(ConstructError::Invalid(invalid)) => assert_eq!(invalid.key, key),
                other => panic!("{text} gave {:?}", other.map(|built| built.options)),
            }
        }
        assert!(matches!(ENTRY.construct_str("mass = \"heavy\""), Err(ConstructError::Form(_))));
        assert!(matches!(ENTRY.construct_str("durration_s = 1"), Err(ConstructError::Form(_))));
    }
}
