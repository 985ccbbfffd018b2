//! What contradicts D2SA's own fields of annotations, which the reader of `coco` reads.

use crate::coco::Annotation;
use crate::family::read::Fault;
use crate::order::Order;
use crate::read::hidden_of;
use std::collections::BTreeMap;
use syntable_formats::listing::Listing;
use syntable_formats::read::Labels;
use syntable_model::prelude::*;

/// `amodal_region.name`, which names another category than that of the object.
pub fn fault_of_name(listing: &Listing, annotation: &Annotation, is_ours: bool) -> Option<Fault> {
    let said = annotation.extra.amodal_region.value()?.name.value()?;
    let categories = || listing.file.categories.iter().flatten();
    let own = &categories().find(|it| it.id == annotation.category_id)?.name;
    let is_wrong = said != own && (is_ours || categories().any(|it| it.name == *said));
    let message = format!("annotation {}: `amodal_region.name` is {said:?}, its category is {own:?}", annotation.id);
    is_wrong.then_some(("records_agree", message))
}

/// `amodal_region` says the area and the box again.
pub fn faults_of_region(annotation: &Annotation) -> Vec<Fault> {
    let mut faults = Vec::new();
    let of = |key: &str| format!("annotation {}: `{key}`", annotation.id);
    let region = annotation.extra.amodal_region.value();
    if let Some(area) = region.and_then(|it| it.area.value()).filter(|it| (**it - annotation.area).abs() > 0.5) {
        let message = format!("{} is {area}, its `area` {}", of("amodal_region.area"), annotation.area);
        faults.push(("records_agree", message));
    }
    let bbox = region.and_then(|it| it.bbox.value());
    if let Some(bbox) = bbox.filter(|it| it.iter().zip(annotation.bbox).any(|(a, b)| (a - b).abs() > 0.5)) {
        let message = format!("{} is {bbox:?}, its `bbox` {:?}", of("amodal_region.bbox"), annotation.bbox);
        faults.push(("records_agree", message));
    }
    faults
}

/// `occl_depth`, that a number of objects contradicts: the most that can be in front of one are all others.
fn faults_of_depth(annotations: &[Annotation]) -> impl Iterator<Item = String> {
    annotations.iter().filter_map(|annotation| {
        let depth = occlusion_depth(annotation)?;
        let others = annotations.len() - 1;
        (depth > others as u64)
            .then(|| format!("annotation {}: `occl_depth` is {depth}, and there are {others} others", annotation.id))
    })
}

fn occlusion_depth(annotation: &Annotation) -> Option<u64> {
    annotation.extra.occl_depth.value().copied()
}

/// Place of an object from the front, from 1.
fn place_from_front(annotation: &Annotation) -> Option<u64> {
    annotation.extra.amodal_region.value()?.order.value().copied()
}

/// What the masks of an image's objects contradict of the numbers: places from the front, and in files of this program, whose
/// meaning is known, how many objects are in front of each other. What circles leave open is not looked at. Without `labels`
/// of both visible and whole objects, masks contradict nothing.
pub fn faults_of_order(
    annotations: &[Annotation],
    labels: Option<impl FnOnce() -> Result<Vec<Labels>>>,
    is_ours: bool,
) -> Vec<Fault> {
    let mut faults: Vec<String> = faults_of_depth(annotations).collect();
    let states_order = |it: &Annotation| place_from_front(it).is_some() || occlusion_depth(it).is_some();
    let Some(labels) = labels.filter(|_| annotations.iter().any(states_order)) else {
        return faults.into_iter().map(|message| ("order_is_that_of_masks", message)).collect();
    };
    let Ok(labels) = labels() else { return Vec::new() };
    let hidden: Vec<Mask> = labels.iter().map(hidden_of).collect();
    let masks: Vec<[&Mask; 2]> = labels.iter().zip(&hidden).map(|(it, hidden)| [&it.visible, hidden]).collect();
    let order = Order::of_masks(&masks);
    let places: Vec<Option<u64>> = annotations.iter().map(place_from_front).collect();
    let mut first_at: BTreeMap<u64, usize> = BTreeMap::new();
    // Of each object one fault of a kind, so that there are not as many as pairs.
    for (j, behind) in annotations.iter().enumerate() {
        let Some(place) = places[j] else { continue };
        let of = || format!("annotation {}: `amodal_region.order` is {place}", behind.id);
        if let Some(&i) = first_at.get(&place) {
            let first = annotations[i].id;
            faults.push(format!("{}, as that of annotation {first} is: no two objects have one place", of()));
        } else {
            first_at.insert(place, j);
        }
        let is_wrong = |i: &usize| places[*i].is_some_and(|other| other > place) && order.is_in_front(*i, j);
        if let Some((i, other)) = (0..places.len()).find(is_wrong).and_then(|i| Some((i, places[i]?))) {
            let hides = masks[i][0].shared_area(masks[j][1]);
            faults.push(format!(
                "{}, but that of annotation {}, which hides {hides} of its pixels, is {other}: the front has the lower number",
                of(),
                annotations[i].id
            ));
        }
    }
    if is_ours {
        let said = annotations.iter().zip(order.certain_layers());
        faults.extend(said.filter_map(|(it, layer)| {
            let (said, own) = (occlusion_depth(it)?, layer? as u64);
            (said != own && said < annotations.len() as u64).then(|| {
                format!("annotation {}: `occl_depth` is {said}, the longest chain of occluders has {own}", it.id)
            })
        }));
    }
    faults.into_iter().map(|message| ("order_is_that_of_masks", message)).collect()
}
