//! Bodies: assets placed in a scene.

use super::{AssetRef, Object, Surface};
use crate::geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Number of a body in a frozen scene. 0 is the background, objects are 1..=M, then distractors, then
/// supports and room parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct InstanceId(pub u16);

impl InstanceId {
    /// No body: what a ray meets that meets nothing.
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
    /// A thing to segment; annotated.
    Object,
    /// A thing that may hide objects and lie among them, but that no label speaks of.
    Distractor,
    /// A thing that objects lie on: the table.
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

/// A body of a scene under construction.
#[derive(Debug, Clone)]
pub struct BodyDraft {
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
    pub surface: Option<Surface>,
    /// Number among the objects in spawn order, from 0; set by [`SceneBuilder::add`](super::SceneBuilder::add).
    pub spawn: u32,
}

impl BodyDraft {
    /// A body with the object's own materials.
    pub fn new(asset: AssetRef, object: Arc<Object>, world_from_body: Pose, role: Role, motion: Motion) -> Self {
        Self { asset, object, world_from_body, role, motion, surface: None, spawn: 0 }
    }

    /// The same body with all materials replaced.
    pub fn with_surface(self, surface: Option<Surface>) -> Self {
        Self { surface, ..self }
    }

    /// Bounding box in the world, metres; exact over the vertices' box, not over the vertices.
    pub fn world_bounds(&self) -> Aabb {
        Aabb::of(self.object.mesh.bounds().corners().map(|p| self.world_from_body * p))
    }

    pub(super) fn with_id(self, id: InstanceId) -> Body {
        let Self { asset, object, world_from_body, role, motion, surface, spawn } = self;
        Body { id, asset, object, world_from_body, role, motion, surface, spawn }
    }
}

/// Name of a body while its scene is under construction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle(pub(super) usize);

/// A body of a frozen scene.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its id in every label of the scene.
    pub id: InstanceId,
    /// Where the asset came from.
    pub asset: AssetRef,
    /// The asset.
    pub object: Arc<Object>,
    /// Pose of the body frame.
    pub world_from_body: Pose,
    /// What it is for.
    pub role: Role,
    /// Whether physics moved it.
    pub motion: Motion,
    /// Replaces all of the object's materials, if set.
    pub surface: Option<Surface>,
    /// Number among the objects in spawn order, from 0, with gaps where objects were removed.
    pub spawn: u32,
}
