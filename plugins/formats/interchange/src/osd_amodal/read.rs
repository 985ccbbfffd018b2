//! Reads OSD-Amodal's folders.

use super::record::{COLOR, DEPTH as DEPTH_FOLDER, IMAGES, LABELS, MASKS, image_path, place_of};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_formats::decode::{self, FileContent};
use syntable_formats::read::{self, Categories, Faults, ObjectLabels};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, RGB, RGB_FILE, is_image_file};
use syntable_model::reader::{DatasetFault, Format, ImageSource, Opened, ReadImage, Source};
use syntable_model::rule;

syntable_model::register_format!(Format::new(
    "osd_amodal",
    "OSD-Amodal's folders `image_color`, `disparity`, `annotation`, `amodal_annotation` and `occlusion_annotation`, as the \
          writer `osd_amodal` writes them.",
    |root| IMAGES.iter().chain([&MASKS[0]]).all(|folder| root.join(folder).is_dir()),
    open,
));

/// Millimeters per step of depth images.
const STEP_MM: f64 = 1.0;

pub struct OsdSource {
    root: DatasetFolder,
    pub images: Vec<OsdImage>,
}

/// An image.
pub struct OsdImage {
    pub name: String,
    pub masks: MaskNames,
}

/// Names of the amodal masks and of the occlusion masks by label, without extensions.
type MaskNames = [BTreeMap<u16, String>; 2];

fn open(source: &Source) -> Result<Opened> {
    let root = source.folder(&source.path)?;
    let mut faults = Faults::default();
    let stems_in = |folder: &str| -> Result<BTreeSet<String>> {
        let images = read::entries_with(&root.file(folder)?, |end| end == "png")?;
        Ok(images.into_iter().map(|(stem, _)| stem).collect())
    };
    let names = stems_in(COLOR)?;
    let missing = |name: &str| format!("{} is missing", image_path(COLOR, name));
    for folder in [DEPTH_FOLDER, LABELS] {
        let stems = stems_in(folder)?;
        for name in names.difference(&stems) {
            faults.add(rule::RECORDS_AGREE, image_path(folder, name), "it is not there, and its image is");
        }
        for name in stems.difference(&names) {
            faults.lost(rule::RECORDS_AGREE, image_path(folder, name), missing(name));
        }
    }
    let mut images: BTreeMap<String, MaskNames> = names.into_iter().map(|name| (name, Default::default())).collect();
    for (which, folder) in MASKS.iter().enumerate() {
        // A dataset without occlusion lacks the folder of occlusion masks.
        if which == 1 && !root.file(folder)?.is_dir() {
            continue;
        }
        for stem in stems_in(folder)? {
            let place = || image_path(folder, &stem);
            let Some((name, label)) = read::labeled(&stem) else {
                faults.add(rule::RECORDS_AGREE, place(), "its name does not end with `_` and a label from 1 to 65535");
                continue;
            };
            let Some(masks) = images.get_mut(name) else {
                faults.lost(rule::KNOWN_IMAGES, place(), missing(name));
                continue;
            };
            match masks[which].entry(label) {
                Entry::Vacant(entry) => drop(entry.insert(stem)),
                Entry::Occupied(first) => {
                    faults.add(rule::UNIQUE_IDS, place(), format!("{}.png is of the same label", first.get()));
                }
            }
        }
    }
    let images: Vec<OsdImage> = images.into_iter().map(|(name, masks)| OsdImage { name, masks }).collect();
    let (refs, images) = faults.in_order(images, |image| (&image.name, place_of(&image.name)));
    let name = read::name_of(&source.path);
    let info = Categories::default().info(name, String::new(), &refs, String::new());
    let mut offers = read::KnownMasks::Both.offers();
    offers.extend(keys![RGB, RGB_FILE, DEPTH]);
    Ok(Opened { faults: faults.into_inner(), ..Opened::new(info, refs, offers, OsdSource { root, images }) })
}

impl ImageSource for OsdSource {
    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        self.faults_of(image)
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let of = &self.images[image];
        let (mut products, mut left_out) = (Products::new(), Vec::new());
        let size = FileContent::read(&self.path(COLOR, &of.name)?)?.put_rgb(wants, &mut products)?;
        if wants.iter().any(|want| !is_image_file(*want)) {
            let shown = self.gray(LABELS, &of.name, size)?;
            read::put(&self.labels(of, &shown)?, None, wants, &mut products)?;
            let without = of.without_amodal(&shown).len();
            let all = of.masks[0].len() + without;
            left_out.push(LeftOut::new(without, all, "labels have no amodal mask, and are no objects"));
        }
        if wants.contains(&DEPTH.id()) {
            products.put(DEPTH, decode::depth_of_size(&self.path(DEPTH_FOLDER, &of.name)?, STEP_MM, size)?)?;
        }
        Ok(ReadImage { left_out, ..ReadImage::new(size, products) })
    }
}

impl OsdSource {
    pub fn path(&self, folder: &str, name: &str) -> Result<PathBuf> {
        self.root.inner(folder).file(format!("{name}.png"))
    }

    /// The objects, which are the labels with an amodal mask. `shown` holds the labels of the visible masks.
    fn labels(&self, image: &OsdImage, shown: &Plane<u16>) -> Result<Vec<ObjectLabels>> {
        let size = [shown.width(), shown.height()];
        let empty = || Mask::empty(size[0], size[1]);
        let visible = read::masks_of(shown);
        let of = |label: u16| -> Result<ObjectLabels> {
            let mask = |which: usize| -> Result<Option<Mask>> {
                let Some(name) = image.masks[which].get(&label) else { return Ok(None) };
                let plane = self.gray(MASKS[which], name, size)?;
                Ok(Some(Mask::from_fn(size[0], size[1], |x, y| *plane.at(x, y) > 0)))
            };
            let shown = visible.get(&label).cloned().unwrap_or_else(empty);
            let labels = ObjectLabels::of_masks(InstanceId(label), shown, mask(0)?, DatasetInfo::OBJECT.0);
            // An object without this file is not occluded.
            Ok(ObjectLabels { occlusion: Some(mask(1)?.unwrap_or_else(empty)), ..labels })
        };
        image.masks[0].keys().copied().map(of).collect()
    }

    fn gray(&self, folder: &str, name: &str, size: [u32; 2]) -> Result<Plane<u16>> {
        decode::gray_of_size(&self.path(folder, name)?, size)
    }
}
