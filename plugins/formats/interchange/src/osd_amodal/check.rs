//! Faults of OSD-Amodal's images of labels.

use super::read::{OsdImage, OsdSource};
use super::record::{LABELS, MASKS};
use std::collections::BTreeSet;
use syntable_formats::decode;
use syntable_model::prelude::*;
use syntable_model::reader::DatasetFault;
use syntable_model::rule;

impl OsdImage {
    /// Labels without an amodal mask that the image shows or that have an occlusion mask.
    pub fn without_amodal(&self, shown: &Plane<u16>) -> BTreeSet<u16> {
        let [amodal, occluded] = &self.masks;
        let labels = shown.data().iter().chain(occluded.keys()).copied();
        labels.filter(|label| *label > 0 && !amodal.contains_key(label)).collect()
    }
}

impl OsdSource {
    /// The rules that the labels of an image break.
    pub fn faults_of(&self, image: usize) -> Vec<DatasetFault> {
        let of = &self.images[image];
        let shown = self.path(LABELS, &of.name).and_then(|path| decode::gray(&path));
        let Ok(shown) = shown else { return Vec::new() };
        let message = |label| format!("label {label} has no mask in {}, and is no object", MASKS[0]);
        let fault = |label| DatasetFault::new(rule::RECORDS_AGREE, message(label));
        of.without_amodal(&shown).into_iter().map(fault).collect()
    }
}
