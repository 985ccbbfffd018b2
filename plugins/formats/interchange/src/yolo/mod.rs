//! Ultralytics YOLO.

mod check;
mod data;
mod read;
mod record;
mod write;

use crate::coco::MaskChoice;
use crate::family::write::check_split;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes the layout of Ultralytics YOLO, for instance segmentation, detection or oriented boxes.
///
/// # Behavior
///
/// Each line of a label file is an object: the number of its class, from 0, then x and y of points, divided by the
/// width and height of the image. Classes are `object` (0) and the classes of the recipe's pools, listed in
/// `data.yaml`. An image without objects has an empty label file.
///
/// - `task = "segment"`: the polygon around the mask. Its parts are linked at their nearest corners to one polygon, as
///   Ultralytics' converter from COCO does, and its holes filled. The annotator `outlines` sets its tolerance.
/// - `task = "detect"`: center, width and height of the box around the mask. A dataset that has boxes and no masks keeps
///   its boxes; their parts outside the image are cut off, since the loader drops images with such boxes.
/// - `task = "obb"`: the four corners of the rotated box around the mask, clockwise. They may lie outside the image;
///   only corners of a box that is larger than the image are moved to its edge, since the loader drops images with such
///   boxes.
///
/// With `masks = "amodal"`, `data.yaml` has the line `masks: amodal`, which tells readers which masks the polygons
/// outline.
///
/// `data.yaml` uses the images of this dataset for training and for validation. For a validation set, point `val` to
/// the images of another dataset. Paths are relative to the folder of `data.yaml`.
///
/// # Output
///
/// - `{id}/images/{split}/{scene:06}_{view:04}.png`, or `.jpg`: 8-bit RGB.
/// - `{id}/labels/{split}/{scene:06}_{view:04}.txt`.
/// - `{id}/data.yaml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Yolo {
    /// Task of the labels. Default: `segment`; `detect` in a conversion of a dataset that has boxes and no masks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub task: Option<YoloTask>,
    /// Mask that polygons and boxes outline. Objects with an empty mask have no label, unless a dataset states their box.
    pub masks: MaskChoice,
    /// Folder of images and labels.
    pub split: String,
    /// Files of the color images.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
}

/// Task of YOLO labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum YoloTask {
    /// Instance segmentation: polygons.
    Segment,
    /// Detection: boxes along the edges of the image.
    Detect,
    /// Oriented bounding boxes.
    Obb,
}

impl Default for Yolo {
    fn default() -> Self {
        Self { task: None, masks: MaskChoice::Visible, split: "train".into(), rgb: RgbFiles::default() }
    }
}

impl Config for Yolo {
    type Stage = dyn Writer;
    const KIND: &'static str = "yolo";
    const EXAMPLE: &'static str = "task = \"segment\"\nmasks = \"amodal\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(self.boxed())
    }
}

register!(Yolo);
