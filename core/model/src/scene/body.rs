//! Bodies: assets placed in a scene.

use super::{AssetRef, MassProperties, MaterialOverride, Object};
use crate::geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Number of a body in a frozen scene. 0 is the background, objects are 1..=M, then distractors, then
/// supports and room parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct InstanceId(pub u16);

impl InstanceId {
    /// No body: the id of a ray that hits nothing.
    pub const BACKGROUND: Self = Self(0);
}

impl fmt::Display for InstanceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What a body is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// An object to segment; annotated.
    Object,
    /// May occlude objects and lie among them; never annotated.
    Distractor,
    /// Carries objects: the table.
    Support,
    /// Floor, wall or ceiling.
    Room,
}

/// Whether physics moves a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Stays where it was placed.
    Fixed,
    /// Falls and collides.
    Dynamic,
}

/// A body of a frozen scene or, without an id, of one under construction.
#[derive(Debug, Clone)]
pub struct Body<Id = InstanceId> {
    /// Its id in every label of the scene.
    pub id: Id,
    /// Where the asset came from.
    pub asset: AssetRef,
    /// The asset.
    pub object: Arc<Object>,
    /// Pose of the body frame.
    pub world_from_body: Pose,
    /// What it is for.
    pub role: Role,
    /// Whether physics moves it.
    pub motion: Motion,
    /// Replaces all of the object's materials, if set.
    pub material_override: Option<MaterialOverride>,
    /// Mass in the simulation; that of the object if the settler gives it no other.
    pub mass: MassProperties,
    /// Coulomb friction coefficient; that of the object if its placer says nothing else.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1; that of the settler if not set.
    pub restitution: Option<f64>,
    /// Half extents along world x and y of the rectangle over the middle of the tabletop where the body starts anew if
    /// it has to, meters; the whole tabletop if not set.
    pub respawn_half_m: Option<[f64; 2]>,
    /// Number among the objects in spawn order, from 0, with gaps where objects were removed. Set by
    /// [`SceneBuilder::add`](super::SceneBuilder::add).
    pub spawn: u32,
}

/// A body of a scene under construction.
pub type BodyDraft = Body<()>;

impl BodyDraft {
    /// A body with the object's own materials.
    pub fn new(asset: AssetRef, object: Arc<Object>, world_from_body: Pose, role: Role, motion: Motion) -> Self {
        let (mass, friction) = (object.mass, object.friction);
        Self {
            id: (),
            asset,
            object,
            world_from_body,
            role,
            motion,
            material_override: None,
            mass,
            friction,
            restitution: None,
            respawn_half_m: None,
            spawn: 0,
        }
    }

    /// The same body with all materials replaced.
    pub fn with_material_override(self, material_override: Option<MaterialOverride>) -> Self {
        Self { material_override, ..self }
    }

    pub(super) fn with_id(self, id: InstanceId) -> Body {
        let Self {
            id: (),
            asset,
            object,
            world_from_body,
            role,
            motion,
            material_override,
            mass,
            friction,
            restitution,
            respawn_half_m,
            spawn,
        } = self;
        Body {
            id,
            asset,
            object,
            world_from_body,
            role,
            motion,
            material_override,
            mass,
            friction,
            restitution,
            respawn_half_m,
            spawn,
        }
    }
}

impl<Id> Body<Id> {
    /// Bounding box in the world, meters; exact over the corners of the mesh's box, not over its vertices.
    pub fn world_bounds(&self) -> Aabb {
        Aabb::of(self.object.mesh.bounds().corners().map(|p| self.world_from_body * p))
    }
}

/// Name of a body while its scene is under construction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle(pub(super) usize);
