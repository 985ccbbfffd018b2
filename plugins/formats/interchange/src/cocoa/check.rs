//! What contradicts the records of COCOA's annotation file.

use super::record::{ImageAnnotation, Region};
use crate::family::read::Fault;
use crate::read::{self as shared, edge_px2, enclosed, eroded};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::prelude::*;
use syntable_model::product::{BBox, meeting_boxes};

/// Largest error of a rate of two decimals.
const TWO_DECIMALS: f64 = 0.005;

impl ImageAnnotation {
    /// The pairs of regions, by their numbers from 1, of which the first is in front of the second.
    fn constraints(&self) -> Result<BTreeSet<[usize; 2]>, String> {
        let number = |text: &str| {
            let number = text.trim().parse().ok().filter(|number| (1..=self.regions.len()).contains(number));
            number.ok_or_else(|| {
                format!(
                    "annotation {}: `depth_constraint` has `{text}`; regions are 1 to {}",
                    self.id,
                    self.regions.len()
                )
            })
        };
        let pair = |text: &str| {
            let (front, back) = text.split_once('-').unwrap_or((text, ""));
            Ok([number(front)?, number(back)?])
        };
        self.depth_constraint.split(',').filter(|text| !text.trim().is_empty()).map(pair).collect()
    }

    /// What it says beside its masks, and what contradicts them. Rates may count what is `beyond` the image.
    pub fn faults(&self, size: [u32; 2], beyond: bool, is_ours: bool) -> Vec<Fault> {
        let mut faults = Vec::new();
        if let Some(count) = self.size.filter(|count| *count != self.regions.len()) {
            let message = format!("annotation {}: `size` is {count}, it has {} regions", self.id, self.regions.len());
            faults.push(("records_agree", message));
        }
        for (number, region) in self.objects() {
            if let Some(order) = region.order.filter(|order| *order != number) {
                let message = format!("{} is {order}, its place from the front {number}", self.key(number, "order"));
                faults.push(("records_agree", message));
            }
            let (Ok([visible, amodal, hidden]), Ok(polygon)) =
                (self.masks(number, region, size), self.polygon(number, region, size))
            else {
                continue;
            };
            if visible.is_empty() && amodal.is_empty() {
                faults.push(shared::no_pixels(&format!("annotation {}: `regions[{}]`", self.id, number - 1)));
            }
            faults.extend(self.faults_of_masks(number, region, [&visible, &amodal, &hidden], (&polygon, beyond)));
        }
        match self.constraints() {
            Ok(pairs) => {
                faults.extend(self.faults_of_order(&pairs, size));
                // Files of others may have a part of all pairs.
                if is_ours || pairs.is_empty() {
                    faults.extend(self.missing_pair(&pairs, size));
                }
            }
            Err(message) => faults.push(("records_agree", message)),
        }
        faults
    }

    fn faults_of_masks(
        &self,
        number: usize,
        region: &Region,
        [visible, amodal, hidden]: [&Mask; 3],
        (polygon, beyond): (&Mask, bool),
    ) -> Vec<Fault> {
        let mut faults = Vec::new();
        let edge = edge_px2(amodal).max(1.0);
        let area = f64::from(amodal.area());
        if let Some(said) = region.area.filter(|said| (said - area).abs() > edge) {
            let message = format!("{} is {said}, its masks have {area}", self.key(number, "area"));
            faults.push(("areas_are_those_of_masks", message));
        }
        let rate = if area == 0.0 { 0.0 } else { f64::from(hidden.area()) / area };
        // A rate may be that of the polygon, whose area is off by the pixels at its edge.
        let of_area = |area: f64| if area <= 0.0 { 1.0 } else { (f64::from(hidden.area()) / area).min(1.0) };
        let [low, high] = match (&region.visible_mask, &region.invisible_mask) {
            // What is hidden is what the polygon has more.
            (Some(_), None) => [-1.0, 1.0].map(|sign: f64| rate + sign * edge / area.max(1.0)),
            _ => [rate.min(of_area(area + edge)), rate.max(of_area(area - edge))],
        };
        let is_off =
            |said: &f64| *said < low - TWO_DECIMALS || (!beyond && *said > high + TWO_DECIMALS) || said.is_nan();
        if let Some(said) = region.occlude_rate.filter(is_off) {
            let message = format!("{} is {said}, that of its masks {rate:.6}", self.key(number, "occlude_rate"));
            faults.push(("rate_is_ratio_of_areas", message));
        }
        let both = visible.and(hidden).area();
        if both > 0 {
            let message = format!("{}: {both} of its pixels are visible, too", self.key(number, "invisible_mask"));
            faults.push(("occlusion_is_amodal_minus_visible", message));
        }
        // A polygon fills the holes of its mask.
        let more = polygon.minus(amodal);
        let holes: u32 = enclosed(&more, polygon).iter().map(Mask::area).sum();
        let differ = f64::from(amodal.minus(polygon).area() + more.area() - holes);
        if differ > edge {
            let message = format!("{} differs from its masks at {differ} pixels", self.key(number, "segmentation"));
            faults.push(("polygon_is_that_of_masks", message));
        }
        faults
    }

    /// The first two regions that are no pair, although the one in front hides a part of the other, away from its own edge.
    fn missing_pair(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Option<Fault> {
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
                "annotation {}: `depth_constraint` has no pair {front}-{back}, and region {front} hides {area} pixels of \
                 region {back}",
                self.id
            );
            (area > 0).then_some(("order_is_that_of_masks", message))
        })
    }

    /// Pairs whose order the masks contradict: the object behind hides a part of that in front, and not the other way round.
    fn faults_of_order(&self, pairs: &BTreeSet<[usize; 2]>, size: [u32; 2]) -> Vec<Fault> {
        let masks =
            self.objects().filter_map(|(number, region)| Some((number, self.masks(number, region, size).ok()?)));
        let masks: BTreeMap<usize, [Mask; 3]> = masks.collect();
        let wrong = |&[front, back]: &[usize; 2]| {
            let ([seen, _, hidden], [seen_behind, _, hidden_behind]) = (masks.get(&front)?, masks.get(&back)?);
            let opposite = seen_behind.shared_area(hidden);
            (opposite > 0 && seen.shared_area(hidden_behind) == 0).then(|| {
                let message = format!(
                    "annotation {}: `depth_constraint` has {front}-{back}, and by its masks region {back} hides {opposite} pixels of \
                     region {front}",
                    self.id
                );
                ("order_is_that_of_masks", message)
            })
        };
        pairs.iter().filter_map(wrong).collect()
    }
}
