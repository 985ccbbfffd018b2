//! Reads datasets whose labels are one image of numbers per view, beside a color and a depth image: TOD and OCID.

use std::path::PathBuf;
use syntable_formats::decode::FileContent;
use syntable_formats::read::{self, KnownMasks, ObjectLabels};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, RGB, RGB_FILE, is_image_file};
use syntable_model::reader::{DatasetFault, ImageSource, ReadImage};
use syntable_model::rule;

/// Millimeters per step of depth images.
const STEP_MM: f64 = 1.0;

/// A view: paths of its images, relative to the dataset.
pub struct LabelImage {
    pub rgb: PathBuf,
    pub depth: PathBuf,
    pub labels: PathBuf,
    /// Largest label of the background and of what objects stand on.
    pub background: u16,
}

/// Reads the views. The id of an object is its label, counted from the last label of the background.
pub struct LabelImages<R> {
    pub root: DatasetFolder,
    pub images: Vec<LabelImage>,
    /// Finds the rules that the labels of a view break.
    pub rules: R,
}

/// The rules of a format for the labels of a view.
pub trait LabelRules: Send + Sync {
    /// The faults of the labels of objects that an image shows.
    fn faults(&self, root: &DatasetFolder, image: &LabelImage, labels: &[u16]) -> Vec<DatasetFault>;
}

/// The products of each view.
pub fn offers() -> Vec<KeyId> {
    let mut offers = KnownMasks::Visible.offers();
    offers.extend(keys![RGB, RGB_FILE, DEPTH]);
    offers
}

/// Adds a fault for each file of a view that does not exist, beside a color image that does.
pub fn note_missing(root: &DatasetFolder, image: &LabelImage, faults: &mut read::Faults) {
    for path in [&image.depth, &image.labels] {
        if !root.path().join(path).is_file() {
            faults.add(rule::RECORDS_AGREE, path.display().to_string(), "it is not there, and its image is");
        }
    }
}

impl<R: LabelRules> LabelImages<R> {
    fn content(&self, path: &PathBuf, size: Option<[u32; 2]>) -> Result<FileContent> {
        let content = FileContent::read(&self.root.file(path)?)?;
        Ok(match size {
            Some(size) => content.stated(size),
            None => content,
        })
    }
}

impl<R: LabelRules> ImageSource for LabelImages<R> {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let of = &self.images[image];
        let (mut products, mut size) = (Products::new(), None);
        if wants.is_empty() || wants.iter().any(|want| !is_image_file(*want)) {
            let labels = self.content(&of.labels, None)?.labels()?;
            size = Some([labels.width(), labels.height()]);
            let shown = read::masks_of(&labels.map(|label| label.saturating_sub(of.background)));
            let object = |(id, mask)| ObjectLabels::of_masks(InstanceId(id), mask, None, DatasetInfo::OBJECT.0);
            read::put(&shown.into_iter().map(object).collect::<Vec<_>>(), None, wants, &mut products)?;
        }
        if [RGB.id(), RGB_FILE.id()].iter().any(|key| wants.contains(key)) {
            size = Some(self.content(&of.rgb, size)?.put_rgb(wants, &mut products)?);
        }
        if wants.contains(&DEPTH.id()) {
            let depth = self.content(&of.depth, size)?.depth(STEP_MM)?;
            size = Some([depth.width(), depth.height()]);
            products.put(DEPTH, depth)?;
        }
        Ok(ReadImage::new(size.unwrap_or_default(), products))
    }

    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        let of = &self.images[image];
        let Ok(labels) = self.content(&of.labels, None).and_then(|content| content.labels()) else { return Vec::new() };
        let shown: Vec<u16> = read::masks_of(&labels).into_keys().filter(|label| *label > of.background).collect();
        self.rules.faults(&self.root, of, &shown)
    }
}
