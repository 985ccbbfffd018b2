//! Reads OSD-Amodal's folders.

use super::{IMAGES, MASKS};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::decode;
use syntable_formats::read::{self, Categories, Faults, Labels};
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, RGB};
use syntable_model::reader::{Format, ImageSource, Opened, ReadImage, Source};

syntable_model::register_format!(Format {
    name: "osd_amodal",
    doc: "OSD-Amodal's folders `image_color`, `disparity`, `annotation`, `amodal_annotation` and `occlusion_annotation`, as the \
          writer `osd_amodal` writes them.",
    detect: |root| IMAGES.iter().chain([&MASKS[0]]).all(|folder| root.join(folder).is_dir()),
    open,
    is_generic: false,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Millimeters per step of depth images.
const STEP_MM: f64 = 1.0;

struct OsdSource {
    root: DatasetFolder,
    images: Vec<Named>,
}

/// An image.
struct Named {
    name: String,
    masks: Masks,
}

/// Names of the amodal masks by their labels, and those of the occlusion masks; without ends.
type Masks = [BTreeMap<u16, String>; 2];

impl Named {
    /// Labels that are shown, or that have an occlusion mask, and have no amodal one.
    fn without_amodal(&self, shown: &Plane<u16>) -> BTreeSet<u16> {
        let [amodal, occluded] = &self.masks;
        let labels = shown.data().iter().chain(occluded.keys()).copied();
        labels.filter(|label| *label > 0 && !amodal.contains_key(label)).collect()
    }
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.folder(&source.path)?;
    let mut faults = Faults::default();
    let [color, depth, labels] = IMAGES.map(|folder| stems(&root.file(folder)?));
    let names = color?;
    for (folder, stems) in IMAGES[1..].iter().zip([depth?, labels?]) {
        for name in names.difference(&stems) {
            faults.add("records_agree", format!("{folder}/{name}.png"), "it is not there, and its image is");
        }
        for name in stems.difference(&names) {
            let message = format!("there is no {}/{name}.png", IMAGES[0]);
            faults.lost("records_agree", format!("{folder}/{name}.png"), &message);
        }
    }
    let mut images: BTreeMap<String, Masks> = names.into_iter().map(|name| (name, Default::default())).collect();
    for (which, folder) in MASKS.iter().enumerate() {
        // Without occlusion there is no folder of it.
        if which == 1 && !root.file(folder)?.is_dir() {
            continue;
        }
        for stem in stems(&root.file(folder)?)? {
            let place = || format!("{folder}/{stem}.png");
            let Some((name, label)) = labeled(&stem) else {
                faults.add("records_agree", place(), "its name does not end with `_` and a label from 1 to 65535");
                continue;
            };
            let Some(masks) = images.get_mut(name) else {
                faults.lost("known_images", place(), &format!("there is no {}/{name}.png", IMAGES[0]));
                continue;
            };
            match masks[which].entry(label) {
                Entry::Vacant(entry) => drop(entry.insert(stem)),
                Entry::Occupied(first) => {
                    faults.add("unique_ids", place(), &format!("{}.png is of the same label", first.get()));
                }
            }
        }
    }
    let images: Vec<Named> = images.into_iter().map(|(name, masks)| Named { name, masks }).collect();
    let (refs, images) = faults.in_order(images, |image| (&image.name, place_of(&image.name)));
    let name = read::name_of(&source.path);
    let info = Categories::default().info(name, String::new(), &refs, String::new());
    let mut offers = read::Known::Both.offers();
    offers.extend(keys![RGB, DEPTH]);
    Ok(Opened { faults: faults.into_inner(), ..Opened::new(info, refs, offers, OsdSource { root, images }) })
}

/// Names of the PNG files of a folder, without their ends.
fn stems(folder: &Path) -> Result<BTreeSet<String>> {
    let fail = |error: std::io::Error| Error::io(folder, &error).of_request();
    let mut stems = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.extension().is_some_and(|it| it == "png") {
            stems.extend(path.file_stem().and_then(|stem| Some(stem.to_str()?.to_owned())));
        }
    }
    Ok(stems)
}

/// Image and label in the name of a mask: `NAME_LABEL`. Label 0 is the background.
fn labeled(stem: &str) -> Option<(&str, u16)> {
    let (name, digits) = stem.rsplit_once('_')?;
    let label = digits.parse().ok().filter(|label| *label > 0)?;
    digits.bytes().all(|byte| byte.is_ascii_digit()).then_some((name, label))
}

/// Scene and view of a name as the writer gives it.
fn place_of(name: &str) -> Option<(u32, u32)> {
    let (scene, view) = name.strip_prefix('s')?.split_once('v')?;
    Some((scene.parse().ok()?, view.parse().ok()?))
}

impl ImageSource for OsdSource {
    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let of = &self.images[image];
        let shown = self.path(IMAGES[2], &of.name).and_then(|path| decode::gray(&path));
        let Ok(shown) = shown else { return Vec::new() };
        let message = |label| format!("label {label} has no mask in {}, and is no object", MASKS[0]);
        of.without_amodal(&shown).into_iter().map(|label| ("records_agree", message(label))).collect()
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let of = &self.images[image];
        let (mut products, mut left_out) = (Products::new(), Vec::new());
        let rgb = decode::rgb(&self.path(IMAGES[0], &of.name)?)?;
        let size = [rgb.width(), rgb.height()];
        if wants.iter().any(|want| ![RGB.id(), DEPTH.id()].contains(want)) {
            let shown = self.gray(IMAGES[2], &of.name, size)?;
            read::put(&self.labels(of, &shown)?, None, wants, &mut products)?;
            let without = of.without_amodal(&shown).len();
            let all = of.masks[0].len() + without;
            left_out.push(LeftOut::new(without, all, "labels have no amodal mask, and are no objects"));
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, rgb)?;
        }
        if wants.contains(&DEPTH.id()) {
            products.put(DEPTH, decode::depth_of_size(&self.path(IMAGES[1], &of.name)?, STEP_MM, size)?)?;
        }
        Ok(ReadImage { left_out, ..ReadImage::new(size, products) })
    }
}

impl OsdSource {
    fn path(&self, folder: &str, name: &str) -> Result<PathBuf> {
        self.root.inner(folder).file(format!("{name}.png"))
    }

    /// The objects: those that have an amodal mask. `shown` are the labels of the visible masks.
    fn labels(&self, image: &Named, shown: &Plane<u16>) -> Result<Vec<Labels>> {
        let size = [shown.width(), shown.height()];
        let empty = || Mask::empty(size[0], size[1]);
        let visible = read::masks_of(shown);
        let of = |label: u16| -> Result<Labels> {
            let mask = |which: usize| -> Result<Option<Mask>> {
                let Some(name) = image.masks[which].get(&label) else { return Ok(None) };
                let plane = self.gray(MASKS[which], name, size)?;
                Ok(Some(Mask::from_fn(size[0], size[1], |x, y| *plane.at(x, y) > 0)))
            };
            Ok(Labels {
                id: InstanceId(label),
                visible: visible.get(&label).cloned().unwrap_or_else(empty),
                amodal: mask(0)?,
                // An object without this file is not occluded.
                occlusion: Some(mask(1)?.unwrap_or_else(empty)),
                rate: None,
                visible_box: None,
                amodal_box: None,
                category: DatasetInfo::OBJECT.0,
            })
        };
        image.masks[0].keys().copied().map(of).collect()
    }

    fn gray(&self, folder: &str, name: &str, size: [u32; 2]) -> Result<Plane<u16>> {
        decode::gray_of_size(&self.path(folder, name)?, size)
    }
}
