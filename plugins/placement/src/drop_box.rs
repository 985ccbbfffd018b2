//! Objects that start in a box above the table, to be dropped.

use crate::oriented_box::OrientedBox;
use crate::surface::OtherMaterial;
use std::sync::Arc;
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{AssetRef, BodyDraft, Motion, Object, Role, Tabletop};

/// Free space left between the boxes of any two bodies, metres.
const GAP_M: f64 = 0.001;

/// How often the box grows for one object before the object is put on top of all others.
const MOST_GROWTHS: u32 = 16;

/// Draws objects and starts them in a box above the tabletop, to be dropped by the settler.
///
/// The middle of an object's bounding box starts uniformly in a box that is `width_factor` times as wide and long as
/// the tabletop and begins `clearance_m` above it. Objects are numbered in the order in which they are drawn.
///
/// With `overlap_free`, the bounding boxes of no two bodies overlap at the start. A place is drawn up to `max_tries`
/// times; when the box is full it grows upwards, so that every object finds a place.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DropBox {
    /// Pools that the objects are drawn from, uniformly over all their entries.
    #[schemars(length(min = 1))]
    from: Vec<ObjectPool>,
    /// How many objects there are, drawn for each scene.
    #[serde(default = "one_to_forty")]
    count: IntDist,
    /// Whether an asset can come more than once in a scene.
    #[serde(default = "yes")]
    with_replacement: bool,
    /// Height of the box's underside above the tabletop, metres.
    #[serde(default = "clearance")]
    #[schemars(range(min = 0.0, max = 100.0))]
    clearance_m: f64,
    /// Height of the box, metres.
    #[serde(default = "height")]
    #[schemars(range(min = 0.0, max = 100.0))]
    height_m: f64,
    /// Width and length of the box as a part of the tabletop's: 1 in the paper, 0.6 in the released program.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 10.0))]
    width_factor: f64,
    /// How objects are turned at the start.
    #[serde(default)]
    rotation: DropRotation,
    /// Whether objects may not overlap at the start.
    #[serde(default = "yes")]
    overlap_free: bool,
    /// How many places are tried for an object before the box grows.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    max_tries: u32,
    /// Another material for some objects, whose shape and mass stay, such as `{ from = "materials", probability = 0.2 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<OtherMaterial>,
    /// Whether labels speak of the objects. Without, they are distractors: they fall, lie among the others and hide
    /// them; what falls off the table lies on the floor.
    #[serde(default = "yes")]
    annotated: bool,
}

/// How objects are turned at the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DropRotation {
    /// Uniform over all rotations.
    #[default]
    UniformSo3,
    /// Roll, pitch and yaw about the fixed axes x, y and z, each uniform in 0 to 360 degrees, as in the paper; prefers
    /// poses near the poles.
    UniformEuler,
    /// Upright, turned about the vertical only.
    UniformYaw,
}

fn one_to_forty() -> IntDist {
    IntDist::Integers(1, 40)
}
fn yes() -> bool {
    true
}
fn clearance() -> f64 {
    0.2
}
fn height() -> f64 {
    0.8
}
fn one() -> f64 {
    1.0
}
fn tries() -> u32 {
    100
}

impl Config for DropBox {
    type Stage = dyn Placer;
    const KIND: &'static str = "drop_box";
    const EXAMPLE: &'static str =
        "from = [\"objects\"]\ncount = { integers = [1, 40] }\nrotation = \"uniform_euler\"\nwidth_factor = 0.6";

    fn build(self) -> Result<Box<dyn Placer>, Invalid> {
        if self.from.is_empty() {
            return Err(Invalid::new("from", "`from = []` names no pool of objects"));
        }
        self.count.within("count", i64::from(self.annotated), 10_000)?;
        for (key, value) in
            [("clearance_m", self.clearance_m), ("height_m", self.height_m), ("width_factor", self.width_factor)]
        {
            if !(0.0..=100.0).contains(&value) {
                return Err(Invalid::new(key, format!("`{key} = {value}` is outside 0 to 100")));
            }
        }
        self.material.as_ref().map_or(Ok(()), OtherMaterial::check)?;
        Ok(Box::new(self))
    }
}
register!(DropBox);

impl Placer for DropBox {
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let tabletop = scene.tabletop()?;
        let count = self.count.draw(&mut context.stream.child("count")) as usize;
        let once = if self.with_replacement { None } else { Some(self.distinct(count, context)?) };
        let mut taken: Vec<OrientedBox> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room)
            .map(|(_, body)| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, GAP_M / 2.0))
            .collect();
        let mut space = Space::new(self, &tabletop);
        for k in 0..once.as_ref().map_or(count, Vec::len) {
            let stream = context.stream.child("object").at(k as u64);
            let (asset, object) = match &once {
                Some(drawn) => drawn[k].clone(),
                None => context.assets.draw_object(&self.from, &mut stream.child("asset"))?,
            };
            let rotation = self.rotation.draw(&mut stream.child("rotation"));
            let pose = if self.overlap_free {
                self.free_pose(&object, rotation, &mut space, &mut taken, &stream.child("place"))
            } else {
                pose_at(&object, rotation, space.draw(&mut stream.child("place")))
            };
            let surface = match &self.material {
                Some(other) => other.draw(context.assets, &stream.child("surface"))?,
                None => None,
            };
            let role = if self.annotated { Role::Object } else { Role::Distractor };
            scene.add(BodyDraft::new(asset, object, pose, role, Motion::Dynamic).with_surface(surface));
        }
        Ok(())
    }
}

impl DropBox {
    /// Draws objects, none twice. A bad asset is passed over.
    fn distinct(&self, count: usize, context: &Context) -> Result<Vec<(AssetRef, Arc<Object>)>> {
        let mut all = Vec::new();
        for pool in &self.from {
            for entry in context.assets.entries(pool.as_str())? {
                all.push(AssetRef { pool: pool.as_str().to_owned(), name: entry.name.clone() });
            }
        }
        let most = self.count.range().1;
        if most > all.len() as i64 {
            let message = format!("`count` can become {most}, but there are {} assets to draw from", all.len());
            return Err(Error::new(message).help("set with_replacement = true, or a smaller count"));
        }
        context.stream.child("order").shuffle(&mut all);
        let mut drawn = Vec::new();
        let mut last = None;
        for asset in all {
            if drawn.len() == count {
                break;
            }
            match context.assets.object(&asset) {
                Ok(object) => drawn.push((asset, object)),
                Err(error) => last = Some(error),
            }
        }
        match last {
            Some(error) if drawn.is_empty() => Err(error.context("no asset can be used; the last one")),
            Some(error) if drawn.len() < count => {
                let message = format!("only {} of {count} objects can be drawn without replacement", drawn.len());
                context.log.warn(&Error::new(message).help(format!("the others are bad; the last one: {error}")));
                Ok(drawn)
            }
            _ => Ok(drawn),
        }
    }

    /// A pose whose box overlaps none of the boxes that are taken; takes it.
    fn free_pose(
        &self,
        object: &Object,
        rotation: UnitQuaternion<f64>,
        space: &mut Space,
        taken: &mut Vec<OrientedBox>,
        stream: &Stream,
    ) -> Pose {
        let bounds = object.mesh.bounds();
        let mut tries = stream.clone();
        for _ in 0..=MOST_GROWTHS {
            for _ in 0..self.max_tries {
                let pose = pose_at(object, rotation, space.draw(&mut tries));
                let candidate = OrientedBox::new(&bounds, &pose, GAP_M / 2.0);
                if !taken.iter().any(|other| other.overlaps(&candidate)) {
                    taken.push(candidate);
                    return pose;
                }
            }
            space.high += bounds.diagonal().max(GAP_M);
        }
        let mut at = space.draw(&mut tries);
        let level = OrientedBox::new(&bounds, &pose_at(object, rotation, at), GAP_M / 2.0);
        at.z = taken.iter().map(OrientedBox::top).fold(space.low, f64::max) + level.half_height() + GAP_M;
        let pose = pose_at(object, rotation, at);
        taken.push(OrientedBox::new(&bounds, &pose, GAP_M / 2.0));
        pose
    }
}

impl DropRotation {
    fn draw(self, stream: &mut Stream) -> UnitQuaternion<f64> {
        let mut turn = || stream.unit() * std::f64::consts::TAU;
        match self {
            Self::UniformSo3 => stream.rotation(),
            Self::UniformEuler => {
                let (roll, pitch, yaw) = (turn(), turn(), turn());
                UnitQuaternion::from_euler_angles(roll, pitch, yaw)
            }
            Self::UniformYaw => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn()),
        }
    }
}

/// Where the middles of objects start.
struct Space {
    centre: Point3<f64>,
    half: [f64; 2],
    low: f64,
    high: f64,
}

impl Space {
    fn new(options: &DropBox, tabletop: &Tabletop) -> Self {
        let low = tabletop.height() + options.clearance_m;
        Self {
            centre: tabletop.centre(),
            half: tabletop.size.map(|edge| options.width_factor * edge / 2.0),
            low,
            high: low + options.height_m,
        }
    }

    fn draw(&self, stream: &mut Stream) -> Point3<f64> {
        let [x, y] = self.half.map(|half| stream.uniform(-half, half));
        Point3::new(self.centre.x + x, self.centre.y + y, stream.uniform(self.low, self.high))
    }
}

/// The pose that puts the middle of an object's bounding box at a point.
fn pose_at(object: &Object, rotation: UnitQuaternion<f64>, middle: Point3<f64>) -> Pose {
    let shift = middle.coords - rotation * object.mesh.bounds().centre().coords;
    Pose::from_parts(shift.into(), rotation)
}
