//! Ultralytics YOLO.

mod data;
mod read;

use crate::coco::Masks;
use crate::family::write::{check_split, image_name};
use crate::labels;
use crate::outlines::{self, Ring, outline_key, rotated_box_key};
use std::fmt::Write as _;
use syntable_formats::encode::png::Image;
use syntable_formats::encode::view_name;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::scene::{SceneId, ViewId};

/// Writes the layout of Ultralytics YOLO, for instance segmentation or oriented boxes.
///
/// # What it does
///
/// A line of a label file is an object: the number of its class from 0, then x and y of points, divided by width and
/// height of the image. Classes are `object` (0) and the classes of the recipe's pools, as `data.yaml` says. An image
/// without objects has an empty label file.
///
/// - `task = "segment"`: the polygon around the mask. Its parts are linked at their nearest corners to one polygon, as
///   Ultralytics' converter from COCO does, and its holes filled. The annotator `outlines` says how close it is.
/// - `task = "obb"`: the four corners of the rotated box around the mask, clockwise. They may lie outside the image;
///   only those of a box that is larger than the image are moved to its edge, since the loader drops images with such
///   boxes.
///
/// With `masks = "amodal"`, `data.yaml` has the line `masks: amodal`, so that readers know what polygons are around.
///
/// `data.yaml` names the images of this dataset for training and for validation: point `val` to the images of a dataset
/// that was made for it. Paths count from the folder of `data.yaml`.
///
/// # Output
///
/// - `{id}/images/{split}/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/labels/{split}/{scene:06}_{view:04}.txt`.
/// - `{id}/data.yaml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Yolo {
    /// What the labels are for.
    pub task: YoloTask,
    /// Mask that polygons and boxes are around. Objects whose mask is empty have no label.
    pub masks: Masks,
    /// Folder of images and labels.
    pub split: String,
}

/// What YOLO labels are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum YoloTask {
    /// Instance segmentation: polygons.
    Segment,
    /// Oriented bounding boxes.
    Obb,
}

impl Default for Yolo {
    fn default() -> Self {
        Self { task: YoloTask::Segment, masks: Masks::Visible, split: "train".into() }
    }
}

impl Config for Yolo {
    type Stage = dyn Writer;
    const KIND: &'static str = "yolo";
    const EXAMPLE: &'static str = "task = \"segment\"\nmasks = \"amodal\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(self.boxed())
    }
}

impl Yolo {
    /// Path of the image inside the writer's folder.
    fn image_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("{}/{}", self.images(), image_name(scene, view))
    }

    fn images(&self) -> String {
        format!("images/{}", self.split)
    }

    /// Path of the label file inside the writer's folder: Ultralytics finds it from that of the image.
    fn label_path(&self, scene: SceneId, view: ViewId) -> String {
        format!("labels/{}/{}.txt", self.split, view_name(scene, view))
    }

    /// Points around an object's mask, px.
    fn points(&self, products: &Products, id: InstanceId, size: [f64; 2]) -> Result<Ring> {
        match self.task {
            YoloTask::Segment => outlines::ring(products, self.masks, id),
            YoloTask::Obb => Ok(within_size(outlines::rotated_box(products, self.masks, id)?, size).to_vec()),
        }
    }
}

/// Name of the file that describes the dataset.
const DATA: &str = "data.yaml";
/// Its key of what polygons are around, which Ultralytics does not read.
const MASKS: &str = "masks";
/// Its value for whole objects; what is visible needs no statement.
const AMODAL: &str = "amodal";

impl ImageWriter for Yolo {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let points = match self.task {
            YoloTask::Segment => outline_key(self.masks),
            YoloTask::Obb => rotated_box_key(self.masks),
        };
        let labels = match self.masks {
            Masks::Visible => labels::visible_inputs(),
            Masks::Amodal => labels::amodal_inputs(),
        };
        [Input::of(RGB), Input::of(points)].into_iter().chain(labels).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (rgb, scene, view) = (products.get(RGB)?, cx.scene_id, cx.view_id);
        Image::rgb(rgb).write(output, &format!("{}/{}", output.id(), self.image_path(scene, view)))?;
        let size = [rgb.width(), rgb.height()].map(f64::from);
        let mut text = String::new();
        let labels = self.masks.shown_partial(cx.log, labels::partial(cx.dataset, products)?, false);
        if self.task == YoloTask::Segment {
            outlines::report_holes(cx.log, products, self.masks, labels.iter().map(|label| label.id))?;
        }
        for label in &labels {
            text += &line(cx.dataset.category(label.category)?.0, &self.points(products, label.id, size)?, size);
        }
        output.write(&format!("{}/{}", output.id(), self.label_path(scene, view)), text.as_bytes())
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let paths = match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![self.image_path(scene, view), self.label_path(scene, view)],
            (None, None) => vec![DATA.to_owned()],
            _ => Vec::new(),
        };
        paths.into_iter().map(|path| format!("{}/{path}", of.id)).collect()
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let path = format!("{}/{DATA}", finish.id());
        let text = data_yaml(self, cx.dataset);
        finish.write(&path, |out| out.write_all(text.as_bytes()).map_err(|error| Error::io(&path, &error)))
    }
}

/// The description of the dataset. Names are quoted as in JSON, which YAML reads.
fn data_yaml(config: &Yolo, dataset: &DatasetInfo) -> String {
    let quoted = |text: &str| serde_json::Value::from(text).to_string();
    let images = quoted(&config.images());
    let mut text = format!("train: {images}\nval: {images}\n");
    if config.masks == Masks::Amodal {
        text += &format!("{MASKS}: {AMODAL}\n");
    }
    text += "names:\n";
    for (class, (_, name)) in dataset.categories().enumerate() {
        text += &format!("  {class}: {}\n", quoted(name));
    }
    text
}

/// The line of an object. Six decimals are a thousandth of a pixel.
fn line(class: usize, points: &[[f64; 2]], [width, height]: [f64; 2]) -> String {
    let mut line = class.to_string();
    for [x, y] in points {
        // Writing to a string cannot fail.
        let _ = write!(line, " {:.6} {:.6}", x / width, y / height);
    }
    line.push('\n');
    line
}

/// The corners of a box, moved to the edge of the image if the box is larger.
fn within_size(corners: [[f64; 2]; 4], size: [f64; 2]) -> [[f64; 2]; 4] {
    let is_larger = |axis: usize| {
        let along = || corners.iter().map(|corner| corner[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min) > size[axis]
    };
    if is_larger(0) || is_larger(1) {
        corners.map(|[x, y]| [x.clamp(0.0, size[0]), y.clamp(0.0, size[1])])
    } else {
        corners
    }
}

register!(Yolo);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_larger_than_the_image_are_moved_to_its_edge() {
        let inside = [[-3.0, 5.0], [5.0, -3.0], [10.0, 5.0], [5.0, 10.0]];
        assert_eq!(within_size(inside, [64.0, 48.0]), inside);
        let large = [[-3.0, 24.0], [32.0, -8.0], [67.0, 24.0], [32.0, 56.0]];
        assert_eq!(within_size(large, [64.0, 48.0]), [[0.0, 24.0], [32.0, 0.0], [64.0, 24.0], [32.0, 48.0]]);
    }

    #[test]
    fn names_are_valid_yaml() {
        let dataset = DatasetInfo { classes: vec!["a: \"b\"".to_owned()], ..syntable_testing::scenes::dataset() };
        assert_eq!([1, 2].map(|category| dataset.category(category).expect("there").0), [0, 1]);
        let want = "train: \"images/val\"\nval: \"images/val\"\nnames:\n  0: \"object\"\n  1: \"a: \\\"b\\\"\"\n";
        let config = Yolo { split: "val".into(), ..Yolo::default() };
        assert_eq!(data_yaml(&config, &dataset), want);
        let amodal = data_yaml(&Yolo { masks: Masks::Amodal, ..config }, &dataset);
        assert_eq!(amodal, want.replace("names:", "masks: amodal\nnames:"));
    }
}
