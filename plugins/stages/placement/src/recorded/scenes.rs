//! The scenes of a dataset, in any format that states cameras and poses of objects.

use super::object::RecordedObject;
use std::path::Path;
use std::sync::Arc;
use syntable_model::geometry::Pose;
use syntable_model::limits::IMAGE_PIXELS;
use syntable_model::prelude::*;
use syntable_model::product::StatedCamera;
use syntable_model::product::standard::{CAMERA, OBJECT_INFO, RGB};
use syntable_model::reader::{ImageRef, OpenDataset, Source};
use syntable_model::registry::Registry;
use syntable_model::scene::{Camera, Distortion, Intrinsics, RecordedCamera, RecordedImage};

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
    /// Takes every n-th image of a recorded scene.
    pub every: u32,
    /// Numbers of the recorded scenes; all by default.
    pub scenes: Option<&'o [u32]>,
}

/// The recorded scenes of a dataset.
pub struct RecordedScenes {
    dataset: Arc<OpenDataset>,
    /// The images of each scene to rebuild, as places in the dataset.
    units: Vec<Vec<usize>>,
}

/// A recorded scene. Poses are in the recorded frame: the world of the dataset, or the camera of the only image.
pub struct RecordedScene {
    /// Its objects.
    pub objects: Vec<RecordedObject>,
    /// The cameras of its images.
    pub cameras: Vec<RecordedCamera>,
    /// Whether the recorded frame is the world of the dataset. Otherwise, it is the frame of the only camera.
    pub is_in_world: bool,
    /// Parts of its images that the reader leaves out.
    pub left_out: Vec<LeftOut>,
}

impl RecordedScenes {
    /// Opens a dataset.
    ///
    /// # Errors
    /// If it cannot be read, has no poses, or the selection is empty.
    pub fn open(path: &Path, format: Option<&str>, selection: &Selection) -> Result<Self> {
        let registry = Registry::linked().map_err(Error::new)?;
        let (format, dataset) = registry.open_dataset(&Source::at_name(path, None)?, format).map_err(with_option)?;
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
            return Err(Error::new(message).in_file(path).help(format!("its first scenes are {}", known.join(", "))));
        }
        let units = units_of(&dataset.images, selection);
        let this = Self { dataset: Arc::new(dataset), units };
        match (this.units.is_empty(), this.lost()) {
            (false, _) => Ok(this),
            (true, None) => Err(Error::new("the dataset has no images").in_file(path)),
            (true, Some((_, why))) => Err(Error::new(format!("none of its images can be read: {why}")).in_file(path)),
        }
    }

    /// Number of files and records that hide images from the list of the dataset, and the first reason.
    fn lost(&self) -> Option<(usize, String)> {
        let mut lost = self.dataset.faults.iter().filter(|fault| fault.is_lost);
        let first = lost.next()?.to_string();
        Some((1 + lost.count(), first))
    }

    /// The images that no scene rebuilds, because they cannot be read.
    pub fn left_out(&self) -> Option<LeftOut> {
        let (count, why) = self.lost()?;
        let what = "images and damaged records of the recorded dataset are not rebuilt: they cannot be read";
        Some(LeftOut::new(count, count + self.dataset.images.len(), what).help(format!("the first one: {why}")))
    }

    /// Number of scenes to rebuild.
    pub fn count(&self) -> usize {
        self.units.len()
    }

    /// Reads a scene.
    ///
    /// # Errors
    /// If its images cannot be read, objects differ in their places between its images, or two images have one pose and different
    /// lenses.
    pub fn read(&self, number: usize) -> Result<RecordedScene> {
        let unit = &self.units[number];
        let (mut objects, mut cameras) = (Objects::default(), Vec::<RecordedCamera>::new());
        let (mut is_in_world, mut left_out) = (true, Vec::new());
        for &place in unit {
            let image = &self.dataset.images[place];
            let read = self.dataset.read(place, &[CAMERA.id(), OBJECT_INFO.id()])?;
            left_out.extend(read.left_out);
            let named = |error: Error| error.context(format!("`{}`", image.name));
            let stated = StatedCamera::of(read.products.get(CAMERA)?).map_err(named)?;
            let pose = match stated.world_from_camera() {
                Ok(pose) => Some(pose),
                Err(_) if unit.len() == 1 => None,
                Err(error) => return Err(named(error).help(PER_IMAGE)),
            };
            is_in_world &= pose.is_some();
            let camera = Camera { world_from_camera: pose.unwrap_or_else(Pose::identity), ..*stated.camera() };
            check(&camera, image)?;
            if let Some(other) = cameras.iter().find(|other| is_ambiguous(&other.camera, &camera)) {
                let message =
                    format!("`{}` and `{}` have one camera pose and different lenses", other.image, image.name);
                return Err(Error::new(message).help(PER_IMAGE));
            }
            cameras.push(RecordedCamera { camera, image: image.name.clone(), photograph: self.photograph(place) });
            let shown = read.products.get(OBJECT_INFO)?.iter();
            let shown = shown.map(|(id, value)| RecordedObject::read(id, value, pose.as_ref(), image));
            objects.add(shown.collect::<Result<_>>()?, image)?;
        }
        Ok(RecordedScene { objects: objects.known, cameras, is_in_world, left_out })
    }

    /// The color image at a place of the dataset, if it has color images.
    fn photograph(&self, place: usize) -> Option<RecordedImage> {
        let dataset = Arc::clone(&self.dataset);
        let read = move || dataset.read(place, &[RGB.id()])?.products.get(RGB).cloned();
        self.dataset.offers.contains(&RGB.id()).then(|| RecordedImage::new(read))
    }
}

/// Whether two cameras have one pose and different lenses: a view cannot tell them apart.
fn is_ambiguous(a: &Camera, b: &Camera) -> bool {
    a.world_from_camera == b.world_from_camera && (a.intrinsics != b.intrinsics || a.distortion != b.distortion)
}

/// How to rebuild images that do not show one scene at rest, or whose cameras have no pose.
const PER_IMAGE: &str = "set `per = \"image\"` in the step, and `views_per_scene = 1` in [dataset]";

/// The objects of a recorded scene, from image to image.
#[derive(Default)]
struct Objects {
    known: Vec<RecordedObject>,
    /// Name of the image that first showed each.
    first_shown: Vec<String>,
}

impl Objects {
    /// Adds the objects of an image that no image before has shown.
    fn add(&mut self, shown: Vec<RecordedObject>, image: &ImageRef) -> Result<()> {
        let before = self.known.len();
        let mut is_seen = vec![false; before];
        let mut others = Vec::new();
        for object in shown {
            match (0..before).find(|&place| !is_seen[place] && self.known[place].is(&object)) {
                Some(place) => is_seen[place] = true,
                None => others.push(object),
            }
        }
        for object in others {
            // Ids of BOP number the entries of one image; an id that an object at its place has taken says nothing.
            let moved = |place: &usize| {
                let known = &self.known[*place];
                !is_seen[*place] && known.id == object.id && known.asset == object.asset
            };
            if let Some(place) = (0..before).find(moved) {
                let (millimeters, degrees) = self.known[place].apart(&object);
                let message = format!(
                    "object {} (`{}`) of `{}` is {millimeters:.1} mm and {degrees:.1}° from its pose in `{}`",
                    object.id, object.asset, image.name, self.first_shown[place]
                );
                return Err(Error::new(message).help(PER_IMAGE));
            }
            self.known.push(object);
            self.first_shown.push(image.name.clone());
        }
        Ok(())
    }
}

fn scene_numbers(dataset: &OpenDataset) -> Vec<u32> {
    let mut numbers: Vec<u32> = dataset.images.iter().map(|image| image.scene.0).collect();
    numbers.dedup();
    numbers
}

/// The error with this step's name of the option, instead of the verbs' name.
fn with_option(error: Error) -> Error {
    match error.help_text().map(|help| help.replace("`options.format`", "`format`")) {
        Some(help) => error.help(help),
        None => error,
    }
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
    let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
    let named = |error: Error| error.context(format!("the camera of `{}`", image.name));
    if [width, height].iter().any(|edge| !(1..=Intrinsics::MAX_EDGE).contains(edge)) {
        let message = format!("an image of {width} × {height} pixels");
        return Err(named(
            Error::new(message).help(format!("images have 1 to {} pixels per edge", Intrinsics::MAX_EDGE)),
        ));
    }
    IMAGE_PIXELS.check_size([width, height]).map_err(named)?;
    if ![fx, fy].iter().all(|f| f.is_finite() && *f > 0.0) || ![cx, cy].iter().all(|c| c.is_finite()) {
        let message = format!("the focal lengths are {fx} and {fy}, and the center is ({cx}, {cy})");
        return Err(named(Error::new(message).help("focal lengths are above 0")));
    }
    let [w, h] = [f64::from(width), f64::from(height)];
    let corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]];
    // A fisheye lens may show nothing in the corners.
    let folds = matches!(camera.distortion, Some(Distortion::Polynomial(_)));
    if let Some([u, v]) = corners.into_iter().find(|[u, v]| folds && camera.unproject(*u, *v).is_none()) {
        let message = format!("its distortion folds the image over before pixel ({u}, {v})");
        return Err(named(Error::new(message).help("its coefficients are not of this image size")));
    }
    Ok(())
}
