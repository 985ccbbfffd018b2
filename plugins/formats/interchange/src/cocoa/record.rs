//! The records of COCOA's annotation file.

use syntable_formats::Extra;
use syntable_formats::coco::id;
use syntable_formats::listing::{AnnotationLink, AnnotationRecord};
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;

/// How the name of the annotation file begins.
pub const FILE: &str = "COCO_amodal_";

/// The annotation of an image by one person.
#[derive(Debug, Serialize, Deserialize)]
pub struct CocoaAnnotation {
    #[serde(deserialize_with = "id")]
    pub id: u64,
    #[serde(deserialize_with = "id")]
    pub image_id: u64,
    /// Fields that the reader ignores, such as `url` and `author`.
    #[serde(flatten)]
    pub extra: Extra,
    /// Number of regions.
    #[serde(default)]
    pub size: Option<usize>,
    /// Pairs `i-j` of regions, by number from 1. Region `i` is in front of region `j`.
    #[serde(default)]
    pub depth_constraint: String,
    /// From front to back.
    pub regions: Vec<CocoaRegion>,
}

/// An object, or stuff.
#[derive(Debug, Serialize, Deserialize)]
pub struct CocoaRegion {
    pub segmentation: Vec<f64>,
    #[serde(default)]
    pub name: String,
    #[serde(default)]
    pub area: Option<f64>,
    #[serde(default, rename = "isStuff")]
    pub is_stuff: u8,
    #[serde(default)]
    pub occlude_rate: Option<f64>,
    /// Position from the front, from 1.
    #[serde(default)]
    pub order: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_mask: Option<Rle>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invisible_mask: Option<Rle>,
    /// Fields that the reader ignores.
    #[serde(flatten)]
    pub extra: Extra,
}

impl AnnotationRecord for CocoaAnnotation {
    fn link(&self) -> AnnotationLink {
        AnnotationLink { id: self.id, image: self.image_id, category: None }
    }
}
