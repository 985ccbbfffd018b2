//! The scenes of a dataset, in any format that states cameras and poses of objects.

use super::object::RecordedObject;
use std::path::Path;
use syntable_model::geometry::Pose;
use syntable_model::prelude::*;
use syntable_model::product::StatedCamera;
use syntable_model::product::standard::{CAMERA, OBJECT_INFO};
use syntable_model::reader::{ImageRef, OpenDataset, Source};
use syntable_model::registry::Registry;
use syntable_model::scene::{Camera, RecordedCamera};

/// Maximum width and height of a recorded image, px.
const MAX_PIXELS: u32 = 16_384;

/// The images that one scene rebuilds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordedUnit {
    /// All images of a recorded scene, whose objects stay in their places. The dataset must state the poses of its cameras.
    #[default]
    Scene,
    /// One image. The poses of its objects may differ from the poses in other images.
    Image,
}

/// The choice of images of a dataset.
pub struct Selection<'o> {
    /// The images that one scene rebuilds.
    pub per: RecordedUnit,
    /// Each how-many-th image of a recorded scene is taken.
    pub every: u32,
    /// Numbers of the recorded scenes; all by default.
    pub scenes: Option<&'o [u32]>,
}

/// The recorded scenes of a dataset.
pub struct RecordedScenes {
    dataset: OpenDataset,
    /// The images of each scene to rebuild, as places in the dataset.
    units: Vec<Vec<usize>>,
}

/// A recorded scene. Poses are in the recorded frame: the world of the dataset, or the camera of the only image.
pub struct RecordedScene {
    /// Its objects.
    pub objects: Vec<RecordedObject>,
    /// The cameras of its images.
    pub cameras: Vec<RecordedCamera>,
}

impl RecordedScenes {
    /// Opens a dataset.
    ///
    /// # Errors
    /// If it cannot be read, has no poses, or the selection is empty.
    pub fn open(path: &Path, format: Option<&str>, selection: &Selection) -> Result<Self> {
        let registry = Registry::linked().map_err(Error::new)?;
        let (format, dataset) = registry.open_dataset(&Source::at_name(path, None)?, format)?;
        for key in [CAMERA.id(), OBJECT_INFO.id()] {
            if !dataset.offers.contains(&key) {
                let message = format!("the dataset has no `{key}`, which states the poses to rebuild");
                return Err(Error::new(message).in_file(path).help(format!(
                    "it was read as `{}`; formats such as `bop`, and `jsonl`, `npz` or `hdf5` with `camera` and `object_info` in \
                     `include`, have poses",
                    format.name()
                )));
            }
        }
        if let Some(scene) = selection.scenes.into_iter().flatten().find(|&&it| !has_scene(&dataset, it)) {
            let known: Vec<String> = scene_numbers(&dataset).into_iter().take(20).map(|it| it.to_string()).collect();
            let message = format!("`scenes` names scene {scene}, which the dataset does not have");
            return Err(Error::new(message).in_file(path).help(format!("its scenes begin with {}", known.join(", "))));
        }
        let units = units_of(&dataset.images, selection);
        if units.is_empty() {
            return Err(Error::new("the dataset has no images").in_file(path));
        }
        Ok(Self { dataset, units })
    }

    /// Number of scenes to rebuild.
    pub fn count(&self) -> usize {
        self.units.len()
    }

    /// Reads a scene.
    ///
    /// # Errors
    /// If its images cannot be read, or objects differ in their places between its images.
    pub fn read(&self, number: usize) -> Result<RecordedScene> {
        let unit = &self.units[number];
        let mut scene = RecordedScene { objects: Vec::new(), cameras: Vec::new() };
        for &place in unit {
            let image = &self.dataset.images[place];
            let read = self.dataset.read(place, &[CAMERA.id(), OBJECT_INFO.id()])?;
            let stated = StatedCamera::of(read.products.get(CAMERA)?)?;
            let pose = match stated.world_from_camera() {
                Ok(pose) => pose,
                Err(_) if unit.len() == 1 => Pose::identity(),
                Err(error) => return Err(error.context(format!("`{}`", image.name)).help(APART)),
            };
            let camera = Camera { world_from_camera: pose, ..*stated.camera() };
            check(&camera, image)?;
            scene.cameras.push(RecordedCamera { camera, image: image.name.clone() });
            for (id, value) in read.products.get(OBJECT_INFO)?.iter() {
                scene.add(RecordedObject::read(id, value, &pose, image)?, image)?;
            }
        }
        Ok(scene)
    }
}

/// How to rebuild scenes whose objects move.
const APART: &str = "set `per = \"image\"` in the step, and `views_per_scene = 1` in [dataset]";

impl RecordedScene {
    /// Adds an object of an image, unless another image has shown it.
    fn add(&mut self, object: RecordedObject, image: &ImageRef) -> Result<()> {
        if self.cameras.len() > 1 && self.objects.iter().any(|known| known.is(&object)) {
            return Ok(());
        }
        let moved = |known: &&RecordedObject| known.id == object.id && known.asset == object.asset;
        if let Some(known) = self.objects.iter().find(moved) {
            let apart =
                (known.recording_from_file.translation.vector - object.recording_from_file.translation.vector).norm();
            let message = format!(
                "object {} (`{}`) of `{}` is {:.1} mm from its place in an earlier image",
                object.id,
                object.asset,
                image.name,
                apart * 1e3
            );
            return Err(Error::new(message).help(APART));
        }
        self.objects.push(object);
        Ok(())
    }
}

fn scene_numbers(dataset: &OpenDataset) -> Vec<u32> {
    let mut numbers: Vec<u32> = dataset.images.iter().map(|image| image.scene.0).collect();
    numbers.dedup();
    numbers
}

fn has_scene(dataset: &OpenDataset, number: u32) -> bool {
    dataset.images.iter().any(|image| image.scene.0 == number)
}

/// The images of each scene to rebuild, in the order of the dataset.
fn units_of(images: &[ImageRef], Selection { per, every, scenes }: &Selection) -> Vec<Vec<usize>> {
    let mut units: Vec<Vec<usize>> = Vec::new();
    let mut begin = 0;
    while let Some(first) = images.get(begin) {
        let end = begin + images[begin..].iter().take_while(|image| image.scene == first.scene).count();
        if scenes.is_none_or(|scenes| scenes.contains(&first.scene.0)) {
            let taken = (begin..end).step_by(*every as usize);
            match per {
                RecordedUnit::Scene => units.push(taken.collect()),
                RecordedUnit::Image => units.extend(taken.map(|image| vec![image])),
            }
        }
        begin = end;
    }
    units
}

/// Refuses cameras that no image can have.
fn check(camera: &Camera, image: &ImageRef) -> Result<()> {
    let k = &camera.intrinsics;
    let sizes = [k.width, k.height].iter().all(|edge| (1..=MAX_PIXELS).contains(edge));
    let focal = [k.fx, k.fy].iter().all(|f| f.is_finite() && *f > 0.0);
    let pose = &camera.world_from_camera;
    let finite = [k.cx, k.cy].iter().chain(pose.translation.vector.iter()).all(|x| x.is_finite());
    if sizes && focal && finite && pose.rotation.coords.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    let message = format!(
        "the camera of `{}` has {} × {} pixels, the focal lengths {} and {} and the center ({}, {})",
        image.name, k.width, k.height, k.fx, k.fy, k.cx, k.cy
    );
    Err(Error::new(message).help(format!("images have up to {MAX_PIXELS} pixels per edge, and positive focal lengths")))
}
