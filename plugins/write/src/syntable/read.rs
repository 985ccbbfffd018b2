//! Reads datasets of SynTable's layout: ours, and those of the release and of UOAIS-Sim.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::decode;
use syntable_formats::read::{self, BACKGROUND, Categories, Faults, Labels};
use syntable_formats::segmentation::Rle;
use syntable_formats::syntable::{Annotation, Dataset, Image, Scene};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    BODIES, CAMERA, DENOISER, DEPTH, EXPOSURE, LABEL_POLICY, OBJECT_INFO, OBJECT_NAME, OCCLUSION_ORDER, RGB, VISIBILITY,
};
use syntable_model::product::{BBox, OcclusionOrder, PixelCounts};
use syntable_model::reader::{DatasetFault, DatasetReader, Format, ImageRef};

syntable_model::register_format!(Format {
    name: "syntable",
    doc: "SynTable's layout, as the writer `syntable` and SynTable's release have it, and the annotation files of UOAIS-Sim.",
    detect: |root| annotation_files(root).is_ok_and(|files| !files.is_empty()) && root.join("data/mono").is_dir(),
    open,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// A dataset whose annotations are in memory.
struct Reader {
    root: PathBuf,
    info: DatasetInfo,
    categories: Categories,
    refs: Vec<ImageRef>,
    images: Vec<Record>,
    scenes: BTreeMap<u32, Scene>,
    faults: Vec<DatasetFault>,
}

/// An image with its annotations, in the order of the file.
struct Record {
    image: Image,
    annotations: Vec<Annotation>,
}

/// Annotation files at the top of a dataset: `annotation_final.json`, else all other JSON files.
fn annotation_files(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let usual = root.join("annotation_final.json");
    if usual.is_file() {
        return Ok(vec![usual]);
    }
    let files = fs::read_dir(root)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    let mut files: Vec<PathBuf> =
        files.into_iter().filter(|path| path.is_file() && path.extension().is_some_and(|it| it == "json")).collect();
    files.sort();
    Ok(files)
}

fn open(root: &Path) -> Result<Box<dyn DatasetReader>> {
    let files = annotation_files(root).map_err(|error| Error::io(root, &error))?;
    let [file] = files.as_slice() else {
        let found = files.len();
        return Err(Error::new(format!(
            "an annotation file was expected at the top of the dataset, and there are {found}"
        ))
        .in_file(root)
        .help("leave one of them there, or name it annotation_final.json")
        .of_request());
    };
    let dataset = Dataset::read(file).map_err(|error| error.of_request())?;
    let scenes = dataset.scenes().map_err(|error| error.in_file(file))?;
    let mut faults = Faults::default();
    let categories = Categories::of(&dataset.categories);
    // In the form of the release, the n-th image is that of the n-th annotation.
    let repeats = dataset.images.len() == dataset.annotations.len()
        && dataset.images.iter().zip(&dataset.annotations).all(|(image, annotation)| image.id == annotation.image_id);
    let mut by_id: BTreeMap<u64, Record> = BTreeMap::new();
    for image in dataset.images {
        match by_id.get(&image.id) {
            Some(first) if first.image != image || !repeats => {
                faults.add("unique_ids", format!("image {}", image.id), "two images have this id");
            }
            Some(_) => {}
            None => drop(by_id.insert(image.id, Record { image, annotations: Vec::new() })),
        }
    }
    faults.of_annotations(&categories, dataset.annotations.iter().map(|it| (it.id, it.category_id)));
    for annotation in dataset.annotations {
        match by_id.get_mut(&annotation.image_id) {
            None => faults.unknown_image(annotation.id, annotation.image_id),
            Some(record) if annotation.category_id != BACKGROUND => record.annotations.push(annotation),
            Some(_) => {}
        }
    }
    let of = |record: &Record| {
        let Image { scene_id, view_id, .. } = record.image;
        scene_id.zip(view_id)
    };
    let (refs, images) =
        faults.in_order(by_id.into_values().collect(), |record: &Record| (&record.image.file_name, of(record)));
    let mut numbers = BTreeSet::new();
    for scene in scenes.iter().filter(|scene: &&Scene| !numbers.insert(scene.id)) {
        faults.add("unique_ids", format!("scene {}", scene.id), "two scenes have this id");
    }
    let recipe = fs::read_to_string(root.join(super::RECIPE)).unwrap_or_default();
    let info = categories.info(dataset.info.description, dataset.info.contributor, &refs, recipe);
    let scenes = scenes.into_iter().map(|scene| (scene.id, scene)).collect();
    let faults = faults.into_inner();
    Ok(Box::new(Reader { root: root.to_owned(), info, categories, refs, images, scenes, faults }))
}

impl DatasetReader for Reader {
    fn info(&self) -> &DatasetInfo {
        &self.info
    }

    fn images(&self) -> &[ImageRef] {
        &self.refs
    }

    fn faults(&self) -> &[DatasetFault] {
        &self.faults
    }

    fn offers(&self) -> Vec<KeyId> {
        let all = |has: &dyn Fn(&Record) -> bool| !self.images.is_empty() && self.images.iter().all(has);
        let mut keys = read::offers(true);
        keys.extend(syntable_model::keys![RGB, OBJECT_NAME, VISIBILITY]);
        let mut offer = |key: KeyId, has: fn(&Image) -> bool| keys.extend(all(&|it| has(&it.image)).then_some(key));
        offer(DEPTH.id(), |image| image.depth_file_name.is_some());
        offer(CAMERA.id(), |image| image.camera.is_some());
        offer(EXPOSURE.id(), |image| image.exposure.is_some());
        offer(DENOISER.id(), |image| image.denoiser.is_some());
        offer(LABEL_POLICY.id(), |image| image.label_policy.is_some());
        let described = |record: &Record| {
            record.annotations.iter().all(|it| it.object.as_ref().is_some_and(|object| !object.is_null()))
        };
        if all(&described) && self.images.iter().any(|record| !record.annotations.is_empty()) {
            keys.push(OBJECT_INFO.id());
        }
        if !self.refs.is_empty() && self.refs.iter().all(|image| self.scenes.contains_key(&image.scene.0)) {
            keys.push(BODIES.id());
        }
        keys
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let record = &self.images[image];
        let labels = record.annotations.iter().enumerate().map(|(row, it)| (it, self.labels(&record.image, row, it)));
        let read = labels.filter_map(|(annotation, labels)| Some((annotation, labels.ok()?)));
        read.flat_map(|(annotation, labels)| faults_of(annotation, &labels)).collect()
    }

    fn derived(&self) -> Vec<KeyId> {
        keys![VISIBILITY]
    }

    fn caveats(&self, reads: &[KeyId]) -> Vec<String> {
        let counts = "what of objects lies beyond the image is not known, and counts as nothing in `visibility`";
        reads.contains(&VISIBILITY.id()).then(|| counts.to_owned()).into_iter().collect()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<(View, Products)> {
        let (at, record) = (&self.refs[image], &self.images[image]);
        let mut products = Products::new();
        let labels = record.annotations.iter().enumerate().map(|(row, it)| self.labels(&record.image, row, it));
        let labels: Vec<Labels> = labels.collect::<Result<_>>()?;
        let wanted = |key: KeyId| wants.contains(&key);
        let order = wanted(OCCLUSION_ORDER.id()).then(|| self.order(&record.image, &labels)).transpose()?.flatten();
        read::put(&labels, order, wants, &mut products)?;
        if wanted(RGB.id()) {
            products.put(RGB, decode::rgb(&self.root.join(&record.image.file_name))?)?;
        }
        if let Some(path) = record.image.depth_file_name.as_ref().filter(|_| wanted(DEPTH.id())) {
            let unit_mm = f64::from(record.image.depth_unit_mm.unwrap_or(1));
            products.put(DEPTH, decode::depth(&self.root.join(path), unit_mm)?)?;
        }
        let Image { camera, exposure, denoiser, label_policy, .. } = &record.image;
        for (key, json) in [(CAMERA, camera), (EXPOSURE, exposure), (DENOISER, denoiser), (LABEL_POLICY, label_policy)]
        {
            if let Some(json) = json.as_ref().filter(|_| wanted(key.id())) {
                products.put(key, Value::of(json)?)?;
            }
        }
        if wanted(VISIBILITY.id()) {
            let counts =
                labels.iter().map(|labels| Ok((labels.id, counts(labels).record()?))).collect::<Result<_>>()?;
            products.put(VISIBILITY, counts)?;
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
        if let Some(scene) = self.scenes.get(&at.scene.0).filter(|_| wanted(BODIES.id())) {
            products.put(BODIES, Value::of(&scene.bodies)?)?;
        }
        Ok((read::view(at.view, record.image.width, record.image.height), products))
    }
}

/// What an annotation of our form says of its masks in numbers. The form of the release has other areas.
fn faults_of(annotation: &Annotation, labels: &Labels) -> Vec<(&'static str, String)> {
    let Some(amodal) = labels.amodal.as_ref().filter(|_| annotation.amodal_bbox.is_some()) else { return Vec::new() };
    let (visible, occluded) = (&labels.visible, labels.occlusion.as_ref());
    let areas = [
        ("area", Some(annotation.area), Some(amodal)),
        ("visible_area", annotation.visible_area, Some(visible)),
        ("occluded_area", annotation.occluded_area, occluded),
    ];
    let mut faults = Vec::new();
    for (name, said, mask) in areas {
        if let (Some(said), Some(mask)) = (said, mask)
            && said != u64::from(mask.area())
        {
            let message =
                format!("annotation {}: `{name}` is {said}, its mask has {} pixels", annotation.id, mask.area());
            faults.push(("areas_are_those_of_masks", message));
        }
    }
    let boxes = [visible.bbox(), amodal.bbox()].map(<[i32; 4]>::from);
    if !boxes.contains(&annotation.bbox) {
        let message =
            format!("annotation {}: `bbox` is {:?}, its masks have {boxes:?}", annotation.id, annotation.bbox);
        faults.push(("bbox_is_that_of_a_mask", message));
    }
    faults
}

/// What masks say of the silhouette: of its parts beyond the image the layout knows nothing.
fn counts(labels: &Labels) -> PixelCounts {
    let (visible, amodal) = (&labels.visible, labels.amodal.as_ref().unwrap_or(&labels.visible));
    let area = u64::from(amodal.area());
    PixelCounts {
        all: area,
        in_frame: area,
        valid: area,
        visible: visible.area().into(),
        silhouette: amodal.bbox().into(),
    }
}

impl Reader {
    fn labels(&self, image: &Image, row: usize, annotation: &Annotation) -> Result<Labels> {
        let mask = |rle: &Rle, name: &str| -> Result<Mask> {
            let of = || format!("annotation {}: `{name}`", annotation.id);
            let mask = rle.decode().map_err(|error| error.context(of()).permanent())?;
            if (mask.width(), mask.height()) == (image.width, image.height) {
                return Ok(mask);
            }
            let [found, expected] = [(mask.width(), mask.height()), (image.width, image.height)];
            Err(Error::new(format!("it has the size {found:?}, its image {expected:?}")).context(of()).permanent())
        };
        let visible = mask(&annotation.visible_mask, "visible_mask")?;
        // The form of the release has no other box than the visible one.
        let visible_box = annotation.visible_bbox.or(Some(annotation.bbox)).filter(|_| !visible.is_empty());
        Ok(Labels {
            id: annotation.instance_id.map_or(InstanceId(row as u16 + 1), InstanceId),
            visible,
            amodal: Some(mask(&annotation.segmentation, "segmentation")?),
            occlusion: Some(mask(&annotation.occluded_mask, "occluded_mask")?),
            rate: Some(annotation.occluded_rate),
            visible_box: visible_box.map(BBox::from),
            amodal_box: annotation.amodal_bbox.map(BBox::from),
            category: self.categories.id(annotation.category_id),
        })
    }

    /// The order that the dataset has, whose n-th row is that of the n-th annotation; none if it has none.
    fn order(&self, image: &Image, labels: &[Labels]) -> Result<Option<OcclusionOrder>> {
        let Some(path) = &image.occlusion_order_file_name else { return Ok(None) };
        let path = self.root.join(path);
        let (edge, entries) = decode::square_npy(&path)?;
        if edge != labels.len() {
            return Err(Error::new(format!("it is of {edge} objects, the image has {} annotations", labels.len()))
                .in_file(&path)
                .permanent());
        }
        // Rows of an order are in the order of ids.
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
