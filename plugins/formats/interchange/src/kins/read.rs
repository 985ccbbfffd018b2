//! Reads KINS' layout, in its form of 2019 or of 2020.

use crate::coco::read::FOLDER;
use crate::order::Order;
use crate::read::{
    self as shared, POLYGONS, Tolerance, cut_holes, edge_px2, enclosed_px2, eroded, fits_mask, hidden_of, settle_edges,
};
use serde::de::{Deserializer, Error as _, IgnoredAny};
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_formats::Extra;
use syntable_formats::coco::{Image, id};
use syntable_formats::decode;
use syntable_formats::index::Record;
use syntable_formats::listing::{AnnotationRecord, Listing};
use syntable_formats::read::{self, Labels};
use syntable_formats::segmentation::Segmentation;
use syntable_formats::unkept::Unkept;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{OCCLUSION_MASK, RGB};
use syntable_model::reader::{Crowd, Format, ImageSource, Note, Opened, ReadImage, Source};

syntable_model::register_format!(Format {
    name: "kins",
    doc: "KINS (`instances_*.json` or `update_*_2020.json` beside the images, or beside KITTI's `training` and `testing`), as \
          the writer `kins` writes it.",
    detect: |path| {
        let is_of_coco = if path.is_file() { shared::is_in(path, FOLDER) } else { shared::is_named(path, FOLDER) };
        shared::is_dataset(path, None, is_one) && !is_of_coco
    },
    open,
    is_generic: false,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// How the annotation files of both forms begin, and end.
const NAMES: [(&str, &str); 2] = [("instances_", ""), ("update_", "_2020")];
/// Folders of images: ours, then those of KITTI, which have other images by the same names.
const IMAGES: [&str; 4] = ["images", "training/image_2", "testing/image_2", "."];

/// The folders in which the images of a file may be, those of its split first: KINS tests on KITTI's images of testing.
fn image_folders(file: &Path) -> [&'static str; 4] {
    let [own, training, testing, here] = IMAGES;
    let is_of_testing = |stem: &str| ["test", "val"].iter().any(|split| stem.contains(split));
    match file.file_stem().is_some_and(|stem| is_of_testing(&stem.to_string_lossy())) {
        true => [own, testing, training, here],
        false => IMAGES,
    }
}

fn is_one(file: &Path) -> bool {
    let stem = file.file_stem().map(|stem| stem.to_string_lossy());
    stem.is_some_and(|stem| NAMES.iter().any(|(start, end)| stem.starts_with(start) && stem.ends_with(end)))
}

/// An object, in either form: amodal and visible mask with their numbers under the names of 2020, then those of 2019.
#[derive(Debug, Deserialize)]
struct Annotation {
    #[serde(deserialize_with = "id")]
    id: u64,
    #[serde(deserialize_with = "id")]
    image_id: u64,
    #[serde(deserialize_with = "id")]
    category_id: u64,
    /// Whether it is of many objects together.
    #[serde(default, rename = "iscrowd", deserialize_with = "flag")]
    is_crowd: bool,
    a_segm: Option<Segmentation>,
    a_bbox: Option<[f64; 4]>,
    a_area: Option<f64>,
    i_segm: Option<Segmentation>,
    i_bbox: Option<[f64; 4]>,
    i_area: Option<f64>,
    a_hole_area: Option<f64>,
    i_hole_area: Option<f64>,
    oco_id: Option<u64>,
    ico_id: Option<u64>,
    segmentation: Option<Segmentation>,
    bbox: Option<[f64; 4]>,
    area: Option<f64>,
    inmodal_seg: Option<Segmentation>,
    inmodal_bbox: Option<[f64; 4]>,
    /// Fields that are not read.
    #[serde(flatten)]
    extra: Extra,
}

/// A flag that some tools write as a boolean.
fn flag<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
    match Json::deserialize(deserializer)? {
        Json::Null => Ok(false),
        Json::Bool(flag) => Ok(flag),
        Json::Number(number) => Ok(number.as_f64() != Some(0.0)),
        other => Err(D::Error::custom(format!("`{other}` is no flag: write 0 or 1"))),
    }
}

impl AnnotationRecord for Annotation {
    fn id(&self) -> u64 {
        self.id
    }

    fn image(&self) -> u64 {
        self.image_id
    }

    fn category(&self) -> Option<u64> {
        Some(self.category_id)
    }
}

/// What an annotation says of a mask: names of keys with their values.
struct Said<'a> {
    mask: (&'static str, Option<&'a Segmentation>),
    area: (&'static str, Option<f64>),
    /// Pixels of the mask's holes, which outlines do not have: ours.
    holes_px2: Option<f64>,
    bbox: (&'static str, Option<[f64; 4]>),
}

impl Annotation {
    /// What it says of the amodal and of the visible mask.
    fn said(&self) -> [Said<'_>; 2] {
        if self.a_segm.is_some() || self.i_segm.is_some() {
            let amodal = Said {
                mask: ("a_segm", self.a_segm.as_ref()),
                area: ("a_area", self.a_area),
                holes_px2: self.a_hole_area,
                bbox: ("a_bbox", self.a_bbox),
            };
            let visible = Said {
                mask: ("i_segm", self.i_segm.as_ref()),
                area: ("i_area", self.i_area),
                holes_px2: self.i_hole_area,
                bbox: ("i_bbox", self.i_bbox),
            };
            return [amodal, visible];
        }
        let amodal = Said {
            mask: ("segmentation", self.segmentation.as_ref()),
            area: ("area", self.area),
            holes_px2: None,
            bbox: ("bbox", self.bbox),
        };
        let visible = Said {
            mask: ("inmodal_seg", self.inmodal_seg.as_ref()),
            area: ("inmodal_area", None),
            holes_px2: None,
            bbox: ("inmodal_bbox", self.inmodal_bbox),
        };
        [amodal, visible]
    }

    /// Area of holes that it says its amodal mask has and its outline does not, px², given what is read. In the form of 2020 the
    /// areas say how much is hidden; in that of 2019 the area falls short of the outline, unless it is that of the outline.
    fn holes_px2(&self, labels: &Labels) -> f64 {
        let [amodal, visible] = self.said();
        let (Some(Segmentation::Polygons(outline)), Some(area), Some(mask)) =
            (amodal.mask.1, amodal.area.1, &labels.amodal)
        else {
            return 0.0;
        };
        match visible.area.1 {
            Some(visible) => f64::from(mask.minus(&labels.visible).area()) - (area - visible),
            None if (area - enclosed_px2(outline)).abs() < 1.0 => 0.0,
            None => f64::from(mask.area()) - area,
        }
    }

    /// Areas that leave room for fewer or more hidden pixels than outlines do, whatever holes they have, given what is read.
    fn fault_of_areas(&self, labels: &Labels) -> Option<(&'static str, String)> {
        let [amodal, visible] = self.said();
        let (Some(Segmentation::Polygons(_)), Some(area), Some(mask)) = (amodal.mask.1, amodal.area.1, &labels.amodal)
        else {
            return None;
        };
        let edges = edge_px2(mask).max(1.0) + edge_px2(&labels.visible);
        let hidden = f64::from(mask.minus(&labels.visible).area());
        let (name, said) = match visible.area.1 {
            Some(visible) => ("`a_area` less `i_area`", area - visible),
            // Holes are nowhere where the object is seen.
            None => ("the hidden part of `area`", area - f64::from(labels.visible.area())),
        };
        (said < -edges || said > hidden + edges).then(|| {
            let message = format!("annotation {}: {name} is {said}, outlines leave 0 to {hidden}", self.id);
            ("areas_are_those_of_masks", message)
        })
    }

    /// A key of it, for messages.
    fn key(&self, key: &str) -> String {
        format!("annotation {}: `{key}`", self.id)
    }

    fn mask(&self, said: &Said, [width, height]: [u32; 2]) -> Result<Mask> {
        let (key, segmentation) = said.mask;
        let missing = || {
            Error::new("it is missing")
                .help("an object has `a_segm` and `i_segm`, or `segmentation` and `inmodal_seg`")
                .context(self.key(key))
        };
        let decoded = segmentation.ok_or_else(missing)?.decode(width, height);
        decoded.map_err(|error| error.context(self.key(key)))
    }

    /// What it says of its masks in numbers, which need not be those of polygons to the pixel.
    fn faults(&self, size: [u32; 2]) -> Vec<(&'static str, String)> {
        let mut faults = Vec::new();
        for said in self.said() {
            let Ok(mask) = self.mask(&said, size) else { continue };
            let own = <[i32; 4]>::from(mask.bbox()).map(f64::from);
            let own_area = f64::from(mask.area());
            let area = said.area.1.unwrap_or(own_area);
            let (area, tolerance) = match said.mask.1 {
                Some(Segmentation::Polygons(_)) => {
                    let area = match said.holes_px2 {
                        Some(holes) => area + holes,
                        // What an outline has more than the mask may be a hole.
                        None => area.max(own_area),
                    };
                    (area, edge_px2(&mask).max(1.0))
                }
                _ => (area, 0.5),
            };
            let bbox = said.bbox.1.unwrap_or(own);
            let tolerance = Tolerance { area_px2: tolerance, box_px: 1.0 };
            faults.extend(fits_mask(&mask, (area, self.key(said.area.0)), (bbox, self.key(said.bbox.0)), tolerance));
        }
        faults
    }
}

/// What the masks of an image's objects contradict of groups and places in them. Outlines are as good as their edges, and where
/// one fills a hole, it does not tell who is in front. Groups may have `crowds`, too.
fn faults_of_order(
    annotations: &[Annotation],
    crowds: &[Annotation],
    labels: &[Labels],
) -> Vec<(&'static str, String)> {
    if annotations.iter().all(|it| it.oco_id.is_none() && it.ico_id.is_none()) {
        return Vec::new();
    }
    let has_holes = |it: &Annotation| it.said().iter().any(|said| said.holes_px2.is_some_and(|holes| holes > 0.0));
    let of = |mask: Mask, it: &Annotation| if has_holes(it) { Mask::empty(mask.width(), mask.height()) } else { mask };
    let each = || labels.iter().zip(annotations);
    let whole: Vec<Mask> =
        each().map(|(label, it)| of(label.amodal.as_ref().map_or_else(|| label.visible.clone(), eroded), it)).collect();
    let seen: Vec<Mask> = each().map(|(label, it)| of(eroded(&label.visible), it)).collect();
    let hidden: Vec<Mask> = each().map(|(label, it)| of(eroded(&hidden_of(label)), it)).collect();
    let clear = Order::of_masks(&seen.iter().zip(&hidden).map(|(seen, hidden)| [seen, hidden]).collect::<Vec<_>>());
    // What the edges alone say may be wrong, but it may also close a circle.
    let exact: Vec<Mask> = labels.iter().map(hidden_of).collect();
    let all = Order::of_masks(&labels.iter().zip(&exact).map(|(it, hidden)| [&it.visible, hidden]).collect::<Vec<_>>());
    let mut faults = Vec::new();
    let boxes: Vec<BBox> = whole.iter().map(Mask::bbox).collect();
    let mut members: BTreeMap<u64, u64> = BTreeMap::new();
    let groups = annotations.iter().chain(crowds).filter_map(|it| it.oco_id);
    groups.for_each(|group| *members.entry(group).or_default() += 1);
    // Of each object one fault of a kind, so that there are not as many as pairs.
    for (j, behind) in annotations.iter().enumerate() {
        let key = |it: &Annotation, key: &str, value: u64| format!("{} is {value}", it.key(key));
        let Some(group) = behind.oco_id else { continue };
        let of_group = members.get(&group).copied().unwrap_or_default();
        if let Some(place) = behind.ico_id
            && (place > of_group || (group == 0) != (place == 0))
        {
            let said = key(behind, "ico_id", place);
            let message = match group == 0 || place == 0 {
                true => format!("{said} and its `oco_id` {group}: both are 0 where no object overlaps it, or neither"),
                false => format!(
                    "{said}, and its `oco_id` {group} is that of {of_group} objects: places are from 1 to their number"
                ),
            };
            faults.push(("order_is_that_of_masks", message));
        }
        let overlaps = |i: usize| boxes[i].meets(&boxes[j]) && whole[i].shared_area(&whole[j]) > 0;
        let other_group = |i: usize| annotations[i].oco_id.filter(|other| *other != group && overlaps(i));
        if let Some((front, other)) = (0..j).find_map(|i| Some((&annotations[i], other_group(i)?))) {
            let message = format!(
                "{}, but {}: objects that overlap have one group",
                key(front, "oco_id", other),
                key(behind, "oco_id", group)
            );
            faults.push(("order_is_that_of_masks", message));
        }
        let Some(place) = behind.ico_id.filter(|place| *place > 0) else { continue };
        let place_before = |i: usize| {
            let of_group = annotations[i].ico_id.filter(|_| annotations[i].oco_id == Some(group));
            of_group.filter(|before| *before >= place && clear.occludes(i, j) && all.is_in_front(i, j))
        };
        if let Some((front, before)) = (0..annotations.len()).find_map(|i| Some((&annotations[i], place_before(i)?))) {
            let message = format!(
                "{}, but {}, which is in front of it: the front has the lower number",
                key(behind, "ico_id", place),
                key(front, "ico_id", before)
            );
            faults.push(("order_is_that_of_masks", message));
        }
    }
    faults
}

struct Reader {
    images_root: DatasetFolder,
    listing: Listing,
    /// Whether any annotation is of a crowd.
    has_crowds: bool,
}

fn open(source: &Source) -> Result<Opened> {
    let (root, file) = shared::root_and_file(source, None, is_one)?;
    let mut crowds = [0; 2];
    let mut unkept = [Unkept::new("images", shared::OF_IMAGES), Unkept::new("annotations", &["num_keypoints"])];
    let listing = Listing::open(&file, &mut |record: &Record<Image, Annotation, IgnoredAny>| match record {
        Record::Annotation(annotation) => {
            crowds[0] += usize::from(annotation.is_crowd);
            crowds[1] += 1;
            unkept[1].add(&annotation.extra);
        }
        Record::Image(image) => shared::count_unkept(&mut unkept[0], image),
        Record::Scene(_) => {}
    })?;
    let first = listing.images.first().map(|image| image.frame.file_name.as_str());
    let images_root = shared::images_root(&root, &image_folders(&file), first);
    let info = shared::info(&listing);
    let mut offers = read::Known::Both.offers();
    let labels = offers.clone();
    offers.push(RGB.id());
    let mut notes = vec![Note::caveat(POLYGONS).of(labels.clone())];
    notes.extend(shared::supercategories(&listing).into_iter().chain(shared::information(&listing, &unkept)));
    notes.extend(shared::labels_not_kept(&offers, &unkept));
    let [crowded, all] = crowds;
    let crowded_out = LeftOut::new(crowded, all, "annotations are crowds (`iscrowd`), and no objects");
    notes.push(Note::not_objects(crowded_out).of(labels));
    let opened = listing.opened(info, offers, |listing| Reader { images_root, listing, has_crowds: crowded > 0 });
    notes.splice(0..0, opened.notes);
    Ok(Opened { derived: keys![OCCLUSION_MASK], notes, ..opened })
}

impl ImageSource for Reader {
    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let frame = &self.listing.images[image].frame;
        let Ok(all) = self.listing.annotations::<Annotation>(image) else { return Vec::new() };
        let (crowds, annotations): (Vec<_>, Vec<_>) = all.into_iter().partition(|it| it.is_crowd);
        let size = [frame.width, frame.height];
        let mut faults: Vec<_> = annotations.iter().flat_map(|annotation| annotation.faults(size)).collect();
        let labels = annotations.iter().enumerate().map(|(row, it)| self.labels(size, row, it));
        if let Ok(mut labels) = labels.collect::<Result<Vec<_>>>() {
            let each = annotations.iter().zip(&labels);
            faults.extend(
                each.filter_map(|(it, label)| shared::without_pixels(label, || format!("annotation {}", it.id))),
            );
            settle_edges(&mut labels);
            faults.extend(annotations.iter().zip(&labels).filter_map(|(it, label)| it.fault_of_areas(label)));
            for (label, annotation) in labels.iter_mut().zip(&annotations) {
                cut_holes(label, annotation.holes_px2(label));
            }
            faults.extend(faults_of_order(&annotations, &crowds, &labels));
        }
        faults
    }

    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        if !self.has_crowds {
            return Ok(Vec::new());
        }
        let frame = &self.listing.images[image].frame;
        let annotations: Vec<Annotation> = self.listing.annotations(image)?;
        let of = |it: &Annotation| {
            let [amodal, visible] = it.said();
            let said = [visible, amodal].into_iter().find(|said| said.mask.1.is_some())?;
            let category = self.listing.categories.id(it.category_id);
            Some(it.mask(&said, [frame.width, frame.height]).map(|mask| Crowd { mask, category }))
        };
        annotations.iter().filter(|it| it.is_crowd).filter_map(of).collect()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let frame = &self.listing.images[image].frame;
        let size = [frame.width, frame.height];
        let mut products = Products::new();
        if wants.iter().any(|want| *want != RGB.id()) {
            let annotations = self.objects(image)?;
            let labels = annotations.iter().enumerate().map(|(row, it)| self.labels(size, row, it));
            let mut labels = labels.collect::<Result<Vec<_>>>()?;
            settle_edges(&mut labels);
            for (label, annotation) in labels.iter_mut().zip(&annotations) {
                cut_holes(label, annotation.holes_px2(label));
            }
            read::put(&labels, None, wants, &mut products)?;
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, decode::rgb_of_size(&self.images_root.file(&frame.file_name)?, size)?)?;
        }
        Ok(ReadImage::new(size, products))
    }
}

impl Reader {
    /// The annotations of the objects of an image: all but crowds.
    fn objects(&self, image: usize) -> Result<Vec<Annotation>> {
        let mut annotations: Vec<Annotation> = self.listing.annotations(image)?;
        annotations.retain(|it| !it.is_crowd);
        Ok(annotations)
    }

    fn labels(&self, size: [u32; 2], row: usize, annotation: &Annotation) -> Result<Labels> {
        let [amodal, visible] = annotation.said();
        Ok(Labels {
            id: read::id_of(row)?,
            visible: annotation.mask(&visible, size)?,
            amodal: Some(annotation.mask(&amodal, size)?),
            occlusion: None,
            rate: None,
            visible_box: None,
            amodal_box: None,
            category: self.listing.categories.id(annotation.category_id),
        })
    }
}
