//! The collision shapes of a scene, for other physics engines.

use crate::hull_cache::HullCache;
use crate::options::{Collision, Rapier};
use crate::relations::solid::{Solid, SolidPart, solids};
use crate::units;
use parry3d::math::Vector;
use syntable_convex::Polyhedron;
use syntable_model::geometry::{Point3, Pose};
use syntable_model::prelude::*;
use syntable_model::product::standard::COLLISION_SHAPES;
use syntable_model::scene::Body;

/// The collision shapes and the masses of all bodies, with which another physics engine continues a scene: MuJoCo, PyBullet, Isaac.
///
/// `collision_shapes` has an entry per body, by `id`. `is_dynamic` states whether the settler moved it. `world_from_body` is its pose
/// at rest. `mass_kg`, `center_of_mass_body_m`, `inertia_body_kg_m2` about the center of mass, and `friction` are the values of the
/// simulation, and `restitution` if a body has its own. `parts_body_m` lists the corners of each convex part in the body's frame. A wall or floor
/// has `half_spaces_world` instead, each with a `point_m` on its surface and the outward `normal`. The last entry, with the id 0, is the ground
/// below z = 0. A room of one mesh has no parts, and causes a warning.
///
/// The parts of the static bodies that carry objects are thicker than their meshes where a board is thin, as in the simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CollisionShapes {
    /// Collision shape of objects and supports. Should equal the option of `settle`.
    collision: Collision,
    /// Maximum distance of convex parts from the mesh in its hollows, meters. Should equal the option of `settle`.
    #[schemars(range(min = 0.001, max = 1.0))]
    max_deviation_m: f64,
    /// Maximum number of convex parts per object. Should equal the option of `settle`.
    #[schemars(range(min = 1, max = 256))]
    max_parts: u32,
}

impl Default for CollisionShapes {
    fn default() -> Self {
        let Rapier { collision, max_deviation_m, max_parts, .. } = Rapier::default();
        Self { collision, max_deviation_m, max_parts }
    }
}

impl Config for CollisionShapes {
    type Stage = dyn SceneAnnotator;
    const KIND: &'static str = "collision_shapes";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn SceneAnnotator>, ConfigError> {
        let Self { collision, max_deviation_m, max_parts } = self;
        let options = Rapier { collision, max_deviation_m, max_parts, ..Rapier::default() };
        Ok(Box::new(Shapes(HullCache::new(&options))))
    }
}

register!(CollisionShapes);

/// The annotator of the kind `collision_shapes`.
struct Shapes(HullCache);

impl SceneAnnotator for Shapes {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![COLLISION_SHAPES]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let solids = solids(cx, cx.scene, &self.0);
        let entry = |solid: &Solid| {
            let body = cx.scene.body(solid.id);
            if let Some(body) = body.filter(|_| solid.parts.iter().any(|part| part.shape.as_trimesh().is_some())) {
                let message = "its collision shape is a mesh, which `collision_shapes` does not list";
                cx.log.warn(&Error::new(message).context(body.asset.to_string()));
            }
            Value::of(&Entry::new(body, solid))
        };
        let entries = solids.iter().map(entry).collect::<Result<_>>()?;
        products.put(COLLISION_SHAPES, Value::List(entries))
    }
}

/// An entry of the product.
#[derive(Serialize)]
struct Entry {
    id: u16,
    is_dynamic: bool,
    world_from_body: [[f64; 4]; 4],
    mass_kg: f64,
    center_of_mass_body_m: [f64; 3],
    inertia_body_kg_m2: [[f64; 3]; 3],
    friction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    restitution: Option<f64>,
    parts_body_m: Vec<Vec<[f64; 3]>>,
    half_spaces_world: Vec<HalfSpaceEntry>,
}

/// A half-space.
#[derive(Serialize)]
struct HalfSpaceEntry {
    point_m: [f64; 3],
    normal: [f64; 3],
}

impl Entry {
    /// The entry of a body, or of the ground.
    fn new(body: Option<&Body>, solid: &Solid) -> Self {
        let inertia = body.map(|body| body.mass.inertia()).unwrap_or_default();
        let world_from_body = body.map_or_else(Pose::identity, |body| body.world_from_body);
        let body_from_world = world_from_body.inverse();
        Self {
            id: solid.id.0,
            is_dynamic: solid.is_dynamic,
            world_from_body: rows(&world_from_body),
            mass_kg: body.map_or(0.0, |body| body.mass.kg),
            center_of_mass_body_m: body.map_or([0.0; 3], |body| body.mass.center.into()),
            inertia_body_kg_m2: std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)])),
            friction: solid.friction,
            restitution: body.and_then(|body| body.restitution),
            parts_body_m: solid.parts.iter().filter_map(|part| corners(part, &body_from_world)).collect(),
            half_spaces_world: solid.parts.iter().filter_map(HalfSpaceEntry::of).collect(),
        }
    }
}

impl HalfSpaceEntry {
    fn of(part: &SolidPart) -> Option<Self> {
        let half_space = part.shape.as_halfspace()?;
        let meters = |v: Vector| v.to_array().map(units::meters);
        let normal = (part.pose.rotation * half_space.normal).to_array().map(f64::from);
        Some(Self { point_m: meters(part.pose.translation), normal })
    }
}

/// Corners of a convex part, body frame, meters.
fn corners(part: &SolidPart, body_from_world: &Pose) -> Option<Vec<[f64; 3]>> {
    let points = Polyhedron::of(&*part.shape)?.points().iter();
    let world = points.map(|p| Point3::from((part.pose * *p).to_array().map(units::meters)));
    Some(world.map(|p| (body_from_world * p).into()).collect())
}

fn rows(pose: &Pose) -> [[f64; 4]; 4] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
