//! What contradicts the records of the annotation file of COCO's panoptic segmentation.

use super::read::{Segments, Things};
use super::record::VOID;
use crate::family::read::Fault;
use crate::read::{Tolerance, fits_mask};
use std::collections::BTreeSet;
use syntable_model::reader::OBJECTS_HAVE_PIXELS;

impl Things {
    /// What contradicts the segments of an image.
    pub fn faults_of(&self, all: &Segments) -> Vec<Fault> {
        let (mut faults, mut said) = (Vec::new(), BTreeSet::new());
        for segment in &all.annotation.segments_info {
            let of = |key: &str| format!("segment {}: `{key}`", segment.id);
            if !said.insert(segment.id) {
                faults.push(("unique_ids", format!("two segments have the id {}", segment.id)));
            }
            if segment.id == VOID {
                let message =
                    format!("a segment has the id {VOID}, which is that of pixels without one: number it from 1");
                faults.push(("segments_are_pixels", message));
                continue;
            }
            let mask = all.mask(segment.id);
            if mask.is_empty() {
                let file = &all.annotation.file_name;
                let is_object = segment.iscrowd == 0 && !self.stuff.contains(&segment.category_id);
                let check = if is_object { OBJECTS_HAVE_PIXELS } else { "segments_are_pixels" };
                faults.push((check, format!("no pixel of {file} is of segment {}", segment.id)));
                continue;
            }
            let exact = Tolerance { area_px2: 0.5, box_px: 0.0 };
            faults.extend(fits_mask(&mask, (segment.area, of("area")), (segment.bbox, of("bbox")), exact));
        }
        let unknown: BTreeSet<u32> =
            all.ids.data().iter().copied().filter(|it| *it != VOID && !said.contains(it)).collect();
        faults.extend(unknown.into_iter().map(|id| {
            let file = &all.annotation.file_name;
            ("segments_are_pixels", format!("pixels of {file} are of segment {id}, which `segments_info` has not"))
        }));
        faults
    }
}
