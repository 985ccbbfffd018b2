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
use syntable_model::product::standard::{AMODAL_OUTLINE, RGB, VISIBLE_OUTLINE};
use syntable_model::product::{BBox, meeting_boxes};

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
    let mut members = vec![0_usize; groups.len()];
    groups.iter().for_each(|&first| members[first] += 1);
    let shared: Vec<usize> = (0..groups.len()).filter(|&first| members[first] > 1).collect();
    let place = |(first, layer): (&usize, usize)| match shared.binary_search(first) {
        Ok(at) => GroupPlace { group: at + 1, order: layer + 1 },
        Err(_) => GroupPlace { group: 0, order: 0 },
    };
    groups.iter().zip(layers).map(place).collect()
}

/// The first object of each object's group. A group consists of objects whose amodal masks overlap, directly or through
/// others.
fn groups(labels: &[ShownLabel]) -> Vec<usize> {
    let boxes: Vec<BBox> = labels.iter().map(|label| label.amodal.bbox()).collect();
    // Each object leads to an earlier one of its group, and the first one to itself.
    let mut before: Vec<usize> = (0..labels.len()).collect();
    fn first(before: &mut [usize], mut object: usize) -> usize {
        while before[object] != object {
            before[object] = before[before[object]];
            object = before[object];
        }
        object
    }
    meeting_boxes(&boxes, &boxes, |i, j| {
        let [one, other] = [i, j].map(|object| first(&mut before, object));
        if one != other && labels[i].amodal.shared_area(labels[j].amodal) > 0 {
            before[one.max(other)] = one.min(other);
        }
    });
    (0..labels.len()).map(|object| first(&mut before, object)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with a walk over all pairs of masks.
    #[test]
    fn groups_match_a_walk_over_all_pairs() {
        let mut stream = Stream::root(9);
        for _ in 0..100 {
            let mut edge = |end: u64| stream.below(end) as u32;
            let masks: Vec<Mask> = (0..edge(12))
                .map(|_| {
                    let [x, y, long] = [edge(24), edge(24), edge(8)];
                    // A cross, which leaves the corners of its box free.
                    Mask::from_fn(24, 24, |u, v| (u == x && v.abs_diff(y) < long) || (v == y && u.abs_diff(x) < long))
                })
                .collect();
            let label = |mask| ShownLabel {
                id: InstanceId(1),
                visible: mask,
                amodal: mask,
                occlusion: mask,
                rate: 0.0,
                visible_box: mask.bbox(),
                amodal_box: mask.bbox(),
                category: 1,
            };
            let found = groups(&masks.iter().map(label).collect::<Vec<_>>());
            for (first, found) in found.into_iter().enumerate() {
                let (mut group, mut open) = (vec![false; masks.len()], vec![first]);
                while let Some(one) = open.pop() {
                    if !std::mem::replace(&mut group[one], true) {
                        open.extend((0..masks.len()).filter(|other| !masks[one].and(&masks[*other]).is_empty()));
                    }
                }
                assert_eq!(found, group.iter().position(|is_in| *is_in).expect("itself"), "{masks:?}");
            }
        }
    }
}
