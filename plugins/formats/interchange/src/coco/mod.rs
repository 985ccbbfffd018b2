//! COCO detection and instance segmentation.

mod keypoints;
pub(crate) mod read;

use crate::annotation_file::{self, Listed, SceneFiles, check_split, merge, policy};
use crate::labels::{self, Label, ObjectMasks, Partial};
use keypoints::Named;
use serde_json::json;
use syntable_formats::Extra;
use syntable_formats::coco::{Annotation, categories};
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{KEYPOINTS, RGB};

/// Writes COCO's layout for detection and instance segmentation.
///
/// # What it does
///
/// `segmentation`, `area` and `bbox` are those of one mask, visible or amodal, so that COCO's own tools measure what they
/// say; every annotation also has both masks, both boxes and the rate of occlusion under SynTable's names. Boxes are
/// `[x, y, width, height]` with `width = last column - first column + 1`, areas whole pixels, masks compressed run lengths.
/// Image ids are `scene · views_per_scene + view + 1`; images without objects are listed, too. Categories are `object` (1)
/// and the classes of the recipe's pools. Of a dataset that is converted and has visible masks alone,
/// `segmentation` is the visible mask and the fields of SynTable are left out; of one of amodal masks alone, `amodal_mask` and
/// `amodal_bbox` say that `segmentation` is amodal.
///
/// With `keypoints` annotations have these as well: x, y and visibility of each, 0 for one that is not labeled (then x and y
/// are 0, too), 1 for a hidden one, 2 for one that is seen. As in COCO's files, (0, 0) is the center of the first pixel.
/// Every category lists the names, and the `skeleton` that joins them.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB; `file_name` is relative to `{id}/images`.
/// - `{id}/annotations/instances_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coco {
    /// Mask of `segmentation`, `area` and `bbox`. Objects whose visible mask is empty have no annotation with `visible`.
    pub masks: Masks,
    /// Name of the split in the annotation file's name.
    pub split: String,
    /// Names of keypoints, in the order in which every annotation has them, as `keypoints` and `num_keypoints`; one that an
    /// object does not have, or that is outside of the image, counts as not labeled. Without names there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keypoints: Vec<String>,
    /// Pairs of names of keypoints that drawings join by a line.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skeleton: Vec<[String; 2]>,
}

/// A mask of each object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Masks {
    /// What the image shows of the object.
    Visible,
    /// The object without occluders.
    Amodal,
}

impl Default for Coco {
    fn default() -> Self {
        Self { masks: Masks::Amodal, split: "train".into(), keypoints: Vec::new(), skeleton: Vec::new() }
    }
}

impl Config for Coco {
    type Stage = dyn Writer;
    const KIND: &'static str = "coco";
    const EXAMPLE: &'static str = "masks = \"amodal\"\nsplit = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        keypoints::check_names(&self.keypoints)?;
        keypoints::check_skeleton(&self.keypoints, &self.skeleton)?;
        Ok(Box::new(self))
    }
}

/// Path of the annotation file.
pub(crate) fn file(split: &str) -> String {
    format!("annotations/instances_{split}.json")
}

impl Writer for Coco {
    fn reads(&self) -> Vec<Input> {
        let keypoints = (!self.keypoints.is_empty()).then(|| Input::of(KEYPOINTS));
        [Input::of(RGB), policy()].into_iter().chain(labels::either_inputs(self.masks)).chain(keypoints).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let files = SceneFiles::new(output);
        Ok(Box::new(CocoScene { masks: self.masks, keypoints: self.keypoints.clone(), files }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(annotation_file::paths(of, &[file(&self.split)]))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let mut categories = categories(cx.dataset);
        if !self.keypoints.is_empty() {
            categories
                .iter_mut()
                .for_each(|category| category.extra = keypoints::of_category(&self.keypoints, &self.skeleton));
        }
        merge(cx, finish, &file(&self.split), Some(&categories), Listed::All)
    }
}

struct CocoScene {
    masks: Masks,
    keypoints: Vec<String>,
    files: SceneFiles,
}

impl SceneWriter for CocoScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let labels = self.masks.shown_partial(cx.log, labels::partial(cx.dataset, products)?, true);
        self.files.image(cx, products, labels.len())?;
        let named = if self.keypoints.is_empty() { None } else { Some(Named::of(products)?) };
        labels.iter().try_for_each(|label| {
            let mut annotation = self.masks.annotation(label);
            if let Some(named) = &named {
                annotation.extra.extend(named.fields(label.id, &self.keypoints));
            }
            self.files.annotation(&annotation)
        })
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

impl Masks {
    /// The mask of an object.
    pub(crate) fn of<'a>(self, label: &Label<'a>) -> &'a Mask {
        match self {
            Self::Visible => label.visible,
            Self::Amodal => label.amodal,
        }
    }

    /// The labels of the objects whose mask is not empty, for a format that stores amodal masks. Objects that are left out are
    /// reported.
    pub(crate) fn shown<'a>(self, log: &dyn Log, labels: Vec<Label<'a>>) -> Vec<Label<'a>> {
        let whole = labels.iter().map(|label| Partial::from(*label)).collect::<Vec<_>>();
        report_left_out(log, &whole, |label| self.shown_of(label), true);
        labels.into_iter().filter(|label| !self.of(label).is_empty()).collect()
    }

    /// The same for labels that need not have both kinds of masks, and a format that stores amodal masks or not.
    pub(crate) fn shown_partial<'a>(
        self,
        log: &dyn Log,
        mut labels: Vec<Partial<'a>>,
        stores_amodal: bool,
    ) -> Vec<Partial<'a>> {
        report_left_out(log, &labels, |label| self.shown_of(label), stores_amodal);
        labels.retain(|label| !self.shown_of(label).is_empty());
        labels
    }

    /// The mask of an object and its box; the other one where there is no such mask.
    fn with_box<'a>(self, label: &Partial<'a>) -> (&'a Mask, BBox) {
        match (label.masks, self) {
            (ObjectMasks::Visible(mask, bbox) | ObjectMasks::Amodal(mask, bbox), _) => (mask, bbox),
            (ObjectMasks::All(all), Self::Visible) => (all.visible, all.visible_box),
            (ObjectMasks::All(all), Self::Amodal) => (all.amodal, all.amodal_box),
        }
    }

    /// The mask of an object; the other one where there is no such mask.
    pub(crate) fn shown_of<'a>(self, label: &Partial<'a>) -> &'a Mask {
        self.with_box(label).0
    }

    /// The record of an object.
    pub(crate) fn annotation(self, label: &Partial) -> Annotation {
        let (mask, bbox) = self.with_box(label);
        let mut extra = Extra::from_iter([("instance_id".to_owned(), label.id.0.into())]);
        extra.extend(of_hidden(label.masks));
        Annotation {
            id: 0,
            image_id: 0,
            category_id: label.category.into(),
            segmentation: Some(Segmentation::Rle(Rle::encode(mask))),
            area: mask.area().into(),
            bbox: <[i32; 4]>::from(bbox).map(f64::from),
            iscrowd: 0,
            extra,
        }
    }
}

/// Reports objects that are left out since their mask is empty: those without any pixel, and if the format stores amodal masks,
/// those whose amodal mask it loses.
fn report_left_out<'a>(
    log: &dyn Log,
    labels: &[Partial<'a>],
    mask: impl Fn(&Partial<'a>) -> &'a Mask,
    stores_amodal: bool,
) {
    let is_hidden = |label: &&Partial| matches!(label.masks, ObjectMasks::All(all) if !all.amodal.is_empty());
    let left_out: Vec<&Partial> = labels.iter().filter(|label| mask(label).is_empty()).collect();
    let hidden = left_out.iter().copied().filter(is_hidden).count();
    log.left_out(&LeftOut::without_pixels(left_out.len() - hidden, labels.len()));
    if stores_amodal {
        let what = "objects are left out with their amodal masks: no pixel of them is visible";
        let help = "the writer `d2sa`, and `coco` with `masks = \"amodal\"`, keep such objects";
        log.left_out(&LeftOut::new(hidden, labels.len(), what).help(help));
    }
}

/// What COCO has no fields for.
fn of_hidden(masks: ObjectMasks) -> Extra {
    let label = match masks {
        ObjectMasks::Visible(..) => return Extra::new(),
        // It says what `segmentation` is.
        ObjectMasks::Amodal(mask, bbox) => {
            return fields(json!({ "amodal_mask": Rle::encode(mask), "amodal_bbox": <[i32; 4]>::from(bbox) }));
        }
        ObjectMasks::All(label) => label,
    };
    let boxes = [label.visible_box, label.amodal_box].map(<[i32; 4]>::from);
    fields(json!({
        "visible_mask": Rle::encode(label.visible),
        "visible_bbox": boxes[0],
        "amodal_mask": Rle::encode(label.amodal),
        "amodal_bbox": boxes[1],
        "occluded_mask": Rle::encode(label.occlusion),
        "occluded_rate": label.rate,
    }))
}

fn fields(json: serde_json::Value) -> Extra {
    json.as_object().cloned().unwrap_or_default()
}

register!(Coco);
