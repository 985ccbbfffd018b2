//! The images of an annotation file in order, with the positions of their annotations.

use crate::coco;
use crate::index::{Indexed, IndexedRecord, RecordSection};
use crate::read::{Categories, Faults, labels_among};
use crate::syntable;
use crate::unkept::Unkept;
use serde::de::DeserializeOwned;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use syntable_model::error::Result;
use syntable_model::left_out::LeftOut;
use syntable_model::limits::{ANNOTATIONS, IMAGE_PIXELS};
use syntable_model::product::KeyId;
use syntable_model::reader::{FaultSubject, ImageRef, ImageSource, Note, Opened};
use syntable_model::rule;
use syntable_model::stage::DatasetInfo;

/// The record of an image in a file of COCO's structure.
pub trait ImageRecord: DeserializeOwned {
    /// The part that stays in memory.
    fn frame(&self) -> ImageHeader;
}

/// The record of an annotation.
pub trait AnnotationRecord: DeserializeOwned {
    /// The part that stays in memory.
    fn link(&self) -> AnnotationLink;
}

/// The ids in an annotation.
#[derive(Debug, Clone, Copy)]
pub struct AnnotationLink {
    /// Its own id.
    pub id: u64,
    /// Id of its image.
    pub image: u64,
    /// Id of its category; none in files without categories.
    pub category: Option<u64>,
}

/// An image of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageHeader {
    /// Its id in the file.
    pub id: u64,
    /// Path of the image, relative to the format's folder of images.
    pub file_name: String,
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// Scene and view, if the file states them.
    pub place: Option<(u32, u32)>,
}

/// An image with the numbers of its records in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedImage {
    /// The image.
    pub frame: ImageHeader,
    /// Number of its record in `images`.
    pub record: u32,
    /// Numbers of its records in `annotations`, ascending.
    pub annotations: Vec<u32>,
}

/// The images of an annotation file.
#[derive(Debug)]
pub struct AnnotationListing {
    /// The file.
    pub file: Indexed,
    /// The categories of the file.
    pub categories: Categories,
    /// Names of the images, in order of scenes and views.
    pub refs: Vec<ImageRef>,
    /// The images, in the same order.
    pub images: Vec<ListedImage>,
    /// Faults of the file.
    pub faults: Faults,
    /// Number of annotations whose image is not in the file, and number of all annotations.
    unknown: [usize; 2],
}

impl AnnotationListing {
    /// Opens a file, and calls `each` with every record.
    pub fn open<I, A, S>(path: &Path, each: &mut dyn FnMut(&IndexedRecord<I, A, S>)) -> Result<Self>
    where
        I: ImageRecord,
        A: AnnotationRecord,
        S: DeserializeOwned,
    {
        let (mut frames, mut annotations) = (Vec::new(), Vec::new());
        let file = Indexed::open(path, &mut |record: IndexedRecord<I, A, S>| {
            each(&record);
            match record {
                IndexedRecord::Image(image) => frames.push(image.frame()),
                IndexedRecord::Annotation(it) => annotations.push(it.link()),
                IndexedRecord::Scene(_) => {}
            }
        })
        .map_err(|error| error.of_request())?;
        let mut categories = Categories::of(file.categories.as_deref().unwrap_or_default());
        annotations.iter().filter_map(|it| it.category).for_each(|category| categories.note(category));
        let mut faults = Faults::default();
        faults.of_categories(file.categories.as_deref().unwrap_or_default());
        let ids: BTreeSet<u64> = frames.iter().map(|frame| frame.id).collect();
        let unknown = annotations.iter().filter(|it| !ids.contains(&it.image)).count();
        let unknown = [unknown, annotations.len()];
        let mut by_id = by_id(frames, &annotations, &mut faults);
        faults.of_annotations(&categories, annotations.iter().map(|it| (it.id, it.category)));
        for (number, annotation) in (0..).zip(&annotations) {
            match by_id.get_mut(&annotation.image) {
                Some(image) => image.annotations.push(number),
                // The fault of the omitted image covers its annotations.
                None if ids.contains(&annotation.image) => {}
                None => {
                    let message = format!("unknown image {}", annotation.image);
                    faults.add(rule::KNOWN_IMAGES, FaultSubject::Annotation(annotation.id), message);
                }
            }
        }
        drop_second_records(&mut by_id, &mut faults);
        let (mut refs, images) = faults
            .in_order(by_id.into_values().collect(), |image: &ListedImage| (&image.frame.file_name, image.frame.place));
        refs.iter_mut().zip(&images).for_each(|(image, listed)| image.id = Some(listed.frame.id));
        Ok(Self { file, categories, refs, images, faults, unknown })
    }

    /// The dataset of the file, with the faults and notes of the listing. `source` reads its images.
    pub fn opened<S: ImageSource + 'static>(
        mut self,
        info: DatasetInfo,
        offers: Vec<KeyId>,
        source: impl FnOnce(Self) -> S,
    ) -> Opened {
        let (images, faults) = (std::mem::take(&mut self.refs), std::mem::take(&mut self.faults));
        let [unknown, all] = self.unknown;
        let unknown = LeftOut::new(unknown, all, "annotations name no image of the file");
        let notes = vec![Note::not_objects(unknown).of(labels_among(&offers))];
        let category_ids = Some(self.categories.ids());
        Opened { faults: faults.into_inner(), category_ids, notes, ..Opened::new(info, images, offers, source(self)) }
    }

    /// Unread sections and fields that are not labels, as text: the licenses of the file, and fields of its categories.
    pub fn information(&self) -> Vec<String> {
        let mut of_categories = Unkept::new("categories", &[coco::IS_THING]);
        let categories = self.file.categories.iter().flatten();
        categories.for_each(|category| of_categories.add(&category.extra));
        let sections = self.file.unread.iter().map(|name| format!("the section `{name}`"));
        sections.chain(of_categories.all()).collect()
    }

    /// Whether the file has annotations, of its own images or of others.
    pub fn has_annotations(&self) -> bool {
        self.unknown[1] > 0
    }

    /// The annotations of an image, in the order of the file.
    ///
    /// # Errors
    /// If they cannot be read, or exceed the [limit](ANNOTATIONS).
    pub fn annotations<A: DeserializeOwned>(&self, image: usize) -> Result<Vec<A>> {
        ANNOTATIONS.check(self.images[image].annotations.len() as u64)?;
        self.file.records(RecordSection::Annotations, &self.images[image].annotations)
    }

    /// The whole record of an image.
    pub fn image<I: DeserializeOwned>(&self, image: usize) -> Result<I> {
        let records = self.file.records(RecordSection::Images, &[self.images[image].record])?;
        Ok(records.into_iter().next().expect("as many records as were asked for"))
    }
}

/// The images by their ids. In the form of SynTable's release, the n-th image belongs to the n-th annotation. If
/// several files share an id, their annotations are ambiguous, and all these images are omitted.
fn by_id(frames: Vec<ImageHeader>, annotations: &[AnnotationLink], faults: &mut Faults) -> BTreeMap<u64, ListedImage> {
    let repeats =
        frames.len() == annotations.len() && frames.iter().zip(annotations).all(|(frame, it)| frame.id == it.image);
    let mut by_id: BTreeMap<u64, ListedImage> = BTreeMap::new();
    let mut ambiguous = BTreeSet::new();
    for (record, frame) in (0..).zip(frames) {
        if let Err(error) = IMAGE_PIXELS.check_size([frame.width, frame.height]) {
            faults.lost(rule::READABLE, FaultSubject::Image(frame.id), format!("{error}: the image is left out"));
            continue;
        }
        if frame.file_name.is_empty() {
            let message = "`file_name` is missing, and `coco_url` names no file either: the image is left out";
            faults.lost(rule::READABLE, FaultSubject::Image(frame.id), message);
            continue;
        }
        match by_id.entry(frame.id) {
            Entry::Occupied(first) if file_of(&first.get().frame.file_name) != file_of(&frame.file_name) => {
                let (one, other) = (&first.get().frame.file_name, &frame.file_name);
                let message =
                    format!("two images have this id, {one} and {other}: they are left out, with their annotations");
                faults.lost(rule::UNIQUE_IDS, FaultSubject::Image(frame.id), message);
                ambiguous.insert(frame.id);
            }
            Entry::Occupied(first) if !repeats || first.get().frame != frame => {
                let message =
                    format!("two images have this id, and are of {}: the second one is left out", frame.file_name);
                faults.lost(rule::UNIQUE_IDS, FaultSubject::Image(frame.id), message);
            }
            Entry::Occupied(_) => {}
            Entry::Vacant(entry) => drop(entry.insert(ListedImage { frame, record, annotations: Vec::new() })),
        }
    }
    by_id.retain(|id, _| !ambiguous.contains(id));
    by_id
}

/// The file that a name refers to: `a.png`, `./a.png` and `b/../a.png` are one file.
fn file_of(name: &str) -> PathBuf {
    let mut file = PathBuf::new();
    for part in Path::new(name).components() {
        let is_inside = matches!(file.components().next_back(), Some(Component::Normal(_)));
        match part {
            Component::CurDir => {}
            Component::ParentDir if is_inside => drop(file.pop()),
            other => file.push(other),
        }
    }
    file
}

/// Omits an image whose file already belongs to an image with a lower id. Written as two images, each would show
/// objects that only the other one labels.
fn drop_second_records(by_id: &mut BTreeMap<u64, ListedImage>, faults: &mut Faults) {
    let mut first_of: BTreeMap<PathBuf, u64> = BTreeMap::new();
    let mut second = BTreeSet::new();
    for image in by_id.values() {
        let ImageHeader { id, file_name, .. } = &image.frame;
        match first_of.entry(file_of(file_name)) {
            Entry::Vacant(entry) => drop(entry.insert(*id)),
            Entry::Occupied(first) => {
                let (first, number) = (first.get(), image.annotations.len());
                let message = format!(
                    "image {first} is of this file, too: {file_name}; image {id} is left out, with its annotations ({number})"
                );
                faults.lost(rule::UNIQUE_NAMES, FaultSubject::Image(*id), message);
                second.insert(*id);
            }
        }
    }
    by_id.retain(|id, _| !second.contains(id));
}

impl ImageRecord for coco::CocoImage {
    fn frame(&self) -> ImageHeader {
        let file_name = self.file().unwrap_or_default();
        ImageHeader { id: self.id, file_name, width: self.width, height: self.height, place: None }
    }
}

impl ImageRecord for syntable::SynTableImage {
    fn frame(&self) -> ImageHeader {
        let Self { id, file_name, width, height, .. } = self;
        let place = self.scene_id.zip(self.view_id);
        ImageHeader { id: *id, file_name: file_name.clone(), width: *width, height: *height, place }
    }
}

impl<E: coco::FurtherFields> AnnotationRecord for coco::CocoAnnotation<E> {
    fn link(&self) -> AnnotationLink {
        AnnotationLink { id: self.id, image: self.image_id, category: Some(self.category_id) }
    }
}

impl AnnotationRecord for syntable::SynTableAnnotation {
    fn link(&self) -> AnnotationLink {
        AnnotationLink { id: self.id, image: self.image_id, category: Some(self.category_id) }
    }
}
