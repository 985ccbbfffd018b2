//! Objects that start in a box above a support.

use crate::bearing::holds;
use crate::material::MaterialReplacement;
use crate::objects::{COUNT, DENSITY_KG_M3, FRICTION, ObjectOptions, RESTITUTION};
use crate::oriented_box::OrientedBox;
use crate::resting::{RestingPose, RestingShapes};
use crate::variation::{ColorChange, FinishChange, SCALE, Variation};
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, DropZone, Object, Role, Support};

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
/// the support's space. If `support` is the name of several supports, each object draws one of them by area.
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
    /// Changes how some objects reflect light, such as `{ roughness = { uniform = [0, 1] } }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
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
    /// Coefficient of restitution of each object, 0 to 1. Default: the asset's, or else the value of `[settle]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = RESTITUTION[0], "maximum" = RESTITUTION[1]))]
    restitution: Option<Dist>,
    /// Density of each object, kg/m³, 1 to 30000. Default: the asset's mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = DENSITY_KG_M3[0], "maximum" = DENSITY_KG_M3[1]))]
    density_kg_m3: Option<Dist>,
    /// Fills the support: objects are poured one after another until their pile has this mean height, as a fraction of the height of
    /// the walls around the support, or of its clear height. `count` is then the maximum number of objects. It needs a settler that
    /// pours, and leaves `overlap_free` without effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FILL_LEVEL[0], "maximum" = FILL_LEVEL[1]))]
    fill_level: Option<Dist>,
    #[serde(skip)]
    shapes: RestingShapes,
}

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
    /// As in its file, with uniform rotation about the world z axis.
    UniformYaw,
    /// The stable pose that is nearest to the file's, with uniform rotation about the world z axis: cans stand.
    Upright,
    /// A stable pose, drawn by its probability, with uniform rotation about the world z axis.
    StablePose,
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

/// Limits of `fill_level`.
const FILL_LEVEL: [f64; 2] = [0.01, 3.0];

impl Config for DropBox {
    type Stage = dyn Placer;
    const KIND: &'static str = "drop_box";
    const EXAMPLE: &'static str =
        "from = [\"objects\"]\ncount = { integers = [1, 40] }\nrotation = \"uniform_euler\"\nwidth_factor = 0.6";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.options().check()?;
        self.fill_level.as_ref().map_or(Ok(()), |level| level.within("fill_level", FILL_LEVEL[0], FILL_LEVEL[1]))?;
        if self.fill_level.is_some() && self.fixed {
            let message = "objects that stay where they are placed fill nothing";
            return Err(ConfigError::new("fill_level", message).help("remove it, or remove `fixed`"));
        }
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
        let supports: Vec<Support> = scene.supports.group(self.support.as_ref())?.into_iter().cloned().collect();
        let drawn = self.options().draw(context)?;
        // The box around a shelf contains the spaces between its boards.
        let is_shelf = |body: &BodyDraft| {
            let is_board = |support: &Support| support.clear_height_m.is_some() && holds(&body.world_bounds(), support);
            body.role == Role::Support && supports.iter().any(is_board)
        };
        let mut taken: Vec<OrientedBox> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room && !is_shelf(body))
            .map(|(_, body)| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, GAP_M / 2.0))
            .collect();
        let (mut spaces, mut last) = (Vec::new(), None);
        for (number, support) in supports.into_iter().enumerate() {
            let full_at_m = self.full_at(&support, &mut context.stream.child("fill").at(number as u64))?;
            let area = support.surface.scaled(self.width_factor);
            match StartBox::new(self, DropZone { area, full_at_m, ..DropZone::on(support) }, scene) {
                Ok(space) => spaces.push(space),
                Err(error) => last = Some(error),
            }
        }
        // A board that is too low for the box stays empty, if a second board is high enough.
        if let Some(error) = last.filter(|_| spaces.is_empty()) {
            return Err(error);
        }
        for k in 0..drawn.count() {
            let object = drawn.object(k)?;
            let (asset, stream) = (&object.asset, &object.stream);
            let number = stream.child("support").pick_by_weight(spaces.iter().map(StartBox::area));
            let last = spaces.len() - 1;
            let space = &mut spaces[number.unwrap_or(last)];
            let rotation = self.rotation(&object.object, &stream.child("rotation"), context);
            let pose = if self.overlap_free && self.fill_level.is_none() {
                self.free_pose(&object.object, rotation, space, &mut taken, &stream.child("place")).map_err(
                    |error| {
                        error.context(format!("{asset}, object {} of {}", k + 1, drawn.count())).help(
                            "lower `count` or `clearance_m`, raise `width_factor` or the height of the room, or set \
                         overlap_free = false",
                        )
                    },
                )?
            } else {
                space.pose(&object.object, rotation, &mut stream.child("place"))
            };
            let zone = space.zone.clone();
            scene.drop_body(drawn.body(&object, pose)?, zone);
        }
        Ok(())
    }
}

impl DropBox {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    fn options(&self) -> ObjectOptions<'_> {
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

    /// Draws the mean height of the pile at which a support is full, meters; none if it is not filled.
    fn full_at(&self, support: &Support, stream: &mut Stream) -> Result<Option<f64>> {
        let Some(level) = &self.fill_level else { return Ok(None) };
        let height = support.walls.map(|walls| walls.height_m).or(support.clear_height_m).ok_or_else(|| {
            let message = format!("`fill_level` is a fraction of the height of walls, and `{}` has none", support.name);
            Error::new(message).help("fill a bin or a shelf board: [[place]] kind = \"support\"")
        })?;
        Ok(Some(level.draw(stream) * height))
    }

    fn rotation(&self, object: &Object, stream: &Stream, context: &Context) -> UnitQuaternion<f64> {
        let mut first = stream.clone();
        let mut angle = || first.unit() * std::f64::consts::TAU;
        let mut about_z = || UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle());
        let resting = |pose: RestingPose| {
            let shape = self.shapes.of(object, context.cache);
            pose.draw(shape.of_asset(), &mut stream.child("side"))
        };
        match self.rotation {
            DropRotation::UniformSo3 => first.rotation(),
            DropRotation::UniformEuler => {
                let (roll, pitch, yaw) = (angle(), angle(), angle());
                UnitQuaternion::from_euler_angles(roll, pitch, yaw)
            }
            DropRotation::UniformYaw => about_z(),
            DropRotation::Upright => about_z() * resting(RestingPose::Upright),
            DropRotation::StablePose => about_z() * resting(RestingPose::StablePose),
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
                let pose = space.pose(object, rotation, &mut tries);
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

/// The box of initial positions above a support.
struct StartBox {
    zone: DropZone,
    low: f64,
    high: f64,
    /// Height at which the space above the support ends, meters; infinite under the open sky.
    ceiling: f64,
}

impl StartBox {
    fn new(options: &DropBox, zone: DropZone, scene: &SceneBuilder) -> Result<Self> {
        let low = zone.area.height() + options.clearance_m;
        let ceiling = scene.space_top(&zone.support).unwrap_or(f64::INFINITY);
        if low >= ceiling {
            return Err(Error::unlucky(format!(
                "the box starts {low:.2} m above the floor, and the space above `{}` ends at {ceiling:.2} m",
                zone.support.name
            ))
            .help("lower `clearance_m`, or raise the height of the room"));
        }
        Ok(Self { zone, low, high: ceiling.min(low + options.height_m), ceiling })
    }

    fn area(&self) -> f64 {
        self.zone.support.surface.edges().iter().product()
    }

    fn draw(&self, stream: &mut Stream) -> Point3<f64> {
        let along = self.zone.area.edges().map(|edge| stream.uniform(-edge / 2.0, edge / 2.0));
        let at = self.zone.area.point(along);
        Point3::new(at.x, at.y, stream.uniform(self.low, self.high))
    }

    /// Draws a pose of an object with a rotation. Between walls or boards, the whole object is above the area and below the end of the
    /// space, if it is small enough.
    fn pose(&self, object: &Object, rotation: UnitQuaternion<f64>, stream: &mut Stream) -> Pose {
        let at = self.draw(stream);
        let pose = pose_at(object, rotation, at);
        if self.zone.support.walls.is_none() && self.zone.support.clear_height_m.is_none() {
            return pose;
        }
        let area = &self.zone.area;
        let corners = object.mesh.bounds().corners().map(|p| area.along(&(pose * p)));
        let along = area.along(&at);
        let inside = [0, 1].map(|edge| {
            let reach = corners.iter().map(|p| (p[edge] - along[edge]).abs()).fold(0.0, f64::max);
            let whole = area.edges()[edge] / 2.0;
            if whole > 0.0 { along[edge] * ((whole - reach).max(0.0) / whole) } else { 0.0 }
        });
        let to = area.point(inside);
        let half = object.mesh.bounds().corners().map(|p| ((pose * p).z - at.z).abs()).into_iter().fold(0.0, f64::max);
        // On a board, an object that fits starts below the next one and above this one.
        let low = self.zone.area.height() + half + GAP_M;
        let z = at.z.min(self.ceiling - half - GAP_M).max(low.min(at.z));
        pose_at(object, rotation, Point3::new(to.x, to.y, z))
    }
}

/// The pose that places the center of an object's bounding box at a point.
fn pose_at(object: &Object, rotation: UnitQuaternion<f64>, center: Point3<f64>) -> Pose {
    let shift = center.coords - rotation * object.mesh.bounds().center().coords;
    Pose::from_parts(shift.into(), rotation)
}
