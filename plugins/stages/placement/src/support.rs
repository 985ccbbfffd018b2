//! Bodies that carry objects: bins, shelves, conveyors.

use crate::areas::{FoundAreas, add_supports};
use crate::bearing::holds;
use crate::bounds::rotated_bounds;
use crate::dist_list::dist_list;
use crate::footprint::Footprint;
use crate::material::MaterialReplacement;
use crate::objects::FRICTION;
use crate::resting::RestingShapes;
use crate::variation::{ColorChange, FinishChange, SCALE, Variation, resized};
use schemars::{Schema, SchemaGenerator};
use std::sync::Arc;
use syntable_model::geometry::{UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Motion, Object, Region, Role, SupportArea};

/// Limits of `count`.
const COUNT: [i64; 2] = [1, 100];

/// Limits of `position_m`, meters.
const POSITION_M: [f64; 2] = [-100.0, 100.0];

/// Limits of `yaw_deg`, degrees.
const YAW_DEG: [f64; 2] = [-3600.0, 3600.0];

/// Minimum distance between two bodies that carry objects, meters.
const GAP_M: f64 = 0.005;

/// Places bodies that carry objects, such as bins, trays, shelves, drawers and conveyors, and makes their level areas supports.
///
/// The areas are known for the assets of `procedural_containers` and `procedural_furniture`. For other meshes they are found: the largest
/// level rectangle at each height, with free space above. A body without such an area is an error.
///
/// The support of a body with one area is called `name`. The supports of a body with several areas, such as the boards of a shelf, are
/// `name/1`, `name/2`, … from the lowest. With a `count` that can exceed 1, bodies are numbered first: `bins/2`, or `shelves/2/3`. A stage whose
/// option `support` is `name` uses all of them.
///
/// Bodies do not overlap other bodies, nor reach through the walls of the room. On another support, they are within its outline, and below
/// the end of its space. A scene in which a body finds no place is drawn
/// again.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Object pools to draw the bodies from.
    from: ObjectPools,
    /// Name of the supports, for the option `support` of other stages.
    #[schemars(length(min = 1))]
    name: String,
    /// Number of bodies, drawn per scene; 1 to 100.
    #[serde(default = "one")]
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Name of the support that the bodies are on, such as a table. The floor, z = 0, by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    on: Option<SupportName>,
    /// Position of the center of a body along the edges of the support that it is on, from its center, meters, −100 to 100; on the floor,
    /// world x and y. If left out, it is drawn uniformly over that support, or is the center of the floor for the first body and beside it
    /// for the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "position_schema")]
    position_m: Option<[Dist; 2]>,
    /// Turn about the vertical, degrees, against the edges of the support that it is on, or against world x on the floor.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = YAW_DEG[0], "maximum" = YAW_DEG[1]))]
    yaw_deg: Dist,
    /// Maximum number of positions drawn for a body.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    max_tries: u32,
    /// Factor of each body's size, 0.01 to 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    scale: Option<Dist>,
    /// Changes the colors of some bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some bodies, such as `{ from = "materials", probability = 0.2 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how some of the pieces reflect light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Coulomb friction coefficient of each body, 0 to 10. Default: the asset's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = FRICTION[0], "maximum" = FRICTION[1]))]
    friction: Option<Dist>,
    #[serde(skip)]
    found: FoundAreas,
    #[serde(skip)]
    shapes: RestingShapes,
}

fn position_schema(generator: &mut SchemaGenerator) -> Schema {
    dist_list(generator, 2, POSITION_M)
}
fn one() -> IntDist {
    IntDist::Constant(1)
}
fn zero() -> Dist {
    Dist::Constant(0.0)
}
fn tries() -> u32 {
    200
}

impl Config for Support {
    type Stage = dyn Placer;
    const KIND: &'static str = "support";
    const EXAMPLE: &'static str =
        "from = [\"bins\"]\nname = \"bins\"\ncount = 2\non = \"table\"\nyaw_deg = { uniform = [0, 360] }";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.count.within("count", COUNT[0], COUNT[1])?;
        for (axis, position) in self.position_m.iter().flatten().enumerate() {
            position.within(&format!("position_m[{axis}]"), POSITION_M[0], POSITION_M[1])?;
        }
        self.yaw_deg.within("yaw_deg", YAW_DEG[0], YAW_DEG[1])?;
        self.friction.as_ref().map_or(Ok(()), |friction| friction.within("friction", FRICTION[0], FRICTION[1]))?;
        self.variation().check()?;
        Ok(Box::new(self))
    }
}
register!(Support);

impl Placer for Support {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let needs = self.on.iter().map(|name| PartUse::Needs(Part::support(Some(name))));
        Some(needs.chain([PartUse::Sets(Part::Support(self.name.clone()))]).collect())
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let count = self.count.draw(&mut context.stream.child("count")) as usize;
        // The body that carries these ones may have rails or walls around its support.
        let below = self.on.as_ref().map(|on| scene.support(Some(on))).transpose()?;
        let carries = |body: &BodyDraft| {
            body.role == Role::Support && below.is_some_and(|below| holds(&body.world_bounds(), below))
        };
        let mut taken: Vec<Footprint> = scene
            .bodies()
            .filter(|(_, body)| body.role != Role::Room && !carries(body))
            .map(|(_, body)| self.shapes.of(&body.object, context.cache).footprint(&body.world_from_body))
            .collect();
        let end = below.and_then(syntable_model::scene::Support::top);
        for number in 0..count {
            let stream = context.stream.child("body").at(number as u64);
            let (asset, object) = context.assets.draw_object(&self.from, &mut stream.child("asset"))?;
            let named = |error: Error| error.context(asset.to_string());
            let object = resized(object, self.variation().factor(&stream)).map_err(named)?;
            let areas = self.areas(&object).map_err(named)?;
            let place = self.free_place(&object, scene, &taken, number, &stream, context);
            let (pose, footprint) = place.map_err(named)?;
            let body = BodyDraft::new(asset.clone(), object, pose, Role::Support, Motion::Fixed);
            let body = self.variation().painted(body, context.assets, &stream)?;
            let friction = self.friction.as_ref().map(|dist| dist.draw(&mut stream.child("friction")));
            let body = BodyDraft { friction: friction.unwrap_or(body.friction), ..body };
            let number = (self.count.range().1 > 1).then_some(number);
            add_supports(scene, (&self.name, number), &areas, &pose, end)?;
            scene.add(body);
            taken.push(footprint);
        }
        Ok(())
    }
}

impl Support {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    /// The areas of an object that carry others.
    fn areas(&self, object: &Object) -> Result<Vec<SupportArea>> {
        let areas = self.found.of(object);
        if areas.is_empty() {
            let message = "no part of it is level and free above, so it carries no objects";
            return Err(Error::new(message).help("state its area: [[place]] kind = \"mesh\" with `supports`"));
        }
        Ok(areas)
    }

    /// A pose at which a body overlaps no other one, and its footprint.
    fn free_place(
        &self,
        object: &Arc<Object>,
        scene: &SceneBuilder,
        taken: &[Footprint],
        number: usize,
        stream: &Stream,
        context: &Context,
    ) -> Result<(Pose, Footprint)> {
        let on = self.on.as_ref().map(|on| scene.support(Some(on))).transpose()?;
        let below = on.map_or(Region::rectangle([0.0; 3], [f64::INFINITY; 2]), |on| on.surface);
        let top = on.and_then(|on| scene.space_top(on)).unwrap_or(f64::INFINITY);
        let room = scene.room_around(&below.center());
        let shape = self.shapes.of(object, context.cache);
        let (mut yaws, mut positions) = (stream.child("yaw"), stream.child("position"));
        for attempt in 0..self.max_tries {
            let yaw = below.yaw() + self.yaw_deg.draw(&mut yaws).to_radians();
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let bounds = rotated_bounds(&object.mesh, &rotation);
            let (center, size) = (bounds.center(), bounds.size());
            let along = match &self.position_m {
                Some(position) => [0, 1].map(|axis| position[axis].draw(&mut positions)),
                None if self.on.is_some() => below.edges().map(|edge| positions.uniform(-edge / 2.0, edge / 2.0)),
                None if number == 0 && attempt == 0 => [0.0; 2],
                // On the floor, further bodies are anywhere around the center, farther out with every attempt.
                None => {
                    let reach = (1.0 + number as f64 + f64::from(attempt) / 20.0) * size.x.max(size.y);
                    [0, 1].map(|_| positions.uniform(-reach, reach))
                }
            };
            let at = below.point(along);
            let shift = Vector3::new(at.x - center.x, at.y - center.y, at.z - bounds.min.z);
            let pose = Pose::from_parts(shift.into(), rotation);
            let footprint = shape.footprint(&pose);
            let is_on = on.is_none() || (footprint.is_within(&below) && footprint.high <= top);
            let is_between_walls = footprint
                .outline
                .iter()
                .all(|p| (0..2).all(|axis| (room.min[axis] + GAP_M..=room.max[axis] - GAP_M).contains(&p[axis])));
            let is_inside = is_between_walls && footprint.high <= room.max.z;
            if is_on && is_inside && !taken.iter().any(|other| footprint.is_near(other, GAP_M)) {
                return Ok((pose, footprint));
            }
        }
        let on = self.on.as_ref().map_or("the floor".to_owned(), |on| format!("`{}`", on.as_str()));
        Err(Error::unlucky(format!("no place is left for it on {on}")).help(
            "lower `count`, take smaller bodies, a larger support or a larger room, or widen the range of `position_m`",
        ))
    }
}
