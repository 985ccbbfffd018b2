//! Faults of D2SA's own fields, which the reader of `coco` reads.

use crate::coco::AmodalAnnotation;
use crate::order::ObjectOrder;
use crate::read::hidden_of;
use std::collections::BTreeMap;
use syntable_formats::listing::AnnotationListing;
use syntable_formats::read::ObjectLabels;
use syntable_model::prelude::*;
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

/// Reports an `amodal_region.name` that differs from the category of the object.
pub fn fault_of_name(
    listing: &AnnotationListing,
    annotation: &AmodalAnnotation,
    is_ours: bool,
) -> Option<DatasetFault> {
    let said = annotation.extra.amodal_region.value()?.name.value()?;
    let categories = || listing.file.categories.iter().flatten();
    let own = &categories().find(|it| it.id == annotation.category_id)?.name;
    let is_wrong = said != own && (is_ours || categories().any(|it| it.name == *said));
    let message = format!("`amodal_region.name` is {said:?}, its category is {own:?}");
    is_wrong.then(|| DatasetFault::new(rule::RECORDS_AGREE, message))
}

/// Checks the area and the box that `amodal_region` repeats.
pub fn faults_of_region(annotation: &AmodalAnnotation) -> Vec<DatasetFault> {
    let mut faults = Vec::new();
    let region = annotation.extra.amodal_region.value();
    if let Some((area, own)) = region.and_then(|it| it.area.value()).zip(annotation.area)
        && (area - own).abs() > 0.5
    {
        let message = format!("`amodal_region.area` is {area}, its `area` {own}");
        faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
    }
    if let Some((bbox, own)) = region.and_then(|it| it.bbox.value()).zip(annotation.bbox)
        && bbox.iter().zip(own).any(|(a, b)| (a - b).abs() > 0.5)
    {
        let message = format!("`amodal_region.bbox` is {bbox:?}, its `bbox` {own:?}");
        faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
    }
    faults
}

/// Reports each `occl_depth` that exceeds the number of other objects in the image.
fn faults_of_depth(annotations: &[AmodalAnnotation]) -> impl Iterator<Item = DatasetFault> {
    annotations.iter().filter_map(|annotation| {
        let depth = occlusion_depth(annotation)?;
        let others = annotations.len() - 1;
        let fault = || {
            fault_of_order(
                annotation,
                format!("`occl_depth` is {depth}, but the image has only {others} other objects"),
            )
        };
        (depth > others as u64).then(fault)
    })
}

fn fault_of_order(annotation: &AmodalAnnotation, message: String) -> DatasetFault {
    DatasetFault::new(rule::ORDER_MATCHES_MASKS, message).of(FaultSubject::Annotation(annotation.id))
}

fn occlusion_depth(annotation: &AmodalAnnotation) -> Option<u64> {
    annotation.extra.occl_depth.value().copied()
}

/// Position of an object from the front, from 1.
fn place_from_front(annotation: &AmodalAnnotation) -> Option<u64> {
    annotation.extra.amodal_region.value()?.order.value().copied()
}

/// Compares the order of objects with the masks of an image: the positions from the front and, in files of this
/// program, the length of the longest chain of occluders in front of each object. Only files of this program define
/// this length exactly. Orders that cycles leave undecided are not checked. Without `labels` that have both visible and
/// amodal masks, the masks contradict nothing.
pub fn faults_of_order(
    annotations: &[AmodalAnnotation],
    labels: Option<impl FnOnce() -> Result<Vec<ObjectLabels>>>,
    is_ours: bool,
) -> Vec<DatasetFault> {
    let mut faults: Vec<DatasetFault> = faults_of_depth(annotations).collect();
    let states_order = |it: &AmodalAnnotation| place_from_front(it).is_some() || occlusion_depth(it).is_some();
    let Some(labels) = labels.filter(|_| annotations.iter().any(states_order)) else {
        return faults;
    };
    let Ok(labels) = labels() else { return Vec::new() };
    let hidden: Vec<Mask> = labels.iter().map(hidden_of).collect();
    let masks: Vec<[&Mask; 2]> = labels.iter().zip(&hidden).map(|(it, hidden)| [&it.visible, hidden]).collect();
    let order = ObjectOrder::of_masks(&masks);
    let places: Vec<Option<u64>> = annotations.iter().map(place_from_front).collect();
    let mut first_at: BTreeMap<u64, usize> = BTreeMap::new();
    // At most one fault of each kind per object, since the number of pairs grows quadratically.
    for (j, behind) in annotations.iter().enumerate() {
        let Some(place) = places[j] else { continue };
        let mut fault = |contradiction: String| {
            let message = format!("`amodal_region.order` is {place}, {contradiction}");
            faults.push(fault_of_order(behind, message));
        };
        if let Some(&i) = first_at.get(&place) {
            let first = annotations[i].id;
            fault(format!("like annotation {first}: no two objects share a place"));
        } else {
            first_at.insert(place, j);
        }
        let is_wrong = |i: &usize| places[*i].is_some_and(|other| other > place) && order.is_in_front(*i, j);
        if let Some((i, other)) = (0..places.len()).find(is_wrong).and_then(|i| Some((i, places[i]?))) {
            let hides = masks[i][0].shared_area(masks[j][1]);
            fault(format!(
                "but annotation {}, which hides {hides} of its pixels, has {other}: the front has the lower number",
                annotations[i].id
            ));
        }
    }
    if is_ours {
        let said = annotations.iter().zip(order.certain_layers());
        faults.extend(said.filter_map(|(it, layer)| {
            let (said, own) = (occlusion_depth(it)?, layer? as u64);
            let message = format!("`occl_depth` is {said}, the longest chain of occluders has {own}");
            (said != own && said < annotations.len() as u64).then(|| fault_of_order(it, message))
        }));
    }
    faults
}
