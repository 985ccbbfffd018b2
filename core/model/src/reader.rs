//! Datasets that are read back, in any format.
//!
//! A reader offers the products of each image, as a renderer does: what derives labels from labels, writes or checks them
//! does not know where they came from. Registered with [`register_format!`](crate::register_format).

use crate::error::{Error, Result};
use crate::files::{DatasetFolder, Reach};
use crate::left_out::LeftOut;
use crate::panics::guarded;
use crate::product::{KeyId, Mask, Products};
use crate::registry::Registry;
use crate::scene::{SceneId, View, ViewId};
use crate::stage::DatasetInfo;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A format of datasets that can be read.
#[derive(Clone, Copy)]
pub struct Format {
    /// Its name, as users write it.
    pub name: &'static str,
    /// What it is, in one sentence.
    pub doc: &'static str,
    /// Whether a folder looks like one, or a file like the annotation file of one. Callers use [`Format::detects`].
    pub detect: fn(&Path) -> bool,
    /// Opens a dataset by its folder, or by an annotation file of it. Names of files that the dataset has are looked up in
    /// [`Source::folder`], so that they lead nowhere else. An error says that there is none, or that nothing of it can be read.
    /// Callers use [`Format::open`].
    pub open: fn(&Source) -> Result<Box<dyn DatasetReader>>,
    /// Whether it holds products under their names, as generic writers write them. Beside a dataset of a layout, that one is
    /// opened.
    pub is_generic: bool,
    /// Crate that registers it.
    pub crate_name: &'static str,
}

inventory::collect!(Format);

impl Format {
    /// Opens a dataset. A panic of its reader, then and later, becomes an error that names the dataset: a reader may use
    /// libraries that panic on damaged files.
    pub fn open(&self, source: &Source) -> Result<Box<dyn DatasetReader>> {
        let (reader, root) = (format!("the reader of {}", self.name), source.path.as_path());
        let inner = guarded(&reader, root, || (self.open)(source))?;
        Ok(Box::new(Guarded { inner, reader, root: root.to_owned(), failed: OnceLock::new() }))
    }

    /// Whether a folder or a file looks like a dataset of the format. One on which the reader panics does not.
    pub fn detects(&self, path: &Path) -> bool {
        guarded(&format!("the reader of {}", self.name), path, || Ok((self.detect)(path))).unwrap_or(false)
    }
}

/// Registers formats.
#[macro_export]
macro_rules! register_format {
    ($($format:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $format }
    )+};
}

/// What a user names as a dataset.
#[derive(Debug, Clone)]
pub struct Source {
    /// Its folder, or an annotation file of it.
    pub path: PathBuf,
    /// How far names and links in it may reach.
    pub reach: Reach,
}

impl Source {
    /// A dataset whose names and links lead nowhere else.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), reach: Reach::Inside }
    }

    /// The same, with the reach of a dataset whose paths the user trusts or not.
    pub fn trusting(self, is_trusted: bool) -> Self {
        Self { reach: if is_trusted { Reach::Anywhere } else { Reach::Inside }, ..self }
    }

    /// A folder that nothing in the dataset leads out of, unless its reach is wider. It is the one that the user named, or
    /// follows from that by names that the format fixes.
    ///
    /// # Errors
    /// If it cannot be found.
    pub fn folder(&self, path: &Path) -> Result<DatasetFolder> {
        DatasetFolder::open(path, self.reach)
    }
}

impl Registry {
    /// Opens a dataset: of the format of a name, or of the one that it looks like.
    ///
    /// # Errors
    /// If nothing is there, it is no dataset of a known format, or of several, or nothing of it can be read.
    pub fn open_dataset(&self, source: &Source, format: Option<&str>) -> Result<(Format, Box<dyn DatasetReader>)> {
        let (format, source) = self.find_dataset(source, format)?;
        Ok((format, format.open(&source)?))
    }

    /// Finds the format of a dataset, and its folder or annotation file, without opening it: a folder that only holds a dataset
    /// is left for that one.
    ///
    /// # Errors
    /// If nothing is there, or it is no dataset of a known format, or of several.
    pub fn find_dataset(&self, source: &Source, format: Option<&str>) -> Result<(Format, Source)> {
        find(self.formats(), source, format)
    }
}

fn find(formats: &[Format], source: &Source, format: Option<&str>) -> Result<(Format, Source)> {
    let root = source.path.as_path();
    let names = || formats.iter().map(|format| format.name).collect::<Vec<_>>().join(", ");
    if !root.is_dir() && !root.is_file() {
        return Err(Error::new("there is no such folder or file").in_file(root).of_request());
    }
    if let Some(name) = format {
        let named = formats.iter().find(|it| it.name == name).copied();
        return named.map(|format| (format, source.clone())).ok_or_else(|| {
            Error::new(format!("`{name}` is no format that can be read"))
                .help(format!("these are: {}", names()))
                .of_request()
        });
    }
    // A dataset of a layout comes before what holds products under their names, wherever it is.
    for is_generic in [false, true] {
        let those = || formats.iter().filter(move |it| it.is_generic == is_generic);
        let found: Vec<&Format> = those().filter(|it| it.detects(root)).collect();
        match found.as_slice() {
            [only] => return Ok((**only, source.clone())),
            [] => {}
            [first, second, ..] => {
                return Err(Error::new(format!("it looks like {} and like {}", first.name, second.name))
                    .in_file(root)
                    .help("name the format with --format")
                    .of_request());
            }
        }
        let entries = std::fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.path());
        let is_one = |path: &PathBuf| path.is_dir() && those().any(|it| it.detects(path));
        let mut inside: Vec<PathBuf> = entries.filter(is_one).collect();
        if let [only] = inside.as_slice() {
            // It may be a link to what the user did not name.
            source.folder(root)?.file(only.file_name().unwrap_or_default())?;
        }
        inside.sort();
        match inside.as_slice() {
            // A writer's folder in a folder of its own, as `convert` makes it.
            [only] => return find(formats, &Source { path: only.clone(), reach: source.reach }, None),
            [] => {}
            [first, others @ ..] => {
                return Err(Error::new(format!("there are {} datasets in it", 1 + others.len()))
                    .in_file(root)
                    .help(format!("name one of them, such as {}", first.display()))
                    .of_request());
            }
        }
    }
    Err(Error::new("it looks like a dataset of no format that can be read")
        .in_file(root)
        .help(format!("name the format with --format: {}", names()))
        .of_request())
}

/// A dataset that is open.
pub trait DatasetReader: Send + Sync {
    /// Name, number of scenes and views, classes.
    fn info(&self) -> &DatasetInfo;
    /// The images, ordered by scene and view.
    fn images(&self) -> &[ImageRef];
    /// The products that images have.
    fn offers(&self) -> Vec<KeyId>;
    /// What is known of an image's camera, and the wanted products that it has. An error says which file or record
    /// cannot be read.
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<(View, Products)>;
    /// What is wrong with the dataset beyond single images: files or records that contradict each other.
    fn faults(&self) -> &[DatasetFault] {
        &[]
    }
    /// Those of the faults that are known without files beyond what images need; [`faults`](Self::faults) may read many.
    fn faults_of_opening(&self) -> &[DatasetFault] {
        self.faults()
    }
    /// Why parts of these products are left out, such as meshes of objects, in all images: files that cannot be read. Asked
    /// after images were read.
    fn left_out(&self, reads: &[KeyId]) -> Vec<Error> {
        let _ = reads;
        Vec::new()
    }
    /// What is wrong with the records of an image beyond its products: names of rules, and what breaks them. What cannot
    /// be read is not looked at.
    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let _ = image;
        Vec::new()
    }
    /// Those of the products that follow from others: nothing is lost if nobody reads them.
    fn derived(&self) -> Vec<KeyId> {
        Vec::new()
    }
    /// Pairs of products that say the same in other forms: if one is read, nothing of the other is lost.
    fn alike(&self) -> Vec<[KeyId; 2]> {
        Vec::new()
    }
    /// Whether images without objects are listed: a dataset without images is then at fault.
    fn lists_all_images(&self) -> bool {
        true
    }
    /// Regions of an image in which objects are there and not told apart, such as COCO's crowds. They are no objects; a score
    /// may neither count what is found in them nor hold it against a detector.
    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        let _ = image;
        Ok(Vec::new())
    }
    /// Annotations that are not given as objects, such as crowds, counted over all images: writers never see them. Asked after
    /// images were read for the products of `reads`.
    fn passed_over(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        let _ = reads;
        Vec::new()
    }
    /// Fields with labels, such as keypoints and attributes, that no product holds: a conversion loses them. Each is counted over
    /// all records of the dataset. Asked after images were read for the products of `reads`.
    fn not_kept(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        let _ = reads;
        Vec::new()
    }
    /// The category, by its id in [`info`](Self::info), that the annotation file calls `own`; none if it has no such category.
    fn category(&self, own: u64) -> Option<u32> {
        self.info().categories().map(|(id, _)| id).find(|id| u64::from(*id) == own)
    }
    /// In what products among these say less than those of a run, for people.
    fn caveats(&self, reads: &[KeyId]) -> Vec<String> {
        let _ = reads;
        Vec::new()
    }
}

/// Opens a dataset by a reader that is not registered, guarded as [`Format::open`] guards those that are.
pub fn open_guarded<R: DatasetReader + 'static>(
    name: &str,
    source: &Source,
    open: impl FnOnce() -> Result<R>,
) -> Result<Box<dyn DatasetReader>> {
    let (reader, root) = (format!("the reader of {name}"), source.path.as_path());
    let inner = Box::new(guarded(&reader, root, open)?);
    Ok(Box::new(Guarded { inner, reader, root: root.to_owned(), failed: OnceLock::new() }))
}

/// A reader whose panics become errors. It forwards every method of the trait: one that it left out would be the default.
struct Guarded {
    inner: Box<dyn DatasetReader>,
    /// Its name in messages.
    reader: String,
    root: PathBuf,
    /// The fault of a reader that panicked while it looked for faults.
    failed: OnceLock<Vec<DatasetFault>>,
}

impl Guarded {
    /// The result of a call, or what stands for it if the reader panics, given the error.
    fn call<T>(&self, work: impl FnOnce() -> T, failed: impl FnOnce(Error) -> T) -> T {
        guarded(&self.reader, &self.root, || Ok(work())).unwrap_or_else(failed)
    }

    fn faults_or_failure<'s>(&'s self, work: impl FnOnce() -> &'s [DatasetFault]) -> &'s [DatasetFault] {
        self.call(work, |error| {
            self.failed.get_or_init(|| {
                let place = self.root.display().to_string();
                vec![DatasetFault { check: "readable", place, message: error.to_string(), is_lost: false }]
            })
        })
    }
}

impl DatasetReader for Guarded {
    fn info(&self) -> &DatasetInfo {
        self.inner.info()
    }

    fn images(&self) -> &[ImageRef] {
        self.inner.images()
    }

    fn offers(&self) -> Vec<KeyId> {
        self.inner.offers()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<(View, Products)> {
        guarded(&self.reader, &self.root, || self.inner.read(image, wants))
    }

    fn faults(&self) -> &[DatasetFault] {
        self.faults_or_failure(|| self.inner.faults())
    }

    fn faults_of_opening(&self) -> &[DatasetFault] {
        self.faults_or_failure(|| self.inner.faults_of_opening())
    }

    fn left_out(&self, reads: &[KeyId]) -> Vec<Error> {
        self.call(|| self.inner.left_out(reads), |error| vec![error])
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        self.call(|| self.inner.image_faults(image), |error| vec![("readable", error.to_string())])
    }

    fn derived(&self) -> Vec<KeyId> {
        self.inner.derived()
    }

    fn alike(&self) -> Vec<[KeyId; 2]> {
        self.inner.alike()
    }

    fn lists_all_images(&self) -> bool {
        self.inner.lists_all_images()
    }

    fn crowds(&self, image: usize) -> Result<Vec<Crowd>> {
        guarded(&self.reader, &self.root, || self.inner.crowds(image))
    }

    fn passed_over(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        self.call(|| self.inner.passed_over(reads), |_| Vec::new())
    }

    fn not_kept(&self, reads: &[KeyId]) -> Vec<LeftOut> {
        self.call(|| self.inner.not_kept(reads), |_| Vec::new())
    }

    fn category(&self, own: u64) -> Option<u32> {
        self.inner.category(own)
    }

    fn caveats(&self, reads: &[KeyId]) -> Vec<String> {
        self.call(|| self.inner.caveats(reads), |error| vec![error.to_string()])
    }
}

/// An image of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageRef {
    /// Its scene; of a format without scenes, a number of its own.
    pub scene: SceneId,
    /// Its view.
    pub view: ViewId,
    /// What the dataset calls it, such as its path.
    pub name: String,
    /// The number that the dataset's annotation file gives it; none in formats without such numbers.
    pub id: Option<u64>,
}

/// Name of an object, or of its category, of which a dataset has nothing but the number.
pub fn unnamed_object(number: u64) -> String {
    format!("obj_{number:06}")
}

/// Name of a category of which a dataset has nothing but the number.
pub fn unnamed_category(number: u64) -> String {
    format!("category_{number}")
}

/// Name of a class of YOLO of which a dataset has nothing but the number. `number` counts from 1, as ids of categories do; classes
/// count from 0.
pub fn unnamed_class(number: u64) -> String {
    format!("class {}", number.saturating_sub(1))
}

/// Whether a name says nothing but the number of an object or a category.
pub fn is_unnamed(number: u64, name: &str) -> bool {
    [unnamed_object, unnamed_category, unnamed_class].iter().any(|of| of(number) == name)
}

/// Name of the rule that each object has a pixel in some mask. Readers that know what their file calls an object report each
/// object without pixels under this name, and a conversion that drops the object repeats the report.
pub const OBJECTS_HAVE_PIXELS: &str = "objects_have_pixels";

/// A region of an image with objects that are not told apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crowd {
    /// Its pixels.
    pub mask: Mask,
    /// Id of the category of its objects.
    pub category: u32,
}

/// Something that is wrong with a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DatasetFault {
    /// The rule that is broken, in snake case, such as `unique_ids`.
    pub check: &'static str,
    /// Where: a file, an image or an annotation.
    pub place: String,
    /// What is wrong.
    pub message: String,
    /// Whether images are left out for it: they cannot be read, or not told apart.
    pub is_lost: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that panics in all that reads files.
    struct Panicking(DatasetInfo);

    impl DatasetReader for Panicking {
        fn info(&self) -> &DatasetInfo {
            &self.0
        }
        fn images(&self) -> &[ImageRef] {
            &[]
        }
        fn offers(&self) -> Vec<KeyId> {
            Vec::new()
        }
        fn read(&self, image: usize, _: &[KeyId]) -> Result<(View, Products)> {
            panic!("image {image}")
        }
        fn faults(&self) -> &[DatasetFault] {
            panic!("faults")
        }
        fn image_faults(&self, _: usize) -> Vec<(&'static str, String)> {
            panic!("faults of an image")
        }
        fn crowds(&self, _: usize) -> Result<Vec<Crowd>> {
            panic!("crowds")
        }
        fn left_out(&self, _: &[KeyId]) -> Vec<Error> {
            panic!("left out")
        }
    }

    #[test]
    fn panics_of_readers_are_errors_that_name_the_dataset() {
        let format = |open| Format {
            name: "odd",
            doc: "",
            detect: |_| panic!("detect"),
            open,
            is_generic: false,
            crate_name: "test",
        };
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
            Ok(Box::new(Panicking(info)))
        })
        .open(&Source::new(root))
        .expect("opens");
        says(&opened.read(3, &[]).err().expect("refused").to_string(), "image 3");
        says(&opened.faults()[0].message, "faults");
        says(&opened.image_faults(0)[0].1, "faults of an image");
        says(&opened.crowds(0).expect_err("refused").to_string(), "crowds");
        says(&opened.left_out(&[])[0].to_string(), "left out");
    }
}
