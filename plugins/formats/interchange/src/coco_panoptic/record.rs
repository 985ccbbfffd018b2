//! The records of the annotation file of COCO's panoptic segmentation.

use syntable_formats::Extra;
use syntable_formats::listing::{AnnotationLink, AnnotationRecord};
use syntable_model::prelude::*;

/// How names of annotation files begin.
pub const FILE: &str = "panoptic_";

/// Name of the stuff category of all pixels without an object.
pub const BACKGROUND_NAME: &str = "background";

/// Id of pixels that belong to no segment.
pub const VOID: u32 = 0;

/// The annotation of an image. `N` is the type of areas and boxes: this program writes whole numbers, and other files
/// have fractions.
#[derive(Serialize, Deserialize)]
pub struct PanopticAnnotation<N = f64> {
    /// Fields that the reader ignores, such as our `id`.
    #[serde(flatten)]
    pub extra: Extra,
    pub image_id: u64,
    pub file_name: String,
    pub segments_info: Vec<PanopticSegment<N>>,
}

/// A segment of an object or of stuff. Its id is R + 256 · G + 256² · B of its pixels.
#[derive(Serialize, Deserialize)]
pub struct PanopticSegment<N = f64> {
    pub id: u32,
    pub category_id: u64,
    pub area: N,
    pub bbox: [N; 4],
    #[serde(default)]
    pub iscrowd: u8,
    /// Fields that the reader ignores.
    #[serde(flatten)]
    pub extra: Extra,
}

impl AnnotationRecord for PanopticAnnotation {
    fn link(&self) -> AnnotationLink {
        AnnotationLink { id: self.image_id, image: self.image_id, category: None }
    }
}
