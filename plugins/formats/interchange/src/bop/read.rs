//! Reads BOP's scenewise layout and its tar files.

use super::check::{self, CocoScene};
use super::files::{self, BopImageRecord, BopImages, json};
use super::meshes::Meshes;
use super::record::{
    BopCamera, BopDatasetInfo, BopModelInfo, BopPixelCenters, CAMERA_FILE, CameraProduct, DATASET_INFO, GroundTruth,
    MM, MODELS, MODELS_INFO, OBJECTS, SceneCamera, model_number,
};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syntable_formats::coco::Category;
use syntable_formats::read::{self, Faults, ObjectLabels};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    CAMERA, CATEGORY_ID, DEPTH, OBJECT_INFO, OBJECT_MODELS, OBJECT_NAME, OCCLUSION_MASK, RGB, VISIBILITY,
};
use syntable_model::product::{ObjectModel, ObjectModels, PixelCounts};
use syntable_model::reader::{
    DatasetFault, FaultSubject, Format, ImageRef, ImageSource, Note, Opened, ReadImage, Source, unnamed_object,
};
use syntable_model::rule;
use syntable_model::scene::SceneId;

syntable_model::register_format!(Format::new(
    "bop",
    "BOP's scenewise layout and its tar files: a folder of a dataset with one split, or the split itself.",
    |root| !files::splits_of(root).is_empty(),
    open,
));

struct BopSource {
    categories: read::Categories,
    refs: Vec<ImageRef>,
    images: Vec<BopImageRecord>,
    /// Names of assets and boxes of models in meters, by `obj_id`.
    names: BTreeMap<u64, String>,
    bounds: BTreeMap<u64, [[f64; 3]; 2]>,
    /// Numbers of the models; none if the dataset does not list them.
    models: Option<BTreeMap<u64, BopModelInfo>>,
    meshes: Meshes,
    /// Numbers of the objects of each scene.
    of_scenes: BTreeMap<SceneId, BTreeSet<u64>>,
    camera: Option<BopCamera>,
    pixel_centers: BopPixelCenters,
    /// The annotation files of scenes by folder, read at their first use.
    coco: BTreeMap<PathBuf, OnceLock<Result<Option<CocoScene>>>>,
}

/// Number of other images of a scene whose poses are compared with the poses of an image.
const COMPARED: usize = 8;

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let split = files::split_of(root)?;
    let mut faults = Faults::default();
    let BopImages { refs, records: images, folders } = files::images(source, &split, &mut faults)?;
    let coco = folders.into_iter().map(|folder| (folder, OnceLock::new())).collect();
    let mut of_scenes = BTreeMap::<SceneId, BTreeSet<u64>>::new();
    for (image, record) in refs.iter().zip(&images) {
        of_scenes.entry(image.scene).or_default().extend(record.objects.iter().map(|object| object.obj_id));
    }
    let above = split.folder.parent().unwrap_or(&split.folder);
    let names = optional(source, [root, above], Path::new(OBJECTS))?;
    let camera: Option<BopCamera> = optional(source, [root, above], Path::new(CAMERA_FILE))?;
    let about: BopDatasetInfo = optional(source, [root, above], Path::new(DATASET_INFO))?;
    let pixel_centers = about.pixel_centers.value().copied().unwrap_or_default();
    camera.iter().for_each(|camera| check::camera_is_valid(camera, &mut faults));
    let model_folders = [root, above].map(|folder| folder.join(MODELS));
    let models: Option<BTreeMap<u64, BopModelInfo>> =
        optional(source, [root, above], &Path::new(MODELS).join(MODELS_INFO))?;
    let model_folder = model_folders.iter().find(|it| it.join(MODELS_INFO).is_file());
    if let Some((models, folder)) = models.as_ref().zip(model_folder) {
        check::faults_of_models(folder, models, &mut faults);
    }
    let all_models = models.iter().flatten();
    let of_models = models.iter().flat_map(|models| models.keys().copied());
    let meshes = Meshes::of(model_folder.unwrap_or(&model_folders[0]), of_models);
    let bounds = all_models.filter_map(|(&id, model)| Some((id, bounds_of(model)?))).collect();
    let listed = listed_models(source, [root, above])?;
    let listed = listed.into_iter().chain(models.iter().flat_map(BTreeMap::keys).copied()).collect();
    let numbers = ObjectNumbers::of(&of_scenes, listed, &names);
    // The category of an object is its number, as in BOP's COCO files.
    let category = |&id: &u64| Category { id, name: asset_of(&names, id), ..Category::default() };
    let categories = read::Categories::of(&numbers.all.iter().map(category).collect::<Vec<_>>());
    let info = categories.info(read::name_of(root), String::new(), &refs, String::new());
    let mut offers = read::KnownMasks::Both.offers();
    offers.extend(keys![RGB, DEPTH, CAMERA, OBJECT_INFO, OBJECT_NAME, VISIBILITY]);
    let has_meshes = !of_scenes.is_empty() && of_scenes.values().all(|models| meshes.have(models));
    offers.extend(has_meshes.then_some(OBJECT_MODELS.id()));
    let notes = numbers.caveat().map(|text| Note::caveat(text).of([CATEGORY_ID.id()])).into_iter().collect();
    let category_ids = categories.ids().into_iter().filter(|(own, _)| numbers.known.contains(own)).collect();
    let source = BopSource {
        categories,
        refs: refs.clone(),
        images,
        names,
        bounds,
        models,
        meshes,
        of_scenes,
        camera,
        pixel_centers,
        coco,
    };
    Ok(Opened {
        faults: faults.into_inner(),
        derived: keys![OCCLUSION_MASK],
        category_ids: Some(category_ids),
        notes,
        ..Opened::new(info, refs, offers, source)
    })
}

/// Numbers of the objects of a dataset, which are its categories: the numbers of the models, or, if no list contains
/// all objects, all numbers up to the largest.
struct ObjectNumbers {
    all: BTreeSet<u64>,
    /// The numbers that the dataset uses or lists. Numbers in gaps may belong to no object.
    known: BTreeSet<u64>,
    /// Whether the dataset lists all objects.
    are_listed: bool,
}

impl ObjectNumbers {
    /// Collects the numbers that occur in images, that folders of models list, and that have names. The `objects.json`
    /// of this program lists only the objects that were drawn, and its folders of models contain only these objects.
    fn of(shown: &BTreeMap<SceneId, BTreeSet<u64>>, listed: BTreeSet<u64>, names: &BTreeMap<u64, String>) -> Self {
        let shown: BTreeSet<u64> = shown.values().flatten().copied().collect();
        if !listed.is_empty() && names.is_empty() && shown.is_subset(&listed) {
            return Self { all: listed.clone(), known: listed, are_listed: true };
        }
        let known: BTreeSet<u64> = shown.into_iter().chain(listed).chain(names.keys().copied()).collect();
        Self { all: read::with_gaps_filled(known.clone()), known, are_listed: false }
    }

    /// Message for the user about objects that the dataset does not list.
    fn caveat(&self) -> Option<String> {
        let list = format!("`models/{MODELS_INFO}` with a model of each object");
        read::unlisted(&self.all, &list).filter(|_| !self.are_listed)
    }
}

/// Numbers of the models in folders such as `models` and `models_eval`: the numbers in the list of models, and the
/// numbers of the meshes. Folders that lead out of the dataset are ignored.
fn listed_models(source: &Source, folders: [&Path; 2]) -> Result<BTreeSet<u64>> {
    let of_mesh = |path: &PathBuf| model_number(&read::file_name(path));
    let mut listed = BTreeSet::new();
    for above in folders.into_iter().collect::<BTreeSet<_>>() {
        let inside = source.folder(above)?;
        let names = read::entries(above).into_iter().filter(|path| path.is_dir()).map(|path| read::file_name(&path));
        for name in names.filter(|name| name == MODELS || name.starts_with("models_")) {
            let folder = inside.inner(&name);
            if folder.file("").is_err() {
                continue;
            }
            listed.extend(read::entries(&folder.path()).iter().filter_map(of_mesh));
            let info = folder.file(MODELS_INFO).and_then(|path| json::<BTreeMap<u64, IgnoredAny>>(&path));
            listed.extend(info.unwrap_or_default().into_keys());
        }
    }
    Ok(listed)
}

/// Reads the file from the first of these folders that contains it.
fn optional<T: DeserializeOwned + Default>(source: &Source, folders: [&Path; 2], name: &Path) -> Result<T> {
    match folders.into_iter().find(|folder| folder.join(name).is_file()) {
        Some(folder) => json(&source.folder(folder)?.file(name)?),
        None => Ok(T::default()),
    }
}

/// Least and largest corner of the box around a model, m.
fn bounds_of(model: &BopModelInfo) -> Option<[[f64; 3]; 2]> {
    let [low, size] = model.box_mm()?.map(|mm| mm.map(|edge| edge / MM));
    Some([low, std::array::from_fn(|axis| low[axis] + size[axis])])
}

impl ImageSource for BopSource {
    fn other_faults(&self) -> Vec<DatasetFault> {
        let mut faults = Faults::default();
        if let Some(models) = &self.models {
            check::faults_of_meshes(&self.meshes, models, &mut faults);
        }
        faults.into_inner()
    }

    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        let record = &self.images[image];
        let mut faults: Vec<DatasetFault> =
            record.objects.iter().enumerate().filter_map(|(entry, it)| self.number_fault(entry, it)).collect();
        faults.extend(self.fault_of_camera_pose(image));
        faults.extend(self.faults_of_masks(record));
        faults
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let record = &self.images[image];
        let wanted = |key: KeyId| wants.contains(&key);
        let (mut products, mut unread) = (Products::new(), Vec::new());
        let file = record.color_file()?;
        // Rebuilt scenes need the size of each image alone.
        let rgb = if wanted(RGB.id()) { Some(file.rgb()?) } else { None };
        let [width, height] = rgb.as_ref().map_or_else(|| file.size(), |rgb| Ok([rgb.width(), rgb.height()]))?;
        if wanted(OBJECT_MODELS.id()) {
            let (models, failed) = self.models_of(self.refs[image].scene);
            products.put(OBJECT_MODELS, models)?;
            unread = failed;
        }
        let masks_wanted = read::KnownMasks::Both.offers().into_iter().any(wanted);
        let labels = if masks_wanted { record.labels(&self.categories, [width, height])? } else { Vec::new() };
        read::put(&labels, None, wants, &mut products)?;
        if let Some(rgb) = rgb {
            products.put(RGB, rgb)?;
        }
        if wanted(DEPTH.id()) {
            products.put(DEPTH, record.depth()?)?;
        }
        if wanted(CAMERA.id()) {
            products
                .put(CAMERA, Value::of(&CameraProduct::of(&record.camera, [width, height], self.pixel_centers))?)?;
        }
        let each = |of: &dyn Fn(usize, &GroundTruth) -> Result<Value>| -> Result<PerInstance<Value>> {
            let objects = record.objects.iter().enumerate();
            objects.map(|(entry, object)| Ok((id_of(entry), of(entry, object)?))).collect()
        };
        if wanted(OBJECT_INFO.id()) {
            products.put(OBJECT_INFO, each(&|_, object| Value::of(&self.object(&record.camera, object)))?)?;
        }
        if wanted(OBJECT_NAME.id()) {
            let names = record.objects.iter().enumerate();
            let name = |asset: String| asset.rsplit('/').next().unwrap_or_default().to_owned();
            let names = names.map(|(entry, object)| (id_of(entry), name(self.asset(object.obj_id)))).collect();
            products.put(OBJECT_NAME, names)?;
        }
        if wanted(VISIBILITY.id()) {
            products.put(VISIBILITY, each(&|entry, _| record.counts(entry).record())?)?;
        }
        Ok(ReadImage { unread, ..ReadImage::new([width, height], products) })
    }
}

/// The id of an entry of `scene_gt.json`: its position, from 1.
fn id_of(entry: usize) -> InstanceId {
    InstanceId(entry as u16 + 1)
}

impl BopImageRecord {
    /// Masks of the objects that are in the image, visible or not.
    fn labels(&self, categories: &read::Categories, size: [u32; 2]) -> Result<Vec<ObjectLabels>> {
        let of = |(entry, [amodal, visible]): (usize, [Mask; 2])| {
            let category = categories.id(self.objects[entry].obj_id);
            ObjectLabels::of_masks(id_of(entry), visible, Some(amodal), category)
        };
        Ok(self.masks(size)?.into_iter().enumerate().map(of).collect())
    }

    fn counts(&self, entry: usize) -> PixelCounts {
        let info = &self.infos[entry];
        let [x, y, width, height] = info.bbox_obj.map(|edge| edge as i32);
        let silhouette = if width < 0 { [0; 4] } else { [x, y, width + 1, height + 1] };
        PixelCounts {
            all: info.px_count_all,
            in_frame: info.px_count_valid,
            valid: info.px_count_valid,
            visible: info.px_count_visib,
            silhouette,
        }
    }

    /// Numbers and poses of the objects in the world; none without the camera's pose.
    fn poses(&self) -> Option<Vec<(u64, [[f64; 4]; 4])>> {
        let camera = self.camera.world_from_camera()?;
        Some(self.objects.iter().map(|it| (it.obj_id, product(&camera, &it.pose()))).collect())
    }
}

impl BopSource {
    /// Reports a camera that other images of the scene contradict.
    fn fault_of_camera_pose(&self, image: usize) -> Option<DatasetFault> {
        let scene = self.refs[image].scene;
        let first = self.refs.partition_point(|other| other.scene < scene);
        let count = self.refs.partition_point(|other| other.scene <= scene) - first;
        // Spread evenly over the scene.
        let compared = COMPARED.min(count - 1);
        let others = (0..compared).map(|at| first + (image - first + 1 + at * (count - 1) / compared) % count);
        let others: Vec<_> = others.filter_map(|other| self.images[other].poses()).collect();
        // Either of two images may be wrong; the fault is reported for the second image.
        let least = match count {
            2 if image == first => return None,
            2 => 1,
            _ => 2,
        };
        check::fault_of_camera_pose(&self.images[image].poses()?, &others, least)
    }

    /// Reports an object whose number belongs to no model.
    fn number_fault(&self, entry: usize, object: &GroundTruth) -> Option<DatasetFault> {
        let id = object.obj_id;
        let message = match &self.models {
            _ if id < 1 => "numbers of objects are from 1".to_owned(),
            Some(models) if !models.contains_key(&id) => format!("{MODELS_INFO} has no such model"),
            _ => return None,
        };
        let fault = DatasetFault::new("known_models", format!("`obj_id` is {id}, and {message}"));
        Some(fault.of(FaultSubject::Instance(id_of(entry))))
    }

    /// The rules that numbers break, given the masks. Unreadable masks are a separate fault.
    fn faults_of_masks(&self, record: &BopImageRecord) -> Vec<DatasetFault> {
        let Ok(size) = record.color_file().and_then(|file| file.size()) else { return Vec::new() };
        let mut all: Vec<DatasetFault> =
            self.camera.iter().filter_map(|camera| check::faults_of_camera(camera, size)).collect();
        let Ok(labels) = record.labels(&self.categories, size) else { return all };
        let depth = record.depth().ok();
        let mut masks = Vec::new();
        for (label, info) in labels.iter().zip(&record.infos) {
            let Some(whole) = &label.amodal else { continue };
            let of_object = info.faults([whole, &label.visible], depth.as_ref()).into_iter();
            all.extend(of_object.map(|fault| fault.of(FaultSubject::Instance(label.id))));
            masks.push([whole, &label.visible]);
        }
        let of_coco = record.folder().and_then(|folder| Some((folder, self.coco.get(&folder.path())?)));
        match of_coco.map(|(folder, scene)| scene.get_or_init(|| CocoScene::read(folder))) {
            Some(Ok(Some(scene))) => all.extend(scene.faults(record.number, &record.infos, &masks)),
            Some(Err(error)) => all.push(DatasetFault::new(rule::READABLE, error.to_string())),
            Some(Ok(None)) | None => {}
        }
        all
    }

    /// The models of all objects of a scene, and the errors of models that cannot be read.
    fn models_of(&self, scene: SceneId) -> (ObjectModels, Vec<Error>) {
        let (mut models, mut failed) = (BTreeMap::new(), Vec::new());
        for &id in self.of_scenes.get(&scene).into_iter().flatten() {
            match self.model(id) {
                Ok(model) => drop(models.insert(self.asset(id), model)),
                Err(error) => failed.push(error),
            }
        }
        (ObjectModels(models), failed)
    }

    /// A model with its number and its symmetries. A symmetry that is not a rigid motion is a fault of the dataset, and
    /// omitted.
    fn model(&self, id: u64) -> Result<ObjectModel> {
        let mut model = self.meshes.model(id)?;
        model.source.obj_id = u32::try_from(id).ok();
        let stated = self.models.as_ref().and_then(|models| models.get(&id)?.symmetries().ok());
        model.source.symmetries = stated.unwrap_or_default();
        Ok(model)
    }

    /// The asset with a number.
    fn asset(&self, obj_id: u64) -> String {
        asset_of(&self.names, obj_id)
    }

    fn object(&self, camera: &SceneCamera, object: &GroundTruth) -> Json {
        let asset = self.asset(object.obj_id);
        let (pool, name) = asset.split_once('/').unwrap_or(("", &asset));
        let camera_from_object = object.pose();
        let mut record = json!({
            "asset": asset,
            "pool": pool,
            "name": name,
            "category": "",
            "obj_id": object.obj_id,
            "camera_from_object": camera_from_object,
        });
        if let Some(world_from_camera) = camera.world_from_camera() {
            record["world_from_object"] = json!(product(&world_from_camera, &camera_from_object));
        }
        if let Some(bounds) = self.bounds.get(&object.obj_id) {
            record["bounds_m"] = json!(bounds);
        }
        record
    }
}

/// The asset with a number: its name, or a name made from the number.
fn asset_of(names: &BTreeMap<u64, String>, obj_id: u64) -> String {
    names.get(&obj_id).cloned().unwrap_or_else(|| unnamed_object(obj_id))
}

fn product(a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}
