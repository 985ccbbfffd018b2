//! Datasets that are read back, in any format.
//!
//! A reader offers the products of each image, as a renderer does. Annotators, writers and checks do not know their origin.
//! Crates register formats with [`register_format!`](crate::register_format).

use crate::check::{LabelCheck, LabelFault};
use crate::error::{Error, Result};
use crate::files::{DatasetFolder, Reach};
use crate::left_out::LeftOut;
use crate::linked::Linked;
use crate::mirror::Mirror;
use crate::panics::guarded;
use crate::product::standard::RGB_FILE;
use crate::product::{KeyId, Mask, Products};
use crate::rule;
use crate::scene::{InstanceId, SceneId, ViewId};
use crate::shown::shown;
use crate::stage::DatasetInfo;
use crate::store::{StoreFolder, is_url};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A format of datasets that can be read. Crates register a [`Format`]; a program may add a format with state of its own
/// ([`Registry::with_formats`](crate::registry::Registry::with_formats)).
pub trait DatasetFormat: Send + Sync {
    /// Its name, as users write it. [`intern`](crate::intern::intern) makes one at run time.
    fn name(&self) -> &'static str;
    /// Description, in one sentence.
    fn doc(&self) -> &str;
    /// Whether a folder looks like a dataset of the format, or a file like its annotation file. Callers use
    /// [`detects`](#method.detects).
    fn looks_like(&self, path: &Path) -> bool;
    /// Reads a dataset without its images, from its folder or annotation file. Readers look up names of files in the
    /// dataset in [`Source::folder`], so that they lead nowhere else. Callers use [`open`](#method.open).
    ///
    /// # Errors
    /// If the path is not a dataset of the format, or nothing of it can be read.
    fn read(&self, source: &Source) -> Result<Opened>;
    /// Whether it holds products under their names, as generic writers write them. A dataset with a layout of its own
    /// takes precedence.
    fn is_generic(&self) -> bool {
        false
    }
    /// Whether its images may be in a folder that the user names; see [`Source::image_folder`].
    fn takes_image_folder(&self) -> bool {
        false
    }
    /// Whether it is recognized only in the folder that the user names, and only if that is no known dataset.
    fn is_fallback(&self) -> bool {
        false
    }
    /// The crate or program that registers it, for messages.
    fn owner(&self) -> &str;
}

impl dyn DatasetFormat + '_ {
    /// Opens a dataset. A panic of its reader, now or later, becomes an error that names the dataset: a reader may use
    /// libraries that panic on damaged files.
    ///
    /// # Errors
    /// If the path is not a dataset of the format, or nothing of it can be read.
    pub fn open(&self, source: &Source) -> Result<OpenDataset> {
        if source.image_folder.is_some() && !self.takes_image_folder() {
            let message = format!("`options.image_folder`: the format {} fixes where its images are", self.name());
            return Err(Error::new(message)
                .in_file(&source.path)
                .help("leave out `options.image_folder`")
                .of_request());
        }
        OpenDataset::open(self.name(), source, || self.read(source))
    }

    /// Whether a folder or a file is a dataset of the format by its looks. False for a [fallback](#method.is_fallback), and
    /// if the reader panics on it.
    pub fn detects(&self, path: &Path) -> bool {
        !self.is_fallback() && self.is_like(path)
    }

    /// Whether the format is a [fallback](#method.is_fallback) that can read a folder. False if the reader panics on it.
    pub fn falls_back_to(&self, path: &Path) -> bool {
        self.is_fallback() && self.is_like(path)
    }

    fn is_like(&self, path: &Path) -> bool {
        guarded(&format!("the reader of {}", self.name()), path, || Ok(self.looks_like(path))).unwrap_or(false)
    }
}

/// A format of a crate, without state. Registered with [`register_format!`](crate::register_format).
#[derive(Clone, Copy)]
pub struct Format {
    /// Its name, as users write it.
    pub name: &'static str,
    /// Description, in one sentence.
    pub doc: &'static str,
    /// Whether a folder looks like one; see [`DatasetFormat::looks_like`].
    pub detect: fn(&Path) -> bool,
    /// Reads a dataset without its images; see [`DatasetFormat::read`].
    pub open: fn(&Source) -> Result<Opened>,
    /// Whether it holds products under their names; see [`DatasetFormat::is_generic`].
    pub is_generic: bool,
    /// Whether its images may be elsewhere; see [`DatasetFormat::takes_image_folder`].
    pub takes_image_folder: bool,
    /// Whether it is recognized last; see [`DatasetFormat::is_fallback`].
    pub is_fallback: bool,
    /// Crate that registers it.
    pub crate_name: &'static str,
}

inventory::collect!(Linked<Format>);

impl Format {
    /// A format whose datasets have a layout of their own. [`register_format!`](crate::register_format) names the crate.
    pub const fn new(
        name: &'static str,
        doc: &'static str,
        detect: fn(&Path) -> bool,
        open: fn(&Source) -> Result<Opened>,
    ) -> Self {
        let (is_generic, takes_image_folder, is_fallback) = (false, false, false);
        Self { name, doc, detect, open, is_generic, takes_image_folder, is_fallback, crate_name: "" }
    }

    /// The same format if its datasets hold products under their names; see [`DatasetFormat::is_generic`].
    pub const fn generic(self) -> Self {
        Self { is_generic: true, ..self }
    }

    /// The same format if its images may be elsewhere; see [`DatasetFormat::takes_image_folder`].
    pub const fn with_image_folder(self) -> Self {
        Self { takes_image_folder: true, ..self }
    }

    /// The same format if it is recognized last; see [`DatasetFormat::is_fallback`].
    pub const fn as_fallback(self) -> Self {
        Self { is_fallback: true, ..self }
    }
}

impl DatasetFormat for Format {
    fn name(&self) -> &'static str {
        self.name
    }

    fn doc(&self) -> &str {
        self.doc
    }

    fn looks_like(&self, path: &Path) -> bool {
        (self.detect)(path)
    }

    fn read(&self, source: &Source) -> Result<Opened> {
        (self.open)(source)
    }

    fn is_generic(&self) -> bool {
        self.is_generic
    }

    fn takes_image_folder(&self) -> bool {
        self.takes_image_folder
    }

    fn is_fallback(&self) -> bool {
        self.is_fallback
    }

    fn owner(&self) -> &str {
        self.crate_name
    }
}

/// Registers formats of the crate that calls it.
#[macro_export]
macro_rules! register_format {
    ($($format:expr),+ $(,)?) => {$(
        $crate::link!($crate::reader::Format { crate_name: env!("CARGO_PKG_NAME"), ..$format });
    )+};
}

/// Recognizes datasets that no format reads, so that an error names their kind and a way out. Registered with
/// [`register_unread!`](crate::register_unread).
pub struct Unread {
    /// Names the kind of a folder or a file in an error with a remedy; none if the kind is not known.
    pub recognize: fn(&Path) -> Option<Error>,
    /// Crate that registers it.
    pub crate_name: &'static str,
}

inventory::collect!(Unread);

impl Unread {
    /// The kind of a folder or a file, if a linked crate knows it. None if the function panics.
    pub(crate) fn known(path: &Path) -> Option<Error> {
        let mut all: Vec<&Self> = inventory::iter::<Self>.into_iter().collect();
        all.sort_by_key(|it| it.crate_name);
        all.into_iter().find_map(|it| guarded(it.crate_name, path, || Ok((it.recognize)(path))).ok().flatten())
    }
}

/// Registers a function that recognizes datasets that no format reads.
#[macro_export]
macro_rules! register_unread {
    ($recognize:expr) => {
        $crate::inventory::submit! {
            $crate::reader::Unread { recognize: $recognize, crate_name: env!("CARGO_PKG_NAME") }
        }
    };
}

/// The path that a user names as a dataset.
#[derive(Debug, Clone)]
pub struct Source {
    /// Its folder, or its annotation file.
    pub path: PathBuf,
    /// How far names and links in it may reach.
    pub reach: Reach,
    /// The folder of its images if the user names it; otherwise it is found by the layout of the format. Images may be in it by their
    /// whole names, or by the last parts of their names alone if these differ.
    pub image_folder: Option<PathBuf>,
    /// The mirrors of URLs that the user named. They last as long as the source, and the dataset that it opens.
    mirrors: Vec<Arc<Mirror>>,
}

impl Source {
    /// A dataset on this machine whose names and links lead nowhere else.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), reach: Reach::Inside, image_folder: None, mirrors: Vec::new() }
    }

    /// A dataset at a path of this machine or at a URL, with its images in the folder at a path or a URL if one is named. A
    /// [`Mirror`] serves a URL.
    ///
    /// # Errors
    /// If nothing is at a URL, or its store cannot be read.
    pub fn at_name(path: &Path, image_folder: Option<&Path>) -> Result<Self> {
        let mut mirrors = Vec::new();
        let mut local = |path: &Path| match path.to_str().filter(|name| is_url(name)) {
            // Refuses URLs that lost a slash.
            None => StoreFolder::at(path).map(|_| path.to_owned()),
            Some(url) => {
                let (mirror, path) = Mirror::open(url)?;
                mirrors.push(mirror);
                Ok(path)
            }
        };
        let (path, image_folder) = (local(path)?, image_folder.map(local).transpose()?);
        Ok(Self { image_folder, mirrors, ..Self::new(path) })
    }

    /// The same source. If `is_trusted`, its names and links may lead anywhere; otherwise they must stay inside.
    pub fn trusting(self, is_trusted: bool) -> Self {
        Self { reach: if is_trusted { Reach::Anywhere } else { Reach::Inside }, ..self }
    }

    /// The same source with its images in this folder of this machine.
    pub fn with_images_in(self, image_folder: Option<PathBuf>) -> Self {
        Self { image_folder, ..self }
    }

    /// The name that the user knows: the path, or the URL that a mirror serves.
    pub fn name(&self) -> PathBuf {
        shown(&self.path)
    }

    /// Why a download failed since the last call, if one did; see [`Mirror::take_outage`].
    pub fn take_outage(&self) -> Option<Error> {
        outage(&self.mirrors)
    }

    /// Whether files are downloaded from URLs.
    pub fn is_remote(&self) -> bool {
        !self.mirrors.is_empty()
    }

    /// The same source at another path.
    pub fn at(&self, path: &Path) -> Self {
        Self { path: path.to_owned(), ..self.clone() }
    }

    /// Opens a folder. Nothing in the dataset may lead out of it, unless the reach is wider. `path` is the path that
    /// the user named, or follows from it by names that the format fixes.
    ///
    /// # Errors
    /// If it cannot be found.
    pub fn folder(&self, path: &Path) -> Result<DatasetFolder> {
        DatasetFolder::open(path, self.reach)
    }
}

fn outage(mirrors: &[Arc<Mirror>]) -> Option<Error> {
    mirrors.iter().find_map(|mirror| mirror.take_outage())
}

/// An open dataset: plain data, and the source of its images.
pub struct Opened {
    /// Name, number of scenes and views, classes.
    pub info: DatasetInfo,
    /// The images, ordered by scene and view.
    pub images: Vec<ImageRef>,
    /// The products that images have.
    pub offers: Vec<KeyId>,
    /// Products among these that follow from others: leaving them unread loses no information.
    pub derived: Vec<KeyId>,
    /// Interchangeable products: reading either of a pair loses no information.
    pub alike: Vec<[KeyId; 2]>,
    /// Faults of the dataset beyond single images, found while opening: files or records that contradict each other.
    pub faults: Vec<DatasetFault>,
    /// Whether images without objects are listed: a dataset without images is then at fault.
    pub lists_all_images: bool,
    /// Names of label checks that the format does not demand: COCO, for one, allows masks to overlap.
    pub waived: Vec<&'static str>,
    /// Ids of the annotation file's categories, each with the id of the category in `info`; none if they are the same.
    pub category_ids: Option<BTreeMap<u64, u32>>,
    /// The gaps of the products.
    pub notes: Vec<Note>,
    /// Reads the images.
    pub source: Box<dyn ImageSource>,
}

impl Opened {
    /// A dataset without derived products, faults and gaps, which lists all images.
    pub fn new(
        info: DatasetInfo,
        images: Vec<ImageRef>,
        offers: Vec<KeyId>,
        source: impl ImageSource + 'static,
    ) -> Self {
        Self {
            info,
            images,
            offers,
            derived: Vec::new(),
            alike: Vec::new(),
            faults: Vec::new(),
            lists_all_images: true,
            waived: Vec::new(),
            category_ids: None,
            notes: Vec::new(),
            source: Box::new(source),
        }
    }

    /// Whether a product follows from others: leaving it unread loses no information.
    pub fn is_derived(&self, key: &KeyId) -> bool {
        *key == RGB_FILE.id() || self.derived.contains(key)
    }
}

/// Reads the images of a dataset. Images are numbered by their place in [`Opened::images`].
pub trait ImageSource: Send + Sync {
    /// Reads the wanted products of an image that it has.
    ///
    /// # Errors
    /// If a file or record cannot be read; the message names it.
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage>;
    /// Regions of an image with objects that are not separated, such as COCO's crowds. They are not objects. A score
    /// ignores detections in them.
    ///
    /// # Errors
    /// If they cannot be read.
    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        let _ = image;
        Ok(Vec::new())
    }
    /// The records that describe the objects of an image, for objects whose ids the dataset does not state: messages name the
    /// records instead.
    fn subjects(&self, image: usize) -> BTreeMap<InstanceId, FaultSubject> {
        let _ = image;
        BTreeMap::new()
    }
    /// The rules that records of an image break, beyond its products. Records that cannot be read are skipped, and
    /// [`DatasetFault::image`] may stay empty.
    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        let _ = image;
        Vec::new()
    }
    /// Reads an image and the rules that its records break. A reader whose products and faults come from the same records reads
    /// these once.
    ///
    /// # Errors
    /// As of [`read`](Self::read).
    fn read_with_faults(&self, image: usize, wants: &[KeyId]) -> Result<(ReadImage, Vec<DatasetFault>)> {
        Ok((self.read(image, wants)?, self.image_faults(image)))
    }
    /// Faults of files that images do not need, such as meshes.
    fn other_faults(&self) -> Vec<DatasetFault> {
        Vec::new()
    }
}

/// An image that was read.
#[derive(Clone)]
pub struct ReadImage {
    /// Width and height, px.
    pub size: [u32; 2],
    /// The wanted products that it has.
    pub products: Products,
    /// Annotations of the image that are not given as objects.
    pub left_out: Vec<LeftOut>,
    /// Why parts of products are missing, such as meshes of objects: files that cannot be read.
    pub unread: Vec<Error>,
}

impl ReadImage {
    /// An image that was read completely.
    pub fn new(size: [u32; 2], products: Products) -> Self {
        Self { size, products, left_out: Vec::new(), unread: Vec::new() }
    }
}

/// A gap of a dataset's products.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    lack: Lack,
    /// The products that it concerns; none means all products.
    concerns: Option<Vec<KeyId>>,
    /// A product whose readers it does not concern.
    unless: Option<KeyId>,
}

/// A kind of gap.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Lack {
    Caveat(String),
    NotObjects(LeftOut),
    NotKept(LeftOut),
}

impl Note {
    /// A text for users: the information that the products lack, compared with products of a run.
    pub fn caveat(text: impl Into<String>) -> Self {
        Self { lack: Lack::Caveat(text.into()), concerns: None, unless: None }
    }

    /// Annotations that are not given as objects, such as crowds, counted over all images: writers never see them.
    pub fn not_objects(left_out: LeftOut) -> Self {
        Self { lack: Lack::NotObjects(left_out), concerns: None, unless: None }
    }

    /// Fields with labels, such as keypoints and attributes, that no product holds: a conversion loses them. Each is counted over
    /// all records of the dataset.
    pub fn not_kept(left_out: LeftOut) -> Self {
        Self { lack: Lack::NotKept(left_out), concerns: None, unless: None }
    }

    /// The same note, for readers of one of these products only.
    pub fn of(self, products: impl IntoIterator<Item = KeyId>) -> Self {
        Self { concerns: Some(products.into_iter().collect()), ..self }
    }

    /// The same note, except for readers of this product, which has what the other products lack.
    pub fn unless(self, product: KeyId) -> Self {
        Self { unless: Some(product), ..self }
    }

    fn concerns(&self, reads: &[KeyId]) -> bool {
        if self.unless.is_some_and(|product| reads.contains(&product)) {
            return false;
        }
        self.concerns.as_ref().is_none_or(|concerns| concerns.iter().any(|key| reads.contains(key)))
    }
}

/// An open dataset. A panic of its reader becomes an error that names the dataset.
pub struct OpenDataset {
    opened: Opened,
    /// The reader's name in messages.
    reader: String,
    root: PathBuf,
    /// Dropped after the reader, which reads files of them.
    mirrors: Vec<Arc<Mirror>>,
    /// All faults, computed at their first use.
    faults: OnceLock<Vec<DatasetFault>>,
}

impl OpenDataset {
    /// Opens a dataset by a function that is not registered as a format. `reader` is the name of the format, for messages.
    ///
    /// # Errors
    /// The errors of the function. A panic in it becomes an error, too.
    pub fn open(reader: &str, source: &Source, open: impl FnOnce() -> Result<Opened>) -> Result<Self> {
        let (reader, root) = (format!("the reader of {reader}"), source.path.clone());
        let opened = guarded(&reader, &root, open);
        if let Some(error) = source.take_outage() {
            return Err(error);
        }
        let opened = opened?;
        Ok(Self { opened, reader, root, mirrors: source.mirrors.clone(), faults: OnceLock::new() })
    }

    /// Reads an image; see [`ImageSource::read`].
    ///
    /// # Errors
    /// If a file or record cannot be read; the message names it.
    pub fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let read = guarded(&self.reader, &self.root, || self.opened.source.read(image, wants));
        match outage(&self.mirrors) {
            Some(error) => Err(error),
            None => read,
        }
    }

    /// Why a download failed, if no call has reported it yet: faults that were found may then be the network's.
    pub fn take_outage(&self) -> Option<Error> {
        outage(&self.mirrors)
    }

    /// Regions of an image with objects that are not separated; see [`ImageSource::crowds`].
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        guarded(&self.reader, &self.root, || self.opened.source.crowds(image))
    }

    /// Whether a check applies to the products of an image: all its inputs are present, and the format demands it.
    pub fn demands(&self, check: &dyn LabelCheck, products: &Products) -> bool {
        !self.opened.waived.contains(&check.name()) && check.applies(products)
    }

    /// Faults that a check finds in the products of an image, one sentence each; none if the format does not demand the check.
    /// They name objects by the records of the dataset.
    ///
    /// # Errors
    /// If a product cannot be read.
    pub fn label_faults(&self, image: usize, check: &dyn LabelCheck, products: &Products) -> Result<Vec<String>> {
        if !self.demands(check, products) {
            return Ok(Vec::new());
        }
        let faults = check.faults(products)?;
        let has_subjects = faults.iter().any(|fault| fault.instance.is_some());
        let subjects = if has_subjects { self.subjects(image) } else { BTreeMap::new() };
        let text = |fault: LabelFault| match fault.instance.and_then(|id| subjects.get(&id)) {
            Some(subject) => format!("{subject}: {}", fault.message),
            None => fault.to_string(),
        };
        Ok(faults.into_iter().map(text).collect())
    }

    /// The records of the objects of an image; see [`ImageSource::subjects`].
    fn subjects(&self, image: usize) -> BTreeMap<InstanceId, FaultSubject> {
        guarded(&self.reader, &self.root, || Ok(self.opened.source.subjects(image))).unwrap_or_default()
    }

    /// The rules that records of an image break, beyond its products; see [`ImageSource::image_faults`].
    pub fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        let found = guarded(&self.reader, &self.root, || Ok(self.opened.source.image_faults(image)));
        let found = found.unwrap_or_else(|error| vec![DatasetFault::new(rule::READABLE, error.to_string())]);
        of_image(image, found)
    }

    /// As [`read`](Self::read) and then [`image_faults`](Self::image_faults), in less time.
    ///
    /// # Errors
    /// If a file or record cannot be read; the message names it.
    pub fn read_with_faults(&self, image: usize, wants: &[KeyId]) -> Result<(ReadImage, Vec<DatasetFault>)> {
        match guarded(&self.reader, &self.root, || Ok(self.opened.source.read_with_faults(image, wants))) {
            Ok(read) => match outage(&self.mirrors) {
                Some(error) => Err(error),
                None => read.map(|(read, found)| (read, of_image(image, found))),
            },
            // The reader panicked. If its faults are the cause, the image is readable.
            Err(_) => self.read(image, wants).map(|read| (read, self.image_faults(image))),
        }
    }

    /// Faults of the dataset beyond single images. The first call may read many files; [`Opened::faults`] has the
    /// faults that were found while opening.
    pub fn all_faults(&self) -> &[DatasetFault] {
        self.faults.get_or_init(|| self.find_faults())
    }

    fn find_faults(&self) -> Vec<DatasetFault> {
        let others = guarded(&self.reader, &self.root, || Ok(self.opened.source.other_faults()));
        let others = others.unwrap_or_else(|error| {
            vec![DatasetFault::new(rule::READABLE, error.to_string()).of(self.root.display().to_string())]
        });
        self.opened.faults.iter().cloned().chain(others).collect()
    }

    /// The id in [`info`](Opened::info) of the category with the id `own` in the annotation file; none if the file has
    /// no such category.
    pub fn category(&self, own: u64) -> Option<u32> {
        match &self.category_ids {
            Some(ids) => ids.get(&own).copied(),
            None => self.info.categories().map(|(id, _)| id).find(|id| u64::from(*id) == own),
        }
    }

    /// Texts for users: the information that these products lack, compared with products of a run.
    pub fn caveats(&self, reads: &[KeyId]) -> Vec<String> {
        self.lacks(reads, |lack| if let Lack::Caveat(text) = lack { Some(text.clone()) } else { None })
    }

    /// Annotations that are not given as objects; see [`Note::not_objects`]. [`ReadImage::left_out`] has such
    /// annotations of single images.
    pub fn not_objects(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        self.lacks(reads, |lack| if let Lack::NotObjects(of) = lack { Some(of.clone()) } else { None })
    }

    /// Fields with labels that no product holds; see [`Note::not_kept`].
    pub fn not_kept(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        self.lacks(reads, |lack| if let Lack::NotKept(of) = lack { Some(of.clone()) } else { None })
    }

    fn lacks<T>(&self, reads: &[KeyId], of: impl Fn(&Lack) -> Option<T>) -> Vec<T> {
        self.notes.iter().filter(|note| note.concerns(reads)).filter_map(|note| of(&note.lack)).collect()
    }
}

/// Faults that name their image.
fn of_image(image: usize, faults: Vec<DatasetFault>) -> Vec<DatasetFault> {
    faults.into_iter().map(|fault| DatasetFault { image: Some(image), ..fault }).collect()
}

impl Deref for OpenDataset {
    type Target = Opened;

    fn deref(&self) -> &Opened {
        &self.opened
    }
}

/// An image of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageRef {
    /// Its scene; of a format without scenes, a number of its own.
    pub scene: SceneId,
    /// Its view.
    pub view: ViewId,
    /// Its name in the dataset, such as its path.
    pub name: String,
    /// The number that the dataset's annotation file gives it; none in formats without such numbers.
    pub id: Option<u64>,
}

/// Name of an object, or of its category, if a dataset has only its number.
pub fn unnamed_object(number: u64) -> String {
    format!("obj_{number:06}")
}

/// Name of a category if a dataset has only its number.
pub fn unnamed_category(number: u64) -> String {
    format!("category_{number}")
}

/// Name of a class of YOLO if a dataset has only its number. `number` counts from 1, as ids of categories do; classes
/// count from 0.
pub fn unnamed_class(number: u64) -> String {
    format!("class {}", number.saturating_sub(1))
}

/// Whether a name is only the number of an object or a category.
pub fn is_unnamed(number: u64, name: &str) -> bool {
    [unnamed_object, unnamed_category, unnamed_class].iter().any(|of| of(number) == name)
}

/// A region of an image with objects that are not separated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crowd {
    /// Its pixels.
    pub mask: Mask,
    /// Id of the category of its objects.
    pub category: u32,
}

/// A rule that a dataset breaks, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DatasetFault {
    /// Id of the rule in snake case, such as `unique_ids`.
    pub rule: &'static str,
    /// The image whose records break the rule, as its place in [`Opened::images`]; none for the dataset as a whole.
    pub image: Option<usize>,
    /// The record or file that breaks the rule; none for an image as a whole.
    pub subject: Option<FaultSubject>,
    /// The fault of the subject.
    pub message: String,
    /// Whether the reader omits images because of the fault: it cannot read them, or cannot distinguish them.
    pub is_lost: bool,
}

/// A record or file that breaks a rule. Messages name it by its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FaultSubject {
    /// An annotation, by its id in the annotation file.
    Annotation(u64),
    /// A category, by its id in the annotation file.
    Category(u64),
    /// An image, by its id in the annotation file.
    Image(u64),
    /// An object, by its id in the image.
    Instance(InstanceId),
    /// A line of a text file, from 1.
    Line(usize),
    /// A scene, by its number.
    Scene(u32),
    /// A segment of an image, by its id.
    Segment(u32),
    /// A file, or a part of the dataset by its name.
    Name(String),
}

impl DatasetFault {
    /// A fault that has neither a subject nor an image yet. The reader omits no image because of it.
    pub fn new(rule: &'static str, message: impl Into<String>) -> Self {
        Self { rule, image: None, subject: None, message: message.into(), is_lost: false }
    }

    /// The same fault with its subject.
    pub fn of(self, subject: impl Into<FaultSubject>) -> Self {
        Self { subject: Some(subject.into()), ..self }
    }

    /// Place and text for users. If the fault is in an image, the place is the image's name and the text begins with
    /// the subject; otherwise the place is the subject.
    pub fn place_and_text(&self, images: &[ImageRef]) -> [String; 2] {
        match self.image {
            Some(image) => {
                let name = images.get(image).map_or_else(|| format!("image {image}"), |image| image.name.clone());
                [name, self.to_string()]
            }
            None => [self.subject.as_ref().map_or_else(String::new, FaultSubject::to_string), self.message.clone()],
        }
    }
}

/// The subject and the message.
impl fmt::Display for DatasetFault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.subject {
            Some(subject) => write!(f, "{subject}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

impl fmt::Display for FaultSubject {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Annotation(id) => write!(f, "annotation {id}"),
            Self::Category(id) => write!(f, "category {id}"),
            Self::Image(id) => write!(f, "image {id}"),
            Self::Instance(id) => write!(f, "instance {id}"),
            Self::Line(number) => write!(f, "line {number}"),
            Self::Scene(id) => write!(f, "scene {id}"),
            Self::Segment(id) => write!(f, "segment {id}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

impl From<String> for FaultSubject {
    fn from(name: String) -> Self {
        Self::Name(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source that panics in all its methods.
    struct Panicking;

    impl ImageSource for Panicking {
        fn read(&self, image: usize, _: &[KeyId]) -> Result<ReadImage> {
            panic!("image {image}")
        }
        fn other_faults(&self) -> Vec<DatasetFault> {
            panic!("faults")
        }
        fn image_faults(&self, _: usize) -> Vec<DatasetFault> {
            panic!("faults of an image")
        }
        fn crowds(&self, _: usize) -> Result<Vec<Crowd>> {
            panic!("crowds")
        }
    }

    #[test]
    fn panics_of_readers_are_errors_that_name_the_dataset() {
        let format = |open| -> Box<dyn DatasetFormat> { Box::new(Format::new("odd", "", |_| panic!("detect"), open)) };
        let root = Path::new("data/set");
        let says = |text: &str, what: &str| {
            assert!(
                text.contains("data/set: the reader of odd failed on it: panicked at ") && text.contains(what),
                "{text}"
            );
        };
        let error = format(|_| panic!("opening")).open(&Source::new(root)).err().expect("refused");
        says(&error.to_string(), "opening");
        assert!(!format(|_| panic!("opening")).detects(root));
        let opened = format(|_| {
            let info = DatasetInfo {
                name: String::new(),
                seed: 0,
                scenes: 0,
                views_per_scene: 0,
                recipe: String::new(),
                program: String::new(),
                classes: Vec::new(),
                own_categories: Vec::new(),
                label_surface: crate::stage::LabelSurface::First,
            };
            Ok(Opened::new(info, Vec::new(), Vec::new(), Panicking))
        })
        .open(&Source::new(root))
        .expect("opens");
        says(&opened.read(3, &[]).err().expect("refused").to_string(), "image 3");
        says(&opened.all_faults()[0].message, "faults");
        says(&opened.image_faults(0)[0].message, "faults of an image");
        says(&opened.crowds(0).expect_err("refused").to_string(), "crowds");
    }
}
