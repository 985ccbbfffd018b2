//! The records of COCO's annotation file, with the fields that COCO does not have.

use super::MaskChoice;
use crate::d2sa::D2saRegion;
use crate::field::LenientField;
use crate::labels::{LabelMasks, Partial};
use serde::de::MapAccess;
use serde_json::Value as Json;
use syntable_formats::coco::FurtherFields;
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_formats::{Extra, coco};
use syntable_model::prelude::*;
use syntable_model::product::BBox;

/// An object.
pub type AmodalAnnotation = coco::CocoAnnotation<AmodalFields>;

/// Fields of annotations beyond COCO's: first SynTable's, then D2SA's and KINS'.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct AmodalFields {
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub instance_id: LenientField<u64>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub visible_mask: LenientField<Segmentation>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub visible_bbox: LenientField<[i32; 4]>,
    /// Used if `segmentation` may be visible.
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub amodal_mask: LenientField<Segmentation>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub amodal_bbox: LenientField<[i32; 4]>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub occluded_mask: LenientField<Segmentation>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub occluded_rate: LenientField<f64>,
    /// x, y and visibility of each keypoint. They are written but not read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keypoints: Option<Vec<Json>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub num_keypoints: Option<usize>,
    /// D2SA's `occluded_mask`.
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub invisible_mask: LenientField<Segmentation>,
    /// D2SA's `occluded_rate`.
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub occlude_rate: LenientField<f64>,
    /// D2SA's number of objects in the longest chain of occluders in front.
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub occl_depth: LenientField<u64>,
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub amodal_region: LenientField<D2saRegion>,
    /// KINS' `visible_mask`.
    #[serde(skip_serializing_if = "LenientField::is_missing")]
    pub inmodal_seg: LenientField<Segmentation>,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

impl FurtherFields for AmodalFields {
    fn read<'de, A: MapAccess<'de>>(&mut self, name: String, fields: &mut A) -> std::result::Result<(), A::Error> {
        match name.as_str() {
            "instance_id" => self.instance_id.read("instance_id", fields),
            "visible_mask" => self.visible_mask.read_by(Segmentation::of_text, "visible_mask", fields),
            "visible_bbox" => self.visible_bbox.read("visible_bbox", fields),
            "amodal_mask" => self.amodal_mask.read_by(Segmentation::of_text, "amodal_mask", fields),
            "amodal_bbox" => self.amodal_bbox.read("amodal_bbox", fields),
            "occluded_mask" => self.occluded_mask.read_by(Segmentation::of_text, "occluded_mask", fields),
            "occluded_rate" => self.occluded_rate.read("occluded_rate", fields),
            "invisible_mask" => self.invisible_mask.read_by(Segmentation::of_text, "invisible_mask", fields),
            "occlude_rate" => self.occlude_rate.read("occlude_rate", fields),
            "occl_depth" => self.occl_depth.read("occl_depth", fields),
            "amodal_region" => self.amodal_region.read("amodal_region", fields),
            "inmodal_seg" => self.inmodal_seg.read_by(Segmentation::of_text, "inmodal_seg", fields),
            _ => self.extra.read(name, fields),
        }
    }
}

/// Unknown fields without new information: D2SA's repeats the record of the image, KINS' box follows from its mask, and
/// the number of keypoints follows from `keypoints`.
pub const FOLLOWING: &[&str] = &["amodal_base", "inmodal_bbox", "num_keypoints"];

/// A field by its name in the file.
pub type NamedField<'a, T> = (&'static str, &'a LenientField<T>);

impl AmodalFields {
    /// Visible masks next to an amodal `segmentation`.
    pub fn visible(&self) -> [NamedField<'_, Segmentation>; 2] {
        [("visible_mask", &self.visible_mask), ("inmodal_seg", &self.inmodal_seg)]
    }

    /// Amodal masks.
    pub fn amodal(&self) -> NamedField<'_, Segmentation> {
        ("amodal_mask", &self.amodal_mask)
    }

    /// Occlusion masks.
    pub fn hidden(&self) -> [NamedField<'_, Segmentation>; 2] {
        [("occluded_mask", &self.occluded_mask), ("invisible_mask", &self.invisible_mask)]
    }

    /// Occlusion rates.
    pub fn rate(&self) -> [NamedField<'_, f64>; 2] {
        [("occluded_rate", &self.occluded_rate), ("occlude_rate", &self.occlude_rate)]
    }
}

impl MaskChoice {
    /// The selected mask of an object and its box; the other mask if the object lacks the selected one. None for an object with
    /// a box alone.
    fn with_box<'a>(self, label: &Partial<'a>) -> Option<(&'a Mask, BBox)> {
        match (label.masks, self) {
            (LabelMasks::Box(_), _) => None,
            (LabelMasks::Visible(mask, bbox) | LabelMasks::Amodal(mask, bbox), _) => Some((mask, bbox)),
            (LabelMasks::All(all), Self::Visible) => Some((all.visible, all.visible_box)),
            (LabelMasks::All(all), Self::Amodal) => Some((all.amodal, all.amodal_box)),
        }
    }

    /// The selected mask of an object; the other mask if the object lacks the selected one. None for an object with a box alone.
    pub(crate) fn shown_of<'a>(self, label: &Partial<'a>) -> Option<&'a Mask> {
        self.with_box(label).map(|(mask, _)| mask)
    }

    /// The box of an object, `[x, y, width, height]`, px.
    pub(crate) fn box_of(self, label: &Partial) -> [f64; 4] {
        match (label.masks, self.with_box(label)) {
            (LabelMasks::Box(bbox), _) => bbox,
            (_, masked) => masked.map_or([0.0; 4], |(_, bbox)| <[i32; 4]>::from(bbox).map(f64::from)),
        }
    }

    /// The record of an object. Like Roboflow's files, a box without a mask has an empty list of polygons.
    pub(crate) fn annotation(self, label: &Partial) -> AmodalAnnotation {
        let (mask, bbox) = (self.shown_of(label), self.box_of(label));
        AmodalAnnotation {
            id: 0,
            image_id: 0,
            category_id: label.category.into(),
            segmentation: Some(mask.map_or_else(|| Segmentation::Polygons(Vec::new()), encoded)),
            area: Some(mask.map_or(bbox[2] * bbox[3], |mask| mask.area().into())),
            bbox: Some(bbox),
            iscrowd: 0,
            extra: AmodalFields { instance_id: u64::from(label.id.0).into(), ..of_masks(label.masks) },
        }
    }
}

fn encoded(mask: &Mask) -> Segmentation {
    Segmentation::Rle(Rle::encode(mask))
}

/// Fields for masks that COCO does not have.
fn of_masks(masks: LabelMasks) -> AmodalFields {
    match masks {
        LabelMasks::Visible(..) | LabelMasks::Box(_) => AmodalFields::default(),
        // Marks `segmentation` as amodal.
        LabelMasks::Amodal(mask, bbox) => AmodalFields {
            amodal_mask: encoded(mask).into(),
            amodal_bbox: <[i32; 4]>::from(bbox).into(),
            ..AmodalFields::default()
        },
        LabelMasks::All(label) => AmodalFields {
            visible_mask: encoded(label.visible).into(),
            visible_bbox: <[i32; 4]>::from(label.visible_box).into(),
            amodal_mask: encoded(label.amodal).into(),
            amodal_bbox: <[i32; 4]>::from(label.amodal_box).into(),
            occluded_mask: encoded(label.occlusion).into(),
            occluded_rate: label.rate.into(),
            ..AmodalFields::default()
        },
    }
}
