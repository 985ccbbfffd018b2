//! The records of KINS' annotation file.

use serde::de::{Deserializer, Error as _};
use serde_json::Value as Json;
use syntable_formats::Extra;
use syntable_formats::coco::id;
use syntable_formats::listing::{AnnotationLink, AnnotationRecord};
use syntable_formats::segmentation::Segmentation;
use syntable_model::prelude::*;

/// An object, in either form: amodal and visible mask with their numbers, first with the names of 2020, then with the
/// names of 2019. `N` is the type of areas and boxes: this program writes whole numbers, and other files have
/// fractions.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct KinsAnnotation<N = f64> {
    #[serde(deserialize_with = "id")]
    pub id: u64,
    #[serde(deserialize_with = "id")]
    pub image_id: u64,
    #[serde(deserialize_with = "id")]
    pub category_id: u64,
    /// 1 if it describes many objects together.
    #[serde(default, deserialize_with = "flag")]
    pub iscrowd: u8,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a_segm: Option<Segmentation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a_bbox: Option<[N; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a_area: Option<N>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub i_segm: Option<Segmentation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub i_bbox: Option<[N; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub i_area: Option<N>,
    /// Pixels of the holes that the polygons fill. SynTable adds this field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a_hole_area: Option<N>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub i_hole_area: Option<N>,
    /// Group of objects that overlap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oco_id: Option<u64>,
    /// Position in the group, from the front.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ico_id: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<N>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<Segmentation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bbox: Option<[N; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inmodal_seg: Option<Segmentation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inmodal_bbox: Option<[N; 4]>,
    /// Fields that the reader ignores.
    #[serde(flatten)]
    pub extra: Extra,
}

/// A flag that some tools write as a boolean.
fn flag<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    match Json::deserialize(deserializer)? {
        Json::Null => Ok(0),
        Json::Bool(flag) => Ok(flag.into()),
        Json::Number(number) => Ok((number.as_f64() != Some(0.0)).into()),
        other => Err(D::Error::custom(format!("`{other}` is no flag: write 0 or 1"))),
    }
}

impl AnnotationRecord for KinsAnnotation {
    fn link(&self) -> AnnotationLink {
        AnnotationLink { id: self.id, image: self.image_id, category: Some(self.category_id) }
    }
}

/// A mask in an annotation with its area and box: names of keys and their values.
pub struct StatedMask<'a> {
    pub mask: (&'static str, Option<&'a Segmentation>),
    pub area: (&'static str, Option<f64>),
    /// Pixels of the mask's holes, which outlines do not have. SynTable adds this field.
    pub holes_px2: Option<f64>,
    pub bbox: (&'static str, Option<[f64; 4]>),
}

impl KinsAnnotation {
    /// The stated amodal mask and visible mask.
    pub fn said(&self) -> [StatedMask<'_>; 2] {
        if self.a_segm.is_some() || self.i_segm.is_some() {
            let amodal = StatedMask {
                mask: ("a_segm", self.a_segm.as_ref()),
                area: ("a_area", self.a_area),
                holes_px2: self.a_hole_area,
                bbox: ("a_bbox", self.a_bbox),
            };
            let visible = StatedMask {
                mask: ("i_segm", self.i_segm.as_ref()),
                area: ("i_area", self.i_area),
                holes_px2: self.i_hole_area,
                bbox: ("i_bbox", self.i_bbox),
            };
            return [amodal, visible];
        }
        let amodal = StatedMask {
            mask: ("segmentation", self.segmentation.as_ref()),
            area: ("area", self.area),
            holes_px2: None,
            bbox: ("bbox", self.bbox),
        };
        let visible = StatedMask {
            mask: ("inmodal_seg", self.inmodal_seg.as_ref()),
            area: ("inmodal_area", None),
            holes_px2: None,
            bbox: ("inmodal_bbox", self.inmodal_bbox),
        };
        [amodal, visible]
    }

    /// Whether it describes many objects together.
    pub fn is_crowd(&self) -> bool {
        self.iscrowd != 0
    }

    /// A key of the annotation, for messages.
    pub fn key(&self, key: &str) -> String {
        format!("annotation {}: `{key}`", self.id)
    }

    pub fn mask(&self, said: &StatedMask, [width, height]: [u32; 2]) -> Result<Mask> {
        let (key, segmentation) = said.mask;
        let missing = || {
            Error::new("it is missing")
                .help("an object has `a_segm` and `i_segm`, or `segmentation` and `inmodal_seg`")
                .context(self.key(key))
        };
        let decoded = segmentation.ok_or_else(missing)?.decode(width, height);
        decoded.map_err(|error| error.context(self.key(key)))
    }
}
