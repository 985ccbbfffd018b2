//! Writes COCO's layout.

use super::keypoints::{self, ObjectKeypoints};
use super::{Coco, MaskChoice};
use crate::family::write::{Family, SceneFiles, policy};
use crate::labels::{self, LabelMasks, Partial, ShownLabel};
use syntable_formats::coco::{Category, categories};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;
use syntable_model::product::standard::{KEYPOINTS, RGB};

/// Path of the annotation file.
pub fn file(split: &str) -> String {
    format!("annotations/instances_{split}.json")
}

impl Family for Coco {
    fn reads(&self) -> Vec<Input> {
        let keypoints = (!self.keypoints.is_empty()).then(|| Input::of(KEYPOINTS));
        [Input::of(RGB), policy()]
            .into_iter()
            .chain(labels::box_inputs(self.masks))
            .chain(keypoints)
            .chain(self.field_inputs())
            .collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        file(&self.split)
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let labels = self.masks.shown_partial(
            cx.log,
            labels::partial_or_box(cx.dataset, products)?,
            StoredParts::AmodalAndBoxes,
        );
        let (of_image, mut of_objects) = self.fields(products)?;
        files.image_with(cx, products, labels.len(), of_image)?;
        let named = if self.keypoints.is_empty() { None } else { Some(ObjectKeypoints::of(products)?) };
        labels.iter().try_for_each(|label| {
            let mut annotation = self.masks.annotation(label);
            if let Some(named) = &named {
                named.fill(label.id, &self.keypoints, &mut annotation.extra);
            }
            annotation.extra.extra.extend(of_objects.remove(&label.id).unwrap_or_default());
            files.annotation(&annotation)
        })
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split", "supercategories"]
    }

    fn categories(&self, dataset: &DatasetInfo) -> Result<Vec<Category>> {
        let mut categories = categories(dataset);
        self.set_supercategories(&mut categories)?;
        if !self.keypoints.is_empty() {
            let extra = keypoints::of_category(&self.keypoints, &self.skeleton);
            categories.iter_mut().for_each(|category| category.extra = extra.clone());
        }
        Ok(categories)
    }
}

impl MaskChoice {
    /// The mask of an object.
    pub(crate) fn of<'a>(self, label: &ShownLabel<'a>) -> &'a Mask {
        match self {
            Self::Visible => label.visible,
            Self::Amodal => label.amodal,
        }
    }

    /// The labels of the objects whose mask is not empty, for a format that stores amodal masks. The run reports the
    /// omitted objects.
    pub(crate) fn shown<'a>(self, log: &dyn Log, labels: Vec<ShownLabel<'a>>) -> Vec<ShownLabel<'a>> {
        let whole = labels.iter().map(|label| Partial::from(*label)).collect::<Vec<_>>();
        report_left_out(log, &whole, |label| self.shown_of(label), StoredParts::Amodal);
        labels.into_iter().filter(|label| !self.of(label).is_empty()).collect()
    }

    /// As [`Self::shown`], for labels that may lack one kind of mask, and for a format that stores the given parts.
    pub(crate) fn shown_partial<'a>(
        self,
        log: &dyn Log,
        mut labels: Vec<Partial<'a>>,
        stored: StoredParts,
    ) -> Vec<Partial<'a>> {
        report_left_out(log, &labels, |label| self.shown_of(label), stored);
        labels.retain(|label| self.shown_of(label).map_or(stored.has_boxes(), |mask| !mask.is_empty()));
        labels
    }
}

/// Parts of an object that a format stores beside a visible mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StoredParts {
    /// No other part.
    Visible,
    /// Amodal masks.
    Amodal,
    /// Amodal masks, and boxes of objects without a mask.
    AmodalAndBoxes,
    /// Only boxes.
    Boxes,
}

impl StoredParts {
    fn has_amodal(self) -> bool {
        matches!(self, Self::Amodal | Self::AmodalAndBoxes)
    }

    fn has_boxes(self) -> bool {
        matches!(self, Self::Boxes | Self::AmodalAndBoxes)
    }
}

/// Reports objects that are omitted because their mask is empty: objects without any pixel and, if the format stores
/// amodal masks, objects whose amodal mask is lost.
fn report_left_out<'a>(
    log: &dyn Log,
    labels: &[Partial<'a>],
    mask: impl Fn(&Partial<'a>) -> Option<&'a Mask>,
    stored: StoredParts,
) {
    let is_hidden = |label: &&Partial| matches!(label.masks, LabelMasks::All(all) if !all.amodal.is_empty());
    let empty: Vec<&Partial> = labels.iter().filter(|label| mask(label).is_some_and(Mask::is_empty)).collect();
    let hidden = empty.iter().copied().filter(is_hidden).count();
    log.left_out(&LeftOut::without_pixels(empty.len() - hidden, labels.len()));
    if stored.has_amodal() {
        let what = "objects are left out with their amodal masks: no pixel of them is visible";
        let help = "the writer `d2sa`, and `coco` with `masks = \"amodal\"`, keep such objects";
        log.left_out(&LeftOut::new(hidden, labels.len(), what).help(help));
    }
}
