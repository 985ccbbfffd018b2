//! Faults of COCOA's annotation files.

use super::read::key_of;
use super::record::{CocoaAnnotation, CocoaRegion};
use crate::read::{edge_px2, enclosed, eroded, no_pixels};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::prelude::*;
use syntable_model::product::{BBox, meeting_boxes};
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

/// Largest rounding error of a rate with two decimals.
const TWO_DECIMALS: f64 = 0.005;

impl CocoaAnnotation {
    /// The pairs of regions in `depth_constraint`, by number from 1. The first region of a pair is in front of the
    /// second.
    fn constraints(&self) -> Result<BTreeSet<[usize; 2]>, String> {
        let number = |text: &str| {
            let number = text.trim().parse().ok().filter(|number| (1..=self.regions.len()).contains(number));
            number.ok_or_else(|| format!("`depth_constraint` has `{text}`; regions are 1 to {}", self.regions.len()))
        };
        let pair = |text: &str| {
            let (front, back) = text.split_once('-').unwrap_or((text, ""));
            Ok([number(front)?, number(back)?])
        };
        self.depth_constraint.split(',').filter(|text| !text.trim().is_empty()).map(pair).collect()
    }

    /// The rules that the annotation breaks. With `beyond`, rates may count parts outside the image.
    pub fn faults(&self, size: [u32; 2], beyond: bool, is_ours: bool) -> Vec<DatasetFault> {
        let faults = self.faults_of_regions(size, beyond, is_ours).into_iter();
        faults.map(|fault| fault.of(FaultSubject::Annotation(self.id))).collect()
    }

    fn faults_of_regions(&self, size: [u32; 2], beyond: bool, is_ours: bool) -> Vec<DatasetFault> {
        let mut faults = Vec::new();
        if let Some(count) = self.size.filter(|count| *count != self.regions.len()) {
            let message = format!("`size` is {count}, it has {} regions", self.regions.len());
            faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
        }
        for (number, region) in self.objects() {
            if let Some(order) = region.order.filter(|order| *order != number) {
                let message = format!("{} is {order}, its place from the front {number}", key_of(number, "order"));
                faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
            }
            let (Ok([visible, amodal, hidden]), Ok(polygon)) =
                (self.masks(number, region, size), self.polygon(number, region, size))
            else {
                continue;
            };
            if visible.is_empty() && amodal.is_empty() {
                let fault = no_pixels();
                let message = format!("`regions[{}]`: {}", number - 1, fault.message);
                faults.push(DatasetFault { message, ..fault });
            }
            faults.extend(region.faults_of_masks(number, [&visible, &amodal, &hidden], (&polygon, beyond)));
        }
        match self.constraints() {
            Ok(pairs) => {
                faults.extend(self.faults_of_order(&pairs, size));
                // Files of other programs may list only some of the pairs.
                if is_ours || pairs.is_empty() {
                    faults.extend(self.missing_pair(&pairs, size));
                }
            }
            Err(message) => faults.push(DatasetFault::new(rule::RECORDS_AGREE, message)),
        }
        faults
    }

    /// The first pair of regions that is missing although one region hides a part of the other, away from its own edge.
    fn missing_pair(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Option<DatasetFault> {
        let masks = self.objects().filter_map(|(number, region)| {
            let [visible, _, hidden] = self.masks(number, region, size).ok()?;
            Some((number, eroded(&visible), hidden))
        });
        let masks: Vec<(usize, Mask, Mask)> = masks.collect();
        let boxes = |of: fn(&(usize, Mask, Mask)) -> &Mask| masks.iter().map(|it| of(it).bbox()).collect::<Vec<BBox>>();
        let mut meeting = Vec::new();
        meeting_boxes(&boxes(|it| &it.1), &boxes(|it| &it.2), |front, back| {
            let pair = [masks[front].0, masks[back].0];
            meeting.extend((front < back && !pairs.contains(&pair)).then_some((front, back)));
        });
        meeting.sort_unstable();
        meeting.into_iter().find_map(|(front, back)| {
            let ((front, seen, _), (back, _, hidden)) = (&masks[front], &masks[back]);
            let area = seen.shared_area(hidden);
            let message = format!(
                "`depth_constraint` has no pair {front}-{back}, and region {front} hides {area} pixels of region {back}"
            );
            (area > 0).then(|| DatasetFault::new(rule::ORDER_MATCHES_MASKS, message))
        })
    }

    /// Pairs in the wrong order: the masks show that the second region hides a part of the first, and not the reverse.
    fn faults_of_order(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Vec<DatasetFault> {
        let masks =
            self.objects().filter_map(|(number, region)| Some((number, self.masks(number, region, size).ok()?)));
        let masks: BTreeMap<usize, [Mask; 3]> = masks.collect();
        let wrong = |&[front, back]: &[usize; 2]| {
            let ([seen, _, hidden], [seen_behind, _, hidden_behind]) = (masks.get(&front)?, masks.get(&back)?);
            let opposite = seen_behind.shared_area(hidden);
            (opposite > 0 && seen.shared_area(hidden_behind) == 0).then(|| {
                let message = format!(
                    "`depth_constraint` has {front}-{back}, and by its masks region {back} hides {opposite} pixels of region {front}"
                );
                DatasetFault::new(rule::ORDER_MATCHES_MASKS, message)
            })
        };
        pairs.iter().filter_map(wrong).collect()
    }
}

impl CocoaRegion {
    fn faults_of_masks(
        &self,
        number: usize,
        [visible, amodal, hidden]: [&Mask; 3],
        (polygon, beyond): (&Mask, bool),
    ) -> Vec<DatasetFault> {
        let mut faults = Vec::new();
        let edge = edge_px2(amodal).max(1.0);
        let area = f64::from(amodal.area());
        if let Some(said) = self.area.filter(|said| (said - area).abs() > edge) {
            let message = format!("{} is {said}, its masks have {area}", key_of(number, "area"));
            faults.push(DatasetFault::new(rule::AREAS_MATCH_MASKS, message));
        }
        let rate = if area == 0.0 { 0.0 } else { f64::from(hidden.area()) / area };
        // A rate may refer to the area of the polygon, which differs from the mask by pixels along the edge.
        let of_area = |area: f64| if area <= 0.0 { 1.0 } else { (f64::from(hidden.area()) / area).min(1.0) };
        let [low, high] = match (&self.visible_mask, &self.invisible_mask) {
            // The hidden part is the polygon without the visible mask.
            (Some(_), None) => [-1.0, 1.0].map(|sign: f64| rate + sign * edge / area.max(1.0)),
            _ => [rate.min(of_area(area + edge)), rate.max(of_area(area - edge))],
        };
        let is_off =
            |said: &f64| *said < low - TWO_DECIMALS || (!beyond && *said > high + TWO_DECIMALS) || said.is_nan();
        if let Some(said) = self.occlude_rate.filter(is_off) {
            let message = format!("{} is {said}, but its masks give {rate:.6}", key_of(number, "occlude_rate"));
            faults.push(DatasetFault::new(rule::RATE_IS_RATIO_OF_AREAS, message));
        }
        let both = visible.and(hidden).area();
        if both > 0 {
            let message = format!("{}: {both} of its pixels are visible, too", key_of(number, "invisible_mask"));
            faults.push(DatasetFault::new(rule::OCCLUSION_IS_AMODAL_MINUS_VISIBLE, message));
        }
        // A polygon fills the holes of its mask.
        let more = polygon.minus(amodal);
        let holes: u32 = enclosed(&more, polygon).iter().map(Mask::area).sum();
        let differ = f64::from(amodal.minus(polygon).area() + more.area() - holes);
        if differ > edge {
            let message = format!("{} differs from its masks at {differ} pixels", key_of(number, "segmentation"));
            faults.push(DatasetFault::new("polygon_matches_mask", message));
        }
        faults
    }
}
