//! The options of the kind `rapier`.

use syntable_model::prelude::*;

/// Lets bodies fall and come to rest with the rapier3d rigid-body engine.
///
/// Objects collide as convex parts. The simulation ends early when all bodies sleep. Bodies off their support (the
/// tabletop, or the support of their drop zone) are then removed. Bodies that still move or penetrate another too
/// deeply are respawned or removed, until no body violates a limit. The scene's settle report lists speeds, penetration
/// depth, and the removed bodies with reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rapier {
    /// Maximum simulated time of the first fall and of every one after respawns, seconds. It ends early when all
    /// bodies sleep.
    #[schemars(range(min = 0.01, max = 60.0))]
    pub(crate) duration_s: f64,
    /// Time step, seconds; at most `duration_s`. Longer steps are faster, but bodies penetrate deeper.
    #[schemars(range(min = 0.0005, max = 0.02))]
    pub(crate) time_step_s: f64,
    /// Gravitational acceleration, m/s², along −z.
    #[schemars(range(min = 0.1, max = 30.0))]
    pub(crate) gravity_m_s2: f64,
    /// Collision shape of objects and supports.
    pub(crate) collision: Collision,
    /// Maximum distance of convex parts from the mesh in its hollows, meters, for `collision = "decomposition"`: an
    /// object in a mug is at most this far above the mug's bottom. Supports have their
    /// own bounds: 1 mm and up to 512 parts with a rim or recesses, 30 mm below a flat top, where no object stays.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub(crate) max_deviation_m: f64,
    /// Maximum number of convex parts per object, for `collision = "decomposition"`. An object that needs more to keep to
    /// `max_deviation_m` is warned about. A mesh of many scattered pieces can exceed it.
    #[schemars(range(min = 1, max = 256))]
    pub(crate) max_parts: u32,
    /// Mass of dynamic bodies: `"real"` for the object's own, or `{ kg = 1.0 }` for the same mass for all.
    pub(crate) mass: Mass,
    /// Coefficient of restitution: 0 is inelastic, 1 fully elastic. A placer can override it for its objects.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(crate) restitution: f64,
    /// Damping of angular velocity, 1/s.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub(crate) angular_damping_per_s: f64,
    /// Coefficient of rolling resistance: a ball that rolls on a level table slows down by 5/7 of this times gravity. Hard
    /// objects on wood have about 0.01, on cloth more. It slows the rotation of every body below 0.5 m/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(crate) rolling_resistance: f64,
    /// Pours the bodies: they start one after another in the order of their placement, this many seconds apart, above
    /// the earlier ones. Without it, all start at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub(crate) pour_interval_s: Option<f64>,
    /// Bodies to remove because of their final position.
    pub(crate) remove: Remove,
    /// Whether to respawn objects before removing them because of their final position, up to `max_respawns` times
    /// each. Nearly all dropped objects then stay on their support.
    pub(crate) respawn_fallen: bool,
    /// Treatment of an object that violates one of the limits below.
    pub(crate) on_violation: OnViolation,
    /// Maximum number of times that one object is respawned before it is removed.
    #[schemars(range(max = 20))]
    pub(crate) max_respawns: u32,
    /// Limit on the speed of an object's center of mass at the end, m/s.
    #[schemars(range(min = 0.0001, max = 10.0))]
    pub(crate) max_speed_m_s: f64,
    /// Limit on an object's angular speed at the end, rad/s.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub(crate) max_angular_speed_rad_s: f64,
    /// Limit on the penetration depth of two bodies, meters.
    #[schemars(range(min = 0.0005, max = 1.0))]
    pub(crate) max_penetration_m: f64,
}

/// Collision shape of objects and supports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Collision {
    /// Convex parts: those supplied by the object, or a convex decomposition of its mesh, which keeps hollows hollow.
    Decomposition,
    /// One convex hull per body, as in SynTable's released code. Concave shapes are filled.
    ConvexHull,
}

/// Mass of dynamic bodies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mass {
    /// The object's own mass.
    Real,
    /// The same mass for all bodies, kg. SynTable's released code uses 1.
    Kg(#[schemars(range(min = 0.001, max = 1000.0))] f64),
}

/// Bodies to remove because of their final position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Remove {
    /// Objects whose bounding-box center is outside the space above their support: below its surface, outside its width
    /// and length, or above the ceiling. The support is the one of their drop zone, such as the tabletop.
    OffTabletop,
    /// No bodies.
    Keep,
}

/// Treatment of an object that violates a limit. An object that only moves gets `duration_s` more time first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnViolation {
    /// The object is respawned above the pile, in its start orientation turned about the vertical, and removed after
    /// `max_respawns` respawns. Distractors are removed at once.
    Respawn,
    /// It is removed.
    Remove,
    /// It stays, and the settle report shows the violation.
    Keep,
}

impl Default for Rapier {
    fn default() -> Self {
        Self {
            duration_s: 5.0,
            time_step_s: 1.0 / 240.0,
            gravity_m_s2: 9.81,
            collision: Collision::Decomposition,
            max_deviation_m: 0.008,
            max_parts: 64,
            mass: Mass::Real,
            restitution: 0.0,
            angular_damping_per_s: 0.5,
            rolling_resistance: 0.01,
            pour_interval_s: None,
            remove: Remove::OffTabletop,
            respawn_fallen: false,
            on_violation: OnViolation::Respawn,
            max_respawns: 3,
            max_speed_m_s: 0.01,
            max_angular_speed_rad_s: 0.1,
            max_penetration_m: 0.005,
        }
    }
}
