//! Reads COCO's layout for panoptic segmentation. COCO's things are objects; stuff is not.

use super::record::{BACKGROUND_NAME, PanopticAnnotation, PanopticSegment, VOID};
use crate::family::find::{Structure, beside};
use crate::family::read::{Annotated, AnnotationFile, image_folders, not_objects};
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::coco::{Category, IS_THING};
use syntable_formats::decode;
use syntable_formats::read::{self, Categories, KnownMasks, ObjectLabels};
use syntable_model::files::DatasetFolder;
use syntable_model::limits::ANNOTATIONS;
use syntable_model::prelude::*;
use syntable_model::reader::{Crowd, DatasetFault, FaultSubject, Format, Note, Opened, Source};
use syntable_model::rule;

syntable_model::register_format!(Format::new(
    "coco_panoptic",
    "COCO panoptic segmentation (`annotations/panoptic_*.json` beside a folder of this name and one of images): its `isthing` segments are objects.",
    |path| Structure::Segments.is_at(path),
    open,
).with_image_folder());

/// The segments of a dataset.
pub struct Things {
    /// Folder of the images of ids.
    folder: DatasetFolder,
    /// The categories of objects, and the ids of the categories of stuff.
    categories: Categories,
    pub stuff: BTreeSet<u64>,
}

fn is_stuff(category: &Category) -> bool {
    category.extra.get(IS_THING).and_then(serde_json::Value::as_u64) == Some(0)
}

fn open(source: &Source) -> Result<Opened> {
    let (root, path) = Structure::Segments.find(source)?;
    // Counts segments by category and by whether they are crowds.
    let mut segments: BTreeMap<(u64, bool), usize> = BTreeMap::new();
    let mut file = AnnotationFile::open(
        source,
        &root,
        &path,
        &image_folders(&path),
        &[("annotations", &[]), ("segments", &[])],
        &mut |annotation: &PanopticAnnotation, unkept| {
            unkept[0].add(&annotation.extra);
            for segment in &annotation.segments_info {
                unkept[1].add(&segment.extra);
                *segments.entry((segment.category_id, segment.iscrowd != 0)).or_default() += 1;
            }
        },
    )?;
    let all = file.categories()?.to_vec();
    let stuff: BTreeSet<u64> = all.iter().filter(|it| is_stuff(it)).map(|it| it.id).collect();
    let things: Vec<Category> = all.iter().filter(|it| !is_stuff(it)).cloned().collect();
    let mut categories = Categories::of(&things);
    for category in segments.keys().map(|key| key.0).filter(|id| !stuff.contains(id)) {
        categories.note(category);
        if !things.iter().any(|thing| thing.id == category) {
            let message = format!("segments are of the category {category}, and `categories` has no such one");
            file.listing.faults.add(rule::KNOWN_CATEGORIES, FaultSubject::Category(category), message);
        }
    }
    let left_out: usize =
        segments.iter().filter(|((id, is_crowd), _)| *is_crowd || stuff.contains(id)).map(|it| it.1).sum();
    let things = segments.iter().filter(|((id, _), _)| !stuff.contains(id));
    let crowds = things.fold([0; 2], |[crowds, all], ((_, is_crowd), number)| {
        [crowds + if *is_crowd { *number } else { 0 }, all + number]
    });
    let named = |id: &u64| all.iter().any(|it| it.id == *id && it.name != BACKGROUND_NAME);
    let of_stuff: usize = segments.iter().filter(|((id, _), _)| stuff.contains(id) && named(id)).map(|it| it.1).sum();
    let of_stuff = [of_stuff, crowds[1] + of_stuff];
    let info = file.info(&categories);
    let labels = KnownMasks::Visible.offers();
    let offers = file.offers(labels, &[]);
    let no_objects = format!("segments of stuff and of crowds are no objects: {left_out} were left out");
    let mut notes: Vec<Note> = (left_out > 0).then(|| Note::caveat(no_objects)).into_iter().collect();
    notes.extend(file.supercategories().into_iter().chain(file.not_kept(&offers)));
    for ([count, of], what) in [
        (of_stuff, "segments are of stuff (`isthing` is 0), and no objects"),
        (crowds, "segments are crowds (`iscrowd`), not objects"),
    ] {
        notes.push(not_objects(&offers, count, of, what));
    }
    let category_ids = Some(categories.ids());
    let [expected, ..] = image_folders(&path);
    let images = root.inner(expected);
    let folder = beside(root, &path).inner(path.file_stem().unwrap_or_default());
    let opened =
        file.with_images_outside(&folder, images).opened(info, offers, notes, Things { folder, categories, stuff });
    Ok(Opened { category_ids, ..opened })
}

/// The segments of an image, and the id of each pixel.
pub struct Segments {
    pub annotation: PanopticAnnotation,
    pub ids: Plane<u32>,
    /// The masks of the segments that have pixels, by segment id.
    masks: BTreeMap<u32, Mask>,
}

impl Segments {
    fn new(annotation: PanopticAnnotation, ids: Plane<u32>) -> Result<Self> {
        let listed: BTreeSet<u32> = annotation.segments_info.iter().map(|it| it.id).filter(|id| *id != VOID).collect();
        ANNOTATIONS.check(annotation.segments_info.len() as u64)?;
        let listed: Vec<u32> = listed.into_iter().collect();
        // Number, from 1, of the segment of each pixel, in one pass.
        let numbers = ids.map(|id| listed.binary_search(id).map_or(0, |at| at as u16 + 1));
        let masks = read::masks_of(&numbers).into_iter().map(|(number, mask)| (listed[number as usize - 1], mask));
        Ok(Self { masks: masks.collect(), annotation, ids })
    }

    pub fn mask(&self, id: u32) -> Mask {
        self.masks.get(&id).cloned().unwrap_or_else(|| Mask::empty(self.ids.width(), self.ids.height()))
    }
}

impl Things {
    /// The segments of an image.
    pub fn segments(&self, file: &AnnotationFile, image: usize) -> Result<Segments> {
        let frame = &file.listing.images[image].frame;
        let mut annotations: Vec<PanopticAnnotation> = file.listing.annotations(image)?;
        let Some(annotation) = annotations.pop().filter(|_| annotations.is_empty()) else {
            let message =
                format!("image {} has no annotation, or several: one with all of its segments is needed", frame.id);
            return Err(Error::new(message));
        };
        let path = self.folder.file(&annotation.file_name)?;
        let ids = decode::rgb_of_size(&path, file.size(image))?;
        let ids = ids.map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
        Segments::new(annotation, ids)
    }

    /// The segments that are not stuff: single objects, or crowds.
    fn things<'s>(&'s self, all: &'s Segments, are_crowds: bool) -> impl Iterator<Item = &'s PanopticSegment> {
        let things = all.annotation.segments_info.iter().filter(|it| it.id != VOID);
        things.filter(move |it| (it.iscrowd != 0) == are_crowds && !self.stuff.contains(&it.category_id))
    }
}

impl Annotated for Things {
    type Records = Segments;

    fn records(&self, file: &AnnotationFile, image: usize) -> Result<Segments> {
        self.segments(file, image)
    }

    fn crowds(&self, file: &AnnotationFile, image: usize) -> Result<Vec<Crowd>> {
        let all = self.segments(file, image)?;
        let crowd =
            |it: &PanopticSegment| Crowd { mask: all.mask(it.id), category: self.categories.id(it.category_id) };
        Ok(self.things(&all, true).map(crowd).collect())
    }

    fn faults(&self, _: &AnnotationFile, _: usize, all: &Segments) -> Vec<DatasetFault> {
        self.faults_of(all)
    }

    fn put(
        &self,
        _: &AnnotationFile,
        _: usize,
        all: &Segments,
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()> {
        let objects: Vec<&PanopticSegment> = self.things(all, false).collect();
        let ids = read::ids_of(&objects.iter().map(|it| Some(it.id.into())).collect::<Vec<_>>())?;
        let labels = ids.into_iter().zip(objects).map(|(id, segment)| {
            ObjectLabels::of_masks(id, all.mask(segment.id), None, self.categories.id(segment.category_id))
        });
        read::put(&labels.collect::<Vec<_>>(), None, wants, products)
    }
}
