//! Furniture and fittings along the walls of a room.

use crate::areas::{FoundAreas, add_supports};
use crate::bounds::rotated_bounds;
use crate::material::MaterialReplacement;
use crate::oriented_box::OrientedBox;
use crate::variation::{ColorChange, FinishChange, SCALE, Variation, resized};
use std::f64::consts::{FRAC_PI_2, PI};
use syntable_model::geometry::{Aabb, Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, Motion, Object, Region, Role};

/// Gap around a piece, meters.
const GAP_M: f64 = 0.01;

/// Limits of `count`.
const COUNT: [i64; 2] = [0, 1000];

/// Limits of `height_m`, `wall_gap_m` and `clear_m`, meters.
const DISTANCE_M: [f64; 2] = [0.0, 100.0];

/// Limits of `yaw_deg`, degrees.
const YAW_DEG: [f64; 2] = [-180.0, 180.0];

/// Places furniture and fittings along the walls of a room: static bodies that are visible and cast shadows, but have no masks.
///
/// The back of a piece, +y of its asset, is to a wall that is drawn by length, at a uniform position along it, on the
/// floor or at a height. A piece overlaps no other body and stays in the room; one for which no place is found is left out. For pieces that stand
/// free on the floor, use `distractors`.
///
/// With a `name`, level areas of the pieces become supports, as with the kind `support`: `arrange` with `annotated = false` puts
/// objects on them. The areas of the embedded furniture are known, and the areas of meshes are found. If no piece of a scene
/// carries anything, steps that place distractors place none. A step or a view that needs the name lets the scene be tried again.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Furnishings {
    /// Object pools to draw the pieces from.
    from: ObjectPools,
    /// Number of pieces, drawn per scene; 0 to 1000.
    #[serde(default = "some")]
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Name of the supports on the pieces, for the option `support` of other stages. Without it, they carry nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    name: Option<String>,
    /// Height of a piece's lowest point above the floor, meters, 0 to 100.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = DISTANCE_M[0], "maximum" = DISTANCE_M[1]))]
    height_m: Dist,
    /// Distance of a piece's back from its wall, meters, 0 to 100.
    #[serde(default = "wall_gap")]
    #[schemars(extend("minimum" = DISTANCE_M[0], "maximum" = DISTANCE_M[1]))]
    wall_gap_m: Dist,
    /// Turn of a piece from facing away from its wall, counterclockwise seen from above, degrees, −180 to 180.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = YAW_DEG[0], "maximum" = YAW_DEG[1]))]
    yaw_deg: Dist,
    /// Minimum horizontal distance of a piece from the main support, the first that a step of `[[place]]` sets, meters, 0 to 100. It
    /// leaves room for cameras around a table.
    #[serde(default = "clear")]
    #[schemars(range(min = DISTANCE_M[0], max = DISTANCE_M[1]))]
    clear_m: f64,
    /// Factor of each piece's size, 0.01 to 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SCALE[0], "maximum" = SCALE[1]))]
    scale: Option<Dist>,
    /// Changes the colors of some pieces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some pieces, such as `{ from = "materials", probability = 0.2 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how some pieces reflect light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Maximum number of places drawn for a piece.
    #[serde(default = "tries")]
    #[schemars(range(min = 1, max = 100000))]
    max_tries: u32,
    #[serde(skip)]
    found: FoundAreas,
}

fn some() -> IntDist {
    IntDist::Integers(3, 8)
}
fn zero() -> Dist {
    Dist::Constant(0.0)
}
fn wall_gap() -> Dist {
    Dist::Constant(0.02)
}
fn clear() -> f64 {
    0.6
}
fn tries() -> u32 {
    100
}

impl Config for Furnishings {
    type Stage = dyn Placer;
    const KIND: &'static str = "furnishings";
    const EXAMPLE: &'static str =
        "from = [\"furniture\"]\ncount = { integers = [3, 8] }\nname = \"furniture\"\nyaw_deg = { uniform = [-5, 5] }";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.count.within("count", COUNT[0], COUNT[1])?;
        self.height_m.within("height_m", DISTANCE_M[0], DISTANCE_M[1])?;
        self.wall_gap_m.within("wall_gap_m", DISTANCE_M[0], DISTANCE_M[1])?;
        self.yaw_deg.within("yaw_deg", YAW_DEG[0], YAW_DEG[1])?;
        self.variation().check()?;
        Ok(Box::new(self))
    }
}
register!(Furnishings);

impl Placer for Furnishings {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let sets = self.name.iter().map(|name| PartUse::Sets(Part::Support(name.clone())));
        let needs = (self.count.range().1 > 0).then_some(PartUse::Needs(Part::Walls));
        Some(needs.into_iter().chain(sets).collect())
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let count = self.count.draw(&mut context.stream.child("count")).max(0) as usize;
        let main = scene.supports.main().map(|support| support.surface);
        let walls = Wall::around(scene, main.map_or_else(Point3::origin, |region| region.center()));
        if walls.is_empty() && count > 0 {
            let message = "the scene has no wall for furnishings";
            return Err(Error::new(message).help("place a `room` with walls first, or use the kind `distractors`"));
        }
        if let Some(name) = self.name.as_ref().filter(|_| self.count.range().1 > 0) {
            scene.supports.may_add(name.as_str());
        }
        let around = |body: &BodyDraft| OrientedBox::new(&body.object.mesh.bounds(), &body.world_from_body, 0.0);
        let others = scene.bodies().filter(|(_, body)| body.role != Role::Room);
        let mut taken: Vec<OrientedBox> = others.map(|(_, body)| around(body)).collect();
        for number in 0..count {
            let stream = context.stream.child("piece").at(number as u64);
            let (asset, object) = context.assets.draw_object(&self.from, &mut stream.child("asset"))?;
            let named = |error: Error| error.context(asset.to_string());
            let object = resized(object, self.variation().factor(&stream)).map_err(named)?;
            let Some(pose) = self.free_place(&object, &walls, main.as_ref(), &taken, &stream) else { continue };
            taken.push(OrientedBox::new(&object.mesh.bounds(), &pose, 0.0));
            let areas = if self.name.is_some() { self.found.of(&object) } else { Vec::new() };
            let role = if areas.is_empty() { Role::Fixture } else { Role::Support };
            let name = self.name.as_deref().unwrap_or_default();
            add_supports(scene, (name, Some(number)), &areas, &pose, None)?;
            let body = BodyDraft::new(asset, object, pose, role, Motion::Fixed);
            scene.add(self.variation().painted(body, context.assets, &stream)?);
        }
        Ok(())
    }
}

impl Furnishings {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: self.scale.as_ref(),
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    /// A pose at a wall at which a piece overlaps no other body; `None` after `max_tries`.
    fn free_place(
        &self,
        object: &Object,
        walls: &[Wall],
        main: Option<&Region>,
        taken: &[OrientedBox],
        stream: &Stream,
    ) -> Option<Pose> {
        let [mut places, mut heights, mut gaps, mut yaws] =
            ["place", "height", "wall gap", "yaw"].map(|name| stream.child(name));
        let keep_clear = main.map(|region| region.grown(self.clear_m));
        let mesh = object.mesh.bounds();
        (0..self.max_tries).find_map(|_| {
            let wall = &walls[places.pick_by_weight(walls.iter().map(|wall| wall.length))?];
            let yaw = wall.yaw + self.yaw_deg.draw(&mut yaws).to_radians();
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            // In the frame of the wall, x runs along it and y into it.
            let turned = rotated_bounds(&object.mesh, &rotation);
            let (across, behind) = wall.extent(&turned);
            let free = wall.length - across - 2.0 * GAP_M;
            if free < 0.0 {
                return None;
            }
            let along = places.uniform(-0.5, 0.5) * free;
            let gap = self.wall_gap_m.draw(&mut gaps);
            if gap + behind + GAP_M > wall.depth {
                return None;
            }
            let center = wall.middle + wall.along * along - wall.outwards * (gap + behind / 2.0);
            let bottom = wall.floor + self.height_m.draw(&mut heights);
            let from = turned.center();
            let shift = Vector3::new(center.x - from.x, center.y - from.y, bottom - turned.min.z);
            if turned.max.z + shift.z > wall.ceiling {
                return None;
            }
            let pose = Pose::from_parts(shift.into(), rotation);
            let own = OrientedBox::new(&mesh, &pose, GAP_M);
            let blocks = keep_clear.as_ref().is_some_and(|region| is_near(&turned, &shift, region));
            (!blocks && !taken.iter().any(|other| own.overlaps(other))).then_some(pose)
        })
    }
}

/// Whether a box, moved, is above or below a region's bounding rectangle.
fn is_near(bounds: &Aabb, shift: &Vector3<f64>, region: &Region) -> bool {
    let (center, size) = (region.center(), region.size());
    (0..2).all(|axis| {
        let middle = bounds.center()[axis] + shift[axis] - center[axis];
        2.0 * middle.abs() < size[axis] + bounds.size()[axis]
    })
}

/// The inner face of a wall.
struct Wall {
    /// Center of its lower edge.
    middle: Point3<f64>,
    /// Unit vector along it.
    along: Vector3<f64>,
    /// Unit vector out of the room.
    outwards: Vector3<f64>,
    /// Turn of a piece whose back, +y, is to it, radians.
    yaw: f64,
    length: f64,
    /// Distance of the opposite wall, meters; infinite without one.
    depth: f64,
    /// Heights of floor and ceiling, meters.
    floor: f64,
    ceiling: f64,
}

impl Wall {
    /// The walls around a point that are of finite length.
    fn around(scene: &SceneBuilder, point: Point3<f64>) -> Vec<Self> {
        let room = scene.room_around(&point);
        let floor = if room.min.z.is_finite() { room.min.z } else { 0.0 };
        let sides = [(0, 1.0, -FRAC_PI_2), (1, 1.0, 0.0), (0, -1.0, FRAC_PI_2), (1, -1.0, PI)];
        let wall = |(axis, sign, yaw): (usize, f64, f64)| {
            let (at, length) =
                (if sign > 0.0 { room.max[axis] } else { room.min[axis] }, room.max[1 - axis] - room.min[1 - axis]);
            (at.is_finite() && length.is_finite()).then(|| {
                let [mut middle, mut along, mut outwards] =
                    [Point3::new(0.0, 0.0, floor).coords, Vector3::zeros(), Vector3::zeros()];
                (middle[axis], middle[1 - axis]) = (at, (room.min[1 - axis] + room.max[1 - axis]) / 2.0);
                (along[1 - axis], outwards[axis]) = (1.0, sign);
                let depth = room.max[axis] - room.min[axis];
                Self { middle: middle.into(), along, outwards, yaw, length, depth, floor, ceiling: room.max.z }
            })
        };
        sides.into_iter().filter_map(wall).collect()
    }

    /// Extents of a box along the wall and away from it.
    fn extent(&self, bounds: &Aabb) -> (f64, f64) {
        let size = bounds.size();
        (size.dot(&self.along.abs()), size.dot(&self.outwards.abs()))
    }
}
