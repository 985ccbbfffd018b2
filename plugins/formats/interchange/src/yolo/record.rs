//! YOLO's names of folders and files, and the lines of label files.

use std::fmt::Write as _;
use std::path::Path;
use syntable_formats::decode;
use syntable_model::prelude::*;

/// Folder of images.
pub const IMAGES: &str = "images";
/// Folder of labels, next to the folder of images.
pub const LABELS: &str = "labels";
/// Extensions of image files.
pub const IMAGE_ENDS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Extension of label files.
pub const LABEL_END: &str = "txt";
/// The file that describes the dataset.
pub const DATA: &str = "data.yaml";
/// The file in the folder of labels to which LabelImg writes the names of the classes, one per line.
pub const CLASSES: &str = "classes.txt";

/// Adds the line of an object to a text. Six decimals resolve about a thousandth of a pixel.
pub fn write_line(text: &mut String, class: usize, points: &[[f64; 2]], [width, height]: [f64; 2]) {
    // Writing to a string cannot fail.
    let _ = write!(text, "{class}");
    for [x, y] in points {
        let _ = write!(text, " {:.6} {:.6}", x / width, y / height);
    }
    text.push('\n');
}

/// Tolerance of sums of coordinates that were rounded to text.
const DECIMALS: f64 = 5e-6;

/// The shape of the numbers after the class in each line of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelShape {
    /// Points.
    Polygons,
    /// x, y, width, height.
    Boxes,
    /// Four corners.
    RotatedBoxes,
    /// A box, then points with or without a flag of visibility.
    Poses,
}

/// Numbers of a box.
pub const BOX: usize = 4;

/// A line of a label file: an object.
pub struct LabelLine {
    /// Line number, from 1.
    pub number: usize,
    pub class: u64,
    /// Coordinates, divided by the width and the height of the image.
    pub values: Vec<f64>,
}

impl LabelLine {
    pub fn is_box(&self) -> bool {
        self.values.len() == BOX
    }

    /// The box in an image of `[width, height]`: x, y, width, height, px. Of a rotated box, the box around its corners.
    pub fn box_px(&self, shape: LabelShape, size: [u32; 2]) -> [f64; 4] {
        let size = size.map(f64::from);
        let [low, high] = match (shape, self.values.as_slice()) {
            (LabelShape::RotatedBoxes, values) => {
                let along = |axis: usize| values.iter().skip(axis).step_by(2).copied();
                let low = [0, 1].map(|axis| along(axis).fold(f64::INFINITY, f64::min));
                [low, [0, 1].map(|axis| along(axis).fold(f64::NEG_INFINITY, f64::max))]
            }
            (_, &[x, y, width, height, ..]) => [-0.5, 0.5].map(|side| [x + side * width, y + side * height]),
            _ => [[0.0; 2]; 2],
        };
        [low[0] * size[0], low[1] * size[1], (high[0] - low[0]) * size[0], (high[1] - low[1]) * size[1]]
    }
}

/// Reads the lines of a label file, given the shape that the dataset states.
///
/// # Errors
/// If the file cannot be read, or a line has another shape.
pub fn lines(path: &Path, stated: Option<LabelShape>) -> Result<Vec<LabelLine>> {
    let text = decode::text(path).map_err(|error| match path.is_file() {
        true => error,
        false => error.help("put a text file in its place, or remove it if the image has no objects"),
    })?;
    let line = |(number, line): (usize, &str)| {
        let refuse = |message: String| {
            let help =
                "a line is the number of a class, then x and y of at least three points, divided by width and height";
            Error::new(message).in_file(path).at_line(number).help(help)
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
        let are_points = values.len() >= 6 && values.len() % 2 == 0;
        let is_known = match stated {
            Some(LabelShape::Boxes) => values.len() == BOX,
            Some(LabelShape::RotatedBoxes) => values.len() == 2 * BOX,
            Some(LabelShape::Poses) => values.len() > BOX,
            Some(LabelShape::Polygons) | None => values.len() == BOX || are_points,
        };
        if !is_known {
            return Err(refuse(format!("a class and {} numbers are no points", values.len())));
        }
        Ok(LabelLine { number, class, values })
    };
    (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()).map(line).collect()
}

impl LabelShape {
    /// The shape of a line with these values; none for an axis-aligned rectangle, which may be a polygon or a rotated
    /// box.
    pub fn of(values: &[f64]) -> Option<Self> {
        let &[ax, ay, bx, by, cx, cy, dx, dy] = values else {
            return Some(if values.len() == BOX { Self::Boxes } else { Self::Polygons });
        };
        let is = |a: f64, b: f64| (a - b).abs() < DECIMALS;
        // Division by width and height turns a rectangle into a parallelogram.
        if !is(ax + cx, bx + dx) || !is(ay + cy, by + dy) {
            return Some(Self::Polygons);
        }
        let is_along = is(ax, bx) && is(by, cy) || is(ay, by) && is(bx, cx);
        (!is_along).then_some(Self::RotatedBoxes)
    }

    /// Name of such lines in messages, in the plural.
    pub fn lines(self) -> &'static str {
        match self {
            Self::Polygons => "polygons",
            Self::Boxes => "boxes",
            Self::RotatedBoxes => "rotated boxes",
            Self::Poses => "poses, boxes with points",
        }
    }

    /// The common shape of two kinds of lines. A polygon may happen to be a parallelogram.
    pub fn joined(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if other != self => Self::Polygons,
            _ => self,
        }
    }
}
