//! Clutter on the floor around a support.

use crate::bounds::rotated_bounds;
use crate::material::MaterialReplacement;
use crate::oriented_box::OrientedBox;
use crate::variation::{ColorChange, FinishChange, SCALE, Variation, resized};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use syntable_model::geometry::{Aabb, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, BodyDraft, Motion, Object, Region, Role};

/// Minimum gap around a distractor, meters.
const GAP_M: f64 = 0.005;

/// Maximum number of assets drawn for one distractor until one is within `size_m`.
const MAX_DRAWS: u32 = 32;

/// Places distractors on the floor around a support such as the table: static objects that are visible and cast shadows, but have no
/// masks.
///
/// A distractor is upright or on one of its sides, with uniform yaw and its lowest point on the floor, z = 0. Its
/// position is uniform over the floor at a horizontal distance of `distance_m[0]` to `distance_m[1]` from the support,
/// within the walls of the room and free of other bodies. A distractor for which no position is found is left out. For
/// distractors on the table, use `drop_box` with `annotated = false`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Distractors {
    /// Object pools to draw from.
    from: ObjectPools,
    /// Number of distractors, drawn per scene; 0 to 10000.
    #[serde(default = "a_few")]
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Name of the support to place them around. If left out, it is the first that a step sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Minimum and maximum horizontal distance between a distractor's bounding box and the support, meters.
    #[serde(default = "around")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    distance_m: [f64; 2],
    /// Minimum and maximum of the longest edge of the bounding box, meters. Assets of other sizes are redrawn.
    #[serde(default = "sizes")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    size_m: [f64; 2],
    /// Probability that a distractor is on its side rather than upright.
    #[serde(default = "some")]
    #[schemars(range(min = 0.0, max = 1.0))]
    lying_probability: f64,
    /// Factor of each distractor's size, 0.01 to 100. `size_m` counts after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    scale: Option<Dist>,
    /// Changes the colors of some distractors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some distractors, such as `{ from = "materials", probability = 0.2 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how some objects reflect light, such as `{ roughness = { uniform = [0, 1] } }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Maximum number of positions drawn for one distractor.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    max_tries: u32,
}

fn a_few() -> IntDist {
    IntDist::Integers(2, 10)
}
fn around() -> [f64; 2] {
    [0.1, 1.5]
}
fn sizes() -> [f64; 2] {
    [0.05, 1.5]
}
fn some() -> f64 {
    0.4
}
fn tries() -> u32 {
    100
}

/// Limits of `count`.
const COUNT: [i64; 2] = [0, 10_000];

impl Config for Distractors {
    type Stage = dyn Placer;
    const KIND: &'static str = "distractors";
    const EXAMPLE: &'static str = "from = [\"objects\"]\ncount = { integers = [2, 10] }\ndistance_m = [0.1, 1.5]";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.count.within("count", COUNT[0], COUNT[1])?;
        for (key, [low, high]) in [("distance_m", self.distance_m), ("size_m", self.size_m)] {
            if low > high {
                let message = format!("`{key} = [{low}, {high}]` is empty; write the smaller bound first");
                return Err(ConfigError::new(key, message));
            }
        }
        self.variation().check()?;
        Ok(Box::new(self))
    }
}
register!(Distractors);

impl Placer for Distractors {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Needs(Part::support(self.support.as_ref()))])
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let surface = scene.support(self.support.as_ref())?.surface;
        let room = scene.room_around(&surface.center());
        let mut taken: Vec<OrientedBox> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room)
            .map(|(_, body)| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, GAP_M / 2.0))
            .collect();
        for k in 0..self.count.draw(&mut context.stream.child("count")).max(0) as u64 {
            let stream = context.stream.child("object").at(k);
            let factor = self.variation().factor(&stream);
            let Some((asset, object)) = self.asset(context, factor, &mut stream.child("asset"))? else { continue };
            let object = resized(object, factor).map_err(|error| error.context(asset.to_string()))?;
            let rotation = self.rotation(&mut stream.child("rotation"));
            let Some(pose) = self.free_pose(&object, rotation, &surface, &room, &mut taken, &mut stream.child("place"))
            else {
                continue;
            };
            let body = BodyDraft::new(asset, object, pose, Role::Distractor, Motion::Fixed);
            scene.add(self.variation().painted(body, context.assets, &stream)?);
        }
        Ok(())
    }
}

impl Distractors {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    /// Draws an asset that is within `size_m` at a factor of its size; `None` if too many draws fail.
    fn asset(&self, context: &Context, factor: f64, stream: &mut Stream) -> Result<Option<(AssetRef, Arc<Object>)>> {
        for _ in 0..MAX_DRAWS {
            let (asset, object) = context.assets.draw_object(&self.from, stream)?;
            let edge = object.mesh.bounds().size().max() * factor;
            if (self.size_m[0]..=self.size_m[1]).contains(&edge) {
                return Ok(Some((asset, object)));
            }
        }
        Ok(None)
    }

    /// Upright or on one of four sides, with uniform yaw.
    fn rotation(&self, stream: &mut Stream) -> UnitQuaternion<f64> {
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.unit() * TAU);
        if !stream.chance(self.lying_probability) {
            return yaw;
        }
        let axis = if stream.chance(0.5) { Vector3::x_axis() } else { Vector3::y_axis() };
        let angle = if stream.chance(0.5) { FRAC_PI_2 } else { -FRAC_PI_2 };
        yaw * UnitQuaternion::from_axis_angle(&axis, angle)
    }

    /// Finds a pose on the floor whose box overlaps none of `taken`, and adds its box to them; `None` after
    /// `max_tries`.
    fn free_pose(
        &self,
        object: &Object,
        rotation: UnitQuaternion<f64>,
        surface: &Region,
        room: &Aabb,
        taken: &mut Vec<OrientedBox>,
        stream: &mut Stream,
    ) -> Option<Pose> {
        let bounds = rotated_bounds(&object.mesh, &rotation);
        let (size, center) = (bounds.size(), bounds.center());
        let [nearest, farthest] = self.distance_m;
        let (edges, middle) = (surface.size(), surface.center());
        let half_range = [0, 1].map(|k| edges[k] / 2.0 + farthest + size[k] / 2.0);
        for _ in 0..self.max_tries {
            let at: [f64; 2] = std::array::from_fn(|k| stream.uniform(-half_range[k], half_range[k]));
            let beside = [0, 1].map(|k| (at[k].abs() - (edges[k] + size[k]) / 2.0).max(0.0));
            let distance = libm::hypot(beside[0], beside[1]);
            if distance < nearest.max(1e-9) || distance > farthest {
                continue;
            }
            let shift = Vector3::new(middle.x + at[0] - center.x, middle.y + at[1] - center.y, -bounds.min.z);
            let (low, high) = (bounds.min + shift, bounds.max + shift);
            let inside = |k: usize| room.min[k] + GAP_M <= low[k] && high[k] + GAP_M <= room.max[k];
            if !(inside(0) && inside(1) && high.z <= room.max.z) {
                continue;
            }
            let pose = Pose::from_parts(shift.into(), rotation);
            let candidate = OrientedBox::new(&object.mesh.bounds(), &pose, GAP_M / 2.0);
            if !taken.iter().any(|other| other.overlaps(&candidate)) {
                taken.push(candidate);
                return Some(pose);
            }
        }
        None
    }
}
