//! Writes KINS' layout, in its form of 2019 or of 2020.

use super::record::KinsAnnotation;
use super::{Kins, KinsVersion};
use crate::coco::MaskChoice;
use crate::family::write::{Family, SceneFiles};
use crate::labels::{self, ShownLabel};
use crate::order::{self, ObjectOrder};
use crate::outlines;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{AMODAL_OUTLINE, RGB, VISIBLE_OUTLINE};

impl Family for Kins {
    fn reads(&self) -> Vec<Input> {
        let mut inputs = vec![Input::of(RGB), Input::of(AMODAL_OUTLINE)];
        if self.version == KinsVersion::V2020 {
            inputs.push(Input::of(VISIBLE_OUTLINE));
            inputs.extend(order::inputs());
        }
        inputs.extend(labels::inputs());
        inputs
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        match self.version {
            KinsVersion::V2019 => format!("instances_{}.json", self.split),
            KinsVersion::V2020 => format!("update_{}_2020.json", self.split),
        }
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let labels = MaskChoice::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        let polygons: &[MaskChoice] = match self.version {
            KinsVersion::V2019 => &[MaskChoice::Amodal],
            KinsVersion::V2020 => &[MaskChoice::Amodal, MaskChoice::Visible],
        };
        for masks in polygons {
            outlines::report_holes(cx.log, products, *masks, labels.iter().map(|label| label.id))?;
        }
        files.image(cx, products, labels.len())?;
        match self.version {
            KinsVersion::V2019 => {
                labels.iter().try_for_each(|label| files.annotation(&annotation_2019(products, label)?))
            }
            KinsVersion::V2020 => {
                let places = places(&ObjectOrder::of(products, &labels)?, &groups(&labels));
                labels
                    .iter()
                    .zip(places)
                    .try_for_each(|(label, place)| files.annotation(&annotation_2020(products, label, place)?))
            }
        }
    }
}

fn numbers(bbox: BBox) -> [i64; 4] {
    <[i32; 4]>::from(bbox).map(i64::from)
}

fn annotation_2019(products: &Products, label: &ShownLabel) -> Result<KinsAnnotation<i64>> {
    let amodal = Segmentation::Polygons(vec![outlines::ring(products, MaskChoice::Amodal, label.id)?.into_flattened()]);
    Ok(KinsAnnotation {
        category_id: label.category.into(),
        area: Some(label.amodal.area().into()),
        segmentation: Some(amodal),
        bbox: Some(numbers(label.amodal_box)),
        inmodal_seg: Some(Segmentation::Rle(Rle::encode(label.visible))),
        inmodal_bbox: Some(numbers(label.visible_box)),
        ..KinsAnnotation::default()
    })
}

fn annotation_2020(products: &Products, label: &ShownLabel, place: GroupPlace) -> Result<KinsAnnotation<i64>> {
    let amodal = Segmentation::Polygons(vec![outlines::ring(products, MaskChoice::Amodal, label.id)?.into_flattened()]);
    Ok(KinsAnnotation {
        category_id: label.category.into(),
        a_segm: Some(amodal),
        a_bbox: Some(numbers(label.amodal_box)),
        a_area: Some(label.amodal.area().into()),
        i_segm: Some(Segmentation::Polygons(outlines::polygons(products, MaskChoice::Visible, label.id)?)),
        i_bbox: Some(numbers(label.visible_box)),
        i_area: Some(label.visible.area().into()),
        a_hole_area: Some(outlines::hole_area(products, MaskChoice::Amodal, label.id, label.amodal)?.into()),
        i_hole_area: Some(outlines::hole_area(products, MaskChoice::Visible, label.id, label.visible)?.into()),
        oco_id: Some(place.group as u64),
        ico_id: Some(place.order as u64),
        ..KinsAnnotation::default()
    })
}

/// Group of overlapping objects, and position in it from the front; both are 0 for an object that overlaps no other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct GroupPlace {
    group: usize,
    order: usize,
}

/// The groups and positions of objects, given the first object of each object's group.
fn places(order: &ObjectOrder, groups: &[usize]) -> Vec<GroupPlace> {
    let layers = order.layers(&order.front_to_back());
    let is_alone = |first: usize| groups.iter().filter(|&&group| group == first).count() == 1;
    let shared: Vec<usize> =
        groups.iter().enumerate().filter(|&(i, &first)| i == first && !is_alone(first)).map(|(i, _)| i).collect();
    let place = |(first, layer): (&usize, usize)| match shared.binary_search(first) {
        Ok(at) => GroupPlace { group: at + 1, order: layer + 1 },
        Err(_) => GroupPlace { group: 0, order: 0 },
    };
    groups.iter().zip(layers).map(place).collect()
}

/// The first object of each object's group. A group consists of objects whose amodal masks overlap, directly or through
/// others.
fn groups(labels: &[ShownLabel]) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..labels.len()).collect();
    for j in 0..labels.len() {
        for i in 0..j {
            if groups[i] != groups[j] && !labels[i].amodal.and(labels[j].amodal).is_empty() {
                let (kept, gone) = (groups[i].min(groups[j]), groups[i].max(groups[j]));
                groups.iter_mut().filter(|group| **group == gone).for_each(|group| *group = kept);
            }
        }
    }
    groups
}
