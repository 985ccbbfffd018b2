//! Folders of label maps: PNG files with object numbers as pixels, and next to them amodal and occlusion masks of
//! single objects, with the folder names of OSD-Amodal's evaluation or shorter ones.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::decode;
use syntable_formats::read::{self, Categories, ObjectLabels};
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::OCCLUSION_MASK;
use syntable_model::product::{KeyId, Mask, Products};
use syntable_model::reader::{ImageRef, ImageSource, Opened, ReadImage, Source};
use syntable_model::scene::{InstanceId, SceneId, ViewId};
use syntable_model::stage::DatasetInfo;

/// Name of the format for users.
pub const NAME: &str = "label_maps";

/// Names of the folders of label maps, of amodal masks and of occlusion masks.
const FOLDERS: [[&str; 2]; 3] =
    [["visible", "annotation"], ["amodal", "amodal_annotation"], ["occlusion", "occlusion_annotation"]];

/// A folder of label maps.
#[derive(Debug)]
pub struct LabelMaps {
    images: Vec<LabelFiles>,
    is_amodal: bool,
    /// Whether a folder of occlusion masks exists. An object without a mask in it is not occluded.
    says_occlusion: bool,
}

/// Files of an image.
#[derive(Debug)]
struct LabelFiles {
    visible: PathBuf,
    /// Amodal and occlusion masks by object.
    masks: [BTreeMap<u16, PathBuf>; 2],
}

/// The existing folders. A folder with only PNG files is itself a folder of label maps.
fn folders(root: &Path) -> [Option<PathBuf>; 3] {
    let [visible, amodal, occlusion] =
        FOLDERS.map(|names| names.iter().map(|name| root.join(name)).find(|folder| folder.is_dir()));
    [
        visible.or_else(|| Some(root.to_owned()).filter(|root| stems(root).is_ok_and(|it| !it.is_empty()))),
        amodal,
        occlusion,
    ]
}

/// PNG files of a folder by their names without extension.
fn stems(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let fail = |error: std::io::Error| Error::io(folder, &error).of_request();
    let mut stems = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.extension().is_some_and(|it| it.eq_ignore_ascii_case("png"))
            && let Some(stem) = path.file_stem().and_then(|stem| stem.to_str())
        {
            stems.insert(stem.to_owned(), path);
        }
    }
    Ok(stems)
}

impl LabelMaps {
    /// Whether a folder has label maps.
    pub fn is_one(root: &Path) -> bool {
        root.is_dir() && folders(root)[0].is_some()
    }

    /// Opens a folder.
    ///
    /// # Errors
    /// If it has no label maps, or a mask belongs to no image or no object.
    pub fn open(source: &Source) -> Result<Opened> {
        let root = source.path.as_path();
        let confined = source.folder(root)?;
        let stems = |folder: &Path| {
            let found = stems(folder)?;
            let inside =
                if folder == root { confined.clone() } else { confined.inner(folder.file_name().unwrap_or_default()) };
            read::check_inside(&inside, found.values())?;
            Ok::<_, Error>(found)
        };
        let [visible, amodal, occlusion] = folders(root);
        let none = || {
            let names = FOLDERS[0].join("` or `");
            Error::new("no label maps in this folder")
                .in_file(root)
                .help(format!("put PNG files into it, or into `{names}`"))
        };
        let maps = stems(&visible.ok_or_else(none)?)?;
        if maps.is_empty() {
            return Err(none());
        }
        let (is_amodal, says_occlusion) = (amodal.is_some() || occlusion.is_some(), occlusion.is_some());
        let mut masks: BTreeMap<&str, [BTreeMap<u16, PathBuf>; 2]> = BTreeMap::new();
        for (which, folder) in [amodal, occlusion].into_iter().enumerate() {
            for (stem, path) in folder.map_or_else(|| Ok(BTreeMap::new()), |folder| stems(&folder))? {
                let wrong = |what: &str| {
                    let help = "name a mask like its label map, plus `_` and the number of the object, from 1 to 65535";
                    Error::new(what.to_owned()).in_file(&path).help(help)
                };
                let (name, label) =
                    read::labeled(&stem).ok_or_else(|| wrong("the name does not end with the number of an object"))?;
                let (name, _) = maps.get_key_value(name).ok_or_else(|| wrong("its image has no label map"))?;
                if masks.entry(name).or_default()[which].insert(label, path.clone()).is_some() {
                    return Err(wrong("the object has another mask"));
                }
            }
        }
        let refs = (0..).zip(maps.keys());
        let refs = refs.map(|(number, name)| ImageRef {
            scene: SceneId(number),
            view: ViewId(0),
            name: name.clone(),
            id: None,
        });
        let refs: Vec<ImageRef> = refs.collect();
        let files = |(name, visible): (&String, &PathBuf)| LabelFiles {
            visible: visible.clone(),
            masks: masks.remove(name.as_str()).unwrap_or_default(),
        };
        let images = maps.iter().map(files).collect();
        let name = read::name_of(root);
        let info = Categories::default().info(name, String::new(), &refs, String::new());
        let mut offers = read::KnownMasks::with_amodal(is_amodal).offers();
        offers.retain(|key| says_occlusion || *key != OCCLUSION_MASK.id());
        Ok(Opened::new(info, refs, offers, Self { images, is_amodal, says_occlusion }))
    }
}

impl ImageSource for LabelMaps {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let files = &self.images[image];
        let shown = decode::gray(&files.visible)?;
        let [width, height] = [shown.width(), shown.height()];
        let ids: BTreeSet<u16> =
            shown.data().iter().chain(files.masks.iter().flat_map(BTreeMap::keys)).copied().collect();
        let mut visible = read::masks_of(&shown);
        let labels = ids.into_iter().filter(|id| *id > 0).map(|id| {
            let visible = visible.remove(&id).unwrap_or_else(|| Mask::empty(width, height));
            let mask = |of: usize| files.masks[of].get(&id).map(|path| mask(path, [width, height])).transpose();
            let (amodal, occlusion) = (mask(0)?, mask(1)?);
            let amodal = amodal.unwrap_or_else(|| occlusion.as_ref().map_or(visible.clone(), |it| visible.or(it)));
            Ok(ObjectLabels {
                id: InstanceId(id),
                visible,
                amodal: self.is_amodal.then_some(amodal),
                occlusion: occlusion.or_else(|| self.says_occlusion.then(|| Mask::empty(width, height))),
                rate: None,
                visible_box: None,
                amodal_box: None,
                category: DatasetInfo::OBJECT.0,
            })
        });
        let mut products = Products::new();
        read::put(&labels.collect::<Result<Vec<_>>>()?, None, wants, &mut products)?;
        Ok(ReadImage::new([width, height], products))
    }
}

/// A mask of one object: all nonzero pixels.
fn mask(path: &Path, [width, height]: [u32; 2]) -> Result<Mask> {
    let plane = decode::gray_of_size(path, [width, height])?;
    Ok(Mask::from_fn(width, height, |x, y| *plane.at(x, y) > 0))
}
