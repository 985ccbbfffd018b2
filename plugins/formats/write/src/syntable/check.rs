//! Faults of SynTable's annotation files.

use super::read::{ShownImage, SynTableSource};
use super::record::two_decimals;
use syntable_formats::read::{self, ObjectLabels};
use syntable_formats::syntable::SynTableAnnotation;
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

impl SynTableSource {
    /// The rules that the records of an image break.
    pub fn faults_of(&self, shown: &ShownImage) -> Vec<DatasetFault> {
        let stated = shown.stated_ids();
        let Ok(ids) = read::ids_of(&stated) else { return Vec::new() };
        let labels = ids.into_iter().zip(&shown.annotations).map(|(id, it)| (it, self.labels(&shown.image, id, it)));
        let read = labels.filter_map(|(annotation, labels)| Some((annotation, labels.ok()?)));
        let faults = read.flat_map(|(annotation, labels)| {
            let faults = fault_of_rate(annotation).into_iter().chain(faults_of_numbers(annotation, &labels));
            faults.map(|fault| fault.of(FaultSubject::Annotation(annotation.id)))
        });
        faults.chain(read::id_fault(&stated)).chain(list_fault(shown)).collect()
    }
}

/// Reports a rate that is missing although masks exist, or a rounded rate that contradicts the exact one.
fn fault_of_rate(annotation: &SynTableAnnotation) -> Option<DatasetFault> {
    let fault = |what: String| Some(DatasetFault::new(rule::RATE_IS_RATIO_OF_AREAS, what));
    match (annotation.occluded_rate, annotation.occluded_rate_rounded) {
        (None, _) if annotation.occluded_mask.is_some() => {
            fault("it has `occluded_mask` and no number as `occluded_rate`".to_owned())
        }
        (Some(rate), Some(rounded)) if (rounded - two_decimals(rate)).abs() > 1e-9 => {
            fault(format!("`occluded_rate_rounded` is {rounded}, `occluded_rate` {rate}"))
        }
        _ => None,
    }
}

/// Areas and boxes in our form that contradict the masks. In the form of the release, areas have another meaning.
fn faults_of_numbers(annotation: &SynTableAnnotation, labels: &ObjectLabels) -> Vec<DatasetFault> {
    let Some(amodal) = labels.amodal.as_ref().filter(|_| annotation.amodal_bbox.is_some()) else { return Vec::new() };
    let (visible, occluded) = (&labels.visible, labels.occlusion.as_ref());
    let areas = [
        ("area", Some(annotation.area), Some(amodal)),
        ("visible_area", annotation.visible_area, Some(visible)),
        ("occluded_area", annotation.occluded_area, occluded),
    ];
    let mut faults = Vec::new();
    for (name, said, mask) in areas {
        if let (Some(said), Some(mask)) = (said, mask)
            && said != u64::from(mask.area())
        {
            let message = format!("`{name}` is {said}, its mask has {} pixels", mask.area());
            faults.push(DatasetFault::new(rule::AREAS_MATCH_MASKS, message));
        }
    }
    let boxes = [visible.bbox(), amodal.bbox()].map(<[i32; 4]>::from);
    if !boxes.contains(&annotation.bbox) {
        let message = format!("`bbox` is {:?}, its masks have {boxes:?}", annotation.bbox);
        faults.push(DatasetFault::new(rule::BOX_MATCHES_MASK, message));
    }
    faults
}

/// Reports a list of an image's objects that contradicts its annotations.
fn list_fault(shown: &ShownImage) -> Option<DatasetFault> {
    let listed = shown.image.instance_ids.as_ref()?;
    let own = shown.annotations.iter().map(|annotation| annotation.instance_id);
    let message = format!("`instance_ids` is {listed:?}, but the annotations have other ids or another order");
    let fault = || DatasetFault::new(rule::RECORDS_AGREE, message).of(FaultSubject::Image(shown.image.id));
    (!listed.iter().copied().map(Some).eq(own)).then(fault)
}
