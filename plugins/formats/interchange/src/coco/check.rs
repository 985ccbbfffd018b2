//! Faults of COCO's annotation files.

use super::read::{CocoObjects, is_there, segmentation, stated_ids};
use super::record::{AmodalAnnotation, NamedField};
use crate::d2sa;
use crate::read::{MaskTolerance, edge_px2, fits_mask, fits_outlines, no_pixels};
use syntable_formats::listing::AnnotationListing;
use syntable_formats::read::{self, KnownMasks};
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

impl CocoObjects {
    /// The rules that the records of an image break.
    pub fn faults_of_image(
        &self,
        listing: &AnnotationListing,
        image: usize,
        annotations: &[AmodalAnnotation],
    ) -> Vec<DatasetFault> {
        let frame = &listing.images[image].frame;
        let size = [frame.width, frame.height];
        let each = annotations.iter().flat_map(|annotation| {
            let faults = self.faults_of(listing, size, annotation).into_iter();
            faults.map(|fault| fault.of(FaultSubject::Annotation(annotation.id)))
        });
        let mut faults: Vec<_> = each.collect();
        let labels = || annotations.iter().map(|it| self.labels(listing, size, InstanceId(1), it)).collect();
        let has_both = self.known == KnownMasks::Both;
        faults.extend(d2sa::faults_of_order(annotations, has_both.then_some(labels), self.is_ours));
        faults.extend(read::id_fault(&stated_ids(annotations)));
        faults
    }

    /// The rules that an annotation breaks. A missing mask is a fault if other annotations have masks.
    fn faults_of(
        &self,
        listing: &AnnotationListing,
        size: [u32; 2],
        annotation: &AmodalAnnotation,
    ) -> Vec<DatasetFault> {
        if self.has_masks && segmentation(annotation).is_none() {
            let message = "`segmentation` is empty or missing: the object has a box alone; add its mask, or remove it";
            return vec![DatasetFault::new("objects_have_masks", message)];
        }
        // If no annotation has a visible mask, and the amodal masks differ from `segmentation`, then `segmentation` is
        // the visible mask.
        let mut faults = faults_of(size, annotation, self.has_visible || self.known != KnownMasks::Both);
        faults.extend(d2sa::fault_of_name(listing, annotation, self.is_ours));
        faults.extend(self.fault_of_hidden(listing, size, annotation));
        faults
    }

    /// Reports an object without an occlusion mask whose other masks show that a part of it is hidden.
    fn fault_of_hidden(
        &self,
        listing: &AnnotationListing,
        size: [u32; 2],
        annotation: &AmodalAnnotation,
    ) -> Option<DatasetFault> {
        let hidden = annotation.extra.hidden();
        if !self.has_hidden || self.known != KnownMasks::Both || is_there(&hidden) {
            return None;
        }
        let label = self.labels(listing, size, InstanceId(1), annotation).ok()?;
        let key = hidden[usize::from(self.is_d2sa)].0;
        let hidden = label.amodal.as_ref()?.minus(&label.visible).area();
        let message =
            format!("`{key}` is missing, and {hidden} pixels of its whole mask are not visible: add the hidden pixels");
        (hidden > 0).then(|| DatasetFault::new(rule::OCCLUSION_IS_AMODAL_MINUS_VISIBLE, message))
    }
}

/// Compares the area and box of an annotation with its mask, and the mask with the other masks of the object. A
/// `segmentation` that matches neither the amodal nor the visible mask is a fault only if `has_role` is set: the file
/// then distinguishes visible and amodal masks.
fn faults_of([width, height]: [u32; 2], annotation: &AmodalAnnotation, has_role: bool) -> Vec<DatasetFault> {
    let Some(segmentation) = segmentation(annotation) else { return Vec::new() };
    let Ok(mask) = segmentation.decode(width, height) else { return Vec::new() };
    let (area, bbox) = (("area", annotation.area), ("bbox", annotation.bbox));
    let (mut faults, edge_px2) = match segmentation {
        Segmentation::Polygons(outlines) => {
            (fits_outlines(("segmentation", outlines), &mask, area, bbox), edge_px2(&mask).max(1.0))
        }
        _ => {
            // A box with fractional edges describes the polygons from which the mask was made.
            let is_whole = annotation.bbox.iter().flatten().all(|edge| edge.fract() == 0.0);
            let box_px = if is_whole { 0.0 } else { 1.0 };
            (fits_mask(&mask, area, bbox, MaskTolerance { area_px2: 0.5, box_px }), 0.0)
        }
    };
    let fields = &annotation.extra;
    let other = |(_, field): NamedField<Segmentation>| field.value()?.decode(width, height).ok();
    let (amodal, visible) = (fields.amodal(), fields.visible());
    let others = || std::iter::once(amodal).chain(visible).chain(fields.hidden());
    if mask.is_empty() && others().filter_map(other).all(|mask| mask.is_empty()) {
        faults.push(no_pixels());
    }
    if let Some((key, amodal)) = other(amodal).filter(|_| has_role).map(|mask| (amodal.0, mask)) {
        let differ = |other: &Mask| f64::from(mask.minus(other).area() + other.minus(&mask).area());
        let is_one = differ(&amodal) <= edge_px2 || other(visible[0]).is_some_and(|it| differ(&it) <= edge_px2);
        if !is_one {
            let message = format!(
                "`segmentation` differs from `{key}` at {} pixels, and is not `{}` either",
                differ(&amodal),
                visible[0].0
            );
            faults.push(DatasetFault::new("segmentation_is_a_mask_of_the_object", message));
        }
    }
    faults.extend(d2sa::faults_of_region(annotation));
    faults
}
