//! Clutter on the floor around the table.

use crate::oriented_box::OrientedBox;
use crate::surface::{OtherMaterial, check_probability};
use crate::table::turned_bounds;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use syntable_model::geometry::{Aabb, UnitQuaternion, Vector3, space_around};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, BodyDraft, Motion, Object, Role, Tabletop};

/// Free space left around a distractor, metres.
const GAP_M: f64 = 0.005;

/// Assets that are drawn for one distractor until one has a size that is allowed.
const MOST_DRAWS: u32 = 32;

/// Distractors: things that stand or lie on the floor around the table. They are seen and throw shadows, but no label
/// speaks of them, and they never move.
///
/// A distractor stands upright or lies on one side, turned at random, with its lowest point on the floor, z = 0. Its
/// place is uniform over the floor from `distance_m[0]` to `distance_m[1]` beside the tabletop, seen from above, within
/// the walls of the room, and free of other bodies. What finds no place is left out. For distractors on the table, use
/// `drop_box` with `annotated = false`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Distractors {
    /// Pools that they are drawn from, uniformly over all their entries.
    #[schemars(length(min = 1))]
    from: Vec<ObjectPool>,
    /// How many there are, drawn for each scene.
    #[serde(default = "a_few")]
    count: IntDist,
    /// Distance of their boxes from the tabletop's rectangle, seen from above, metres: smallest and largest.
    #[serde(default = "around")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    distance_m: [f64; 2],
    /// Longest edge of their boxes, metres: smallest and largest. Others are drawn again.
    #[serde(default = "sizes")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    size_m: [f64; 2],
    /// Probability that one lies on its side.
    #[serde(default = "some")]
    #[schemars(range(min = 0.0, max = 1.0))]
    lying_probability: f64,
    /// Another material for some of them, such as `{ from = "materials", probability = 0.2 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<OtherMaterial>,
    /// How many places are tried for one.
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

impl Config for Distractors {
    type Stage = dyn Placer;
    const KIND: &'static str = "distractors";
    const EXAMPLE: &'static str = "from = [\"objects\"]\ncount = { integers = [2, 10] }\ndistance_m = [0.1, 1.5]";

    fn build(self) -> Result<Box<dyn Placer>, Invalid> {
        if self.from.is_empty() {
            return Err(Invalid::new("from", "`from = []` names no pool of objects"));
        }
        self.count.within("count", 0, 10_000)?;
        for (key, [low, high]) in [("distance_m", self.distance_m), ("size_m", self.size_m)] {
            if !(0.0 <= low && low <= high && high <= 1000.0) {
                let message = format!("`{key} = [{low}, {high}]` must be two numbers in 0 to 1000, the smaller first");
                return Err(Invalid::new(key, message));
            }
        }
        check_probability("lying_probability", self.lying_probability)?;
        self.material.as_ref().map_or(Ok(()), OtherMaterial::check)?;
        Ok(Box::new(self))
    }
}
register!(Distractors);

impl Placer for Distractors {
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let tabletop = scene.tabletop()?;
        let parts = scene.bodies().filter(|(_, body)| body.role == Role::Room).map(|(_, body)| body.world_bounds());
        let room = space_around(&tabletop.centre(), parts);
        let mut taken: Vec<OrientedBox> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room)
            .map(|(_, body)| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, GAP_M / 2.0))
            .collect();
        for k in 0..self.count.draw(&mut context.stream.child("count")).max(0) as u64 {
            let stream = context.stream.child("object").at(k);
            let Some((asset, object)) = self.asset(context, &mut stream.child("asset"))? else { continue };
            let rotation = self.rotation(&mut stream.child("rotation"));
            let Some(pose) =
                self.free_pose(&object, rotation, &tabletop, &room, &mut taken, &mut stream.child("place"))
            else {
                continue;
            };
            let surface = match &self.material {
                Some(other) => other.draw(context.assets, &stream.child("surface"))?,
                None => None,
            };
            scene.add(BodyDraft::new(asset, object, pose, Role::Distractor, Motion::Fixed).with_surface(surface));
        }
        Ok(())
    }
}

impl Distractors {
    /// An asset whose size is allowed, if one is found.
    fn asset(&self, context: &Context, stream: &mut Stream) -> Result<Option<(AssetRef, Arc<Object>)>> {
        for _ in 0..MOST_DRAWS {
            let (asset, object) = context.assets.draw_object(&self.from, stream)?;
            let edge = object.mesh.bounds().size().max();
            if (self.size_m[0]..=self.size_m[1]).contains(&edge) {
                return Ok(Some((asset, object)));
            }
        }
        Ok(None)
    }

    /// Upright or on one of the four sides, then turned about the vertical.
    fn rotation(&self, stream: &mut Stream) -> UnitQuaternion<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.unit() * TAU);
        if !stream.chance(self.lying_probability) {
            return turn;
        }
        let axis = if stream.chance(0.5) { Vector3::x_axis() } else { Vector3::y_axis() };
        let angle = if stream.chance(0.5) { FRAC_PI_2 } else { -FRAC_PI_2 };
        turn * UnitQuaternion::from_axis_angle(&axis, angle)
    }

    /// A pose on the floor whose box overlaps none of those taken, if one is found; takes it.
    fn free_pose(
        &self,
        object: &Object,
        rotation: UnitQuaternion<f64>,
        tabletop: &Tabletop,
        room: &Aabb,
        taken: &mut Vec<OrientedBox>,
        stream: &mut Stream,
    ) -> Option<Pose> {
        let bounds = turned_bounds(&object.mesh, &rotation);
        let (size, middle) = (bounds.size(), bounds.centre());
        let [near, far] = self.distance_m;
        let reach = [0, 1].map(|k| tabletop.size[k] / 2.0 + far + size[k] / 2.0);
        for _ in 0..self.max_tries {
            let at: [f64; 2] = std::array::from_fn(|k| stream.uniform(-reach[k], reach[k]));
            let beside = [0, 1].map(|k| (at[k].abs() - (tabletop.size[k] + size[k]) / 2.0).max(0.0));
            let distance = beside[0].hypot(beside[1]);
            if distance < near.max(1e-9) || distance > far {
                continue;
            }
            let shift = Vector3::new(
                tabletop.centre[0] + at[0] - middle.x,
                tabletop.centre[1] + at[1] - middle.y,
                -bounds.min.z,
            );
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
