//! The records of UOAIS-Sim's annotation file.

use crate::labels::ShownLabel;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;

/// How the name of the annotation file begins.
pub const FILE: &str = "coco_anns_uoais_sim_";

/// The one category, which UOAIS-Net knows.
pub const CATEGORY: u64 = 1;

/// An object, with the fields that UOAIS-Net's loader and evaluator read.
#[derive(Serialize)]
pub struct UoaisAnnotation {
    pub id: u64,
    pub image_id: u64,
    pub category_id: u64,
    pub bbox: [i32; 4],
    pub area: u32,
    pub iscrowd: u8,
    pub segmentation: Rle,
    pub visible_mask: Rle,
    pub occluded_mask: Rle,
    pub occluded_rate: f64,
}

impl UoaisAnnotation {
    /// The record of an object.
    pub fn of(label: &ShownLabel) -> Self {
        Self {
            id: 0,
            image_id: 0,
            category_id: CATEGORY,
            bbox: label.amodal_box.into(),
            area: label.amodal.area(),
            iscrowd: 0,
            segmentation: Rle::encode(label.amodal),
            visible_mask: Rle::encode(label.visible),
            occluded_mask: Rle::encode(label.occlusion),
            occluded_rate: label.rate,
        }
    }
}
