//! Labels from the records of KINS.

use super::record::KinsAnnotation;
use crate::read::enclosed_px2;
use syntable_formats::read::{self, Categories, ObjectLabels};
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;

/// The labels of an object, by its position among the objects of the image.
pub fn labels_of(
    categories: &Categories,
    size: [u32; 2],
    row: usize,
    annotation: &KinsAnnotation,
) -> Result<ObjectLabels> {
    let [amodal, visible] = annotation.said();
    let (visible, amodal) = (annotation.mask(&visible, size)?, annotation.mask(&amodal, size)?);
    Ok(ObjectLabels::of_masks(read::id_of(row)?, visible, Some(amodal), categories.id(annotation.category_id)))
}

impl KinsAnnotation {
    /// Area of the holes that the amodal mask has according to the record but that its outline lacks, px², given the
    /// labels as read. In the form of 2020, the areas state how many pixels are hidden. In the form of 2019, the area
    /// is smaller than the outline's area, unless it was computed from the outline.
    pub fn holes_px2(&self, labels: &ObjectLabels) -> f64 {
        let [amodal, visible] = self.said();
        let (Some(Segmentation::Polygons(outline)), Some(area), Some(mask)) =
            (amodal.mask.1, amodal.area.1, &labels.amodal)
        else {
            return 0.0;
        };
        match visible.area.1 {
            Some(visible) => f64::from(mask.minus(&labels.visible).area()) - (area - visible),
            None if (area - enclosed_px2(outline)).abs() < 1.0 => 0.0,
            None => f64::from(mask.area()) - area,
        }
    }
}
