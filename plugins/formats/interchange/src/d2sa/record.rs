//! The records of D2SA's annotation file.

use crate::field::LenientField;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;

/// How the name of the annotation file begins.
pub const FILE: &str = "D2S_amodal_";

/// An object, with its fields in the order in which they are written. The reader of `coco` reads it as
/// [`AmodalFields`](crate::coco::AmodalFields).
#[derive(Serialize)]
pub struct D2saAnnotation {
    pub id: u64,
    pub image_id: u64,
    pub category_id: u32,
    pub iscrowd: bool,
    pub area: f64,
    pub bbox: [f64; 4],
    pub segmentation: Rle,
    pub visible_mask: Rle,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub invisible_mask: Option<Rle>,
    pub occlude_rate: f64,
    pub occl_depth: usize,
    pub amodal_region: D2saRegion,
}

/// The whole object, with its position from the front, from 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct D2saRegion {
    pub name: LenientField<String>,
    pub area: LenientField<f64>,
    #[serde(rename = "isStuff")]
    pub is_stuff: LenientField<u8>,
    pub bbox: LenientField<[f64; 4]>,
    pub order: LenientField<u64>,
}
