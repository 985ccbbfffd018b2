//! Reads COCO's layout, and related layouts with amodal and visible masks in one annotation: SynTable's, D2SA's and
//! UOAIS-Sim's.

use super::record::{AmodalAnnotation, FOLLOWING, NamedField};
use crate::family::find::Structure;
use crate::family::read::{Annotated, AnnotationFile, image_folders, not_objects};
use crate::read::{self as shared, edge_px2, pixels_around};
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::listing::AnnotationListing;
use syntable_formats::read::{self, KnownMasks, ObjectLabels};
use syntable_formats::segmentation::Segmentation;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{BOX, CATEGORY_ID, DEPTH, LABEL_POLICY, OCCLUSION_MASK, VISIBLE_BOX};
use syntable_model::reader::{Crowd, DatasetFault, FaultSubject, Format, Note, Opened, Source};
use syntable_model::rule;

syntable_model::register_format!(Format::new(
    "coco",
    "COCO instance annotations (`annotations/*.json` beside an image folder), with amodal masks where annotations have \
          both, as the writer `coco` does, and with depth where images name a file of it, as UOAIS-Sim's do.",
    |path| Structure::Instances.is_at(path),
    |source| {
        let (root, file) = Structure::Instances.find(source)?;
        open_file(source, &root, &file, false)
    },
).with_image_folder());

/// Maximum number of objects whose masks are decoded to find out whether they are visible or amodal.
const LOOKED_AT: usize = 64;
/// Least fraction of occluded objects in a dataset with visible masks.
const OCCLUDED: f64 = 0.05;

/// The kinds of labels that a file has.
pub struct CocoObjects {
    /// Whether this program wrote the dataset.
    pub is_ours: bool,
    /// Whether the file has D2SA's name.
    pub is_d2sa: bool,
    /// Whether any annotation has a mask, or the file has no objects. Otherwise, all annotations have boxes only.
    pub has_masks: bool,
    pub known: KnownMasks,
    /// Whether any annotation has a visible mask next to its `segmentation`.
    pub has_visible: bool,
    /// Whether any annotation has an occlusion mask. Otherwise, occlusion masks are computed from the other masks.
    pub has_hidden: bool,
    /// Whether any annotation describes a crowd.
    has_crowds: bool,
}

/// Opens the dataset of an annotation file, of COCO or of D2SA.
pub fn open_file(source: &Source, root: &DatasetFolder, path: &Path, is_d2sa: bool) -> Result<Opened> {
    let (mut has_masks, mut crowds) = (false, 0);
    let (mut has_visible, mut has_amodal, mut has_hidden, mut pairs) = (false, false, false, MaskPairs::default());
    let (mut objects, mut without_mask, mut without_place) = (0, 0, 0);
    let mut file = AnnotationFile::open(
        source,
        root,
        path,
        &image_folders(path),
        &[("annotations", FOLLOWING)],
        &mut |annotation: &AmodalAnnotation, unkept| {
            let fields = &annotation.extra;
            unkept[0].add(&fields.extra);
            has_masks |= segmentation(annotation).is_some();
            has_visible |= is_there(&fields.visible());
            has_amodal |= !fields.amodal_mask.is_missing();
            has_hidden |= is_there(&fields.hidden());
            pairs.add(annotation);
            if is_crowd(annotation) {
                crowds += 1;
            } else if !has_place(annotation) {
                without_place += 1;
            } else {
                objects += 1;
                without_mask += usize::from(segmentation(annotation).is_none());
            }
        },
    )?;
    file.categories()?;
    let info = file.info(&file.listing.categories);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let says_amodal = file.listing.file.info.extra.get("masks") == Some(&"amodal".into());
    let is_amodal = has_amodal || name.to_lowercase().contains("amodal") || says_amodal;
    let known = match (has_visible || objects == 0, is_amodal) {
        // Without objects, all masks are known.
        (true, _) => KnownMasks::Both,
        // If the amodal masks differ from `segmentation`, then `segmentation` is the visible mask.
        (false, true) if !says_amodal && pairs.show_what_is_seen(&file.listing) => KnownMasks::Both,
        // D2SA omits the visible mask of an object that is not occluded.
        (false, true) if is_d2sa => KnownMasks::Both,
        (false, true) => KnownMasks::Amodal,
        (false, false) => KnownMasks::Visible,
    };
    has_masks |= objects == 0;
    let mut labels = if has_masks { known.offers() } else { keys![VISIBLE_BOX, CATEGORY_ID] };
    labels.extend((without_mask > 0).then(|| BOX.id()));
    let offers = file.offers(labels, &[DEPTH.id(), LABEL_POLICY.id()]);
    let caveats = [
        (crowds > 0, format!("annotations of crowds (`iscrowd`) are no objects: {crowds} were left out")),
        (!has_masks, "no annotation has a mask: boxes and categories are all that is known of objects".to_owned()),
        (
            has_masks && without_mask > 0,
            format!("annotations with an empty `segmentation`, or without one, have boxes alone: {without_mask}"),
        ),
        (
            !file.listing.has_annotations(),
            "the annotation file has no annotations of objects: images are without objects".to_owned(),
        ),
    ];
    let mut notes: Vec<Note> = caveats.into_iter().filter(|it| it.0).map(|it| Note::caveat(it.1)).collect();
    notes.extend(file.supercategories().into_iter().chain(file.not_kept(&offers)));
    let what = "annotations are crowds (`iscrowd`), and no objects";
    notes.push(not_objects(&offers, crowds, crowds + objects, what));
    if has_masks {
        let what = "objects have a box and no mask (`segmentation` is missing or empty)";
        notes.push(not_objects(&offers, without_mask, objects, what).unless(BOX.id()));
    }
    let what = "annotations have neither `segmentation` nor `bbox`, and are no objects";
    notes.push(not_objects(&offers, without_place, objects + without_place, what));
    let mut derived = if has_hidden { Vec::new() } else { keys![OCCLUSION_MASK] };
    derived.extend((!has_masks).then(|| VISIBLE_BOX.id()));
    let (is_ours, has_crowds) = (file.is_ours(), crowds > 0);
    let of = CocoObjects { is_ours, is_d2sa, has_masks, known, has_visible, has_hidden, has_crowds };
    let lists_all_images = !shared::name_starts(path, crate::uoais::FILE);
    // Annotators outline objects one by one, and their masks may overlap.
    let waived = if is_ours || known != KnownMasks::Visible { Vec::new() } else { vec![rule::VISIBLE_MASKS_DISJOINT] };
    Ok(Opened { derived, waived, lists_all_images, ..file.opened(info, offers, notes, of) })
}

/// Objects with both `segmentation` and an amodal mask. They reveal whether `segmentation` is visible or amodal.
#[derive(Default)]
struct MaskPairs {
    /// Number of such objects.
    all: usize,
    /// Number of such objects whose two records differ. The records may still encode the same mask.
    unlike: usize,
    /// The first annotations whose records differ.
    first: Vec<AmodalAnnotation>,
}

impl MaskPairs {
    fn add(&mut self, annotation: &AmodalAnnotation) {
        let amodal = annotation.extra.amodal_mask.value().filter(|_| !is_crowd(annotation));
        let Some((amodal, own)) = amodal.zip(segmentation(annotation)) else { return };
        self.all += 1;
        if own != amodal {
            self.unlike += 1;
            if self.first.len() < LOOKED_AT {
                self.first.push(annotation.clone());
            }
        }
    }

    /// Whether `segmentation` is the visible mask: it lies within the amodal mask, and in a sufficient fraction of all
    /// objects it lacks pixels of the amodal mask. A single such object may be a fault.
    fn show_what_is_seen(&self, listing: &AnnotationListing) -> bool {
        let lacks = |annotation: &&AmodalAnnotation| -> Option<()> {
            let frame = &listing.images.iter().find(|image| image.frame.id == annotation.image_id)?.frame;
            let of = |it: &Segmentation| it.decode(frame.width, frame.height).ok();
            let records = (segmentation(annotation)?, annotation.extra.amodal_mask.value()?);
            let (own, amodal) = (of(records.0)?, of(records.1)?);
            let are_outlines = [records.0, records.1].iter().any(|it| matches!(it, Segmentation::Polygons(_)));
            let edge = if are_outlines { edge_px2(&amodal) } else { 0.0 };
            let [more, less] = [own.minus(&amodal), amodal.minus(&own)].map(|it| f64::from(it.area()));
            (more <= edge && less > edge).then_some(())
        };
        let lacking = self.first.iter().filter(|it| lacks(it).is_some()).count();
        let of_all = (lacking * self.unlike) as f64 / (self.first.len() * self.all).max(1) as f64;
        lacking > 0 && of_all >= OCCLUDED
    }
}

/// The mask of an annotation; none for an empty list of polygons, which files with boxes only contain.
pub fn segmentation(annotation: &AmodalAnnotation) -> Option<&Segmentation> {
    annotation.segmentation.as_ref().filter(|it| !matches!(it, Segmentation::Polygons(all) if all.is_empty()))
}

/// Whether an annotation describes many objects together.
fn is_crowd(annotation: &AmodalAnnotation) -> bool {
    annotation.iscrowd != 0
}

/// Whether an annotation states where its object is.
fn has_place(annotation: &AmodalAnnotation) -> bool {
    annotation.bbox.is_some() || segmentation(annotation).is_some()
}

/// Whether any of these fields exists.
pub fn is_there<T>(fields: &[NamedField<T>]) -> bool {
    fields.iter().any(|(_, field)| !field.is_missing())
}

impl Annotated for CocoObjects {
    /// Annotations of single objects.
    type Records = Vec<AmodalAnnotation>;

    fn records(&self, file: &AnnotationFile, image: usize) -> Result<Self::Records> {
        objects(&file.listing, image)
    }

    fn crowds(&self, file: &AnnotationFile, image: usize) -> Result<Vec<Crowd>> {
        if !self.has_crowds {
            return Ok(Vec::new());
        }
        let [width, height] = file.size(image);
        let annotations: Vec<AmodalAnnotation> = file.listing.annotations(image)?;
        let of = |it: &AmodalAnnotation| {
            let mask = segmentation(it)?.decode(width, height);
            let crowd = mask.map(|mask| Crowd { mask, category: file.listing.categories.id(it.category_id) });
            Some(crowd.map_err(|error| error.context(format!("annotation {}: `segmentation`", it.id))))
        };
        annotations.iter().filter(|it| is_crowd(it)).filter_map(of).collect()
    }

    fn subjects(&self, file: &AnnotationFile, image: usize) -> BTreeMap<InstanceId, FaultSubject> {
        let annotations = objects(&file.listing, image).unwrap_or_default();
        let stated = stated_ids(&annotations);
        let ids = read::ids_of(&stated).unwrap_or_default();
        let unstated = ids.into_iter().zip(stated).zip(&annotations).filter(|((_, stated), _)| stated.is_none());
        unstated.map(|((id, _), annotation)| (id, FaultSubject::Annotation(annotation.id))).collect()
    }

    fn faults(&self, file: &AnnotationFile, image: usize, records: &Self::Records) -> Vec<DatasetFault> {
        self.faults_of_image(&file.listing, image, records)
    }

    fn put(
        &self,
        file: &AnnotationFile,
        image: usize,
        records: &Self::Records,
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()> {
        let (listing, size) = (&file.listing, file.size(image));
        let ids = read::ids_of(&stated_ids(records))?;
        let named = || ids.iter().copied().zip(records);
        let boxes = || named().filter(|(_, it)| segmentation(it).is_none()).filter_map(|(id, it)| Some((id, it.bbox?)));
        if wants.contains(&BOX.id()) {
            let boxes = boxes().map(|(id, bbox)| Ok((id, Value::of(&bbox)?)));
            products.put(BOX, boxes.collect::<Result<_>>()?)?;
        }
        if self.has_masks {
            let labels = named().map(|(id, it)| self.labels(listing, size, id, it));
            return read::put(&labels.collect::<Result<Vec<_>>>()?, None, wants, products);
        }
        if wants.contains(&VISIBLE_BOX.id()) {
            products.put(VISIBLE_BOX, boxes().map(|(id, bbox)| (id, pixels_around(bbox))).collect())?;
        }
        if wants.contains(&CATEGORY_ID.id()) {
            let category = |it: &AmodalAnnotation| listing.categories.id(it.category_id);
            products.put(CATEGORY_ID, named().map(|(id, it)| (id, category(it))).collect())?;
        }
        Ok(())
    }
}

/// Annotations of single objects.
fn objects(listing: &AnnotationListing, image: usize) -> Result<Vec<AmodalAnnotation>> {
    let mut annotations: Vec<AmodalAnnotation> = listing.annotations(image)?;
    annotations.retain(|annotation| !is_crowd(annotation) && has_place(annotation));
    Ok(annotations)
}

/// The object ids that annotations state.
pub fn stated_ids(annotations: &[AmodalAnnotation]) -> Vec<Option<u64>> {
    annotations.iter().map(|annotation| annotation.extra.instance_id.value().copied()).collect()
}

impl CocoObjects {
    /// The labels of an object.
    pub fn labels(
        &self,
        listing: &AnnotationListing,
        [width, height]: [u32; 2],
        id: InstanceId,
        annotation: &AmodalAnnotation,
    ) -> Result<ObjectLabels> {
        let fields = &annotation.extra;
        let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
        let decoded = |segmentation: &Segmentation, key: &str| {
            segmentation.decode(width, height).map_err(|error| error.context(of(key)))
        };
        let either = |named: [NamedField<Segmentation>; 2]| {
            let found = first(annotation, &named)?;
            found.map(|(key, segmentation)| decoded(segmentation, key)).transpose()
        };
        let record = segmentation(annotation);
        let own = match record {
            Some(own) => decoded(own, "segmentation")?,
            None => Mask::empty(width, height),
        };
        // In a file with amodal masks, an object without a visible mask is not occluded.
        let amodal = match (self.known, first(annotation, &[fields.amodal()])) {
            (KnownMasks::Visible, _) => None,
            (_, found) => Some(match found? {
                // Equal records have equal masks.
                Some((key, it)) if record != Some(it) => decoded(it, key)?,
                _ => own.clone(),
            }),
        };
        let visible = either(fields.visible())?.unwrap_or(own);
        let bbox = |named: NamedField<[i32; 4]>| Ok(first(annotation, &[named])?.map(|(_, bbox)| BBox::from(*bbox)));
        let is_amodal = self.known == KnownMasks::Both;
        Ok(ObjectLabels {
            id,
            visible,
            amodal,
            occlusion: either(fields.hidden())?.filter(|_| is_amodal),
            rate: first(annotation, &fields.rate())?.map(|(_, rate)| *rate).filter(|_| is_amodal),
            visible_box: bbox(("visible_bbox", &fields.visible_bbox))?,
            amodal_box: bbox(("amodal_bbox", &fields.amodal_bbox))?.filter(|_| self.known != KnownMasks::Visible),
            category: listing.categories.id(annotation.category_id),
        })
    }
}

/// The first of some fields that exists, with its name.
fn first<'a, T>(annotation: &AmodalAnnotation, fields: &[NamedField<'a, T>]) -> Result<Option<(&'static str, &'a T)>> {
    for (key, field) in fields {
        let wrong = |reason| Error::new(reason).context(format!("annotation {}: `{key}`", annotation.id));
        if let Some(value) = field.get().map_err(wrong)? {
            return Ok(Some((key, value)));
        }
    }
    Ok(None)
}
