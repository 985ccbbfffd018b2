//! Shared code of readers of COCO's family: the annotation file, its images, and its unread fields.

use super::find::only_folder;
use serde::de::IgnoredAny;
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_formats::coco::{Category, CocoImage};
use syntable_formats::decode::{self, FileContent};
use syntable_formats::index::IndexedRecord;
use syntable_formats::listing::{AnnotationListing, AnnotationRecord};
use syntable_formats::read::{Categories, labels_among};
use syntable_formats::unkept::{self, Unkept};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, DEPTH, LABEL_POLICY, RGB, RGB_FILE};
use syntable_model::reader::{Crowd, DatasetFault, FaultSubject, ImageSource, Note, Opened, ReadImage, Source};
use syntable_model::shown::shown;

/// Key of an image's depth image, in whole millimeters, next to its `file_name`. UOAIS-Sim uses it.
pub const DEPTH_FILE: &str = "depth_file_name";
/// Millimeters per step of such a depth image.
const DEPTH_UNIT_MM: f64 = 1.0;

/// Fields of image records that at least one reader of the family reads.
const OF_IMAGES: &[&str] = &[LABEL_POLICY.name(), DEPTH_FILE];

/// Number of images that are looked up to find their folder, since some may be missing.
const LOOKED_UP: usize = 16;

/// The objects in images, as a format of the family stores them.
pub trait Annotated: Send + Sync + 'static {
    /// The records of an image.
    type Records;

    /// Reads the records of an image.
    fn records(&self, file: &AnnotationFile, image: usize) -> Result<Self::Records>;

    /// Adds the requested labels of an image to `products`.
    fn put(
        &self,
        file: &AnnotationFile,
        image: usize,
        records: &Self::Records,
        wants: &[KeyId],
        products: &mut Products,
    ) -> Result<()>;

    /// See [`ImageSource::crowds`].
    fn crowds(&self, file: &AnnotationFile, image: usize) -> Result<Vec<Crowd>> {
        let _ = (file, image);
        Ok(Vec::new())
    }

    /// See [`ImageSource::subjects`].
    fn subjects(&self, file: &AnnotationFile, image: usize) -> BTreeMap<InstanceId, FaultSubject> {
        let _ = (file, image);
        BTreeMap::new()
    }

    /// See [`ImageSource::image_faults`].
    fn faults(&self, file: &AnnotationFile, image: usize, records: &Self::Records) -> Vec<DatasetFault>;
}

/// An annotation file of COCO's structure, and the folder of its images.
pub struct AnnotationFile {
    /// The records of the file.
    pub listing: AnnotationListing,
    /// The folder to which the image names are relative.
    images_root: DatasetFolder,
    /// Whether the images are in this folder by the last parts of their names alone.
    by_last_part: bool,
    /// Whether every image has a depth image.
    has_depth: bool,
    /// Whether every image states the policy of its labels.
    has_policy: bool,
    /// Ignored fields, first of images and then of each kind of record of the format.
    unkept: Vec<Unkept>,
}

impl AnnotationFile {
    /// Opens the annotation file of a dataset whose images are in the folder that the user names, or else in one of
    /// `folders`. `records` names the kinds of
    /// records of the format, in the plural, each with the fields in its `extra` that are read. `each` visits every
    /// annotation, and counts the unread fields of its records.
    pub fn open<A: AnnotationRecord>(
        source: &Source,
        root: &DatasetFolder,
        file: &Path,
        folders: &[impl AsRef<Path>],
        records: &[(&'static str, &'static [&'static str])],
        each: &mut dyn FnMut(&A, &mut [Unkept]),
    ) -> Result<Self> {
        let (mut has_depth, mut has_policy, mut depth_files) = (true, true, Vec::new());
        let of_records = [("images", OF_IMAGES)].iter().chain(records).map(|(of, read)| Unkept::new(of, read));
        let mut unkept: Vec<Unkept> = of_records.collect();
        let listing =
            AnnotationListing::open(file, &mut |record: &IndexedRecord<CocoImage, A, IgnoredAny>| match record {
                IndexedRecord::Annotation(annotation) => each(annotation, &mut unkept[1..]),
                IndexedRecord::Image(image) => {
                    count_unkept(&mut unkept[0], image);
                    let depth = depth_file(image);
                    has_depth &= depth.is_some();
                    depth_files.extend(depth.filter(|_| source.image_folder.is_some()).map(str::to_owned));
                    has_policy &= policy(image).is_some();
                }
                IndexedRecord::Scene(_) => {}
            })?;
        let [has_depth, has_policy] = [has_depth, has_policy].map(|has| has && !listing.images.is_empty());
        let (images_root, by_last_part) = match &source.image_folder {
            Some(folder) => named_root(source.folder(folder)?, &listing, &depth_files)?,
            None => (images_root(root, folders, &listing), false),
        };
        Ok(Self { listing, images_root, by_last_part, has_depth, has_policy, unkept })
    }

    /// The same file if its images are not in this folder, which has other images of the same names: without the color images, it
    /// is the only one that has them.
    pub fn with_images_outside(mut self, folder: &DatasetFolder, expected: DatasetFolder) -> Self {
        if self.images_root.path() == folder.path() {
            self.images_root = expected;
        }
        self
    }

    /// The categories that the file lists.
    ///
    /// # Errors
    /// If the file has no list of categories.
    pub fn categories(&self) -> Result<&[Category]> {
        let missing = || Error::new("missing field `categories`").in_file(self.listing.file.path());
        self.listing.file.categories.as_deref().ok_or_else(missing)
    }

    /// Name, program and categories of the dataset.
    pub fn info(&self, categories: &Categories) -> DatasetInfo {
        let about = &self.listing.file.info;
        categories.info(about.description.clone(), about.contributor.clone(), &self.listing.refs, String::new())
    }

    /// Whether this program wrote the file.
    pub fn is_ours(&self) -> bool {
        self.listing.file.info.contributor.starts_with("syntable ")
    }

    /// The products that the dataset offers: labels, color and, if every image has them and `others` contains them,
    /// depth and the policy of labels.
    pub fn offers(&mut self, labels: Vec<KeyId>, others: &[KeyId]) -> Vec<KeyId> {
        self.has_depth &= others.contains(&DEPTH.id());
        self.has_policy &= others.contains(&LABEL_POLICY.id());
        let others = [
            (true, RGB.id()),
            (true, RGB_FILE.id()),
            (self.has_depth, DEPTH.id()),
            (self.has_policy, LABEL_POLICY.id()),
        ];
        labels.into_iter().chain(others.into_iter().filter(|it| it.0).map(|it| it.1)).collect()
    }

    /// The note about lost supercategories, if the reader does not keep the ids of categories.
    pub fn supercategories(&self) -> Option<Note> {
        let all = self.listing.file.categories.iter().flatten();
        let names: BTreeSet<&str> = all.map(|category| category.supercategory.as_str()).collect();
        // A single supercategory for all categories carries no information.
        let tells = names.len() > 1 && self.info(&self.listing.categories).own_categories.is_empty();
        let text = "of categories, names alone are read: supercategories are left out, since some ids are not kept";
        tells.then(|| Note::caveat(text).of([CATEGORY_ID.id()]))
    }

    /// Notes about ignored content: information, unless this program wrote the dataset, where it is always the same;
    /// and fields that may be labels, for stages that read labels.
    pub fn not_kept(&self, offers: &[KeyId]) -> Vec<Note> {
        let of_records = self.unkept.iter().flat_map(Unkept::information);
        let all: Vec<String> = self.listing.information().into_iter().chain(of_records).collect();
        let information = unkept::note(&all).filter(|_| !self.is_ours()).map(Note::caveat);
        let labels = labels_among(offers);
        let not_kept = self.unkept.iter().flat_map(Unkept::labels);
        information.into_iter().chain(not_kept.map(|it| Note::not_kept(it).of(labels.clone()))).collect()
    }

    /// The dataset, with the notes of the listing before `notes`.
    pub fn opened(self, info: DatasetInfo, offers: Vec<KeyId>, notes: Vec<Note>, annotated: impl Annotated) -> Opened {
        let Self { listing, images_root, by_last_part, has_depth, has_policy, unkept } = self;
        let mut opened = listing.opened(info, offers, |listing| FamilySource {
            file: Self { listing, images_root, by_last_part, has_depth, has_policy, unkept },
            annotated,
        });
        opened.notes.extend(notes);
        opened
    }

    /// Width and height of an image, px.
    pub fn size(&self, image: usize) -> [u32; 2] {
        let frame = &self.listing.images[image].frame;
        [frame.width, frame.height]
    }

    /// Whether occlusion rates of an image count parts outside the image, which no mask contains.
    pub fn counts_beyond(&self, image: usize) -> Result<bool> {
        Ok(self.has_policy && policy(&self.listing.image(image)?).is_some_and(extends))
    }

    /// The name of an image, of color or depth, in the folder of the images.
    fn name_in_folder<'n>(&self, name: &'n str) -> &'n str {
        if self.by_last_part { last_part(name) } else { name }
    }

    /// Adds color, depth and the policy of labels, where requested.
    fn put_images(&self, image: usize, wants: &[KeyId], products: &mut Products) -> Result<()> {
        let size = self.size(image);
        if [RGB.id(), RGB_FILE.id()].iter().any(|key| wants.contains(key)) {
            let name = self.listing.images[image].frame.file_name.as_str();
            let path = self.images_root.file(self.name_in_folder(name))?;
            let content = FileContent::read(&path).map_err(|error| match path.exists() {
                true => error,
                false => error.help("name the folder of the images with `options.image_folder`"),
            })?;
            content.stated(size).put_rgb(wants, products)?;
        }
        let wanted = |has: bool, key: KeyId| has && wants.contains(&key);
        let (depth, policy) = (wanted(self.has_depth, DEPTH.id()), wanted(self.has_policy, LABEL_POLICY.id()));
        if depth || policy {
            let record: CocoImage = self.listing.image(image)?;
            if depth {
                let path = self.images_root.file(self.name_in_folder(depth_file(&record).unwrap_or_default()))?;
                products.put(DEPTH, decode::depth_of_size(&path, DEPTH_UNIT_MM, size)?)?;
            }
            if policy {
                products.put(LABEL_POLICY, Value::of(&record.extra[LABEL_POLICY.name()])?)?;
            }
        }
        Ok(())
    }
}

/// Names of the first images.
fn first_names(listing: &AnnotationListing) -> impl Iterator<Item = &str> {
    listing.images.iter().take(LOOKED_UP).map(|it| it.frame.file_name.as_str())
}

/// The folder of the images: one of `folders`, the only one that has the images, or else the first of `folders`.
fn images_root(root: &DatasetFolder, folders: &[impl AsRef<Path>], listing: &AnnotationListing) -> DatasetFolder {
    let has = |folder: &DatasetFolder| first_names(listing).any(|image| folder.has(image));
    let inner = || folders.iter().map(|name| root.inner(name));
    let found = inner().find(has).or_else(|| only_folder(root, has)).or_else(|| inner().next());
    found.unwrap_or_else(|| root.clone())
}

/// The folder that the user names, and whether it has the images by the last parts of their names alone: LVIS' names begin with
/// the folder, as in `val2017/000000317999.jpg`.
///
/// # Errors
/// If it has them so, and two images would be one file.
fn named_root(
    folder: DatasetFolder,
    listing: &AnnotationListing,
    depth_files: &[String],
) -> Result<(DatasetFolder, bool)> {
    let has = |of: fn(&str) -> &str| first_names(listing).any(|name| folder.has(of(name)));
    if has(|name| name) || !has(last_part) {
        return Ok((folder, false));
    }
    let images = listing.images.iter().map(|image| image.frame.file_name.as_str());
    let mut names = BTreeMap::new();
    for name in images.chain(depth_files.iter().map(String::as_str)) {
        let other = *names.entry(last_part(name)).or_insert(name);
        if other != name {
            let message = format!("`{other}` and `{name}` would be one file in {}", shown(&folder.path()).display());
            let help = format!("`options.image_folder`: name the folder that contains `{other}` under this whole name");
            return Err(Error::new(message).help(help).of_request());
        }
    }
    Ok((folder, true))
}

/// The name of a file without its folders.
fn last_part(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

struct FamilySource<A> {
    file: AnnotationFile,
    annotated: A,
}

impl<A: Annotated> FamilySource<A> {
    /// Reads an image, and its records if labels are wanted.
    fn read_records(&self, image: usize, wants: &[KeyId]) -> Result<(ReadImage, Option<A::Records>)> {
        let (mut products, mut records) = (Products::new(), None);
        if !labels_among(wants).is_empty() {
            let read = records.insert(self.annotated.records(&self.file, image)?);
            self.annotated.put(&self.file, image, read, wants, &mut products)?;
        }
        self.file.put_images(image, wants, &mut products)?;
        Ok((ReadImage::new(self.file.size(image), products), records))
    }
}

impl<A: Annotated> ImageSource for FamilySource<A> {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        self.read_records(image, wants).map(|(read, _)| read)
    }

    fn read_with_faults(&self, image: usize, wants: &[KeyId]) -> Result<(ReadImage, Vec<DatasetFault>)> {
        let (read, records) = self.read_records(image, wants)?;
        let faults = match records {
            Some(records) => self.annotated.faults(&self.file, image, &records),
            None => self.image_faults(image),
        };
        Ok((read, faults))
    }

    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        self.annotated.crowds(&self.file, image)
    }

    fn subjects(&self, image: usize) -> BTreeMap<InstanceId, FaultSubject> {
        self.annotated.subjects(&self.file, image)
    }

    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        let records = self.annotated.records(&self.file, image);
        records.map_or_else(|_| Vec::new(), |records| self.annotated.faults(&self.file, image, &records))
    }
}

/// Possible folders of images next to `annotations`, in COCO and in other datasets: `images`, and names with the split.
pub fn image_folders(file: &Path) -> [String; 5] {
    let split = file.file_stem().and_then(|stem| stem.to_str()?.rsplit('_').next()).unwrap_or_default();
    ["images".into(), split.into(), format!("{split}2017"), format!("{split}2014"), ".".into()]
}

/// The note about annotations that do not describe objects, such as crowds, for stages that read labels.
pub fn not_objects(offers: &[KeyId], count: usize, of: usize, what: &'static str) -> Note {
    Note::not_objects(LeftOut::new(count, of, what)).of(labels_among(offers))
}

/// The policy of labels that an image's record states.
fn policy(image: &CocoImage) -> Option<&Json> {
    image.extra.get(LABEL_POLICY.name())
}

/// Whether a policy of labels counts parts of objects outside the image.
pub fn extends(policy: &Json) -> bool {
    policy["image_frame"] == "extend"
}

/// Path of the depth image of an image.
fn depth_file(image: &CocoImage) -> Option<&str> {
    image.extra.get(DEPTH_FILE)?.as_str()
}

/// Counts the unread fields of an image's record.
fn count_unkept(unkept: &mut Unkept, image: &CocoImage) {
    unkept.add(&image.extra);
    let CocoImage { license, date_captured, coco_url, flickr_url, .. } = image;
    unkept.add_information("license", license.is_some());
    for (name, text) in [("date_captured", date_captured), ("coco_url", coco_url), ("flickr_url", flickr_url)] {
        let is_empty = |json: &Json| json.is_null() || json.as_str().is_some_and(str::is_empty);
        unkept.add_information(name, text.as_ref().is_some_and(|text| !is_empty(text)));
    }
}
