//! Reads the layout of Ultralytics YOLO: polygons, boxes, rotated boxes and poses.
//!
//! Lines do not state their shape. `data.yaml` may state it, with `task` or, for poses, with `kpt_shape`. Otherwise,
//! all lines of the dataset decide: boxes if each line has four numbers; rotated boxes if each line has the corners of
//! a parallelogram and at least one is not parallel to the edges of the image; otherwise polygons.

use super::data;
use super::record::{CLASSES, DATA, IMAGE_ENDS, IMAGES, LABEL_END, LABELS, LabelLine, LabelShape, lines};
use crate::family::find::Structure;
use crate::read::{POLYGONS, pixels_around, settle_edges};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::coco::Category;
use syntable_formats::decode::{self, FileContent};
use syntable_formats::read::{self, Categories, Faults, KnownMasks, ObjectLabels};
use syntable_formats::segmentation::Segmentation;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{
    AMODAL_BOX, BOX, CATEGORY_ID, OCCLUSION_MASK, RGB, RGB_FILE, VISIBLE_BOX, is_image_file,
};
use syntable_model::reader::{DatasetFault, Format, ImageSource, Note, Opened, ReadImage, Source, unnamed_class};
use syntable_model::rule;
use syntable_model::shown::shown;

syntable_model::register_format!(Format::new(
    "yolo",
    "Ultralytics YOLO: `images/SPLIT` beside `labels/SPLIT`, one split, or its folder of images. Polygons are taken for \
          visible masks, unless `data.yaml` has `masks: amodal`; of rotated boxes and poses, boxes are read.",
    |root| !splits_of(root).is_empty() && !is_beside_coco(root),
    open,
));

/// Whether COCO's annotation files contain the same labels and more. The YOLO labels are then an export of Ultralytics'
/// tools without a description.
fn is_beside_coco(root: &Path) -> bool {
    !is_there(&root.join(DATA)) && Structure::any_is_at(root)
}

/// Whether the path exists, as a file, a folder or a link, even a broken one.
fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Number of folders above the folder of images that may contain the description of the dataset.
const ABOVE: usize = 3;

pub struct YoloSource {
    categories: Categories,
    /// Numbers of the classes that have names.
    pub classes: BTreeSet<u64>,
    /// The file that contains the names, if any.
    pub names_file: Option<&'static str>,
    images: Vec<YoloImage>,
    pub shape: LabelShape,
    /// The masks that polygons outline.
    known: KnownMasks,
}

/// An image and its labels, if it has any.
struct YoloImage {
    name: String,
    image: PathBuf,
    labels: Option<PathBuf>,
}

/// Folders of the images and of the labels of each split, sorted.
fn splits_of(root: &Path) -> Vec<[PathBuf; 2]> {
    let pair = |images: PathBuf, labels: PathBuf| (images.is_dir() && labels.is_dir()).then_some([images, labels]);
    // The path is the folder of images.
    if let (Some(split), Some(above)) = (root.file_name(), root.parent())
        && above.file_name().is_some_and(|name| name == IMAGES)
        && let Some(found) = pair(root.to_owned(), above.with_file_name(LABELS).join(split))
    {
        return vec![found];
    }
    let [images, labels] = [IMAGES, LABELS].map(|folder| root.join(folder));
    let entries = fs::read_dir(&images).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut splits: Vec<[PathBuf; 2]> =
        entries.filter_map(|split| pair(images.join(&split), labels.join(&split))).collect();
    splits.sort();
    if splits.is_empty() && images_of(&images).is_ok_and(|images| !images.is_empty()) && labels.is_dir() {
        splits.push([images, labels]);
    }
    splits
}

/// Folders of the images and of the labels of the one split.
fn folders(root: &Path) -> Result<[PathBuf; 2]> {
    match <[[PathBuf; 2]; 1]>::try_from(splits_of(root)) {
        Ok([only]) => Ok(only),
        Err(splits) => Err(match splits.first() {
            None => Error::new(format!("no folder `{IMAGES}` with a folder `{LABELS}` beside it")),
            Some([first, _]) => Error::new(format!("the dataset has {} splits", splits.len()))
                .help(format!("name the folder of one split, such as {}", shown(first).display())),
        }
        .in_file(root)
        .of_request()),
    }
}

/// Images of a folder with their names without extensions, sorted.
fn images_of(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    read::entries_with(folder, |end| IMAGE_ENDS.iter().any(|other| other.eq_ignore_ascii_case(end)))
}

/// The folders of images and of labels, to which names are relative. If the user named the folder of images, the labels
/// may lie outside of it.
fn confined(source: &Source, [images, labels]: [&Path; 2]) -> Result<[DatasetFolder; 2]> {
    let root = &source.path;
    if images == root && !labels.starts_with(root) {
        return Ok([source.folder(images)?, source.folder(labels)?]);
    }
    let inner = |folder: &Path| Ok(source.folder(root)?.inner(folder.strip_prefix(root).unwrap_or(folder)));
    Ok([inner(images)?, inner(labels)?])
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let [images, labels] = folders(root)?;
    let [of_images, of_labels] = confined(source, [&images, &labels])?;
    let inside = |folder: &DatasetFolder, path: &Path| folder.file(path.file_name().unwrap_or_default()).map(drop);
    // The folders themselves may be links, too.
    [&of_images, &of_labels].into_iter().try_for_each(|folder| folder.file("").map(drop))?;
    let mut faults = Faults::default();
    let mut of_image: BTreeMap<String, PathBuf> =
        read::entries_with(&labels, |end| end == LABEL_END)?.into_iter().collect();
    let mut all: Vec<YoloImage> = Vec::new();
    of_image.values().try_for_each(|path| inside(&of_labels, path))?;
    for (name, image) in images_of(&images)? {
        inside(&of_images, &image)?;
        match all.last().filter(|last| last.name == name) {
            None => all.push(YoloImage { labels: of_image.remove(&name), name, image }),
            Some(first) => {
                let message = format!("{} has the same labels, and is read", shown(&first.image).display());
                faults.lost(rule::UNIQUE_VIEWS, shown(&image).display().to_string(), message);
            }
        }
    }
    let is_of_image = |path: &&PathBuf| path.file_name().is_none_or(|name| name != CLASSES);
    for path in of_image.values().filter(is_of_image) {
        faults.lost(
            rule::KNOWN_IMAGES,
            shown(path).display().to_string(),
            format!("{} has no image of this name", shown(&images).display()),
        );
    }
    let description = images.ancestors().take(ABOVE).map(|above| above.join(DATA)).find(|path| is_there(path));
    if let Some(above) = description.as_deref().and_then(Path::parent) {
        source.folder(above)?.file(DATA)?;
    }
    let stated = description.as_deref().map(data::shape).transpose()?.flatten();
    let known = description.as_deref().map_or(Ok(KnownMasks::Visible), data::masks)?;
    let (mut shape, mut boxes, mut all_lines, mut found) = (None, 0, 0, BTreeSet::new());
    for path in all.iter().filter_map(|image| image.labels.as_ref()) {
        // An unreadable file is a fault of its image.
        for line in lines(path, stated).unwrap_or_default() {
            found.insert(line.class);
            all_lines += 1;
            boxes += usize::from(line.is_box());
            shape = LabelShape::of(&line.values).map(|it| it.joined(shape)).or(shape);
        }
    }
    // Classes count from 0, but category 0 is a background in other formats.
    let id = |class: u64| class.saturating_add(1);
    let (names, names_file) = match (&description, names_beside_labels(&of_labels)?) {
        (Some(path), _) => (data::names(path)?, Some(DATA)),
        (None, Some(names)) => (names, Some(CLASSES)),
        (None, None) => {
            let ids = read::with_gaps_filled(found.iter().copied().map(id).collect());
            (ids.into_iter().map(|id| (id - 1, unnamed_class(id))).collect(), None)
        }
    };
    let classes: BTreeSet<u64> = names.keys().copied().collect();
    let category = |(class, name): (u64, String)| Category { id: id(class), name, ..Category::default() };
    let mut categories = Categories::of(&names.into_iter().map(category).collect::<Vec<_>>());
    found.iter().for_each(|class| categories.note(id(*class)));
    let (refs, images) = faults.in_order(all, |image| (&image.name, None));
    let name = read::name_of(root);
    let info = categories.info(name, String::new(), &refs, String::new());
    let shape = stated.or(shape).unwrap_or(LabelShape::Polygons);
    let mut offers = match shape {
        LabelShape::Polygons => known.offers(),
        LabelShape::Boxes | LabelShape::RotatedBoxes | LabelShape::Poses => vec![box_key(known).id(), CATEGORY_ID.id()],
    };
    offers.extend((shape != LabelShape::Polygons || boxes > 0).then(|| BOX.id()));
    let labels = offers.clone();
    offers.extend(keys![RGB, RGB_FILE]);
    let caveat = |text: String| Note::caveat(text).of(labels.clone());
    let mut notes = Vec::new();
    match shape {
        LabelShape::Polygons => {
            notes.push(caveat(POLYGONS.to_owned()));
            if known == KnownMasks::Visible {
                notes.push(caveat(
                    "polygons are taken as visible masks: the format does not distinguish masks".to_owned(),
                ));
            }
            if boxes > 0 {
                notes.push(caveat(format!("objects with a box and no polygon have boxes alone: {boxes}")));
            }
            let what = "objects have a box and no polygon";
            let boxes = LeftOut::new(boxes, all_lines, what);
            notes.push(Note::not_objects(boxes).of(labels.clone()).unless(BOX.id()));
        }
        LabelShape::Boxes => {
            notes.push(caveat("labels are boxes: boxes and classes are all that is known of objects".to_owned()));
        }
        other => {
            notes.push(caveat(format!("labels are {}: of objects, boxes and classes are read", other.lines())));
            let what = format!("labels are {}: only boxes and classes are kept", other.lines());
            notes.push(Note::not_kept(LeftOut::new(all_lines, all_lines, what)).of(labels.clone()));
        }
    }
    let ids = classes.iter().copied().map(id).collect();
    let unlisted = read::unlisted(&ids, &format!("`{DATA}`")).filter(|_| names_file.is_none());
    notes.extend(unlisted.map(caveat));
    let source = YoloSource { categories, classes, names_file, images, shape, known };
    let derived = if shape == LabelShape::Polygons { OCCLUSION_MASK.id() } else { box_key(known).id() };
    Ok(Opened { faults: faults.into_inner(), derived: vec![derived], notes, ..Opened::new(info, refs, offers, source) })
}

/// The boxes of labels without masks, in whole pixels: around visible parts, unless `data.yaml` states amodal masks.
fn box_key(known: KnownMasks) -> Key<PerInstance<BBox>> {
    if known == KnownMasks::Amodal { AMODAL_BOX } else { VISIBLE_BOX }
}

/// The names of classes that LabelImg writes into the folder of labels, if the file exists.
fn names_beside_labels(labels: &DatasetFolder) -> Result<Option<BTreeMap<u64, String>>> {
    let path = labels.file(CLASSES)?;
    if !path.is_file() {
        return Ok(None);
    }
    let text = decode::text(&path).map_err(Error::of_request)?;
    let names = (0..).zip(text.lines()).map(|(class, name)| (class, name.trim().to_owned()));
    let names: BTreeMap<u64, String> = names.filter(|(_, name)| !name.is_empty()).collect();
    Ok(Some(names).filter(|names| !names.is_empty()))
}

impl ImageSource for YoloSource {
    fn image_faults(&self, image: usize) -> Vec<DatasetFault> {
        self.faults_of(image)
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let mut products = Products::new();
        let size = FileContent::read(&self.images[image].image)?.put_rgb(wants, &mut products)?;
        if wants.iter().any(|want| !is_image_file(*want)) {
            let lines = self.lines(image)?;
            self.put_boxes(&lines, size, wants, &mut products)?;
            match self.shape {
                LabelShape::Polygons => {
                    let rows = lines.iter().enumerate();
                    let labels = rows.map(|(row, line)| self.labels(image, row, line, size));
                    let mut labels = labels.collect::<Result<Vec<_>>>()?;
                    // Amodal masks may share pixels.
                    if self.known == KnownMasks::Visible {
                        settle_edges(&mut labels);
                    }
                    read::put(&labels, None, wants, &mut products)?;
                }
                LabelShape::Boxes | LabelShape::RotatedBoxes | LabelShape::Poses => {
                    let of = |(row, line): (usize, &LabelLine)| Ok((read::id_of(row)?, self.category(line)));
                    products.put(CATEGORY_ID, lines.iter().enumerate().map(of).collect::<Result<_>>()?)?;
                }
            }
        }
        Ok(ReadImage::new(size, products))
    }
}

impl YoloSource {
    pub fn lines(&self, image: usize) -> Result<Vec<LabelLine>> {
        self.images[image].labels.as_ref().map_or_else(|| Ok(Vec::new()), |path| lines(path, Some(self.shape)))
    }

    /// Puts the boxes of objects without a polygon.
    fn put_boxes(&self, lines: &[LabelLine], size: [u32; 2], wants: &[KeyId], products: &mut Products) -> Result<()> {
        let is_one = |line: &LabelLine| self.shape != LabelShape::Polygons || line.is_box();
        let rows = || lines.iter().enumerate().filter(|(_, line)| is_one(line));
        let boxes = || rows().map(|(row, line)| Ok((read::id_of(row)?, line.box_px(self.shape, size))));
        if wants.contains(&BOX.id()) {
            let boxes = boxes().map(|of| of.and_then(|(id, bbox)| Ok((id, Value::of(&bbox)?))));
            products.put(BOX, boxes.collect::<Result<_>>()?)?;
        }
        let key = box_key(self.known);
        if wants.contains(&key.id()) && self.shape != LabelShape::Polygons {
            let boxes = boxes().map(|of| of.map(|(id, bbox)| (id, pixels_around(bbox))));
            products.put(key, boxes.collect::<Result<_>>()?)?;
        }
        Ok(())
    }

    fn category(&self, line: &LabelLine) -> u32 {
        self.categories.id(line.class.saturating_add(1))
    }

    fn labels(&self, image: usize, row: usize, line: &LabelLine, [width, height]: [u32; 2]) -> Result<ObjectLabels> {
        let at = |error: Error| match &self.images[image].labels {
            Some(path) => error.in_file(path).at_line(line.number),
            None => error,
        };
        let scale = [f64::from(width), f64::from(height)];
        let polygon = line.values.iter().enumerate().map(|(i, value)| value * scale[i % 2]).collect();
        let mask = match line.is_box() {
            true => Mask::empty(width, height),
            false => Segmentation::Polygons(vec![polygon]).decode(width, height).map_err(at)?,
        };
        let amodal = (self.known == KnownMasks::Amodal).then(|| mask.clone());
        Ok(ObjectLabels::of_masks(read::id_of(row)?, mask, amodal, self.category(line)))
    }
}
