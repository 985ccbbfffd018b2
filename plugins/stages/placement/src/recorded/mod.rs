//! Recorded scenes, rebuilt: the objects of a dataset at their poses, and the cameras that saw them.

mod frame;
mod object;
mod scenes;
mod swap;

use crate::material::MaterialReplacement;
use crate::resting::RestingShapes;
use crate::variation::{ColorChange, FinishChange, Variation, resized};
use frame::{RecordedFrame, on_support};
use object::KnownAssets;
use scenes::{RecordedScene, RecordedScenes, RecordedUnit, Selection};
use std::sync::{Arc, Mutex, PoisonError};
use swap::{Swap, Swapped};
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetRef, BodyDraft, DropZone, Motion, Object, RecordedCamera, Role};

/// Rebuilds the scenes of a dataset: the same objects at the same poses before the same cameras.
///
/// The dataset can have any format that states cameras and poses of objects: BOP's `scene_gt.json` and `scene_camera.json`, or the
/// products `camera` and `object_info` of a dataset of this program. Scene `i` of the new dataset rebuilds scene `i` of the
/// recorded one, and starts again after the last one. The recipe gives the lights, materials, tables and rooms, and the kinds
/// `recorded` of `[views]` and `[camera]` give the views of the recorded cameras.
///
/// An object is found in the pools of `from`: by its pool and name as in the dataset, by its number (`obj_id`), or else by its name.
/// Objects stay where they were recorded, even where their meshes overlap a little, unless `fixed = false`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Folder or annotation file of the dataset. For BOP, the folder of the dataset or of one split.
    dataset: AssetPath,
    /// Format of the dataset, if it is not recognized.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    format: Option<String>,
    /// Pools with the models of its objects.
    from: ObjectPools,
    /// The images that one scene rebuilds.
    #[serde(default)]
    per: RecordedUnit,
    /// Takes every n-th image of a recorded scene only, from its first.
    #[serde(default = "each")]
    #[schemars(range(min = 1, max = 1_000_000))]
    every: u32,
    /// Numbers of the recorded scenes to rebuild; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    scenes: Option<Vec<u32>>,
    /// How the frame of a recorded scene becomes the world.
    #[serde(default)]
    frame: RecordedFrame,
    /// Name of the support that carries the objects. If left out, it is the first that a step sets. The frame `world` needs none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Rotation of the recorded scene about the center of the support, degrees, −360 to 360. The frame `world` has none.
    #[serde(default = "straight")]
    #[schemars(extend("minimum" = YAW_DEG[0], "maximum" = YAW_DEG[1]))]
    yaw_deg: Dist,
    /// Treatment of objects that no pool of `from` has.
    #[serde(default)]
    missing: Missing,
    /// Replaces some objects by others of their size, such as `{ from = "household", probability = 0.3 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    swap: Option<Swap>,
    /// Changes the colors of some objects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<ColorChange>,
    /// Replaces the material of some objects, such as `{ from = "materials", probability = 0.2 }`. Shape and mass stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialReplacement>,
    /// Changes how some objects reflect light, such as `{ roughness = { uniform = [0, 1] } }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishChange>,
    /// Whether the objects are labeled.
    #[serde(default = "yes")]
    annotated: bool,
    /// Whether the objects stay where they were recorded. Otherwise, physics lets them settle from there.
    #[serde(default = "yes")]
    fixed: bool,
    #[serde(skip)]
    opened: Opened,
    #[serde(skip)]
    shapes: RestingShapes,
}

/// Treatment of recorded objects that no pool has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Missing {
    /// The run stops: a scene without them would be another scene.
    #[default]
    Error,
    /// They are left out.
    LeaveOut,
}

/// Limits of `yaw_deg`, degrees.
const YAW_DEG: [f64; 2] = [-360.0, 360.0];

fn each() -> u32 {
    1
}

fn yes() -> bool {
    true
}

fn straight() -> Dist {
    Dist::Constant(0.0)
}

/// The open dataset, after the first scene has been placed.
#[derive(Default)]
struct Opened(Mutex<Option<Arc<RecordedScenes>>>);

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Opened")
    }
}

impl Clone for Opened {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Config for Recorded {
    type Stage = dyn Placer;
    const KIND: &'static str = "recorded";
    const EXAMPLE: &'static str = "dataset = \"${DATASETS}/ycbv/test\"\nfrom = \"ycbv\"\nper = \"image\"\n\
                                   swap = { from = \"household\", probability = 0.3 }";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.yaw_deg.within("yaw_deg", YAW_DEG[0], YAW_DEG[1])?;
        self.variation().check()?;
        if self.frame == RecordedFrame::World {
            let help = "leave it out, or set `frame = \"z_up\"` or `frame = \"resting_plane\"`";
            let message = |key: &str| format!("the frame `world` keeps the recorded poses, so `{key}` has no effect");
            if self.yaw_deg != straight() {
                return Err(ConfigError::new("yaw_deg", message("yaw_deg")).help(help));
            }
            if self.support.is_some() && self.fixed {
                return Err(ConfigError::new("support", message("support")).help(help));
            }
        }
        Ok(Box::new(self))
    }
}
register!(Recorded);

impl Placer for Recorded {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let needs = self.frame != RecordedFrame::World || self.support.is_some();
        Some(needs.then(|| PartUse::Needs(Part::support(self.support.as_ref()))).into_iter().collect())
    }

    fn places_objects(&self) -> bool {
        self.annotated
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let recorded = self.opened()?;
        let number = scene.id.0 as usize % recorded.count();
        let RecordedScene { objects, cameras } =
            recorded.read(number).map_err(|error| error.in_file(self.dataset.path()))?;
        let mut found = self.found(&objects, context)?;
        let recording = self.recording(&found, &cameras, scene, context)?;
        for placed in &mut found {
            placed.pose = recording * placed.pose;
        }
        for (number, placed) in found.into_iter().enumerate() {
            let body = self.body(placed, &context.stream.child("object").at(number as u64), context)?;
            match scene.support(self.support.as_ref()).ok().cloned() {
                Some(support) if !self.fixed => {
                    scene.drop_body(body, DropZone { starts_at_rest: true, ..DropZone::on(support) });
                }
                _ => drop(scene.add(body)),
            }
        }
        let in_world = |RecordedCamera { mut camera, image }: RecordedCamera| {
            camera.world_from_camera = recording * camera.world_from_camera;
            RecordedCamera { camera, image }
        };
        scene.recorded_cameras.extend(cameras.into_iter().map(in_world));
        Ok(())
    }
}

/// A recorded object whose asset is known.
struct FoundObject {
    asset: AssetRef,
    object: Arc<Object>,
    /// Pose of the body, first in the recorded frame and then in the world.
    pose: Pose,
}

impl FoundObject {
    fn corners(&self, shapes: &RestingShapes, context: &Context) -> Vec<Point3<f64>> {
        shapes.of(&self.object, context.cache).corners().map(|p| self.pose * p).collect()
    }
}

impl Recorded {
    fn variation(&self) -> Variation<'_> {
        Variation {
            scale: None,
            color: self.color.as_ref(),
            material: self.material.as_ref(),
            finish: self.finish.as_ref(),
        }
    }

    /// The dataset, which the first call opens.
    fn opened(&self) -> Result<Arc<RecordedScenes>> {
        let mut opened = self.opened.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(scenes) = &*opened {
            return Ok(Arc::clone(scenes));
        }
        let selection = Selection { per: self.per, every: self.every, scenes: self.scenes.as_deref() };
        let scenes = Arc::new(RecordedScenes::open(self.dataset.path(), self.format.as_deref(), &selection)?);
        *opened = Some(Arc::clone(&scenes));
        Ok(scenes)
    }

    /// The objects of a scene with their assets.
    fn found(&self, objects: &[object::RecordedObject], context: &Context) -> Result<Vec<FoundObject>> {
        let known = KnownAssets::of(&self.from, context)?;
        context.assets.expect(objects.len());
        let mut found = Vec::new();
        for recorded in objects {
            let Some(asset) = known.asset(recorded) else {
                let number = recorded.obj_id.map_or(String::new(), |number| format!(" (`obj_id` {number})"));
                if self.missing == Missing::LeaveOut {
                    continue;
                }
                let pools = self.from.names().join("`, `");
                let message = format!("the recorded object `{}`{number} is in none of `{pools}`", recorded.asset);
                return Err(Error::new(message).in_file(self.dataset.path()).help(
                    "add the pool of its model to `from`, such as the kind `bop_models`, or set `missing = \"leave_out\"`",
                ));
            };
            let object = context.assets.get(asset).and_then(Asset::into_object);
            let object = resized(object?, recorded.scale).map_err(|error| error.context(asset.to_string()))?;
            let pose = recorded.recording_from_body(&object);
            found.push(FoundObject { asset: asset.clone(), object, pose });
        }
        let what = "recorded objects are left out: no pool of `from` has their models";
        context.log.left_out(&LeftOut::new(objects.len() - found.len(), objects.len(), what));
        Ok(found)
    }

    /// Pose of the recorded frame in the world.
    fn recording(
        &self,
        objects: &[FoundObject],
        cameras: &[RecordedCamera],
        scene: &SceneBuilder,
        context: &Context,
    ) -> Result<Pose> {
        let yaw = self.yaw_deg.draw(&mut context.stream.child("yaw")).to_radians();
        let camera = cameras.first().map_or_else(Pose::identity, |first| first.camera.world_from_camera);
        if self.frame == RecordedFrame::World || objects.is_empty() {
            return Ok(Pose::identity());
        }
        let support = scene.support(self.support.as_ref())?;
        let corners = objects.iter().map(|object| object.corners(&self.shapes, context)).collect();
        on_support(self.frame, &corners, &camera, support, yaw).map_err(|error| {
            let image = cameras.first().map_or("", |first| first.image.as_str());
            error.context(format!("`{image}`")).in_file(self.dataset.path())
        })
    }

    /// The body of an object, or of another at its place.
    fn body(&self, placed: FoundObject, stream: &Stream, context: &Context) -> Result<BodyDraft> {
        let other = match &self.swap {
            Some(swap) => {
                let bounds = Aabb::of(placed.corners(&self.shapes, context));
                swap.draw(&bounds, &self.shapes, stream, context)?
            }
            None => None,
        };
        let FoundObject { asset, object, pose } = placed;
        let Swapped { asset, object, world_from_body } =
            other.unwrap_or(Swapped { asset, object, world_from_body: pose });
        let role = if self.annotated { Role::Object } else { Role::Distractor };
        let motion = if self.fixed { Motion::Fixed } else { Motion::Dynamic };
        let body = BodyDraft::new(asset, object, world_from_body, role, motion);
        self.variation().painted(body, context.assets, stream)
    }
}
