//! Reads datasets of SynTable's layout: from this program, from SynTable's release, and UOAIS-Sim.

use super::{ANNOTATION_FILE, RECIPE};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syntable_formats::decode::{self, FileContent};
use syntable_formats::index::{IndexedRecord, RecordSection};
use syntable_formats::listing::AnnotationListing;
use syntable_formats::read::{self, BACKGROUND, ObjectLabels};
use syntable_formats::segmentation::Rle;
use syntable_formats::syntable::{self, SynTableAnnotation, SynTableImage, SynTableScene};
use syntable_model::files::{DatasetFolder, read_small};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    BODIES, CAMERA, DENOISER, DEPTH, EXPOSURE, LABEL_POLICY, OBJECT_INFO, OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER,
    RGB, RGB_FILE, VISIBILITY,
};
use syntable_model::product::{BBox, OcclusionOrder};
use syntable_model::reader::{DatasetFault, FaultSubject, Format, ImageSource, Note, Opened, ReadImage, Source};
use syntable_model::rule;

syntable_model::register_format!(Format::new(
    "syntable",
    "SynTable's layout, as the writer `syntable` and SynTable's release have it, and the annotation files of UOAIS-Sim.",
    |path| { annotation_files(path).is_ok_and(|files| !files.is_empty()) && syntable::is_root(&root_of(path)) },
    open,
));

/// An open dataset.
pub struct SynTableSource {
    root: DatasetFolder,
    listing: AnnotationListing,
    /// Scene record of each image, by its index; none if the image has no scene record.
    scenes: Vec<Option<u32>>,
    /// Whether any object states its occlusion.
    is_amodal: bool,
}

/// The fields that all images of a dataset have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Has {
    depth: bool,
    camera: bool,
    exposure: bool,
    denoiser: bool,
    label_policy: bool,
    /// Whether all objects are described; none without objects.
    objects: Option<bool>,
    /// Whether all objects have a name; none without objects.
    names: Option<bool>,
    /// Whether any object states its occlusion rate or occlusion mask.
    amodal: bool,
    /// Whether any object has an occlusion mask.
    occlusion: bool,
}

impl Has {
    const ALL: Self = Self {
        depth: true,
        camera: true,
        exposure: true,
        denoiser: true,
        label_policy: true,
        objects: None,
        names: None,
        amodal: false,
        occlusion: false,
    };

    fn image(&mut self, image: &SynTableImage) {
        self.depth &= image.depth_file_name.is_some();
        self.camera &= image.camera.is_some();
        self.exposure &= image.exposure.is_some();
        self.denoiser &= image.denoiser.is_some();
        self.label_policy &= image.label_policy.is_some();
    }

    fn annotation(&mut self, it: &SynTableAnnotation) {
        if it.category_id == BACKGROUND {
            return;
        }
        let is_described = it.object.as_ref().is_some_and(|object| !object.is_null());
        self.objects = Some(self.objects.unwrap_or(true) && is_described);
        self.names = Some(self.names.unwrap_or(true) && it.object_name.is_some());
        self.occlusion |= it.occluded_mask.is_some();
        self.amodal |= it.occluded_mask.is_some() || it.occluded_rate.is_some();
    }
}

/// The folder of a dataset. The path may be the dataset's annotation file.
fn root_of(path: &Path) -> PathBuf {
    if path.is_file() { read::above(path) } else { path.to_owned() }
}

/// Annotation files at the top of a dataset: the given file, the file with the usual name, or otherwise all JSON files.
fn annotation_files(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let usual = root.join(ANNOTATION_FILE);
    match root.is_file() {
        true => Ok(Some(root.to_owned()).filter(|file| read::is_json(file)).into_iter().collect()),
        false if usual.is_file() => Ok(vec![usual]),
        false => read::json_files(root),
    }
}

fn open(source: &Source) -> Result<Opened> {
    let path = source.path.as_path();
    let root = source.folder(&root_of(path))?;
    let files = annotation_files(path).map_err(|error| Error::io(path, &error))?;
    let [file] = files.as_slice() else {
        let found = files.len();
        return Err(Error::new(format!("expected one annotation file at the top of the dataset, found {found}"))
            .in_file(path)
            .help(format!("name one of them instead of the folder, or call it {ANNOTATION_FILE}")));
    };
    if !path.is_file() {
        root.file(file.file_name().unwrap_or_default())?;
    }
    let (mut has, mut scenes) = (Has::ALL, Vec::new());
    let listing = AnnotationListing::open(file, &mut |record: &IndexedRecord<
        SynTableImage,
        SynTableAnnotation,
        SynTableScene,
    >| match record {
        IndexedRecord::Image(image) => has.image(image),
        IndexedRecord::Annotation(annotation) => has.annotation(annotation),
        IndexedRecord::Scene(scene) => scenes.push(scene.id),
    });
    let mut listing = listing?;
    let mut of_scene = BTreeMap::new();
    for (record, scene) in (0..).zip(scenes) {
        if of_scene.insert(scene, record).is_some() {
            listing.faults.add(rule::UNIQUE_IDS, FaultSubject::Scene(scene), "two scenes have this id");
        }
    }
    // In a file without annotations, no object lacks amodal labels.
    has.amodal |= listing.file.is_empty(RecordSection::Annotations);
    let recipe = root.file(RECIPE).ok().and_then(|path| String::from_utf8(read_small(&path).ok()?).ok());
    let recipe = recipe.unwrap_or_default();
    let about = &listing.file.info;
    listing.categories.forget_supercategory(read::SUPERCATEGORY);
    let info = listing.categories.info(about.description.clone(), about.contributor.clone(), &listing.refs, recipe);
    let scenes: Vec<Option<u32>> = listing.refs.iter().map(|image| of_scene.get(&image.scene.0).copied()).collect();
    let offers = offers(&listing, has, scenes.iter().all(Option::is_some));
    let mut derived = keys![VISIBILITY];
    derived.extend((!has.occlusion).then_some(OCCLUSION_MASK.id()));
    let opened =
        listing.opened(info, offers, |listing| SynTableSource { root, listing, scenes, is_amodal: has.amodal });
    let within_image = Note::caveat(read::WITHIN_IMAGE).of([VISIBILITY.id()]);
    let notes = std::iter::once(within_image).chain(opened.notes).collect();
    Ok(Opened { derived, notes, ..opened })
}

/// The products that all images have.
fn offers(listing: &AnnotationListing, has: Has, has_bodies: bool) -> Vec<KeyId> {
    if listing.images.is_empty() {
        return keys![RGB, RGB_FILE];
    }
    let mut keys = read::KnownMasks::with_amodal(has.amodal).offers();
    keys.extend(keys![RGB, RGB_FILE]);
    let more = [
        (VISIBILITY.id(), has.amodal),
        (OBJECT_NAME.id(), has.names.unwrap_or(true)),
        (DEPTH.id(), has.depth),
        (CAMERA.id(), has.camera),
        (EXPOSURE.id(), has.exposure),
        (DENOISER.id(), has.denoiser),
        (LABEL_POLICY.id(), has.label_policy),
        (OBJECT_INFO.id(), has.objects.unwrap_or(false)),
        (BODIES.id(), has_bodies),
    ];
    keys.extend(more.into_iter().filter(|(_, has)| *has).map(|(key, _)| key));
    keys
}

/// An image with its annotations, in the order of the file.
pub struct ShownImage {
    pub image: SynTableImage,
    pub annotations: Vec<SynTableAnnotation>,
}

impl ShownImage {
    /// The object ids that annotations state.
    pub fn stated_ids(&self) -> Vec<Option<u64>> {
        self.annotations.iter().map(|annotation| annotation.instance_id.map(u64::from)).collect()
    }
}

impl ImageSource for SynTableSource {
    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        self.shown(image).map_or_else(|_| Vec::new(), |shown| self.faults_of(&shown))
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let record = self.shown(image)?;
        let size = [record.image.width, record.image.height];
        let mut products = Products::new();
        let ids = read::ids_of(&record.stated_ids())?;
        let labels = ids.into_iter().zip(&record.annotations).map(|(id, it)| self.labels(&record.image, id, it));
        let labels: Vec<ObjectLabels> = labels.collect::<Result<_>>()?;
        let wanted = |key: KeyId| wants.contains(&key);
        let order = wanted(OCCLUSION_ORDER.id()).then(|| self.order(&record.image, &labels)).transpose()?.flatten();
        read::put(&labels, order, wants, &mut products)?;
        if wanted(RGB.id()) || wanted(RGB_FILE.id()) {
            let content = FileContent::read(&self.root.file(&record.image.file_name)?)?;
            content.stated(size).put_rgb(wants, &mut products)?;
        }
        if let Some(path) = record.image.depth_file_name.as_ref().filter(|_| wanted(DEPTH.id())) {
            let unit_mm = f64::from(record.image.depth_unit_mm.unwrap_or(1));
            products.put(DEPTH, decode::depth_of_size(&self.root.file(path)?, unit_mm, size)?)?;
        }
        let SynTableImage { camera, exposure, denoiser, label_policy, .. } = &record.image;
        for (key, json) in [(CAMERA, camera), (EXPOSURE, exposure), (DENOISER, denoiser), (LABEL_POLICY, label_policy)]
        {
            if let Some(json) = json.as_ref().filter(|_| wanted(key.id())) {
                products.put(key, Value::of(json)?)?;
            }
        }
        if wanted(VISIBILITY.id()) {
            products.put(VISIBILITY, read::visibility(&labels)?)?;
        }
        if wanted(OBJECT_NAME.id()) {
            let names = labels.iter().zip(&record.annotations);
            let names = names.map(|(labels, it)| (labels.id, it.object_name.clone().unwrap_or_default())).collect();
            products.put(OBJECT_NAME, names)?;
        }
        if wanted(OBJECT_INFO.id()) {
            let objects = labels.iter().zip(&record.annotations);
            let infos = objects.filter_map(|(labels, it)| Some((labels.id, it.object.as_ref()?)));
            let infos = infos.map(|(id, json)| Ok((id, Value::of(json)?))).collect::<Result<_>>()?;
            products.put(OBJECT_INFO, infos)?;
        }
        if let Some(scene) = self.scenes[image].filter(|_| wanted(BODIES.id())) {
            for scene in self.listing.file.records::<SynTableScene>(RecordSection::Scenes, &[scene])? {
                products.put(BODIES, Value::of(&scene.bodies)?)?;
            }
        }
        Ok(ReadImage::new(size, products))
    }
}

impl SynTableSource {
    fn shown(&self, image: usize) -> Result<ShownImage> {
        let mut annotations: Vec<SynTableAnnotation> = self.listing.annotations(image)?;
        annotations.retain(|annotation| annotation.category_id != BACKGROUND);
        Ok(ShownImage { image: self.listing.image(image)?, annotations })
    }

    pub fn labels(
        &self,
        image: &SynTableImage,
        id: InstanceId,
        annotation: &SynTableAnnotation,
    ) -> Result<ObjectLabels> {
        let mask = |rle: &Rle, name: &str| -> Result<Mask> {
            let of = || format!("annotation {}: `{name}`", annotation.id);
            let mask = rle.decode().map_err(|error| error.context(of()))?;
            if (mask.width(), mask.height()) == (image.width, image.height) {
                return Ok(mask);
            }
            let [found, expected] = [(mask.width(), mask.height()), (image.width, image.height)];
            Err(Error::new(format!("it has the size {found:?}, its image {expected:?}")).context(of()))
        };
        let visible = mask(&annotation.visible_mask, "visible_mask")?;
        // The form of the release has only the visible box.
        let visible_box = annotation.visible_bbox.or(Some(annotation.bbox)).filter(|_| !visible.is_empty());
        Ok(ObjectLabels {
            id,
            visible,
            amodal: self.is_amodal.then(|| mask(&annotation.segmentation, "segmentation")).transpose()?,
            occlusion: annotation.occluded_mask.as_ref().map(|rle| mask(rle, "occluded_mask")).transpose()?,
            rate: annotation.occluded_rate,
            visible_box: visible_box.map(BBox::from),
            amodal_box: annotation.amodal_bbox.map(BBox::from),
            category: self.listing.categories.id(annotation.category_id),
        })
    }

    /// The occlusion order in the dataset, whose n-th row belongs to the n-th annotation; none if the dataset has no
    /// order.
    fn order(&self, image: &SynTableImage, labels: &[ObjectLabels]) -> Result<Option<OcclusionOrder>> {
        let Some(path) = &image.occlusion_order_file_name else { return Ok(None) };
        let path = self.root.file(path)?;
        let (edge, entries) = FileContent::read(&path)?.square_npy()?;
        if edge != labels.len() {
            return Err(Error::new(format!("it is of {edge} objects, the image has {} annotations", labels.len()))
                .in_file(&path));
        }
        if let Some(at) = entries.iter().position(|entry| *entry != 0.0 && *entry != 1.0) {
            let (row, column) = (at / edge, at % edge);
            return Err(Error::new(format!("row {row}, column {column} is {}, not 0 or 1", entries[at])).in_file(&path));
        }
        // Reorders the rows by id.
        let mut rows: Vec<usize> = (0..edge).collect();
        rows.sort_by_key(|&row| labels[row].id);
        let mut order = OcclusionOrder::new(rows.iter().map(|&row| labels[row].id).collect());
        for (i, &row) in rows.iter().enumerate() {
            for (j, &column) in rows.iter().enumerate() {
                if entries[row * edge + column] != 0.0 {
                    order.set(i, j);
                }
            }
        }
        Ok(Some(order))
    }
}
