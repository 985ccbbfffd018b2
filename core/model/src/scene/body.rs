//! Bodies: assets placed in a scene.

use super::{
    AssetRef, Finish, MassProperties, Material, MaterialOverride, Moment, Object, Recolor, TextureMapping, Trajectory,
    UvTransform,
};
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

/// The purpose of a body. Roles may be added: stages that treat a role specially leave all others unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Role {
    /// An object to segment; annotated.
    Object,
    /// May occlude objects and lie among them; never annotated.
    Distractor,
    /// Carries objects: a table, a bin, a shelf.
    Support,
    /// Floor, wall or ceiling.
    Room,
    /// Carries no objects and is no part of the room: a robot arm, a rack.
    Fixture,
}

impl Role {
    /// Whether a body is an object or a distractor. All other roles are furniture: masks `before support` end at it,
    /// and its ids follow the ids of the foreground.
    pub fn is_foreground(self) -> bool {
        matches!(self, Self::Object | Self::Distractor)
    }
}

/// Whether physics moves a body. Motions may be added: physics leaves a body of an unknown motion where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Motion {
    /// Stays where it was placed.
    Fixed,
    /// Falls and collides.
    Dynamic,
    /// Moves along a [trajectory](Body::trajectory). Physics treats it as a body that is fixed at its starting pose.
    Scripted,
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
    /// Its purpose.
    pub role: Role,
    /// Whether physics moves it.
    pub motion: Motion,
    /// Replaces all of the object's materials, if set.
    pub material_override: Option<MaterialOverride>,
    /// Changes the base colors of its materials, if set.
    pub recolor: Option<Recolor>,
    /// Changes how its materials reflect light, if set.
    pub finish: Option<Finish>,
    /// Mass in the simulation: the mass of the object, unless the settler assigns another.
    pub mass: MassProperties,
    /// Coulomb friction coefficient: the coefficient of the object, unless the placer sets another.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1: the coefficient of the object, unless the placer sets another. If not set, the
    /// settler's coefficient applies.
    pub restitution: Option<f64>,
    /// Poses over time of a body that moves by a script; see [`BodyDraft::scripted`].
    pub trajectory: Option<Arc<Trajectory>>,
    /// Number among the objects in spawn order, from 0, with gaps where objects were removed. Set by
    /// [`SceneBuilder::add`](super::SceneBuilder::add).
    pub spawn: u32,
}

/// A body of a scene under construction.
pub type BodyDraft = Body<()>;

impl BodyDraft {
    /// A body with the object's own materials.
    pub fn new(asset: AssetRef, object: Arc<Object>, world_from_body: Pose, role: Role, motion: Motion) -> Self {
        let (mass, friction, restitution) = (object.mass, object.friction, object.restitution);
        Self {
            id: (),
            asset,
            object,
            world_from_body,
            role,
            motion,
            material_override: None,
            recolor: None,
            finish: None,
            mass,
            friction,
            restitution,
            trajectory: None,
            spawn: 0,
        }
    }

    /// The same body with all materials replaced.
    pub fn with_material_override(self, material_override: Option<MaterialOverride>) -> Self {
        Self { material_override, ..self }
    }

    /// The same body with its base colors changed.
    pub fn with_recolor(self, recolor: Option<Recolor>) -> Self {
        Self { recolor, ..self }
    }

    /// The same body with another finish.
    pub fn with_finish(self, finish: Option<Finish>) -> Self {
        Self { finish, ..self }
    }

    /// The same body, moved by a script.
    pub fn scripted(self, trajectory: Trajectory) -> Self {
        let world_from_body = trajectory.at(Moment::START);
        Self { world_from_body, motion: Motion::Scripted, trajectory: Some(Arc::new(trajectory)), ..self }
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
            recolor,
            finish,
            mass,
            friction,
            restitution,
            trajectory,
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
            recolor,
            finish,
            mass,
            friction,
            restitution,
            trajectory,
            spawn,
        }
    }
}

impl<Id> Body<Id> {
    /// The materials that the body shows, by slot of its mesh: its own ones or the one that replaces them, with the changed
    /// colors and finish. Faces of higher slots have the last material. Empty if the object has no materials.
    pub fn materials(&self) -> Vec<Arc<Material>> {
        let mut materials = self.own_materials().to_vec();
        if let Some(finish) = &self.finish {
            materials = materials.into_iter().map(|material| material.finished(finish)).collect();
        }
        if let Some(recolor) = &self.recolor {
            let (matrix, has_vertex_colors) = (recolor.matrix(), !self.object.mesh.data().colors.is_empty());
            let recolored = |material: Arc<Material>| material.recolored(matrix, has_vertex_colors);
            materials = materials.into_iter().map(recolored).collect();
        }
        materials
    }

    /// The [`materials`](Self::materials) without the changed colors and finish. Emission is the same in both.
    pub fn own_materials(&self) -> &[Arc<Material>] {
        match &self.material_override {
            Some(surface) => std::slice::from_ref(&surface.material),
            None => &self.object.materials,
        }
    }

    /// How the textures of [`materials`](Self::materials) are mapped.
    pub fn texture_mapping(&self) -> TextureMapping {
        let own = TextureMapping::Uv(UvTransform::default());
        self.material_override.as_ref().map_or(own, |surface| surface.mapping)
    }

    /// Pose of the body frame at a moment. A body without a script has one pose.
    pub fn pose_at(&self, moment: Moment) -> Pose {
        self.trajectory.as_ref().map_or(self.world_from_body, |trajectory| trajectory.at(moment))
    }

    /// The body at a moment.
    pub(super) fn at(self, moment: Moment) -> Self {
        Self { world_from_body: self.pose_at(moment), ..self }
    }

    /// Bounding box in the world, meters; exact over the corners of the mesh's box, not over its vertices.
    pub fn world_bounds(&self) -> Aabb {
        Aabb::of(self.object.mesh.bounds().corners().map(|p| self.world_from_body * p))
    }
}

/// Name of a body while its scene is under construction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle(pub(super) usize);
