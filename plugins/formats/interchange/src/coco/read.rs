//! Reads COCO's layout, and those of its relatives that keep amodal and visible masks in one annotation: ours, D2SA,
//! KINS.

use crate::order::Order;
use crate::read::{self as shared, Tolerance, edge_px2, fits_mask, fits_outlines, hidden_of};
use serde::de::{DeserializeOwned, IgnoredAny};
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::coco::{Annotation, Image};
use syntable_formats::decode;
use syntable_formats::index::Record;
use syntable_formats::listing::Listing;
use syntable_formats::read::{self, Known, Labels};
use syntable_formats::segmentation::Segmentation;
use syntable_formats::unkept::Unkept;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{CATEGORY_ID, DEPTH, LABEL_POLICY, OCCLUSION_MASK, RGB, VISIBLE_BOX};
use syntable_model::reader::{Crowd, Format, ImageSource, Note, Opened, ReadImage};

syntable_model::register_format!(Format {
    name: "coco",
    doc: "COCO instance annotations (`annotations/*.json` beside an image folder), with amodal masks where annotations have \
          both, as the writer `coco` does, and with depth where images name a file of it, as UOAIS-Sim's do.",
    detect: |path| {
        let is_other = |file: &Path| OTHERS.iter().any(|start| shared::name_starts(file, start));
        let is = |is_one: &dyn Fn(&Path) -> bool| shared::is_dataset(path, Some(FOLDER), is_one);
        is(&has_instances) && !is(&is_other)
    },
    open: |source| {
        let (root, file) = shared::root_and_file(source, Some(FOLDER), has_instances)?;
        open_file(&root, &file)
    },
    is_generic: false,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Whether a file may have instances: not if it has orders or segments of those in a file beside it.
fn has_instances(file: &Path) -> bool {
    ![crate::insta_order::FILE, crate::coco_panoptic::FILE].iter().any(|start| shared::name_starts(file, start))
}

/// Folder of the annotation file.
pub(crate) const FOLDER: &str = "annotations";

/// How annotation files of formats begin that have readers of their own.
const OTHERS: [&str; 2] = [crate::d2sa::FILE, crate::cocoa::FILE];

/// Keys of visible masks beside an amodal `segmentation`; ours, D2SA's and COCOA's, then KINS'.
const VISIBLE: [&str; 2] = ["visible_mask", "inmodal_seg"];
/// Key of amodal masks beside a `segmentation` that may be visible: ours.
const AMODAL: &str = "amodal_mask";
/// Keys of occlusion masks: ours, then D2SA's.
const HIDDEN: [&str; 2] = ["occluded_mask", "invisible_mask"];
/// Keys of occlusion rates: ours, then D2SA's.
const RATE: [&str; 2] = ["occluded_rate", "occlude_rate"];
/// Key of the depth image of an image, in whole millimeters, beside its `file_name`: UOAIS-Sim's.
const DEPTH_FILE: &str = "depth_file_name";
/// Millimeters per step of such a depth image.
const DEPTH_UNIT_MM: f64 = 1.0;

/// Maximum number of objects whose masks are decoded to find out what those are of.
const LOOKED_AT: usize = 64;
/// Least fraction of objects that are occluded in a dataset of what is seen.
const OCCLUDED: f64 = 0.05;

/// Fields of annotations that are read, or that follow from masks. D2SA's `amodal_base` repeats the record of the image.
const OF_ANNOTATIONS: &[&str] = &[
    VISIBLE[0],
    VISIBLE[1],
    AMODAL,
    HIDDEN[0],
    HIDDEN[1],
    RATE[0],
    RATE[1],
    "instance_id",
    "visible_bbox",
    "amodal_bbox",
    "inmodal_bbox",
    "amodal_region",
    "amodal_base",
    "occl_depth",
    // Goes with `keypoints`.
    "num_keypoints",
];

struct Reader {
    /// The folder that image names count from.
    images_root: DatasetFolder,
    /// Whether this program wrote the dataset.
    is_ours: bool,
    listing: Listing,
    /// Whether any annotation has a mask, or there are no objects; else all have boxes alone.
    has_masks: bool,
    known: Known,
    /// Whether any annotation has a visible mask beside its `segmentation`.
    has_visible: bool,
    /// Whether any annotation has an occlusion mask; else these follow from the others.
    has_hidden: bool,
    /// Whether every image has a depth image.
    has_depth: bool,
    /// Whether every image says the policy of its labels.
    has_policy: bool,
    /// Whether any annotation is of a crowd.
    has_crowds: bool,
}

/// Opens the dataset of an annotation file.
pub(crate) fn open_file(root: &DatasetFolder, file: &Path) -> Result<Opened> {
    let (mut has_masks, mut has_depth, mut has_policy, mut crowds) = (false, true, true, 0);
    let (mut has_visible, mut has_amodal, mut has_hidden, mut pairs) = (false, false, false, Pairs::default());
    let (mut objects, mut without_mask) = (0_u64, 0_u64);
    let mut unkept = [Unkept::new("images", shared::OF_IMAGES), Unkept::new("annotations", OF_ANNOTATIONS)];
    let listing = Listing::open(file, &mut |record: &Record<Image, Annotation, IgnoredAny>| match record {
        Record::Annotation(annotation) => {
            unkept[1].add(&annotation.extra);
            has_masks |= segmentation(annotation).is_some();
            let says = |key: &str| annotation.extra.get(key).is_some_and(|it| !it.is_null());
            has_visible |= VISIBLE.iter().any(|key| says(key));
            has_amodal |= says(AMODAL);
            has_hidden |= HIDDEN.iter().any(|key| says(key));
            pairs.add(annotation);
            crowds += u64::from(is_crowd(annotation));
            objects += u64::from(!is_crowd(annotation));
            without_mask += u64::from(!is_crowd(annotation) && segmentation(annotation).is_none());
        }
        Record::Image(image) => {
            shared::count_unkept(&mut unkept[0], image);
            has_depth &= depth_file(image).is_some();
            has_policy &= shared::policy(image).is_some();
        }
        Record::Scene(_) => {}
    })?;
    if listing.file.categories.is_none() {
        return Err(Error::new("missing field `categories`").in_file(file));
    }
    let images_root = images_root(root, file, listing.images.first().map(|image| image.frame.file_name.as_str()));
    let info = shared::info(&listing);
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let says_amodal = listing.file.info.extra.get("masks") == Some(&"amodal".into());
    let is_amodal = has_amodal || name.to_lowercase().contains("amodal") || says_amodal;
    let known = match (has_visible || objects == 0, is_amodal) {
        // Without objects, nothing is unknown of them.
        (true, _) => Known::Both,
        // Beside amodal masks that are others, COCO's own are the visible ones.
        (false, true) if !says_amodal && pairs.show_what_is_seen(&listing) => Known::Both,
        // Files of these leave out the visible mask of what is not occluded.
        (false, true) if shared::name_starts(file, crate::d2sa::FILE) => Known::Both,
        (false, true) => Known::Amodal,
        (false, false) => Known::Visible,
    };
    let lists_all = !shared::name_starts(file, crate::uoais::FILE);
    let [has_depth, has_policy] = [has_depth, has_policy].map(|has| has && !listing.images.is_empty());
    has_masks |= objects == 0;
    let mut offers = if has_masks { known.offers() } else { keys![VISIBLE_BOX, CATEGORY_ID] };
    offers.push(RGB.id());
    offers.extend(
        [(has_depth, DEPTH.id()), (has_policy, LABEL_POLICY.id())].into_iter().filter(|it| it.0).map(|it| it.1),
    );
    let caveats = [
        (crowds > 0, format!("annotations of crowds (`iscrowd`) are no objects: {crowds} were left out")),
        (!has_masks, "no annotation has a mask: boxes and categories are all that is known of objects".to_owned()),
        (
            has_masks && without_mask > 0,
            format!(
                "annotations with an empty `segmentation`, or without one, are objects without pixels: there are {without_mask}"
            ),
        ),
        (
            !listing.has_annotations(),
            "the annotation file has no annotations of objects: images are without objects".to_owned(),
        ),
    ];
    let mut notes: Vec<Note> = caveats.into_iter().filter(|it| it.0).map(|it| Note::caveat(it.1)).collect();
    notes.extend(shared::supercategories(&listing).into_iter().chain(shared::information(&listing, &unkept)));
    notes.extend(shared::labels_not_kept(&offers, &unkept));
    let labels = read::labels_among(&offers);
    let not_objects = |count: u64, of: u64, what: &'static str| {
        Note::not_objects(LeftOut::new(count as usize, of as usize, what)).of(labels.clone())
    };
    notes.push(not_objects(crowds, crowds + objects, "annotations are crowds (`iscrowd`), and no objects"));
    if has_masks {
        let what = "objects have no mask (`segmentation` is missing or empty): they are objects without pixels";
        notes.push(not_objects(without_mask, objects, what));
    }
    let is_ours = shared::is_ours(&info);
    let derived = if has_hidden { Vec::new() } else { keys![OCCLUSION_MASK] };
    let opened = listing.opened(info, offers, |listing| Reader {
        images_root,
        is_ours,
        listing,
        has_masks,
        known,
        has_depth,
        has_policy,
        has_crowds: crowds > 0,
        has_visible,
        has_hidden,
    });
    notes.splice(0..0, opened.notes);
    Ok(Opened { derived, lists_all_images: lists_all, notes, ..opened })
}

/// Path of the depth image of an image.
fn depth_file(image: &Image) -> Option<&str> {
    image.extra.get(DEPTH_FILE)?.as_str()
}

/// Objects with a mask of their own and an amodal one, which tell what the first one is of.
#[derive(Default)]
struct Pairs {
    /// How many there are.
    all: usize,
    /// How many of them have different records of masks, which may be the same mask in two encodings.
    unlike: usize,
    /// The first ones of these.
    first: Vec<Annotation>,
}

impl Pairs {
    fn add(&mut self, annotation: &Annotation) {
        let amodal = field::<Segmentation>(annotation, AMODAL).ok().flatten().filter(|_| !is_crowd(annotation));
        let Some((amodal, own)) = amodal.zip(segmentation(annotation)) else { return };
        self.all += 1;
        if *own != amodal {
            self.unlike += 1;
            if self.first.len() < LOOKED_AT {
                self.first.push(annotation.clone());
            }
        }
    }

    /// Whether the masks of their own are of what is seen: they are parts of the amodal ones, and a fraction of all lacks some of
    /// these. One object alone may be a fault.
    fn show_what_is_seen(&self, listing: &Listing) -> bool {
        let lacks = |annotation: &&Annotation| -> Option<()> {
            let frame = &listing.images.iter().find(|image| image.frame.id == annotation.image_id)?.frame;
            let of = |it: &Segmentation| it.decode(frame.width, frame.height).ok();
            let records = (segmentation(annotation)?, field::<Segmentation>(annotation, AMODAL).ok()??);
            let (own, amodal) = (of(records.0)?, of(&records.1)?);
            let are_outlines = [records.0, &records.1].iter().any(|it| matches!(it, Segmentation::Polygons(_)));
            let edge = if are_outlines { edge_px2(&amodal) } else { 0.0 };
            let [more, less] = [own.minus(&amodal), amodal.minus(&own)].map(|it| f64::from(it.area()));
            (more <= edge && less > edge).then_some(())
        };
        let lacking = self.first.iter().filter(|it| lacks(it).is_some()).count();
        let of_all = (lacking * self.unlike) as f64 / (self.first.len() * self.all).max(1) as f64;
        lacking > 0 && of_all >= OCCLUDED
    }
}

/// The mask of an annotation. An empty list of polygons is none: files of boxes have it.
fn segmentation(annotation: &Annotation) -> Option<&Segmentation> {
    annotation.segmentation.as_ref().filter(|it| !matches!(it, Segmentation::Polygons(all) if all.is_empty()))
}

/// Whether an annotation is of many objects together.
fn is_crowd(annotation: &Annotation) -> bool {
    annotation.iscrowd != 0
}

/// The folder beside `annotations` in which the first image is, as COCO, KINS and others call it.
pub(crate) fn images_root(root: &DatasetFolder, file: &Path, first: Option<&str>) -> DatasetFolder {
    let split = file.file_stem().and_then(|stem| stem.to_str()?.rsplit('_').next()).unwrap_or_default();
    let names = ["images", split, &format!("{split}2017"), &format!("{split}2014"), "."];
    shared::images_root(root, &names, first)
}

impl ImageSource for Reader {
    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        if !self.has_crowds {
            return Ok(Vec::new());
        }
        let frame = &self.listing.images[image].frame;
        let annotations: Vec<Annotation> = self.listing.annotations(image)?;
        let of = |it: &Annotation| {
            let mask = segmentation(it)?.decode(frame.width, frame.height);
            let crowd = mask.map(|mask| Crowd { mask, category: self.listing.categories.id(it.category_id) });
            Some(crowd.map_err(|error| error.context(format!("annotation {}: `segmentation`", it.id))))
        };
        annotations.iter().filter(|it| is_crowd(it)).filter_map(of).collect()
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let frame = &self.listing.images[image].frame;
        let Ok(annotations) = self.objects(image) else { return Vec::new() };
        let size = [frame.width, frame.height];
        let mut faults: Vec<_> = annotations.iter().flat_map(|annotation| self.faults_of(size, annotation)).collect();
        faults.extend(self.faults_of_order([frame.width, frame.height], &annotations));
        faults.extend(read::id_faults(&stated_ids(&annotations)));
        faults
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let frame = &self.listing.images[image].frame;
        let size = [frame.width, frame.height];
        let mut products = Products::new();
        if wants.iter().any(|want| ![RGB.id(), DEPTH.id(), LABEL_POLICY.id()].contains(want)) {
            let annotations = self.objects(image)?;
            let ids = read::ids_of(&stated_ids(&annotations))?;
            match self.has_masks {
                true => {
                    let labels = ids.into_iter().zip(&annotations).map(|(id, it)| self.labels(size, id, it));
                    read::put(&labels.collect::<Result<Vec<_>>>()?, None, wants, &mut products)?;
                }
                false => self.put_boxes(&ids, &annotations, wants, &mut products)?,
            }
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, decode::rgb_of_size(&self.images_root.file(&frame.file_name)?, size)?)?;
        }
        let wanted = |has: bool, key: KeyId| has && wants.contains(&key);
        let (depth, policy) = (wanted(self.has_depth, DEPTH.id()), wanted(self.has_policy, LABEL_POLICY.id()));
        if depth || policy {
            let record: Image = self.listing.image(image)?;
            if depth {
                let path = self.images_root.file(depth_file(&record).unwrap_or_default())?;
                products.put(DEPTH, decode::depth_of_size(&path, DEPTH_UNIT_MM, size)?)?;
            }
            if policy {
                products.put(LABEL_POLICY, Value::of(&record.extra[LABEL_POLICY.name()])?)?;
            }
        }
        Ok(ReadImage::new(size, products))
    }
}

impl Reader {
    /// What contradicts an annotation; where the others have masks, none is a fault.
    fn faults_of(&self, size: [u32; 2], annotation: &Annotation) -> Vec<(&'static str, String)> {
        if self.has_masks && segmentation(annotation).is_none() {
            let message = format!(
                "annotation {}: `segmentation` is empty or missing: the object has no pixels; add its mask, or remove it",
                annotation.id
            );
            return vec![("objects_have_masks", message)];
        }
        // Without a visible mask beside it, `segmentation` is that one, if the amodal masks are others.
        let mut faults = faults_of(size, annotation, self.has_visible || self.known != Known::Both);
        faults.extend(self.fault_of_name(annotation));
        faults.extend(self.fault_of_hidden(size, annotation));
        faults
    }

    /// D2SA's `amodal_region.name`, which names another category than that of the object.
    fn fault_of_name(&self, annotation: &Annotation) -> Option<(&'static str, String)> {
        let said = annotation.extra.get("amodal_region")?.get("name")?.as_str()?;
        let categories = || self.listing.file.categories.iter().flatten();
        let own = &categories().find(|it| it.id == annotation.category_id)?.name;
        let is_wrong = said != own && (self.is_ours || categories().any(|it| it.name == said));
        let message =
            format!("annotation {}: `amodal_region.name` is {said:?}, its category is {own:?}", annotation.id);
        is_wrong.then_some(("records_agree", message))
    }

    /// An object without an occlusion mask, of which masks that it has say that a part is hidden.
    fn fault_of_hidden(&self, size: [u32; 2], annotation: &Annotation) -> Option<(&'static str, String)> {
        let says = |key: &&str| annotation.extra.get(*key).is_some_and(|it| !it.is_null());
        if !self.has_hidden || self.known != Known::Both || HIDDEN.iter().any(says) {
            return None;
        }
        let label = self.labels(size, InstanceId(1), annotation).ok()?;
        let hidden = label.amodal.as_ref()?.minus(&label.visible).area();
        let key = if shared::name_starts(self.listing.file.path(), crate::d2sa::FILE) { HIDDEN[1] } else { HIDDEN[0] };
        let message = format!(
            "annotation {}: `{key}` is missing, and {hidden} pixels of its whole mask are not visible: add what is hidden",
            annotation.id
        );
        (hidden > 0).then_some(("occlusion_is_amodal_minus_visible", message))
    }
}

/// What an annotation says of its mask in numbers, and a mask that contradicts it. An amodal mask that is another one does if
/// `has_role` says that the file tells visible masks apart.
fn faults_of([width, height]: [u32; 2], annotation: &Annotation, has_role: bool) -> Vec<(&'static str, String)> {
    let Some(segmentation) = segmentation(annotation) else { return Vec::new() };
    let Ok(mask) = segmentation.decode(width, height) else { return Vec::new() };
    let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
    let (area, bbox) = ((annotation.area, of("area")), (annotation.bbox, of("bbox")));
    let (mut faults, edge_px2) = match segmentation {
        Segmentation::Polygons(outlines) => {
            (fits_outlines((outlines, of("segmentation")), &mask, area, bbox), edge_px2(&mask).max(1.0))
        }
        _ => {
            // A box with fractions is that of polygons that the mask was made from.
            let is_whole = annotation.bbox.iter().all(|edge| edge.fract() == 0.0);
            let box_px = if is_whole { 0.0 } else { 1.0 };
            (fits_mask(&mask, area, bbox, Tolerance { area_px2: 0.5, box_px }), 0.0)
        }
    };
    let other = |key: &str| field::<Segmentation>(annotation, key).ok()??.decode(width, height).ok();
    let keys = || std::iter::once(AMODAL).chain(VISIBLE).chain(HIDDEN);
    if mask.is_empty() && keys().filter_map(other).all(|mask| mask.is_empty()) {
        faults.push(shared::no_pixels(&format!("annotation {}", annotation.id)));
    }
    if let Some(amodal) = other(AMODAL).filter(|_| has_role) {
        let differ = |other: &Mask| f64::from(mask.minus(other).area() + other.minus(&mask).area());
        let is_one = differ(&amodal) <= edge_px2 || other(VISIBLE[0]).is_some_and(|it| differ(&it) <= edge_px2);
        if !is_one {
            let message = format!(
                "{} differs from `{AMODAL}` at {} pixels, and is not `{}` either",
                of("segmentation"),
                differ(&amodal),
                VISIBLE[0]
            );
            faults.push(("segmentation_is_a_mask_of_the_object", message));
        }
    }
    faults.extend(faults_of_region(annotation));
    faults
}

/// D2SA's `amodal_region` says the area and the box again.
fn faults_of_region(annotation: &Annotation) -> Vec<(&'static str, String)> {
    let mut faults = Vec::new();
    let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
    let region = annotation.extra.get("amodal_region");
    if let Some(area) = region.and_then(|it| it.get("area")?.as_f64()).filter(|it| (it - annotation.area).abs() > 0.5) {
        let message = format!("{} is {area}, its `area` {}", of("amodal_region.area"), annotation.area);
        faults.push(("records_agree", message));
    }
    let bbox = region.and_then(|it| serde_json::from_value::<[f64; 4]>(it.get("bbox")?.clone()).ok());
    if let Some(bbox) = bbox.filter(|it| it.iter().zip(annotation.bbox).any(|(a, b)| (a - b).abs() > 0.5)) {
        let message = format!("{} is {bbox:?}, its `bbox` {:?}", of("amodal_region.bbox"), annotation.bbox);
        faults.push(("records_agree", message));
    }
    faults
}

/// D2SA's `occl_depth`, that a number of objects contradicts: the most that can be in front of one are all others.
fn faults_of_depth(annotations: &[Annotation]) -> impl Iterator<Item = String> {
    annotations.iter().filter_map(|annotation| {
        let depth = occlusion_depth(annotation)?;
        let others = annotations.len() - 1;
        (depth > others as u64)
            .then(|| format!("annotation {}: `occl_depth` is {depth}, and there are {others} others", annotation.id))
    })
}

fn occlusion_depth(annotation: &Annotation) -> Option<u64> {
    annotation.extra.get("occl_depth")?.as_u64()
}

/// D2SA's place of an object from the front, from 1.
fn place_from_front(annotation: &Annotation) -> Option<u64> {
    annotation.extra.get("amodal_region")?.get("order")?.as_u64()
}

/// The ids that annotations state of their objects.
fn stated_ids(annotations: &[Annotation]) -> Vec<Option<u64>> {
    annotations.iter().map(|annotation| annotation.extra.get("instance_id")?.as_u64()).collect()
}

impl Reader {
    /// What the masks of an image's objects contradict of D2SA's numbers: places from the front, and in files of this program, whose
    /// meaning is known, how many objects are in front of each other. What circles leave open is not looked at.
    fn faults_of_order(&self, size: [u32; 2], annotations: &[Annotation]) -> Vec<(&'static str, String)> {
        let mut faults: Vec<String> = faults_of_depth(annotations).collect();
        let states_order = |it: &Annotation| place_from_front(it).is_some() || occlusion_depth(it).is_some();
        if self.known != Known::Both || !annotations.iter().any(states_order) {
            return faults.into_iter().map(|message| ("order_is_that_of_masks", message)).collect();
        }
        let labels = annotations.iter().map(|it| self.labels(size, InstanceId(1), it));
        let Ok(labels) = labels.collect::<Result<Vec<_>>>() else { return Vec::new() };
        let hidden: Vec<Mask> = labels.iter().map(hidden_of).collect();
        let masks: Vec<[&Mask; 2]> = labels.iter().zip(&hidden).map(|(it, hidden)| [&it.visible, hidden]).collect();
        let order = Order::of_masks(&masks);
        let places: Vec<Option<u64>> = annotations.iter().map(place_from_front).collect();
        let mut first_at: BTreeMap<u64, usize> = BTreeMap::new();
        // Of each object one fault of a kind, so that there are not as many as pairs.
        for (j, behind) in annotations.iter().enumerate() {
            let Some(place) = places[j] else { continue };
            let of = || format!("annotation {}: `amodal_region.order` is {place}", behind.id);
            if let Some(&i) = first_at.get(&place) {
                let first = annotations[i].id;
                faults.push(format!("{}, as that of annotation {first} is: no two objects have one place", of()));
            } else {
                first_at.insert(place, j);
            }
            let is_wrong = |i: &usize| places[*i].is_some_and(|other| other > place) && order.is_in_front(*i, j);
            if let Some((i, other)) = (0..places.len()).find(is_wrong).and_then(|i| Some((i, places[i]?))) {
                let hides = masks[i][0].shared_area(masks[j][1]);
                faults.push(format!(
                    "{}, but that of annotation {}, which hides {hides} of its pixels, is {other}: the front has the lower number",
                    of(),
                    annotations[i].id
                ));
            }
        }
        if self.is_ours {
            let said = annotations.iter().zip(order.certain_layers());
            faults.extend(said.filter_map(|(it, layer)| {
                let (said, own) = (occlusion_depth(it)?, layer? as u64);
                (said != own && said < annotations.len() as u64).then(|| {
                    format!("annotation {}: `occl_depth` is {said}, the longest chain of occluders has {own}", it.id)
                })
            }));
        }
        faults.into_iter().map(|message| ("order_is_that_of_masks", message)).collect()
    }

    /// Annotations of single objects.
    fn objects(&self, image: usize) -> Result<Vec<Annotation>> {
        let mut annotations: Vec<Annotation> = self.listing.annotations(image)?;
        annotations.retain(|annotation| !is_crowd(annotation));
        Ok(annotations)
    }

    fn put_boxes(
        &self,
        ids: &[InstanceId],
        annotations: &[Annotation],
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()> {
        let named = || ids.iter().copied().zip(annotations);
        if wants.contains(&VISIBLE_BOX.id()) {
            let around = |bbox: [f64; 4]| {
                let [x, y] = [bbox[0], bbox[1]].map(|low| low.floor());
                let [w, h] = [bbox[0] + bbox[2] - x, bbox[1] + bbox[3] - y].map(|size| size.ceil());
                BBox::from([x, y, w, h].map(|edge| edge as i32))
            };
            products.put(VISIBLE_BOX, named().map(|(id, it)| (id, around(it.bbox))).collect())?;
        }
        if wants.contains(&CATEGORY_ID.id()) {
            let category = |it: &Annotation| self.listing.categories.id(it.category_id);
            products.put(CATEGORY_ID, named().map(|(id, it)| (id, category(it))).collect())?;
        }
        Ok(())
    }

    fn labels(&self, [width, height]: [u32; 2], id: InstanceId, annotation: &Annotation) -> Result<Labels> {
        let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
        let decoded = |segmentation: &Segmentation, key: &str| {
            segmentation.decode(width, height).map_err(|error| error.context(of(key)))
        };
        let extra = |key: &str| -> Result<Option<Mask>> {
            let segmentation: Option<Segmentation> = field(annotation, key)?;
            segmentation.map(|segmentation| decoded(&segmentation, key)).transpose()
        };
        let either = |keys: [&str; 2]| match extra(keys[0])? {
            None => extra(keys[1]),
            some => Ok(some),
        };
        let own = match segmentation(annotation) {
            Some(own) => decoded(own, "segmentation")?,
            None => Mask::empty(width, height),
        };
        // Where the masks of others are amodal, an object without a visible one is not occluded.
        let amodal = match self.known {
            Known::Visible => None,
            Known::Amodal | Known::Both => Some(extra(AMODAL)?.unwrap_or_else(|| own.clone())),
        };
        let visible = either(VISIBLE)?.unwrap_or(own);
        let bbox = |key| Ok(field::<[i32; 4]>(annotation, key)?.map(BBox::from));
        let rate = match field(annotation, RATE[0])? {
            None => field(annotation, RATE[1])?,
            some => some,
        };
        let is_amodal = self.known == Known::Both;
        Ok(Labels {
            id,
            visible,
            amodal,
            occlusion: either(HIDDEN)?.filter(|_| is_amodal),
            rate: rate.filter(|_| is_amodal),
            visible_box: bbox("visible_bbox")?,
            amodal_box: bbox("amodal_bbox")?.filter(|_| self.known != Known::Visible),
            category: self.listing.categories.id(annotation.category_id),
        })
    }
}

/// A field that annotations of some formats have.
fn field<T: DeserializeOwned>(annotation: &Annotation, key: &str) -> Result<Option<T>> {
    let Some(json) = annotation.extra.get(key).filter(|json| !json.is_null()) else { return Ok(None) };
    serde_json::from_value(json.clone())
        .map(Some)
        .map_err(|error| Error::new(error.to_string()).context(format!("annotation {}: `{key}`", annotation.id)))
}
