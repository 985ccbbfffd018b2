//! Reads the layout of Ultralytics YOLO: polygons, boxes and rotated boxes.

use super::{DATA, data};
use crate::read::{POLYGONS, settle_edges};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_formats::coco::Category;
use syntable_formats::decode;
use syntable_formats::read::{self, Categories, Faults, Labels};
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, RGB};
use syntable_model::reader::{DatasetFault, DatasetReader, Format, ImageRef};

syntable_model::register_format!(Format {
    name: "yolo",
    doc: "Ultralytics YOLO: `images/SPLIT` beside `labels/SPLIT`, one split, or its folder of images. Polygons are taken for \
          visible masks; of boxes and rotated boxes only classes are read.",
    detect: |root| folders(root).is_ok(),
    open,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Names of the folders of images and labels.
const FOLDERS: [&str; 2] = ["images", "labels"];
/// Ends of image files.
const ENDS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Folders above that of images in which the description of the dataset may be.
const ABOVE: usize = 3;

struct Reader {
    info: DatasetInfo,
    categories: Categories,
    /// Numbers of the classes that have names.
    classes: BTreeSet<u64>,
    refs: Vec<ImageRef>,
    images: Vec<Labeled>,
    shape: Shape,
    faults: Faults,
}

/// An image and its labels, if it has any.
struct Labeled {
    name: String,
    image: PathBuf,
    labels: Option<PathBuf>,
}

/// Error of sums of coordinates in text.
const DECIMALS: f64 = 5e-6;

/// What the lines of a dataset have after the class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Polygons,
    /// x, y, width, height.
    Boxes,
    /// Four corners.
    RotatedBoxes,
}

/// A line of a label file.
struct Line {
    number: usize,
    class: u64,
    values: Vec<f64>,
}

/// Folders of the images and of the labels.
fn folders(root: &Path) -> Result<[PathBuf; 2]> {
    let pair = |images: PathBuf, labels: PathBuf| (images.is_dir() && labels.is_dir()).then_some([images, labels]);
    // The folder of images itself.
    if let (Some(split), Some(above)) = (root.file_name(), root.parent())
        && above.file_name().is_some_and(|name| name == FOLDERS[0])
        && let Some(found) = pair(root.to_owned(), above.with_file_name(FOLDERS[1]).join(split))
    {
        return Ok(found);
    }
    let [images, labels] = FOLDERS.map(|folder| root.join(folder));
    let entries = fs::read_dir(&images).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut splits: Vec<[PathBuf; 2]> =
        entries.filter_map(|split| pair(images.join(&split), labels.join(&split))).collect();
    splits.sort();
    match splits.as_slice() {
        [only] => Ok(only.clone()),
        [] if images_of(&images).is_ok_and(|images| !images.is_empty()) && labels.is_dir() => Ok([images, labels]),
        [] => {
            Err(Error::new("there is no folder `images` with a folder `labels` beside it").in_file(root).of_request())
        }
        [first, ..] => Err(Error::new(format!("there are {} splits", splits.len()))
            .in_file(images)
            .help(format!("name the folder of one split, such as {}", first[0].display()))
            .of_request()),
    }
}

/// Images of a folder by their names without ends.
fn images_of(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    files_of(folder, |end| ENDS.iter().any(|other| other.eq_ignore_ascii_case(end)))
}

fn files_of(folder: &Path, is_one: impl Fn(&str) -> bool) -> Result<BTreeMap<String, PathBuf>> {
    let fail = |error: std::io::Error| Error::io(folder, &error).of_request();
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let is_one = path.extension().and_then(|end| end.to_str()).is_some_and(&is_one);
        if let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()).filter(|_| is_one && path.is_file()) {
            files.insert(stem.to_owned(), path.clone());
        }
    }
    Ok(files)
}

fn open(root: &Path) -> Result<Box<dyn DatasetReader>> {
    let [images, labels] = folders(root)?;
    let mut faults = Faults::default();
    let mut of_image = files_of(&labels, |end| end == "txt")?;
    let labeled = |(name, image): (String, PathBuf)| Labeled { labels: of_image.remove(&name), name, image };
    let all: Vec<Labeled> = images_of(&images)?.into_iter().map(labeled).collect();
    for path in of_image.values() {
        faults.add(
            "known_images",
            path.display().to_string(),
            &format!("{} has no image of this name", images.display()),
        );
    }
    let (mut shape, mut found) = (None, BTreeSet::new());
    for path in all.iter().filter_map(|image| image.labels.as_ref()) {
        // What cannot be read is at fault when the image is read.
        for line in lines(path).unwrap_or_default() {
            found.insert(line.class);
            shape = Shape::of(&line.values).map(|it| it.joined(shape)).or(shape);
        }
    }
    let description = images.ancestors().take(ABOVE).map(|above| above.join(DATA)).find(|path| path.is_file());
    let names = match description {
        Some(path) => data::names(&path)?,
        None => found.iter().map(|class| (*class, format!("class {class}"))).collect(),
    };
    let classes = names.keys().copied().collect();
    // Classes count from 0, and category 0 is a background elsewhere.
    let category = |(class, name): (u64, String)| Category { id: class.saturating_add(1), name, ..Category::default() };
    let categories = Categories::of(&names.into_iter().map(category).collect::<Vec<_>>());
    let (refs, images) = faults.in_order(all, |image| (&image.name, None));
    let name = root.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let info = categories.info(name, String::new(), &refs, String::new());
    let shape = shape.unwrap_or(Shape::Polygons);
    Ok(Box::new(Reader { info, categories, classes, refs, images, shape, faults }))
}

/// The lines of a label file.
fn lines(path: &Path) -> Result<Vec<Line>> {
    let text = fs::read_to_string(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::InvalidData => Error::new("it is no text").in_file(path).permanent(),
        _ => Error::io(path, &error),
    })?;
    let line = |(number, line): (usize, &str)| {
        let refuse = |message: String| {
            let help =
                "a line is the number of a class, then x and y of at least three points, divided by width and height";
            Error::new(message).in_file(path).at_line(number).help(help).permanent()
        };
        let mut words = line.split_ascii_whitespace();
        let class = words.next().unwrap_or_default();
        // Some tools write classes as floats.
        let class = class.strip_suffix(".0").unwrap_or(class);
        let class = class.parse().map_err(|_| refuse(format!("`{class}` is no number of a class")))?;
        let value = |word: &str| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(refuse(format!("`{word}` is no coordinate"))),
        };
        let values = words.map(value).collect::<Result<Vec<f64>>>()?;
        if values.len() != 4 && (values.len() < 6 || values.len() % 2 == 1) {
            return Err(refuse(format!("a class and {} numbers are no points", values.len())));
        }
        Ok(Line { number, class, values })
    };
    (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()).map(line).collect()
}

impl Shape {
    /// What a line with these values has; none if it is a polygon and a rotated box alike: a rectangle along the edges of the
    /// image.
    fn of(values: &[f64]) -> Option<Self> {
        let &[ax, ay, bx, by, cx, cy, dx, dy] = values else {
            return Some(if values.len() == 4 { Self::Boxes } else { Self::Polygons });
        };
        let is = |a: f64, b: f64| (a - b).abs() < DECIMALS;
        // Divided by width and height, a rectangle is still a parallelogram.
        if !is(ax + cx, bx + dx) || !is(ay + cy, by + dy) {
            return Some(Self::Polygons);
        }
        let is_along = is(ax, bx) && is(by, cy) || is(ay, by) && is(bx, cx);
        (!is_along).then_some(Self::RotatedBoxes)
    }

    /// What lines have of which others have that. A polygon may be a parallelogram, too.
    fn joined(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if other != self => Self::Polygons,
            _ => self,
        }
    }
}

impl DatasetReader for Reader {
    fn info(&self) -> &DatasetInfo {
        &self.info
    }

    fn images(&self) -> &[ImageRef] {
        &self.refs
    }

    fn faults(&self) -> &[DatasetFault] {
        self.faults.all()
    }

    fn offers(&self) -> Vec<KeyId> {
        let mut keys = match self.shape {
            Shape::Polygons => read::offers(false),
            Shape::Boxes | Shape::RotatedBoxes => keys![CATEGORY_ID],
        };
        keys.push(RGB.id());
        keys
    }

    fn caveats(&self, reads: &[KeyId]) -> Vec<String> {
        let reads_masks = self.shape == Shape::Polygons && reads.iter().any(|key| *key != RGB.id());
        let visible = "polygons are taken for visible masks: the format does not say which they are";
        if reads_masks { vec![POLYGONS.to_owned(), visible.to_owned()] } else { Vec::new() }
    }

    fn image_faults(&self, image: usize) -> Vec<(&'static str, String)> {
        let Ok(lines) = self.lines(image) else { return Vec::new() };
        let mut faults = Vec::new();
        for line in lines {
            if !self.classes.contains(&line.class) {
                let message = format!("line {}: {DATA} has no class {}", line.number, line.class);
                faults.push(("known_categories", message));
            }
            // Corners of rotated boxes may lie outside.
            let beyond = line.values.iter().find(|value| !(0.0..=1.0).contains(*value));
            if let Some(value) = beyond.filter(|_| self.shape != Shape::RotatedBoxes) {
                let message = format!("line {}: {value} is not in [0, 1]", line.number);
                faults.push(("coordinates_are_within_the_image", message));
            }
        }
        faults
    }

    fn read(&self, image: usize, wants: &[KeyId]) -> Result<(View, Products)> {
        let mut products = Products::new();
        let rgb = decode::rgb(&self.images[image].image)?;
        let size = [rgb.width(), rgb.height()];
        if wants.iter().any(|want| *want != RGB.id()) {
            let lines = self.lines(image)?;
            match self.shape {
                Shape::Polygons => {
                    let labels = lines.iter().enumerate().map(|(row, line)| self.labels(image, row, line, size));
                    let mut labels = labels.collect::<Result<Vec<_>>>()?;
                    settle_edges(&mut labels);
                    read::put(&labels, None, wants, &mut products)?;
                }
                Shape::Boxes | Shape::RotatedBoxes => {
                    let of = |(row, line): (usize, &Line)| Ok((read::id_of(row)?, self.category(line)));
                    products.put(CATEGORY_ID, lines.iter().enumerate().map(of).collect::<Result<_>>()?)?;
                }
            }
        }
        if wants.contains(&RGB.id()) {
            products.put(RGB, rgb)?;
        }
        Ok((read::view(self.refs[image].view, size[0], size[1]), products))
    }
}

impl Reader {
    fn lines(&self, image: usize) -> Result<Vec<Line>> {
        self.images[image].labels.as_ref().map_or_else(|| Ok(Vec::new()), |path| lines(path))
    }

    fn category(&self, line: &Line) -> u32 {
        self.categories.id(line.class.saturating_add(1))
    }

    fn labels(&self, image: usize, row: usize, line: &Line, [width, height]: [u32; 2]) -> Result<Labels> {
        let at = |error: Error| match &self.images[image].labels {
            Some(path) => error.in_file(path).at_line(line.number).permanent(),
            None => error.permanent(),
        };
        let scale = [f64::from(width), f64::from(height)];
        let polygon = line.values.iter().enumerate().map(|(i, value)| value * scale[i % 2]).collect();
        Ok(Labels {
            id: read::id_of(row)?,
            visible: Segmentation::Polygons(vec![polygon]).decode(width, height).map_err(at)?,
            amodal: None,
            occlusion: None,
            rate: None,
            visible_box: None,
            amodal_box: None,
            category: self.category(line),
        })
    }
}
