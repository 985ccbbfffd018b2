//! Faults of the annotation files of COCO's panoptic segmentation.

use super::read::{Segments, Things};
use super::record::VOID;
use crate::read::{MaskTolerance, fits_mask};
use std::collections::BTreeSet;
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

/// Id of the rule that segments match regions in the image of ids.
const SEGMENTS_ARE_PIXELS: &str = "segments_are_pixels";

impl Things {
    /// The rules that the segments of an image break.
    pub fn faults_of(&self, all: &Segments) -> Vec<DatasetFault> {
        let (mut faults, mut said, file) = (Vec::new(), BTreeSet::new(), &all.annotation.file_name);
        for segment in &all.annotation.segments_info {
            if !said.insert(segment.id) {
                faults.push(DatasetFault::new(rule::UNIQUE_IDS, format!("two segments have the id {}", segment.id)));
            }
            if segment.id == VOID {
                let message = format!(
                    "a segment has the id {VOID}, which means pixels without a segment: number segments from 1"
                );
                faults.push(DatasetFault::new(SEGMENTS_ARE_PIXELS, message));
                continue;
            }
            let mask = all.mask(segment.id);
            if mask.is_empty() {
                let is_object = segment.iscrowd == 0 && !self.stuff.contains(&segment.category_id);
                let rule = if is_object { rule::OBJECTS_HAVE_PIXELS } else { SEGMENTS_ARE_PIXELS };
                faults.push(DatasetFault::new(rule, format!("no pixel of {file} is of segment {}", segment.id)));
                continue;
            }
            let exact = MaskTolerance { area_px2: 0.5, box_px: 0.0 };
            let found = fits_mask(&mask, ("area", Some(segment.area)), ("bbox", Some(segment.bbox)), exact);
            faults.extend(found.into_iter().map(|fault| fault.of(FaultSubject::Segment(segment.id))));
        }
        let unknown: BTreeSet<u32> =
            all.ids.data().iter().copied().filter(|it| *it != VOID && !said.contains(it)).collect();
        faults.extend(unknown.into_iter().map(|id| {
            let message = format!("pixels of {file} are of segment {id}, which `segments_info` has not");
            DatasetFault::new(SEGMENTS_ARE_PIXELS, message)
        }));
        faults
    }
}
