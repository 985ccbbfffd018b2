//! The bodies of a frozen scene as collision shapes.

use crate::collision_shape::CollisionShape;
use crate::hull_cache::HullCache;
use crate::static_body::{self, StaticBody, SupportSurface, is_dynamic};
use crate::units;
use crate::units::friction;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose as EnginePose;
use parry3d::shape::SharedShape;
use std::sync::Arc;
use syntable_model::context::SceneContext;
use syntable_model::error::Result;
use syntable_model::geometry::Point3;
use syntable_model::scene::{Body, InstanceId, Object, Role, Scene, Support};

/// A body, or the ground.
pub struct Solid {
    /// Id of the body; the background's id for the ground.
    pub id: InstanceId,
    /// Whether forces move it.
    pub is_dynamic: bool,
    /// Whether it is an object or a distractor.
    pub is_foreground: bool,
    /// Height of the center of its box, meters.
    pub height_m: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Its parts in the world.
    pub parts: Vec<SolidPart>,
    /// Bounding box of the parts, engine units; `None` without parts.
    pub bounds: Option<Aabb>,
}

/// A part of a solid.
pub struct SolidPart {
    /// Pose in the world, engine units.
    pub pose: EnginePose,
    /// Its shape, engine units: convex, a half-space or a mesh.
    pub shape: SharedShape,
    /// Box around it, engine units.
    pub bounds: Aabb,
}

impl SolidPart {
    fn new(pose: EnginePose, shape: SharedShape) -> Self {
        let bounds = shape.compute_aabb(&pose);
        Self { pose, shape, bounds }
    }

    fn of(body: StaticBody) -> Vec<Self> {
        body.parts().into_iter().map(|(local, shape)| Self::new(body.pose * local, shape)).collect()
    }
}

impl Solid {
    fn new(body: &Body, parts: Vec<SolidPart>) -> Self {
        Self {
            id: body.id,
            is_dynamic: is_dynamic(body),
            is_foreground: body.role.is_foreground(),
            height_m: body.world_bounds().center().z,
            friction: friction(body.friction).into(),
            bounds: bounds(&parts),
            parts,
        }
    }

    fn ground() -> Self {
        let ground = static_body::ground(0.0);
        let friction = ground.friction.into();
        let parts = SolidPart::of(ground);
        Self {
            id: InstanceId::BACKGROUND,
            is_dynamic: false,
            is_foreground: false,
            height_m: 0.0,
            friction,
            bounds: bounds(&parts),
            parts,
        }
    }
}

fn bounds(parts: &[SolidPart]) -> Option<Aabb> {
    parts.iter().map(|part| part.bounds).reduce(|one, other| one.merged(&other))
}

/// All bodies of a scene in the order of their ids, then the ground. A body whose mesh allows no collision shape has no
/// parts, and causes a warning.
pub fn solids(cx: &SceneContext, scene: &Scene, shapes: &HullCache) -> Vec<Solid> {
    let supports = &scene.supports;
    let is_room = |body: &Body| body.role == Role::Room && !is_dynamic(body);
    let shaped: Vec<&Body> = scene.bodies().iter().filter(|body| !is_room(body)).collect();
    let surface = SupportSurface::new(shaped.iter().copied().filter(|body| body.role == Role::Support));
    let objects: Vec<(&Object, _)> =
        shaped.iter().map(|body| (&*body.object, static_body::purpose(body, supports))).collect();
    let mut found = shapes.shapes(&objects, cx.cache, cx.workers, cx.log).into_iter();
    let inside = inside_of_room(scene);
    let mut solids = Vec::with_capacity(scene.bodies().len() + 1);
    for body in scene.bodies() {
        let parts = if is_room(body) {
            static_body::room_part(body, &inside).map_or(Vec::new(), SolidPart::of)
        } else {
            parts(body, found.next(), &|shape| static_body::support(body, shape, supports, &surface), cx)
        };
        solids.push(Solid::new(body, parts));
    }
    solids.push(Solid::ground());
    solids
}

/// Positions of objects, which no wall separates from the supports.
fn inside_of_room(scene: &Scene) -> Vec<Point3<f64>> {
    let dynamic = scene.bodies().iter().filter(|body| is_dynamic(body));
    dynamic.map(|body| body.world_bounds().center()).chain(scene.supports.iter().map(Support::center)).collect()
}

fn parts(
    body: &Body,
    shape: Option<Result<Arc<CollisionShape>>>,
    fixed: &dyn Fn(&CollisionShape) -> Vec<StaticBody>,
    cx: &SceneContext,
) -> Vec<SolidPart> {
    match shape {
        Some(Ok(shape)) if !is_dynamic(body) => fixed(&shape).into_iter().flat_map(SolidPart::of).collect(),
        Some(Ok(shape)) => {
            let pose = units::pose(&body.world_from_body);
            shape.parts.iter().map(|part| SolidPart::new(pose, part.clone())).collect()
        }
        Some(Err(error)) => {
            cx.log.warn(&error.context(body.asset.to_string()));
            Vec::new()
        }
        None => Vec::new(),
    }
}
