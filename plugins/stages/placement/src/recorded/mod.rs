//! Recorded scenes, rebuilt: the objects of a dataset at their poses, and the cameras that saw them.

mod frame;
mod object;
mod scenes;
mod swap;

use crate::material::MaterialReplacement;
use crate::resting::RestingShapes;
use crate::variation::{ColorChange, FinishChange, Variation, resized};
use frame::{RecordedFrame, on_support};
use object::{RecordedObject, asset_of};
use scenes::{RecordedScene, RecordedScenes, RecordedUnit, Selection};
use std::sync::{Arc, Mutex, PoisonError};
use swap::{Place, Swap, Swapped};
use syntable_model::context::Assets;
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetRef, BodyDraft, DropZone, Motion, Object, RecordedCamera, Role};

/// Rebuilds the scenes of a dataset: the same objects at the same poses, seen by the same cameras.
///
/// The dataset can have any format that states cameras and poses of objects: BOP's `scene_gt.json` and `scene_camera.json`, or the
/// products `camera` and `object_info` of a dataset of this program. Scene `i` of the new dataset rebuilds scene `i` of the
/// recorded one, and starts again after the last one. The recipe gives the lights, materials, tables and rooms, and the kinds
/// `recorded` of `[views]` and `[camera]` give the views of the recorded cameras.
///
/// An object is found in the pools of `from` by its pool and name as in the dataset, or else by its name alone. If the dataset names
/// objects by their numbers, as BOP does, it is found by its number (`obj_id`). Images and scenes that cannot be read are left out, and
/// so later scenes get other numbers. Objects stay where they were recorded, even where their meshes overlap a little, unless `fixed = false`.
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
    /// Numbers of the recorded scenes to rebuild, in the order of the dataset; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    scenes: Option<Vec<u32>>,
    /// How the frame of a recorded scene becomes the world.
    #[serde(default)]
    frame: RecordedFrame,
    /// Name of the support that carries the objects. If left out, it is the first that a step sets. In the frame `world`, only
    /// objects that are not `fixed` need one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Rotation of the recorded scene about the center of the support, degrees, −360 to 360. The frame `world` has none.
    #[serde(default = "straight")]
    #[schemars(extend("minimum" = YAW_DEG[0], "maximum" = YAW_DEG[1]))]
    yaw_deg: Dist,
    /// Treatment of objects that no pool of `from` has.
    #[serde(default)]
    missing: Missing,
    /// Replaces some objects by others of about their size, such as `{ from = "household", probability = 0.3 }`.
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
            if self.swap.is_some() {
                let message = "objects that are swapped stand upright, and the frame `world` need not have a vertical";
                return Err(ConfigError::new("swap", message).help(help));
            }
        }
        Ok(Box::new(RecordedPlacer { options: self, opened: Mutex::default(), shapes: RestingShapes::default() }))
    }
}
register!(Recorded);

struct RecordedPlacer {
    options: Recorded,
    /// The dataset, after the first scene has been placed.
    opened: Mutex<Option<Arc<RecordedScenes>>>,
    shapes: RestingShapes,
}

impl Placer for RecordedPlacer {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let Recorded { frame, support, fixed, .. } = &self.options;
        let needs = *frame != RecordedFrame::World || !fixed;
        let needs = needs.then(|| PartUse::Needs(Part::support(support.as_ref())));
        Some([PartUse::Sets(Part::RecordedCameras)].into_iter().chain(needs).collect())
    }

    fn places_objects(&self) -> bool {
        self.options.annotated
    }

    /// Reads the first scene, and finds its models.
    fn ready(&self, assets: &dyn Assets, log: &dyn Log) -> Result<()> {
        let scenes = self.opened()?;
        scenes.left_out().iter().for_each(|left_out| log.left_out(left_out));
        let in_dataset = |error: Error| error.in_file(self.options.dataset.path());
        let first = scenes.read(0).map_err(in_dataset)?;
        first.objects.iter().try_for_each(|object| self.asset(object, assets).map(drop))
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        let Recorded { dataset, support, fixed, .. } = &self.options;
        let scenes = self.opened()?;
        let number = scene.id().0 as usize % scenes.count();
        let in_dataset = |error: Error| error.in_file(dataset.path());
        let RecordedScene { objects, cameras, is_in_world, left_out } = scenes.read(number).map_err(in_dataset)?;
        left_out.iter().for_each(|left_out| context.log.left_out(left_out));
        let mut found = self.found(&objects, context)?;
        let image = cameras.first().map_or("", |first| first.image.as_str());
        let in_image = |error: Error| in_dataset(error.context(format!("`{image}`")));
        if found.is_empty() && self.options.annotated {
            let message = "no object of the recorded scene is left to rebuild";
            let help = "leave its scene out of `scenes`, or add the pools of its models to `from`";
            return Err(in_image(Error::new(message).help(help)));
        }
        if !is_in_world && self.options.frame != RecordedFrame::RestingPlane {
            let message = "the dataset does not state the pose of its camera, so the recorded frame has no vertical";
            return Err(in_image(Error::new(message).help("set `frame = \"resting_plane\"`")));
        }
        let recording = self.recording(&found, &cameras, scene, context).map_err(in_image)?;
        for placed in &mut found {
            placed.pose = recording * placed.pose;
        }
        let zone = match fixed {
            true => None,
            false => Some(DropZone { starts_at_rest: true, ..DropZone::on(scene.support(support.as_ref())?.clone()) }),
        };
        for body in self.bodies(found, context)? {
            match &zone {
                Some(zone) => scene.drop_body(body, zone.clone()),
                None => scene.add(body),
            };
        }
        let in_world = |mut recorded: RecordedCamera| {
            recorded.camera.world_from_camera = recording * recorded.camera.world_from_camera;
            recorded
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
}

impl RecordedPlacer {
    /// The dataset, which the first call opens.
    fn opened(&self) -> Result<Arc<RecordedScenes>> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(scenes) = &*opened {
            return Ok(Arc::clone(scenes));
        }
        let Recorded { dataset, format, per, every, scenes, .. } = &self.options;
        let selection = Selection { per: *per, every: *every, scenes: scenes.as_deref() };
        let scenes = Arc::new(RecordedScenes::open(dataset.path(), format.as_deref(), &selection)?);
        *opened = Some(Arc::clone(&scenes));
        Ok(scenes)
    }

    /// The asset of a recorded object; none if it is left out.
    fn asset(&self, recorded: &RecordedObject, assets: &dyn Assets) -> Result<Option<AssetRef>> {
        let Recorded { dataset, from, missing, .. } = &self.options;
        let asset = asset_of(recorded, from, assets).map_err(|error| error.in_file(dataset.path()))?;
        if asset.is_none() && *missing == Missing::Error {
            let number = recorded.obj_id.map_or(String::new(), |number| format!(" (`obj_id` {number})"));
            let pools = from.names().join("`, `");
            let message = format!("the recorded object `{}`{number} is in none of `{pools}`", recorded.asset);
            return Err(Error::new(message).in_file(dataset.path()).help(
                "add the pool of its model to `from`, such as the kind `bop_models`, or set `missing = \"leave_out\"`",
            ));
        }
        Ok(asset)
    }

    /// The objects of a scene with their assets.
    fn found(&self, objects: &[RecordedObject], context: &Context) -> Result<Vec<FoundObject>> {
        let dataset = &self.options.dataset;
        context.assets.expect(objects.len());
        let (mut found, mut other) = (Vec::new(), Vec::new());
        for recorded in objects {
            let Some(asset) = self.asset(recorded, context.assets)? else { continue };
            let object = context.assets.get(&asset).and_then(Asset::into_object)?;
            let object = resized(object, recorded.scale).map_err(|error| {
                // Another attempt rebuilds the same object.
                Error::new(error.message().to_owned()).context(asset.to_string()).in_file(dataset.path())
            })?;
            if recorded.differs_from(&object.digest) {
                other.push(asset.to_string());
            }
            let pose = recorded.recording_from_body(&object);
            found.push(FoundObject { asset, object, pose });
        }
        let what = "recorded objects are left out: no pool of `from` has their models";
        context.log.left_out(&LeftOut::new(objects.len() - found.len(), objects.len(), what));
        if let Some(first) = other.first() {
            let message = format!("{} of {} recorded objects have another model now", other.len(), objects.len());
            let help = format!("give their pools the options with which the dataset was made; the first is `{first}`");
            context.log.warn(&Error::new(message).help(help).in_file(dataset.path()));
        }
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
        let Recorded { frame, support, yaw_deg, .. } = &self.options;
        if *frame == RecordedFrame::World || objects.is_empty() {
            return Ok(Pose::identity());
        }
        let yaw = yaw_deg.draw(&mut context.stream.child("yaw")).to_radians();
        let camera = cameras.first().map_or_else(Pose::identity, |first| first.camera.world_from_camera);
        let corners = objects.iter().map(|object| object.corners(&self.shapes, context)).collect();
        on_support(*frame, &corners, &camera, scene.support(support.as_ref())?, yaw)
    }

    /// The bodies of objects, or of others at their places.
    fn bodies(&self, objects: Vec<FoundObject>, context: &Context) -> Result<Vec<BodyDraft>> {
        let Recorded { swap, annotated, fixed, .. } = &self.options;
        let bounds: Vec<Aabb> = match swap {
            Some(_) => objects.iter().map(|object| Aabb::of(object.corners(&self.shapes, context))).collect(),
            None => Vec::new(),
        };
        let role = if *annotated { Role::Object } else { Role::Distractor };
        let motion = if *fixed { Motion::Fixed } else { Motion::Dynamic };
        let body = |(number, placed): (usize, FoundObject)| {
            let stream = context.stream.child("object").at(number as u64);
            let other = match swap {
                Some(swap) => swap.draw(&Place::among(&bounds, number), &self.shapes, &stream, context)?,
                None => None,
            };
            let FoundObject { asset, object, pose } = placed;
            let Swapped { asset, object, world_from_body } =
                other.unwrap_or(Swapped { asset, object, world_from_body: pose });
            let body = BodyDraft::new(asset, object, world_from_body, role, motion);
            self.options.variation().painted(body, context.assets, &stream)
        };
        objects.into_iter().enumerate().map(body).collect()
    }
}
