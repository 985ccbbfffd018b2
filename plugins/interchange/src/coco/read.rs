//! Reads COCO's layout, and those of its relatives that keep amodal and visible masks in one annotation: ours, D2SA,
//! KINS.

use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::coco::{Annotation, Dataset, Image};
use syntable_formats::decode;
use syntable_formats::read::{self, Categories, Faults, Labels};
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::RGB;
use syntable_model::reader::{DatasetFault, DatasetReader, Format, ImageRef};

syntable_model::register_format!(Format {
    name: "coco",
    doc: "COCO instance annotations (`annotations/*.json` beside an image folder), with amodal masks where annotations have \
          both, as the writer `coco`, D2SA and KINS do.",
    detect: |root| annotation_files(root).is_ok_and(|files| !files.is_empty()),
    open,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Keys of visible masks beside an amodal `segmentation`; ours, D2SA's and COCOA's, then KINS'.
const VISIBLE: [&str; 2] = ["visible_mask", "inmodal_seg"];

struct Reader {
    /// The folder that image names count from.
    images_root: PathBuf,
    info: DatasetInfo,
    categories: Categories,
    refs: Vec<ImageRef>,
    images: Vec<(Image, Vec<Annotation>)>,
    is_amodal: bool,
    faults: Vec<DatasetFault>,
}

fn annotation_files(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(root.join("annotations"))?;
    let files = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    let is_json = |path: &PathBuf| path.is_file() && path.extension().is_some_and(|it| it == "json");
    let mut files: Vec<PathBuf> = files.into_iter().filter(is_json).collect();
    files.sort();
    Ok(files)
}

fn open(root: &Path) -> Result<Box<dyn DatasetReader>> {
    let files = annotation_files(root).map_err(|error| Error::io(root.join("annotations"), &error).of_request())?;
    let [file] = files.as_slice() else {
        return Err(Error::new(format!("one annotation file was expected, and there are {}", files.len()))
            .in_file(root.join("annotations"))
            .help("leave the one to read there")
            .of_request());
    };
    let dataset = Dataset::read(file).map_err(Error::of_request)?;
    let mut faults = Faults::default();
    let categories = Categories::of(&dataset.categories);
    let is_amodal = dataset.annotations.iter().any(|it| VISIBLE.iter().any(|key| it.extra.contains_key(*key)));
    let images_root = images_root(root, file, dataset.images.first());
    let mut by_id: BTreeMap<u64, (Image, Vec<Annotation>)> = BTreeMap::new();
    for image in dataset.images {
        let id = image.id;
        if by_id.insert(id, (image, Vec::new())).is_some() {
            faults.add("unique_ids", format!("image {id}"), "two images have this id");
        }
    }
    faults.of_annotations(&categories, dataset.annotations.iter().map(|it| (it.id, it.category_id)));
    for annotation in dataset.annotations {
        match by_id.get_mut(&annotation.image_id) {
            Some((_, annotations)) => annotations.push(annotation),
            None => faults.unknown_image(annotation.id, annotation.image_id),
        }
    }
    let (refs, images) = faults.in_order(by_id.into_values().collect(), |(image, _)| (&image.file_name, None));
    let info = categories.info(dataset.info.description, dataset.info.contributor, &refs, String::new());
    let faults = faults.into_inner();
    Ok(Box::new(Reader { images_root, info, categories, refs, images, is_amodal, faults }))
}

/// The folder beside `annotations` in which the first image is, as COCO, KINS and others call it.
fn images_root(root: &Path, file: &Path, first: Option<&Image>) -> PathBuf {
    let split = file.file_stem().and_then(|stem| stem.to_str()?.rsplit('_').next()).unwrap_or_default();
    let names = ["images", split, &format!("{split}2017"), &format!("{split}2014"), "."].map(|name| root.join(name));
    let has = |folder: &&PathBuf| first.is_some_and(|image| folder.join(&image.file_name).is_file());
    names.iter().find(has).unwrap_or(&names[0]).clone()
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
        let mut keys = read::offers(self.is_amodal);
        keys.push(RGB.id());
        keys
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let (record, annotations) = &self.images[image];
        annotations.iter().flat_map(|annotation| faults_of(record, annotation)).collect()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<(View, Products)> {
        let (record, annotations) = &self.images[image];
        let mut products = Products::new();
        let labels = annotations.iter().enumerate().map(|(row, it)| self.labels(record, row, it));
        read::put(&labels.collect::<Result<Vec<_>>>()?, None, wants, &mut products)?;
        if wants.contains(&RGB.id()) {
            products.put(RGB, decode::rgb(&self.images_root.join(&record.file_name))?)?;
        }
        Ok((read::view(self.refs[image].view, record.width, record.height), products))
    }
}

/// What an annotation says of its mask in numbers. Polygons have areas and boxes of their own.
fn faults_of(image: &Image, annotation: &Annotation) -> Vec<(&'static str, String)> {
    let Some(segmentation) = annotation.segmentation.as_ref().filter(|it| !matches!(it, Segmentation::Polygons(_)))
    else {
        return Vec::new();
    };
    let Ok(mask) = segmentation.decode(image.width, image.height) else { return Vec::new() };
    let mut faults = Vec::new();
    if (annotation.area - f64::from(mask.area())).abs() > 0.5 {
        let message =
            format!("annotation {}: `area` is {}, its mask has {}", annotation.id, annotation.area, mask.area());
        faults.push(("areas_are_those_of_masks", message));
    }
    let own = <[i32; 4]>::from(mask.bbox()).map(f64::from);
    let differs = |(said, own): (&f64, &f64)| (said - own).abs() > 1.0;
    if annotation.bbox.iter().zip(&own).any(differs) {
        let message =
            format!("annotation {}: `bbox` is {:?}, that of its mask {own:?}", annotation.id, annotation.bbox);
        faults.push(("bbox_is_that_of_a_mask", message));
    }
    faults
}

impl Reader {
    fn labels(&self, image: &Image, row: usize, annotation: &Annotation) -> Result<Labels> {
        let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
        let decoded = |segmentation: &Segmentation, key: &str| {
            segmentation.decode(image.width, image.height).map_err(|error| error.context(of(key)).permanent())
        };
        let extra = |key: &str| -> Result<Option<Mask>> {
            let Some(json) = annotation.extra.get(key).filter(|json| !json.is_null()) else { return Ok(None) };
            let segmentation: Segmentation = serde_json::from_value(json.clone())
                .map_err(|error| Error::new(error.to_string()).context(of(key)).permanent())?;
            decoded(&segmentation, key).map(Some)
        };
        let missing = || Error::new("it is missing").context(of("segmentation")).permanent();
        let own = decoded(annotation.segmentation.as_ref().ok_or_else(missing)?, "segmentation")?;
        let visible = match extra(VISIBLE[0])? {
            None => extra(VISIBLE[1])?,
            some => some,
        };
        // Where the masks of others are amodal, an object without a visible one is not occluded.
        let amodal = if self.is_amodal { Some(extra("amodal_mask")?.unwrap_or_else(|| own.clone())) } else { None };
        let visible = visible.unwrap_or(own);
        let bbox = |key| Ok(field::<[i32; 4]>(annotation, key)?.map(BBox::from));
        Ok(Labels {
            id: InstanceId(field(annotation, "instance_id")?.unwrap_or(row as u16 + 1)),
            visible,
            amodal,
            occlusion: extra("occluded_mask")?,
            rate: field(annotation, "occluded_rate")?,
            visible_box: bbox("visible_bbox")?,
            amodal_box: bbox("amodal_bbox")?,
            category: self.categories.id(annotation.category_id),
        })
    }
}

/// A field that annotations of some formats have.
fn field<T: DeserializeOwned>(annotation: &Annotation, key: &str) -> Result<Option<T>> {
    let Some(json) = annotation.extra.get(key).filter(|json| !json.is_null()) else { return Ok(None) };
    serde_json::from_value(json.clone()).map(Some).map_err(|error| {
        Error::new(error.to_string()).context(format!("annotation {}: `{key}`", annotation.id)).permanent()
    })
}
