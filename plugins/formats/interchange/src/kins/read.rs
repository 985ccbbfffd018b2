//! Reads KINS' layout, in its form of 2019 or of 2020.

use super::check::faults_of_image;
use super::labels::labels_of;
use super::record::KinsAnnotation;
use crate::family::find::Structure;
use crate::family::read::{Annotated, AnnotationFile, not_objects};
use crate::read::{POLYGONS, cut_holes, settle_edges};
use std::path::Path;
use syntable_formats::read;
use syntable_model::prelude::*;
use syntable_model::product::standard::OCCLUSION_MASK;
use syntable_model::reader::{Crowd, DatasetFault, Format, Note, Opened, Source};

syntable_model::register_format!(Format::new(
    "kins",
    "KINS (`instances_*.json` or `update_*_2020.json` beside the images, or beside KITTI's `training` and `testing`), as \
          the writer `kins` writes it.",
    |path| Structure::Kins.is_at(path),
    open,
).with_image_folder());

/// Folders of images: ours, then KITTI's, which contain other images with the same names.
const IMAGES: [&str; 4] = ["images", "training/image_2", "testing/image_2", "."];

/// The folders in which the images of a file may be, the folder of its split first: the test split of KINS uses KITTI's
/// testing images.
fn image_folders(file: &Path) -> [&'static str; 4] {
    let [own, training, testing, here] = IMAGES;
    let is_of_testing = |stem: &str| ["test", "val"].iter().any(|split| stem.contains(split));
    match file.file_stem().is_some_and(|stem| is_of_testing(&stem.to_string_lossy())) {
        true => [own, testing, training, here],
        false => IMAGES,
    }
}

/// The objects of a dataset.
struct KinsObjects {
    /// Whether any annotation describes a crowd.
    has_crowds: bool,
}

fn open(source: &Source) -> Result<Opened> {
    let (root, path) = Structure::Kins.find(source)?;
    let [mut crowds, mut all] = [0; 2];
    let mut file = AnnotationFile::open(
        source,
        &root,
        &path,
        &image_folders(&path),
        &[("annotations", &["num_keypoints"])],
        &mut |annotation: &KinsAnnotation, unkept| {
            crowds += usize::from(annotation.is_crowd());
            all += 1;
            unkept[0].add(&annotation.extra);
        },
    )?;
    let info = file.info(&file.listing.categories);
    let labels = read::KnownMasks::Both.offers();
    let offers = file.offers(labels.clone(), &[]);
    let mut notes = vec![Note::caveat(POLYGONS).of(labels)];
    notes.extend(file.supercategories().into_iter().chain(file.not_kept(&offers)));
    notes.push(not_objects(&offers, crowds, all, "annotations are crowds (`iscrowd`), and no objects"));
    let opened = file.opened(info, offers, notes, KinsObjects { has_crowds: crowds > 0 });
    Ok(Opened { derived: keys![OCCLUSION_MASK], ..opened })
}

impl Annotated for KinsObjects {
    type Records = Vec<KinsAnnotation>;

    fn records(&self, file: &AnnotationFile, image: usize) -> Result<Self::Records> {
        file.listing.annotations(image)
    }

    fn faults(&self, file: &AnnotationFile, image: usize, records: &Self::Records) -> Vec<DatasetFault> {
        faults_of_image(file, image, records)
    }

    fn crowds(&self, file: &AnnotationFile, image: usize) -> Result<Vec<Crowd>> {
        if !self.has_crowds {
            return Ok(Vec::new());
        }
        let annotations: Vec<KinsAnnotation> = file.listing.annotations(image)?;
        let of = |it: &KinsAnnotation| {
            let [amodal, visible] = it.said();
            let said = [visible, amodal].into_iter().find(|said| said.mask.1.is_some())?;
            let category = file.listing.categories.id(it.category_id);
            Some(it.mask(&said, file.size(image)).map(|mask| Crowd { mask, category }))
        };
        annotations.iter().filter(|it| it.is_crowd()).filter_map(of).collect()
    }

    fn put(
        &self,
        file: &AnnotationFile,
        image: usize,
        records: &Self::Records,
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()> {
        let annotations: Vec<&KinsAnnotation> = records.iter().filter(|it| !it.is_crowd()).collect();
        let labels = annotations
            .iter()
            .enumerate()
            .map(|(row, it)| labels_of(&file.listing.categories, file.size(image), row, it));
        let mut labels = labels.collect::<Result<Vec<_>>>()?;
        settle_edges(&mut labels);
        for (label, annotation) in labels.iter_mut().zip(annotations) {
            cut_holes(label, annotation.holes_px2(label));
        }
        read::put(&labels, None, wants, products)
    }
}
