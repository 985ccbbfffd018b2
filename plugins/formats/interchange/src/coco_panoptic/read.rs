//! Reads COCO's layout for panoptic segmentation. Things are objects; stuff is none.

use super::{BACKGROUND_NAME, FILE};
use crate::coco::read::{FOLDER, images_root};
use crate::read::{self as shared, Tolerance, fits_mask};
use serde::de::IgnoredAny;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::Extra;
use syntable_formats::coco::{Category, Image};
use syntable_formats::decode;
use syntable_formats::index::Record;
use syntable_formats::listing::{AnnotationRecord, Listing};
use syntable_formats::read::{self, Categories, Known, Labels};
use syntable_formats::unkept::Unkept;
use syntable_model::files::DatasetFolder;
use syntable_model::limits::ANNOTATIONS;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::reader::{Crowd, Format, ImageSource, Note, OBJECTS_HAVE_PIXELS, Opened, ReadImage, Source};

syntable_model::register_format!(Format {
    name: "coco_panoptic",
    doc: "COCO panoptic segmentation (`annotations/panoptic_*.json` beside a folder of this name and one of images): things are \
          objects.",
    detect: |path| shared::is_dataset(path, Some(FOLDER), |file| shared::name_starts(file, FILE)),
    open,
    is_generic: false,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Id of the pixels of no segment.
const VOID: u32 = 0;

/// The annotation of an image, as others write it.
#[derive(Deserialize)]
struct ImageAnnotation {
    image_id: u64,
    file_name: String,
    segments_info: Vec<Segment>,
    /// Fields that are not read.
    #[serde(flatten)]
    extra: Extra,
}

#[derive(Deserialize)]
struct Segment {
    id: u32,
    category_id: u64,
    area: f64,
    bbox: [f64; 4],
    #[serde(default)]
    iscrowd: u8,
    /// Fields that are not read.
    #[serde(flatten)]
    extra: Extra,
}

impl AnnotationRecord for ImageAnnotation {
    fn id(&self) -> u64 {
        self.image_id
    }

    fn image(&self) -> u64 {
        self.image_id
    }

    fn category(&self) -> Option<u64> {
        None
    }
}

struct Reader {
    images_root: DatasetFolder,
    /// Folder of the images of segments.
    segments: DatasetFolder,
    listing: Listing,
    /// The categories of things, and ids of those of stuff.
    categories: Categories,
    stuff: BTreeSet<u64>,
}

fn is_stuff(category: &Category) -> bool {
    category.extra.get("isthing").and_then(serde_json::Value::as_u64) == Some(0)
}

fn open(source: &Source) -> Result<Opened> {
    let (root, file) = shared::root_and_file(source, Some(FOLDER), |file| shared::name_starts(file, FILE))?;
    // By category and whether they are crowds.
    let mut segments: BTreeMap<(u64, bool), u64> = BTreeMap::new();
    let mut unkept = [("images", shared::OF_IMAGES), ("annotations", &[]), ("segments", &[])]
        .map(|(of, read)| Unkept::new(of, read));
    let mut listing = Listing::open(&file, &mut |record: &Record<Image, ImageAnnotation, IgnoredAny>| match record {
        Record::Annotation(annotation) => {
            unkept[1].add(&annotation.extra);
            for segment in &annotation.segments_info {
                unkept[2].add(&segment.extra);
                *segments.entry((segment.category_id, segment.iscrowd != 0)).or_default() += 1;
            }
        }
        Record::Image(image) => shared::count_unkept(&mut unkept[0], image),
        Record::Scene(_) => {}
    })?;
    let Some(all) = listing.file.categories.clone() else {
        return Err(Error::new("missing field `categories`").in_file(file));
    };
    let stuff: BTreeSet<u64> = all.iter().filter(|it| is_stuff(it)).map(|it| it.id).collect();
    let things: Vec<Category> = all.iter().filter(|it| !is_stuff(it)).cloned().collect();
    let mut categories = Categories::of(&things);
    for category in segments.keys().map(|key| key.0).filter(|id| !stuff.contains(id)) {
        categories.note(category);
        if !things.iter().any(|thing| thing.id == category) {
            let message = format!("segments are of the category {category}, and `categories` has no such one");
            listing.faults.add("known_categories", format!("category {category}"), &message);
        }
    }
    let left_out: u64 =
        segments.iter().filter(|((id, is_crowd), _)| *is_crowd || stuff.contains(id)).map(|it| it.1).sum();
    let things = segments.iter().filter(|((id, _), _)| !stuff.contains(id));
    let crowds = things.fold([0; 2], |[crowds, all], ((_, is_crowd), number)| {
        [crowds + if *is_crowd { *number } else { 0 }, all + number]
    });
    let named = |id: &u64| all.iter().any(|it| it.id == *id && it.name != BACKGROUND_NAME);
    let of_stuff: u64 = segments.iter().filter(|((id, _), _)| stuff.contains(id) && named(id)).map(|it| it.1).sum();
    let of_stuff = [of_stuff, crowds[1] + of_stuff];
    let images_root = images_root(&root, &file, listing.images.first().map(|image| image.frame.file_name.as_str()));
    let about = &listing.file.info;
    let info = categories.info(about.description.clone(), about.contributor.clone(), &listing.refs, String::new());
    let beside = if shared::is_in(&file, FOLDER) { root.inner(FOLDER) } else { root };
    let segments = beside.inner(file.file_stem().unwrap_or_default());
    let mut offers = Known::Visible.offers();
    let labels = offers.clone();
    offers.push(RGB.id());
    let no_objects = format!("segments of stuff and of crowds are no objects: {left_out} were left out");
    let mut notes: Vec<Note> = (left_out > 0).then(|| Note::caveat(no_objects)).into_iter().collect();
    notes.extend(shared::supercategories(&listing).into_iter().chain(shared::information(&listing, &unkept)));
    notes.extend(shared::labels_not_kept(&offers, &unkept));
    for ([count, of], what) in [
        (of_stuff, "segments are of stuff (`isthing` is 0), and no objects"),
        (crowds, "segments of things are crowds (`iscrowd`), and no objects"),
    ] {
        notes.push(Note::not_objects(LeftOut::new(count as usize, of as usize, what)).of(labels.clone()));
    }
    let category_ids = Some(categories.ids());
    let opened = listing.opened(info, offers, |listing| Reader { images_root, segments, listing, categories, stuff });
    notes.splice(0..0, opened.notes);
    Ok(Opened { category_ids, notes, ..opened })
}

/// The segments of an image, and the ids of its pixels.
struct Segments {
    annotation: ImageAnnotation,
    ids: Plane<u32>,
    /// The masks of the segments that have pixels, by id.
    masks: BTreeMap<u32, Mask>,
}

impl Segments {
    fn new(annotation: ImageAnnotation, ids: Plane<u32>) -> Result<Self> {
        let listed: BTreeSet<u32> = annotation.segments_info.iter().map(|it| it.id).filter(|id| *id != VOID).collect();
        ANNOTATIONS.check(annotation.segments_info.len() as u64)?;
        let listed: Vec<u32> = listed.into_iter().collect();
        // Numbers of the segments from 1, of all pixels at once.
        let numbers = ids.map(|id| listed.binary_search(id).map_or(0, |at| at as u16 + 1));
        let masks = read::masks_of(&numbers).into_iter().map(|(number, mask)| (listed[number as usize - 1], mask));
        Ok(Self { masks: masks.collect(), annotation, ids })
    }

    fn mask(&self, id: u32) -> Mask {
        self.masks.get(&id).cloned().unwrap_or_else(|| Mask::empty(self.ids.width(), self.ids.height()))
    }
}

impl Reader {
    fn segments(&self, image: usize) -> Result<Segments> {
        let frame = &self.listing.images[image].frame;
        let mut annotations: Vec<ImageAnnotation> = self.listing.annotations(image)?;
        let Some(annotation) = annotations.pop().filter(|_| annotations.is_empty()) else {
            let message =
                format!("image {} has no annotation, or several: one with all of its segments is needed", frame.id);
            return Err(Error::new(message));
        };
        let path = self.segments.file(&annotation.file_name)?;
        let ids = decode::rgb_of_size(&path, [frame.width, frame.height])?;
        let ids = ids.map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
        Segments::new(annotation, ids)
    }

    /// The segments of things: objects, or those of crowds.
    fn things<'s>(&'s self, all: &'s Segments, are_crowds: bool) -> impl Iterator<Item = &'s Segment> {
        let things = all.annotation.segments_info.iter().filter(|it| it.id != VOID);
        things.filter(move |it| (it.iscrowd != 0) == are_crowds && !self.stuff.contains(&it.category_id))
    }
}

impl ImageSource for Reader {
    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        let all = self.segments(image)?;
        let crowd = |it: &Segment| Crowd { mask: all.mask(it.id), category: self.categories.id(it.category_id) };
        Ok(self.things(&all, true).map(crowd).collect())
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let Ok(all) = self.segments(image) else { return Vec::new() };
        let (mut faults, mut said) = (Vec::new(), BTreeSet::new());
        for segment in &all.annotation.segments_info {
            let of = |key: &str| format!("segment {}: `{key}`", segment.id);
            if !said.insert(segment.id) {
                faults.push(("unique_ids", format!("two segments have the id {}", segment.id)));
            }
            if segment.id == VOID {
                let message =
                    format!("a segment has the id {VOID}, which is that of pixels without one: number it from 1");
                faults.push(("segments_are_pixels", message));
                continue;
            }
            let mask = all.mask(segment.id);
            if mask.is_empty() {
                let file = &all.annotation.file_name;
                let is_object = segment.iscrowd == 0 && !self.stuff.contains(&segment.category_id);
                let check = if is_object { OBJECTS_HAVE_PIXELS } else { "segments_are_pixels" };
                faults.push((check, format!("no pixel of {file} is of segment {}", segment.id)));
                continue;
            }
            let exact = Tolerance { area_px2: 0.5, box_px: 0.0 };
            faults.extend(fits_mask(&mask, (segment.area, of("area")), (segment.bbox, of("bbox")), exact));
        }
        let unknown: BTreeSet<u32> =
            all.ids.data().iter().copied().filter(|it| *it != VOID && !said.contains(it)).collect();
        faults.extend(unknown.into_iter().map(|id| {
            let file = &all.annotation.file_name;
            ("segments_are_pixels", format!("pixels of {file} are of segment {id}, which `segments_info` has not"))
        }));
        faults
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let frame = &self.listing.images[image].frame;
        let size = [frame.width, frame.height];
        let mut products = Products::new();
        if wants.iter().any(|want| *want != RGB.id()) {
            let all = self.segments(image)?;
            let objects: Vec<&Segment> = self.things(&all, false).collect();
            let ids = read::ids_of(&objects.iter().map(|it| Some(it.id.into())).collect::<Vec<_>>())?;
            let labels = ids.into_iter().zip(objects).map(|(id, segment)| Labels {
                id,
                visible: all.mask(segment.id),
                amodal: None,
                occlusion: None,
                rate: None,
                visible_box: None,
                amodal_box: None,
                category: self.categories.id(segment.category_id),
            });
            read::put(&labels.collect::<Vec<_>>(), None, wants, &mut products)?;
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, decode::rgb_of_size(&self.images_root.file(&frame.file_name)?, size)?)?;
        }
        Ok(ReadImage::new(size, products))
    }
}
