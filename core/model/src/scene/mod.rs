//! The scene, which placers and the settler build and every later stage reads.
//!
//! A [`SceneBuilder`] is mutable; [`SceneBuilder::freeze`] checks it, gives dense instance ids and makes a [`Scene`]
//! that never changes again. A [`View`] adds camera, exposure and lights; hiding an object is a property of a render
//! request, never of the world.

mod articulation;
mod asset;
mod body;
mod camera;
mod environment;
mod finish;
mod light;
mod mass;
mod material;
mod mesh;
mod moment;
mod moments;
mod recolor;
mod recorded;
mod rig;
mod settled;
mod support;
mod symmetry;
mod texture;
mod topology;

pub use articulation::{Articulation, Joint, JointKind, Link};
pub use asset::{
    Asset, AssetClass, AssetRef, Catalog, CatalogEntry, ConvexPart, Keypoint, Object, Resized, SourceModel,
};
pub use body::{Body, BodyDraft, BodyHandle, InstanceId, Motion, Role};
pub use camera::{Camera, Distortion, Exposure, Fisheye, Intrinsics, Optics, Polynomial, Rays, ThinLens};
pub use environment::EnvironmentMap;
pub use finish::Finish;
pub use light::{DirectionalLight, DiskLight, EnvironmentLight, Light, RectLight, SphereLight, WindowLight};
pub use mass::{MassDistribution, MassOrigin, MassProperties};
pub use material::{
    Alpha, Clearcoat, Color, Material, MaterialOverride, NormalMap, Scalar, Sheen, TextureMapping, Transmission, Volume,
};
pub use mesh::{Mesh, MeshData};
pub use moment::{Moment, Trajectory};
pub use moments::Moments;
pub use recolor::{ColorMatrix, Recolor};
pub use recorded::{RecordedCamera, RecordedImage};
pub use rig::RigView;
pub use settled::{PlacedBodies, Settled};
pub use support::{DropZone, Region, Support, SupportArea, Supports, Walls, is_in_group};
pub use symmetry::{Symmetries, SymmetryAxis};
pub use texture::{Encoding, Texture, TextureRef, UvTransform, Wrap};
pub use topology::{Topology, weld};

use crate::error::{Error, Result};
use crate::geometry::{Aabb, Point3, Pose, Vector3, space_around};
use crate::names::SupportName;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A scene's number in its dataset, from 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct SceneId(pub u32);

/// A view's number in its scene, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct ViewId(pub u32);

/// Why a body left the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Removal {
    /// The body's number in spawn order.
    pub spawn: u32,
    /// Its asset.
    pub asset: AssetRef,
    /// Why, in words: `fell off the table`, `still moving at 0.12 m/s`.
    pub reason: String,
}

/// How a scene came to rest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SettleReport {
    /// Longest simulated time between two starts of bodies, s: of the first fall, or of one after respawns.
    pub simulated_s: f64,
    /// Largest speed of a body that stayed, m/s.
    pub residual_speed_m_s: f64,
    /// Largest angular speed of a body that stayed, rad/s.
    pub residual_angular_speed_rad_s: f64,
    /// Deepest penetration between any two bodies that stayed, m.
    pub deepest_penetration_m: f64,
    /// Largest distance by which the collision shape of a body that stayed fills hollows of its mesh, m.
    #[serde(default)]
    pub collision_deviation_m: f64,
    /// Number of respawns of bodies.
    pub respawned: u32,
    /// Number of distractors that were taken out.
    pub removed_distractors: u32,
    /// Number of bodies that were not poured because their support was full.
    #[serde(default)]
    pub spare: u32,
    /// Objects that were taken out, in spawn order.
    pub removed: Vec<Removal>,
}

/// A scene under construction.
#[derive(Debug, Default)]
pub struct SceneBuilder {
    id: SceneId,
    attempt: u32,
    bodies: Vec<Option<BodyDraft>>,
    /// Drop zone of each body; none for bodies whose placers set none.
    zones: Vec<Option<DropZone>>,
    spawned: u32,
    /// The places that carry objects, set by placers.
    pub supports: Supports,
    /// Bodies that are parts of one mechanism.
    pub articulations: Vec<Articulation<BodyHandle>>,
    /// Lights that belong to the scene rather than to a view.
    pub lights: Vec<Light>,
    /// Cameras of the recorded scene that a placer rebuilds, in the order of its images. Empty for other scenes.
    pub recorded_cameras: Vec<RecordedCamera>,
}

impl SceneBuilder {
    /// An empty scene of a number in its dataset, for an attempt at it, from 0.
    pub fn new(id: SceneId, attempt: u32) -> Self {
        Self { id, attempt, ..Self::default() }
    }

    /// The scene's number in its dataset.
    pub fn id(&self) -> SceneId {
        self.id
    }

    /// Adds a body. Objects are numbered in the order in which they are added.
    pub fn add(&mut self, mut body: BodyDraft) -> BodyHandle {
        if body.role == Role::Object {
            body.spawn = self.spawned;
            self.spawned += 1;
        }
        self.bodies.push(Some(body));
        self.zones.push(None);
        BodyHandle(self.bodies.len() - 1)
    }

    /// Adds a body that is dropped on a support.
    pub fn drop_body(&mut self, body: BodyDraft, zone: DropZone) -> BodyHandle {
        let handle = self.add(body);
        self.zones[handle.0] = Some(zone);
        handle
    }

    /// The drop zone that the placer set for a body, or else the whole main support. None if the scene has no support.
    pub fn drop_zone(&self, handle: BodyHandle) -> Option<DropZone> {
        let stated = self.zones.get(handle.0).cloned().flatten();
        stated.or_else(|| self.supports.main().cloned().map(DropZone::on))
    }

    /// Takes a body out, if it is still there.
    pub fn remove(&mut self, handle: BodyHandle) -> Option<BodyDraft> {
        self.bodies.get_mut(handle.0)?.take()
    }

    /// A body, if it is still there.
    pub fn body(&self, handle: BodyHandle) -> Option<&BodyDraft> {
        self.bodies.get(handle.0)?.as_ref()
    }

    /// Moves a body.
    pub fn set_pose(&mut self, handle: BodyHandle, world_from_body: Pose) {
        if let Some(Some(body)) = self.bodies.get_mut(handle.0) {
            body.world_from_body = world_from_body;
        }
    }

    /// Gives a body a trajectory, and moves it to its pose at the start.
    pub fn set_trajectory(&mut self, handle: BodyHandle, trajectory: Trajectory) {
        if let Some(Some(body)) = self.bodies.get_mut(handle.0) {
            body.world_from_body = trajectory.at(Moment::START);
            body.trajectory = Some(Arc::new(trajectory));
        }
    }

    /// Gives a body another mass, kg, distributed as its own.
    pub fn assign_mass(&mut self, handle: BodyHandle, kg: f64) {
        if let Some(Some(body)) = self.bodies.get_mut(handle.0) {
            body.mass = body.mass.with_kg(kg, MassOrigin::Assigned);
        }
    }

    /// The bodies in the scene, in the order in which they were added.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyHandle, &BodyDraft)> {
        self.bodies.iter().enumerate().filter_map(|(i, body)| Some((BodyHandle(i), body.as_ref()?)))
    }

    /// The support that a recipe names, or the main one; an error for a placer or settler that needs it.
    ///
    /// # Errors
    /// See [`Supports::get`].
    pub fn support(&self, name: Option<&SupportName>) -> Result<&Support> {
        self.supports.get(name)
    }

    /// Height at which the space above a support ends, meters above the floor: at the lowest part of the room above its
    /// center, or at the end of its [clear height](Support::clear_height_m). None under the open sky.
    pub fn space_top(&self, support: &Support) -> Option<f64> {
        [self.ceiling_height(support), support.top()].into_iter().flatten().reduce(f64::min)
    }

    /// Height of the lowest part of the room above the center of a support, meters; none under the open sky.
    pub fn ceiling_height(&self, support: &Support) -> Option<f64> {
        let center = support.center();
        let above = |bounds: &Aabb| {
            bounds.min.z >= center.z && (0..2).all(|axis| (bounds.min[axis]..=bounds.max[axis]).contains(&center[axis]))
        };
        let parts = self.bodies().filter(|(_, body)| body.role == Role::Room).map(|(_, body)| body.world_bounds());
        parts.filter(above).map(|bounds| bounds.min.z).reduce(f64::min)
    }

    /// The inside of the room around a place, such as the center of a support; infinite in directions without a wall, floor or
    /// ceiling.
    pub fn room_around(&self, place: &Point3<f64>) -> Aabb {
        let parts = self.bodies().filter(|(_, body)| body.role == Role::Room);
        space_around(&above(place), parts.map(|(_, body)| body.world_bounds()))
    }

    /// Whether a part of the room is below the center of a support.
    pub fn has_floor(&self, support: &Support) -> bool {
        let center = support.center();
        let below = |bounds: &Aabb| {
            bounds.min.z < center.z && (0..2).all(|axis| (bounds.min[axis]..=bounds.max[axis]).contains(&center[axis]))
        };
        self.bodies().any(|(_, body)| body.role == Role::Room && below(&body.world_bounds()))
    }

    /// Checks the scene and fixes it: objects get the ids 1..=M in spawn order, everything else the ids after.
    pub fn freeze(self, settle: SettleReport) -> Result<Scene> {
        let all = self.bodies.into_iter().enumerate();
        let mut bodies: Vec<(BodyHandle, BodyDraft)> =
            all.filter_map(|(number, body)| Some((BodyHandle(number), body?))).collect();
        bodies.sort_by_key(|(_, body)| (body.role != Role::Object, !body.role.is_foreground()));
        if bodies.len() > usize::from(u16::MAX) {
            return Err(Error::new(format!("{} bodies are more than {} ids", bodies.len(), u16::MAX)));
        }
        let ids = (1..).map(InstanceId).zip(&bodies).map(|(id, (handle, _))| (*handle, id)).collect();
        let articulations =
            self.articulations.into_iter().map(|articulation| articulation.frozen(&ids)).collect::<Result<_>>()?;
        let bodies = (1..).map(InstanceId).zip(bodies).map(|(id, (_, draft))| draft.with_id(id).at(Moment::START));
        let bodies: Vec<Body> = bodies.collect();
        for body in &bodies {
            let pose = &body.world_from_body;
            if !pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite()) {
                return Err(Error::unlucky(format!("the pose of {} is not finite", body.asset)));
            }
        }
        if !bodies.iter().any(|body| body.role == Role::Object) {
            return Err(nothing_left(self.spawned, &settle.removed));
        }
        let Self { id, attempt, supports, lights, recorded_cameras, .. } = self;
        let moment = Moment::START;
        Ok(Scene { id, attempt, moment, bodies, supports, articulations, lights, recorded_cameras, settle })
    }
}

/// Why a scene has no object: none was placed, or all were taken out, with the reasons and the number of times each
/// occurred.
fn nothing_left(placed: u32, removed: &[Removal]) -> Error {
    if placed == 0 {
        return Error::unlucky("no step placed an object")
            .help("a scene needs an annotated object: add a `drop_box` to [[place]], or raise its `count`");
    }
    // Reasons that differ only in numbers count as the same reason.
    let sort = |reason: &str| -> String { reason.chars().filter(|c| !c.is_ascii_digit()).collect() };
    let mut reasons: Vec<(String, &str, u32)> = Vec::new();
    for Removal { reason, .. } in removed {
        let sort = sort(reason);
        match reasons.iter_mut().find(|(other, ..)| *other == sort) {
            Some((.., count)) => *count += 1,
            None => reasons.push((sort, reason, 1)),
        }
    }
    reasons.sort_by_key(|(.., count)| std::cmp::Reverse(*count));
    let said = reasons.iter().map(|(sort, first, count)| {
        // The numbers come from the first such reason.
        let such = if *count > 1 && sort != first { "such as: " } else { "" };
        format!("{count} {such}{first}")
    });
    let said: Vec<String> = said.collect();
    let reasons = if said.is_empty() { String::new() } else { format!(": {}", said.join(", ")) };
    Error::unlucky(format!("no object is left, of {placed} that were placed{reasons}")).help(
        "where they fall off, drop them nearer to the middle of their support or take a larger one; where they lie in a bin or on a \
         shelf beside or below that support, set `settle.remove = \"keep\"`; where they still move, give them more time in [settle]",
    )
}

/// A finished scene: written once, read by many. It shows the bodies at one [moment](Self::moment); [`Scene::at`] gives the same
/// scene at another.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Number in the dataset.
    pub id: SceneId,
    /// Which attempt this is, from 0; a failed scene is tried again with the next.
    pub attempt: u32,
    /// The moment at which the bodies have their poses.
    pub moment: Moment,
    bodies: Vec<Body>,
    /// The places that carry objects.
    pub supports: Supports,
    /// Bodies that are parts of one mechanism. Nothing moves their joints yet.
    pub articulations: Vec<Articulation>,
    /// Lights of all views.
    pub lights: Vec<Light>,
    /// Cameras of the recorded scene that it rebuilds; empty for other scenes.
    recorded_cameras: Vec<RecordedCamera>,
    /// How the objects came to rest.
    pub settle: SettleReport,
}

/// The point 1 cm above a place: a support on the floor lies in the plane where the walls end.
fn above(place: &Point3<f64>) -> Point3<f64> {
    place + Vector3::z() * 0.01
}

impl Scene {
    /// All bodies; body `i` has the instance id `i + 1`. Objects come first.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The objects, ids 1..=M.
    pub fn objects(&self) -> &[Body] {
        let count = self.bodies.iter().take_while(|body| body.role == Role::Object).count();
        &self.bodies[..count]
    }

    /// The objects and distractors, [`Role::is_foreground`]. They come first.
    pub fn foreground(&self) -> &[Body] {
        let count = self.bodies.iter().take_while(|body| body.role.is_foreground()).count();
        &self.bodies[..count]
    }

    /// The bodies behind the [foreground](Self::foreground): supports, furniture and room.
    pub fn furniture(&self) -> &[Body] {
        &self.bodies[self.foreground().len()..]
    }

    /// The support that a recipe names, or the main one.
    ///
    /// # Errors
    /// See [`Supports::get`].
    pub fn support(&self, name: Option<&SupportName>) -> Result<&Support> {
        self.supports.get(name)
    }

    /// The inside of the room around a place, as [`SceneBuilder::room_around`].
    pub fn room_around(&self, place: &Point3<f64>) -> Aabb {
        let parts = self.bodies.iter().filter(|body| body.role == Role::Room);
        space_around(&above(place), parts.map(|body| body.world_bounds()))
    }

    /// The cameras of the recorded scene that it rebuilds, in the order of its images: at least one.
    ///
    /// # Errors
    /// If it rebuilds none.
    pub fn recorded_cameras(&self) -> Result<&[RecordedCamera]> {
        match self.recorded_cameras.as_slice() {
            [] => {
                Err(Error::new("the scene has no recorded cameras")
                    .help("add a step of the kind `recorded` to [[place]]"))
            }
            cameras => Ok(cameras),
        }
    }

    /// Whether a body moves by a script, so that the scene differs between moments.
    pub fn moves(&self) -> bool {
        self.bodies.iter().any(|body| body.trajectory.is_some())
    }

    /// The scene at a moment: the same bodies, ids and lights, with scripted bodies at their poses then. The scene itself if
    /// nothing in it moves.
    pub fn at(self: &Arc<Self>, moment: Moment) -> Arc<Self> {
        if moment == self.moment || !self.moves() {
            return Arc::clone(self);
        }
        let mut scene = Self::clone(self);
        scene.moment = moment;
        scene.bodies = scene.bodies.into_iter().map(|body| body.at(moment)).collect();
        Arc::new(scene)
    }

    /// The body of an id; none for the background.
    pub fn body(&self, id: InstanceId) -> Option<&Body> {
        self.bodies.get(usize::from(id.0).checked_sub(1)?)
    }
}

/// One image of a scene: camera, exposure and lights.
#[derive(Debug, Clone)]
pub struct View {
    /// Number in the scene.
    pub id: ViewId,
    /// When it is taken: it shows the [scene at](Scene::at) this moment.
    pub moment: Moment,
    /// Intrinsics and pose.
    pub camera: Camera,
    /// How scene light becomes an image.
    pub exposure: Exposure,
    /// All lights: the scene's and the view's own.
    pub lights: Vec<Light>,
    /// The camera that takes it, if it belongs to a rig.
    pub rig: Option<RigView>,
}
