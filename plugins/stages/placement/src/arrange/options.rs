//! The options of the kind `arrange`.

use super::layout::Layout;
use super::limits::GAP_M;
use crate::material::MaterialReplacement;
use crate::objects::{COUNT, DENSITY_KG_M3, FRICTION, ObjectOptions, RESTITUTION};
use crate::resting::{RestingPose, RestingShapes};
use crate::variation::{ColorChange, FinishChange, SCALE, Variation};
use std::collections::BTreeMap;
use syntable_model::pools::MAX_WEIGHT;
use syntable_model::prelude::*;

/// Limits of `stack`.
const STACK: [i64; 2] = [1, 50];

/// Limits of `yaw_deg`, degrees.
const YAW_DEG: [f64; 2] = [-3600.0, 3600.0];

/// Puts objects down on a support: upright or in other poses in which they rest, apart from each other, scattered, in rows or on
/// a grid, one on each place or a stack of them.
///
/// `pose` decides which side of an object is down. A stable pose is computed from the convex hull and the center of mass of the
/// object, with its probability: the quasi-static estimate of Goldberg et al. (IEEE Trans. Robotics and Automation 15, 1999). The yaw
/// is drawn. The lowest point of an object is 1 mm above the surface, so that it comes to rest where it is put. Scattered objects are at least `gap_m` from other
/// bodies, seen from above. In rows, `gap_m` is the distance of the objects in a row. Each one is above the surface with its whole outline. An object that finds no place
/// is left out, so a scene can have fewer than `count` objects.
///
/// If `support` is the name of several supports, such as the boards of a shelf, `scatter` takes one of them per object, by area. In the
/// other layouts, each gets an equal part of the objects, in order.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arrange {
    /// Object pools to draw from.
    pub(super) from: ObjectPools,
    /// Maximum number of objects, drawn per scene; 1 to 10000, or from 0 with `annotated = false`.
    #[serde(default = "some")]
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    pub(super) count: IntDist,
    /// Whether the same asset can occur more than once in a scene.
    #[serde(default = "yes")]
    pub(super) with_replacement: bool,
    /// Name of the support to put the objects on. If left out, it is the first that a step sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) support: Option<SupportName>,
    /// Where the objects are.
    #[serde(default)]
    pub(super) layout: Layout,
    /// Which side is down: one pose, or a table of weights, such as `{ upright = 0.7, stable_pose = 0.3 }`.
    #[serde(default = "upright")]
    pub(super) pose: Poses,
    /// Turn about the vertical, degrees, against the edges of the support. By default any turn when scattered, and 0 otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = YAW_DEG[0], "maximum" = YAW_DEG[1]))]
    pub(super) yaw_deg: Option<Dist>,
    /// Number of objects on each other at each place, 1 to 50. Only objects that are flat on top carry others.
    #[serde(default = "one")]
    #[schemars(extend("minimum" = STACK[0], "maximum" = STACK[1]))]
    pub(super) stack: IntDist,
    /// Whether the objects of a row and of a stack are copies of one asset, of one size and color.
    #[serde(default = "yes")]
    pub(super) alike: bool,
    /// Distance of an object from the others, meters, 0 to 10.
    #[serde(default = "gap")]
    #[schemars(extend("minimum" = GAP_M[0], "maximum" = GAP_M[1]))]
    pub(super) gap_m: Dist,
    /// Ratio of the width and length of the area used to the support's, around its center.
    #[serde(default = "all")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub(super) area_factor: f64,
    /// Maximum number of positions drawn for an object.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    pub(super) max_tries: u32,
    /// Factor of each object's size, 0.01 to 100; the mass grows with its cube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    pub(super) scale: Option<Dist>,
    /// Changes the colors of some objects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) color: Option<ColorChange>,
    /// Replaces the material of some objects, such as `{ from = "materials", probability = 0.2 }`. Shape and mass stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) material: Option<MaterialReplacement>,
    /// Changes how some objects reflect light, such as `{ roughness = { uniform = [0, 1] } }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) finish: Option<FinishChange>,
    /// Whether the objects are labeled. Otherwise, they are distractors.
    #[serde(default = "yes")]
    pub(super) annotated: bool,
    /// Whether the objects stay where they are placed, as if they were glued.
    #[serde(default)]
    pub(super) fixed: bool,
    /// Coulomb friction coefficient of each object, 0 to 10. Default: the asset's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FRICTION[0], "maximum" = FRICTION[1]))]
    pub(super) friction: Option<Dist>,
    /// Coefficient of restitution of each object, 0 to 1. Default: the asset's, or else the value of `[settle]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = RESTITUTION[0], "maximum" = RESTITUTION[1]))]
    pub(super) restitution: Option<Dist>,
    /// Density of each object, kg/m³, 1 to 30000. Default: the asset's mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = DENSITY_KG_M3[0], "maximum" = DENSITY_KG_M3[1]))]
    pub(super) density_kg_m3: Option<Dist>,
    #[serde(skip)]
    pub(super) shapes: RestingShapes,
}

/// The poses of objects: one, or several by weight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Poses {
    /// The same for all objects.
    One(RestingPose),
    /// Weights of poses.
    Weighted(BTreeMap<RestingPose, f64>),
}

impl Poses {
    fn check(&self) -> Result<(), ConfigError> {
        let Self::Weighted(weights) = self else { return Ok(()) };
        if let Some((pose, weight)) = weights.iter().find(|(_, weight)| !(0.0..=MAX_WEIGHT).contains(*weight)) {
            let message = format!("the weight {weight} is not within 0 and {MAX_WEIGHT}");
            return Err(ConfigError::new(format!("pose.{}", pose.name()), message));
        }
        if weights.values().all(|weight| *weight == 0.0) {
            return Err(ConfigError::new("pose", "no pose has a weight above 0").help("name one: pose = \"upright\""));
        }
        Ok(())
    }

    /// Draws the pose of an object.
    pub fn draw(&self, stream: &mut Stream) -> RestingPose {
        match self {
            Self::One(pose) => *pose,
            Self::Weighted(weights) => {
                let drawn = stream.pick_by_weight(weights.values().copied());
                drawn.and_then(|place| weights.keys().nth(place)).copied().unwrap_or(RestingPose::Upright)
            }
        }
    }
}

fn some() -> IntDist {
    IntDist::Integers(5, 20)
}
fn one() -> IntDist {
    IntDist::Constant(1)
}
fn yes() -> bool {
    true
}
fn upright() -> Poses {
    Poses::One(RestingPose::Upright)
}
fn gap() -> Dist {
    Dist::Constant(0.01)
}
fn all() -> f64 {
    1.0
}
fn tries() -> u32 {
    100
}

impl Arrange {
    /// Refuses values that make no sense.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.options().check()?;
        self.layout.check()?;
        self.pose.check()?;
        self.stack.within("stack", STACK[0], STACK[1])?;
        self.gap_m.within("gap_m", GAP_M[0], GAP_M[1])?;
        self.yaw_deg.as_ref().map_or(Ok(()), |yaw| yaw.within("yaw_deg", YAW_DEG[0], YAW_DEG[1]))?;
        let has_copies = self.alike && (self.stack.range().1 > 1 || self.layout.has_rows());
        if has_copies && !self.with_replacement {
            let message = "copies of an asset in a row or a stack need `with_replacement = true`";
            return Err(ConfigError::new("alike", message).help("set `alike = false`, or remove `with_replacement`"));
        }
        Ok(())
    }

    pub(super) fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    pub(super) fn options(&self) -> ObjectOptions<'_> {
        ObjectOptions {
            from: &self.from,
            count: &self.count,
            with_replacement: self.with_replacement,
            variation: self.variation(),
            annotated: self.annotated,
            fixed: self.fixed,
            friction: self.friction.as_ref(),
            restitution: self.restitution.as_ref(),
            density_kg_m3: self.density_kg_m3.as_ref(),
        }
    }

    /// Draws the turn of an object about the vertical, radians.
    pub(super) fn yaw(&self, stream: &mut Stream) -> f64 {
        let default = if self.layout == Layout::Scatter { Dist::Uniform(0.0, 360.0) } else { Dist::Constant(0.0) };
        self.yaw_deg.as_ref().unwrap_or(&default).draw(stream).to_radians()
    }
}
