//! Objects that start in a box above a support.

use crate::material::MaterialReplacement;
use crate::oriented_box::OrientedBox;
use crate::variation::{ColorChange, SCALE, Variation, resized};
use std::sync::Arc;
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetRef, BodyDraft, DropZone, Motion, Object, Region, Role};

/// Minimum gap between the bounding boxes of any two bodies, meters.
const GAP_M: f64 = 0.001;

/// Maximum number of times that the box grows for one object before the object is placed above all others.
const MAX_GROWTHS: u32 = 16;

/// Draws objects and places them in a box above a support such as the tabletop, from where the settler drops them.
///
/// The center of each object's bounding box is uniform in a box that is `width_factor` times as wide and long as the
/// support and starts `clearance_m` above it. Objects are numbered in the order in which they are drawn.
///
/// With `overlap_free`, no two bounding boxes overlap at the start: up to `max_tries` positions are drawn per object,
/// then the box grows upwards until the object fits. The box ends at the ceiling of the room, or at the upper end of
/// the support's space.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DropBox {
    /// Object pools to draw from.
    from: ObjectPools,
    /// Number of objects, drawn per scene; 1 to 10000, or from 0 with `annotated = false`.
    #[serde(default = "one_to_forty")]
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Whether the same asset can occur more than once in a scene.
    #[serde(default = "yes")]
    with_replacement: bool,
    /// Name of the support to drop on. If left out, it is the first that a step sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Height of the bottom of the box above the support, meters.
    #[serde(default = "clearance")]
    #[schemars(range(min = 0.0, max = 100.0))]
    clearance_m: f64,
    /// Height of the box, meters.
    #[serde(default = "height")]
    #[schemars(range(min = 0.0, max = 100.0))]
    height_m: f64,
    /// Ratio of the width and length of the box to the support's: 1 in the paper, 0.6 in SynTable's released code.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 10.0))]
    width_factor: f64,
    /// Distribution of initial rotations.
    #[serde(default)]
    rotation: DropRotation,
    /// Whether to keep the bounding boxes of all bodies apart at the start.
    #[serde(default = "yes")]
    overlap_free: bool,
    /// Maximum number of positions drawn for an object before the box grows, for `overlap_free`.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    max_tries: u32,
    /// Factor of each object's size, 0.01 to 100; the mass grows with its cube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    scale: Option<Dist>,
    /// Changes the colors of some objects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some objects, such as `{ from = "materials", probability = 0.2 }`. Shape and mass stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Whether the objects are labeled. Otherwise, they are distractors: they fall and occlude like objects, have no
    /// masks, and stay on the floor if they fall off the support. Without a floor, they are removed in that case, and
    /// also if they still move in the end.
    #[serde(default = "yes")]
    annotated: bool,
    /// Whether the objects stay where they are placed, as if they were held. They are annotated nevertheless.
    #[serde(default)]
    fixed: bool,
    /// Coulomb friction coefficient of each object, 0 to 10. Default: the asset's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FRICTION[0], "maximum" = FRICTION[1]))]
    friction: Option<Dist>,
    /// Coefficient of restitution of each object, 0 to 1. Default: the value of `[settle]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = RESTITUTION[0], "maximum" = RESTITUTION[1]))]
    restitution: Option<Dist>,
}

/// Limits of `friction`.
const FRICTION: [f64; 2] = [0.0, 10.0];

/// Limits of `restitution`.
const RESTITUTION: [f64; 2] = [0.0, 1.0];

/// Distribution of initial rotations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DropRotation {
    /// Uniform over all rotations.
    #[default]
    UniformSo3,
    /// Roll, pitch and yaw about the fixed axes x, y and z, each uniform in 0° to 360°, as in the paper. Not uniform
    /// over rotations: denser near the poles.
    UniformEuler,
    /// Upright, with uniform rotation about the world z axis.
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

/// Limits of `count`. With `annotated`, the minimum is one object.
const COUNT: [i64; 2] = [0, 10_000];

impl Config for DropBox {
    type Stage = dyn Placer;
    const KIND: &'static str = "drop_box";
    const EXAMPLE: &'static str =
        "from = [\"objects\"]\ncount = { integers = [1, 40] }\nrotation = \"uniform_euler\"\nwidth_factor = 0.6";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.count.within("count", i64::from(self.annotated), COUNT[1])?;
        self.variation().check()?;
        self.friction.as_ref().map_or(Ok(()), |friction| friction.within("friction", FRICTION[0], FRICTION[1]))?;
        self.restitution
            .as_ref()
            .map_or(Ok(()), |restitution| restitution.within("restitution", RESTITUTION[0], RESTITUTION[1]))?;
        Ok(Box::new(self))
    }
}
register!(DropBox);

impl Placer for DropBox {
    fn parts(&self) -> Option<Vec<PartUse>> {
        Some(vec![PartUse::Needs(Part::support(self.support.as_ref()))])
    }

    fn places_objects(&self) -> bool {
        self.annotated
    }

    fn resizes_objects(&self) -> bool {
        self.annotated && self.variation().resizes()
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let support = scene.support(self.support.as_ref())?.clone();
        let count = self.count.draw(&mut context.stream.child("count")) as usize;
        let materials = self.material.as_ref().map_or(0, |_| count);
        context.assets.expect(if self.with_replacement { count + materials } else { count });
        let once = if self.with_replacement { None } else { Some(self.distinct(count, context)?) };
        if once.is_some() {
            context.assets.expect(materials);
        }
        let mut taken: Vec<OrientedBox> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room)
            .map(|(_, body)| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, GAP_M / 2.0))
            .collect();
        let zone = DropZone { area: support.surface.scaled(self.width_factor), support };
        let mut space = StartBox::new(self, &zone, scene.space_top(&zone.support))?;
        for k in 0..once.as_ref().map_or(count, Vec::len) {
            let stream = context.stream.child("object").at(k as u64);
            let (asset, object) = match &once {
                Some(drawn) => drawn[k].clone(),
                None => context.assets.draw_object(&self.from, &mut stream.child("asset"))?,
            };
            let factor = self.variation().factor(&stream);
            let object = resized(object, factor).map_err(|error| error.context(asset.to_string()))?;
            let rotation = self.rotation.draw(&mut stream.child("rotation"));
            let pose = if self.overlap_free {
                self.free_pose(&object, rotation, &mut space, &mut taken, &stream.child("place")).map_err(|error| {
                    error.context(format!("{asset}, object {} of {count}", k + 1)).help(
                        "lower `count` or `clearance_m`, raise `width_factor` or the height of the room, or set \
                         overlap_free = false",
                    )
                })?
            } else {
                pose_at(&object, rotation, space.draw(&mut stream.child("place")))
            };
            let role = if self.annotated { Role::Object } else { Role::Distractor };
            let motion = if self.fixed { Motion::Fixed } else { Motion::Dynamic };
            let body = BodyDraft::new(asset, object, pose, role, motion);
            let body = self.variation().painted(body, context.assets, &stream)?;
            let draw = |dist: &Dist, name: &str| dist.draw(&mut stream.child(name));
            let body = BodyDraft {
                friction: self.friction.as_ref().map_or(body.friction, |dist| draw(dist, "friction")),
                restitution: self.restitution.as_ref().map(|dist| draw(dist, "restitution")),
                ..body
            };
            scene.drop_body(body, zone.clone());
        }
        Ok(())
    }
}

impl DropBox {
    fn variation(&self) -> Variation<'_> {
        Variation { scale: self.scale.as_ref(), color: self.color.as_ref(), material: self.material.as_ref() }
    }

    /// Draws distinct objects. Assets that cannot be loaded are skipped.
    fn distinct(&self, count: usize, context: &Context) -> Result<Vec<(AssetRef, Arc<Object>)>> {
        let all = context.assets.drawn_order(&self.from, &mut context.stream.child("order"))?;
        let max_count = self.count.range().1;
        if max_count > all.len() as i64 {
            let message = format!("`count` can become {max_count}, but its pools have {} assets", all.len());
            return Err(Error::new(message).help("set with_replacement = true, or a smaller count"));
        }
        let mut drawn = Vec::new();
        let mut last = None;
        for asset in all {
            if drawn.len() == count {
                break;
            }
            match context.assets.get(&asset).and_then(Asset::into_object) {
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

    /// Finds a pose whose box overlaps none of `taken`, and adds its box to them.
    fn free_pose(
        &self,
        object: &Object,
        rotation: UnitQuaternion<f64>,
        space: &mut StartBox,
        taken: &mut Vec<OrientedBox>,
        stream: &Stream,
    ) -> Result<Pose> {
        let bounds = object.mesh.bounds();
        let mut tries = stream.clone();
        for _ in 0..=MAX_GROWTHS {
            for _ in 0..self.max_tries {
                let pose = pose_at(object, rotation, space.draw(&mut tries));
                let candidate = OrientedBox::new(&bounds, &pose, GAP_M / 2.0);
                if candidate.top() <= space.ceiling && !taken.iter().any(|other| other.overlaps(&candidate)) {
                    taken.push(candidate);
                    return Ok(pose);
                }
            }
            space.high = space.ceiling.min(space.high + bounds.diagonal().max(GAP_M));
        }
        let mut at = space.draw(&mut tries);
        let level = OrientedBox::new(&bounds, &pose_at(object, rotation, at), GAP_M / 2.0);
        at.z = taken.iter().map(OrientedBox::top).fold(space.low, f64::max) + level.half_height() + GAP_M;
        if at.z + level.half_height() > space.ceiling {
            return Err(Error::unlucky("no place is left for it in the space above the support"));
        }
        let pose = pose_at(object, rotation, at);
        taken.push(OrientedBox::new(&bounds, &pose, GAP_M / 2.0));
        Ok(pose)
    }
}

impl DropRotation {
    fn draw(self, stream: &mut Stream) -> UnitQuaternion<f64> {
        let mut angle = || stream.unit() * std::f64::consts::TAU;
        match self {
            Self::UniformSo3 => stream.rotation(),
            Self::UniformEuler => {
                let (roll, pitch, yaw) = (angle(), angle(), angle());
                UnitQuaternion::from_euler_angles(roll, pitch, yaw)
            }
            Self::UniformYaw => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle()),
        }
    }
}

/// The box of initial positions.
struct StartBox {
    area: Region,
    low: f64,
    high: f64,
    /// Height at which the space above the support ends, meters; infinite under the open sky.
    ceiling: f64,
}

impl StartBox {
    fn new(options: &DropBox, zone: &DropZone, ceiling: Option<f64>) -> Result<Self> {
        let low = zone.area.height() + options.clearance_m;
        let ceiling = ceiling.unwrap_or(f64::INFINITY);
        if low >= ceiling {
            return Err(Error::unlucky(format!(
                "the box starts {low:.2} m above the floor, and the space above `{}` ends at {ceiling:.2} m",
                zone.support.name
            ))
            .help("lower `clearance_m`, or raise the height of the room"));
        }
        Ok(Self { area: zone.area, low, high: ceiling.min(low + options.height_m), ceiling })
    }

    fn draw(&self, stream: &mut Stream) -> Point3<f64> {
        let ([x, y], center) =
            (self.area.size().map(|edge| stream.uniform(-edge / 2.0, edge / 2.0)), self.area.center());
        Point3::new(center.x + x, center.y + y, stream.uniform(self.low, self.high))
    }
}

/// The pose that places the center of an object's bounding box at a point.
fn pose_at(object: &Object, rotation: UnitQuaternion<f64>, center: Point3<f64>) -> Pose {
    let shift = center.coords - rotation * object.mesh.bounds().center().coords;
    Pose::from_parts(shift.into(), rotation)
}
