//! Faults of KINS' annotation files.

use super::labels::labels_of;
use super::record::KinsAnnotation;
use crate::family::read::AnnotationFile;
use crate::order::ObjectOrder;
use crate::read::{MaskTolerance, cut_holes, edge_px2, eroded, fits_mask, hidden_of, no_pixels, settle_edges};
use std::collections::BTreeMap;
use syntable_formats::read::ObjectLabels;
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

/// The rules that the records of an image break.
pub fn faults_of_image(file: &AnnotationFile, image: usize, all: &[KinsAnnotation]) -> Vec<DatasetFault> {
    let (crowds, annotations): (Vec<&KinsAnnotation>, Vec<_>) = all.iter().partition(|it| it.is_crowd());
    let size = file.size(image);
    let mut faults: Vec<_> = annotations.iter().flat_map(|annotation| annotation.faults(size)).collect();
    let labels = annotations.iter().enumerate().map(|(row, it)| labels_of(&file.listing.categories, size, row, it));
    if let Ok(mut labels) = labels.collect::<Result<Vec<_>>>() {
        let empty = annotations.iter().zip(&labels).filter(|(_, label)| label.is_empty());
        faults.extend(empty.map(|(it, _)| no_pixels().of(it.subject())));
        settle_edges(&mut labels);
        faults.extend(annotations.iter().zip(&labels).filter_map(|(it, label)| it.fault_of_areas(label)));
        for (label, annotation) in labels.iter_mut().zip(&annotations) {
            cut_holes(label, annotation.holes_px2(label));
        }
        faults.extend(faults_of_order(&annotations, &crowds, &labels));
    }
    faults
}

impl KinsAnnotation {
    fn subject(&self) -> FaultSubject {
        FaultSubject::Annotation(self.id)
    }

    /// Reports areas that contradict the outlines: the number of hidden pixels that they imply is impossible, whatever
    /// holes the masks have. `labels` are the labels as read.
    fn fault_of_areas(&self, labels: &ObjectLabels) -> Option<DatasetFault> {
        let [amodal, visible] = self.said();
        let (Some(Segmentation::Polygons(_)), Some(area), Some(mask)) = (amodal.mask.1, amodal.area.1, &labels.amodal)
        else {
            return None;
        };
        let edges = edge_px2(mask).max(1.0) + edge_px2(&labels.visible);
        let hidden = f64::from(mask.minus(&labels.visible).area());
        let (name, said) = match visible.area.1 {
            Some(visible) => ("`a_area` less `i_area`", area - visible),
            // A visible region has no holes.
            None => ("the hidden part of `area`", area - f64::from(labels.visible.area())),
        };
        (said < -edges || said > hidden + edges).then(|| {
            let message = format!("{name} is {said}, outlines leave 0 to {hidden}");
            DatasetFault::new(rule::AREAS_MATCH_MASKS, message).of(self.subject())
        })
    }

    /// Compares the areas and boxes of the annotation with its masks. They need not match polygons to the pixel.
    fn faults(&self, size: [u32; 2]) -> Vec<DatasetFault> {
        let mut faults = Vec::new();
        for said in self.said() {
            let Ok(mask) = self.mask(&said, size) else { continue };
            let own = <[i32; 4]>::from(mask.bbox()).map(f64::from);
            let own_area = f64::from(mask.area());
            let area = said.area.1.unwrap_or(own_area);
            let (area, tolerance) = match said.mask.1 {
                Some(Segmentation::Polygons(_)) => {
                    let area = match said.holes_px2 {
                        Some(holes) => area + holes,
                        // The extra pixels of an outline may fill a hole.
                        None => area.max(own_area),
                    };
                    (area, edge_px2(&mask).max(1.0))
                }
                _ => (area, 0.5),
            };
            let bbox = said.bbox.1.unwrap_or(own);
            let tolerance = MaskTolerance { area_px2: tolerance, box_px: 1.0 };
            let found = fits_mask(&mask, (said.area.0, Some(area)), (said.bbox.0, Some(bbox)), tolerance);
            faults.extend(found.into_iter().map(|fault| fault.of(self.subject())));
        }
        faults
    }
}

/// Compares groups and positions in groups with the masks of an image's objects. Outlines are inexact along their
/// edges. An outline that fills a hole does not show which object is in front. `crowds` may belong to groups, too.
fn faults_of_order(
    annotations: &[&KinsAnnotation],
    crowds: &[&KinsAnnotation],
    labels: &[ObjectLabels],
) -> Vec<DatasetFault> {
    if annotations.iter().all(|it| it.oco_id.is_none() && it.ico_id.is_none()) {
        return Vec::new();
    }
    let has_holes = |it: &KinsAnnotation| it.said().iter().any(|said| said.holes_px2.is_some_and(|holes| holes > 0.0));
    let of =
        |mask: Mask, it: &KinsAnnotation| if has_holes(it) { Mask::empty(mask.width(), mask.height()) } else { mask };
    let each = || labels.iter().zip(annotations);
    let whole: Vec<Mask> =
        each().map(|(label, it)| of(label.amodal.as_ref().map_or_else(|| label.visible.clone(), eroded), it)).collect();
    let seen: Vec<Mask> = each().map(|(label, it)| of(eroded(&label.visible), it)).collect();
    let hidden: Vec<Mask> = each().map(|(label, it)| of(eroded(&hidden_of(label)), it)).collect();
    let clear =
        ObjectOrder::of_masks(&seen.iter().zip(&hidden).map(|(seen, hidden)| [seen, hidden]).collect::<Vec<_>>());
    // Edges alone are not evidence of an order, but they may complete a cycle.
    let exact: Vec<Mask> = labels.iter().map(hidden_of).collect();
    let all =
        ObjectOrder::of_masks(&labels.iter().zip(&exact).map(|(it, hidden)| [&it.visible, hidden]).collect::<Vec<_>>());
    let mut faults = Vec::new();
    let boxes: Vec<BBox> = whole.iter().map(Mask::bbox).collect();
    let mut members: BTreeMap<u64, u64> = BTreeMap::new();
    let groups = annotations.iter().chain(crowds).filter_map(|it| it.oco_id);
    groups.for_each(|group| *members.entry(group).or_default() += 1);
    let mut fault = |of: &KinsAnnotation, message: String| {
        faults.push(DatasetFault::new(rule::ORDER_MATCHES_MASKS, message).of(of.subject()));
    };
    // At most one fault of each kind per object, since the number of pairs grows quadratically.
    for (j, behind) in annotations.iter().enumerate() {
        let Some(group) = behind.oco_id else { continue };
        let of_group = members.get(&group).copied().unwrap_or_default();
        if let Some(place) = behind.ico_id
            && (place > of_group || (group == 0) != (place == 0))
        {
            let end = match group == 0 || place == 0 {
                true => format!(" and its `oco_id` {group}: both are 0 where no object overlaps it, or neither"),
                false => {
                    format!(", and {of_group} objects have its `oco_id` {group}: places are from 1 to their number")
                }
            };
            fault(behind, format!("`ico_id` is {place}{end}"));
        }
        let overlaps = |i: usize| boxes[i].meets(&boxes[j]) && whole[i].shared_area(&whole[j]) > 0;
        let other_group = |i: usize| annotations[i].oco_id.filter(|other| *other != group && overlaps(i));
        if let Some((front, other)) = (0..j).find_map(|i| Some((&annotations[i], other_group(i)?))) {
            let own = format!("{} is {group}", behind.key("oco_id"));
            fault(front, format!("`oco_id` is {other}, but {own}: objects that overlap have one group"));
        }
        let Some(place) = behind.ico_id.filter(|place| *place > 0) else { continue };
        let place_before = |i: usize| {
            let of_group = annotations[i].ico_id.filter(|_| annotations[i].oco_id == Some(group));
            of_group.filter(|before| *before >= place && clear.occludes(i, j) && all.is_in_front(i, j))
        };
        if let Some((front, before)) = (0..annotations.len()).find_map(|i| Some((&annotations[i], place_before(i)?))) {
            let other = format!("{} is {before}", front.key("ico_id"));
            let end = "which is in front of it: the front has the lower number";
            fault(behind, format!("`ico_id` is {place}, but {other}, {end}"));
        }
    }
    faults
}
