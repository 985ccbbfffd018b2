//! COCO's average precision and recall, equal to pycocotools with `useCats = 0`.
//!
//! Boxes and areas are computed from masks. The area of an object is the area of its mask, except for a predicted box. Predictions are ranked by score. Of equal scores, the earlier image comes
//! first, then the earlier prediction.

use crate::image::ImagePair;
use crate::masked_object::MaskedObject;
use crate::measure::{Measure, Measurement, Metric};
use crate::register_metric;
use syntable_model::product::{BBox, Mask};
use syntable_model::reader::Crowd;

/// Maximum number of predictions of an image that are used.
pub const MOST: usize = 100;

/// Smaller maximum numbers of predictions of an image, for AR1 and AR10.
const FEWER: [usize; 2] = [1, 10];
/// Number of thresholds of IoU: from 0.5 to 0.95.
const THRESHOLDS: usize = 10;
/// Number of recall values at which precision is sampled: from 0 to 1.
const RECALLS: usize = 101;
/// Areas in pixels: all, small, medium, large. Both limits are inclusive.
pub const AREAS: [[u32; 2]; 4] = [[0, u32::MAX], [0, 1024], [1024, 9216], [9216, u32::MAX]];
/// Scores of a kind of mask or box, in the order of pycocotools.
pub(crate) const SCORES: [&str; 12] =
    ["ap", "ap50", "ap75", "aps", "apm", "apl", "ar1", "ar10", "ar100", "ars", "arm", "arl"];

/// A kind of mask: its name, the mask of an instance, and whether the mask's box is compared instead.
pub(crate) struct MaskKind {
    pub(crate) name: &'static str,
    of: fn(&MaskedObject) -> &Mask,
    is_box: bool,
}

pub(crate) const KINDS: [MaskKind; 4] = [
    MaskKind { name: "amodal_mask", of: |it| &it.amodal, is_box: false },
    MaskKind { name: "amodal_box", of: |it| &it.amodal, is_box: true },
    MaskKind { name: "visible_mask", of: |it| &it.visible, is_box: false },
    MaskKind { name: "visible_box", of: |it| &it.visible, is_box: true },
];

/// Names of the kinds, and of the scores of each.
pub fn names() -> ([&'static str; 4], [&'static str; 12]) {
    (KINDS.map(|kind| kind.name), SCORES)
}

register_metric!(Metric {
    name: "coco",
    doc: "COCO's AP and AR of amodal and visible masks and their boxes, regardless of class; needs scores.",
    build: |_| Measurement::of(CocoMetric),
    crate_name: env!("CARGO_PKG_NAME"),
});

struct CocoMetric;

/// Tally of an image for one kind.
#[derive(Default)]
pub(crate) struct KindTally {
    /// Number of labels by area.
    labels: [u32; AREAS.len()],
    /// Predictions by descending score.
    found: Vec<RankedPrediction>,
    /// Whether a prediction has no score.
    pub(super) is_unranked: bool,
}

/// A prediction: bits of thresholds by area.
struct RankedPrediction {
    score: f64,
    is_matched: [u16; AREAS.len()],
    is_ignored: [u16; AREAS.len()],
}

impl Measure for CocoMetric {
    type Tally = CocoTally;

    fn names(&self) -> Vec<String> {
        KINDS.iter().flat_map(|kind| SCORES.map(|score| format!("{}_{score}", kind.name))).collect()
    }

    fn tally(&self, pair: &ImagePair) -> CocoTally {
        let objects = ComparedObjects {
            labels: pair.labels.iter().collect(),
            crowds: pair.crowds.iter().collect(),
            ranked: pair.predictions.iter().chain(&pair.unlikely).collect(),
        };
        CocoTally(KINDS.map(|kind| kind.tally(&objects)))
    }

    fn values(&self, images: &[&CocoTally]) -> Vec<Option<f64>> {
        (0..KINDS.len()).flat_map(|kind| values(&images.iter().map(|it| &it.0[kind]).collect::<Vec<_>>())).collect()
    }
}

/// Objects of an image that are compared with each other.
pub(crate) struct ComparedObjects<'a> {
    pub(crate) labels: Vec<&'a MaskedObject>,
    pub(crate) crowds: Vec<&'a Crowd>,
    /// Predictions by descending score.
    pub(crate) ranked: Vec<&'a MaskedObject>,
}

/// Tally of an image for all kinds.
struct CocoTally([KindTally; KINDS.len()]);

/// A mask with its box and attributes.
struct ComparedShape<'a> {
    mask: &'a Mask,
    bbox: BBox,
    area: u32,
    is_crowd: bool,
}

impl<'a> ComparedShape<'a> {
    fn new(mask: &'a Mask, is_crowd: bool) -> Self {
        Self { mask, bbox: mask.bbox(), area: mask.area(), is_crowd }
    }
}

impl MaskKind {
    pub(crate) fn tally(&self, objects: &ComparedObjects) -> KindTally {
        let shown = objects.labels.iter().map(|it| (self.of)(it)).filter(|mask| !mask.is_empty());
        let crowds = objects.crowds.iter().map(|it| ComparedShape::new(&it.mask, true));
        let labels: Vec<ComparedShape> = shown.map(|mask| ComparedShape::new(mask, false)).chain(crowds).collect();
        let ranked = || objects.ranked.iter();
        let predictions: Vec<ComparedShape> = ranked().take(MOST).map(|it| self.predicted((self.of)(it))).collect();
        let overlaps: Vec<Vec<f64>> =
            predictions.iter().map(|it| labels.iter().map(|label| self.overlap(it, label)).collect()).collect();
        let scores = ranked().map(|it| it.score.unwrap_or(0.0));
        let mut found: Vec<RankedPrediction> =
            scores.take(MOST).map(|score| RankedPrediction { score, is_matched: [0; 4], is_ignored: [0; 4] }).collect();
        let mut count = [0; AREAS.len()];
        for (area, limits) in AREAS.iter().enumerate() {
            let is_within = |shape: &ComparedShape| (limits[0]..=limits[1]).contains(&shape.area);
            let is_ignored: Vec<bool> = labels.iter().map(|it| it.is_crowd || !is_within(it)).collect();
            count[area] = is_ignored.iter().filter(|it| !**it).count() as u32;
            // Labels that are not ignored come first.
            let mut order: Vec<usize> = (0..labels.len()).collect();
            order.sort_by_key(|label| is_ignored[*label]);
            for threshold in 0..THRESHOLDS {
                let mut is_taken = vec![false; labels.len()];
                for (index, prediction) in predictions.iter().enumerate() {
                    let bit = 1 << threshold;
                    let label = best(&overlaps[index], &labels, &order, &is_ignored, &is_taken, threshold);
                    if let Some(label) = label {
                        is_taken[label] = true;
                        found[index].is_matched[area] |= bit;
                    }
                    if label.map_or_else(|| !is_within(prediction), |label| is_ignored[label]) {
                        found[index].is_ignored[area] |= bit;
                    }
                }
            }
        }
        KindTally { labels: count, found, is_unranked: ranked().any(|it| it.score.is_none()) }
    }

    /// A prediction. `loadRes` of pycocotools computes the area of a result with a box from the box.
    fn predicted<'a>(&self, mask: &'a Mask) -> ComparedShape<'a> {
        let shape = ComparedShape::new(mask, false);
        let area = if self.is_box { box_area(&shape.bbox) as u32 } else { shape.area };
        ComparedShape { area, ..shape }
    }

    /// IoU; for a crowd, the share of the prediction that lies in it.
    fn overlap(&self, prediction: &ComparedShape, label: &ComparedShape) -> f64 {
        if !prediction.bbox.meets(&label.bbox) {
            return 0.0;
        }
        let area = |it: &ComparedShape| if self.is_box { box_area(&it.bbox) } else { f64::from(it.area) };
        let both = if self.is_box {
            common(&prediction.bbox, &label.bbox)
        } else {
            f64::from(prediction.mask.shared_area(label.mask))
        };
        let whole = if label.is_crowd { area(prediction) } else { area(prediction) + area(label) - both };
        both / whole
    }
}

/// Width times height, px².
fn box_area(bbox: &BBox) -> f64 {
    f64::from(bbox.width) * f64::from(bbox.height)
}

/// Area of the intersection of two boxes.
fn common(a: &BBox, b: &BBox) -> f64 {
    let edge = |a: i32, long: i32, b: i32, other: i32| f64::from((a + long).min(b + other) - a.max(b));
    edge(a.x, a.width, b.x, b.width) * edge(a.y, a.height, b.y, b.height)
}

/// IoU threshold by its index, as computed by NumPy's `linspace`.
fn iou_of(threshold: usize) -> f64 {
    let (first, last) = (0.5, 0.95);
    let step = (last - first) / (THRESHOLDS - 1) as f64;
    if threshold + 1 == THRESHOLDS { last } else { threshold as f64 * step + first }
}

/// The label that a prediction matches: the label with the largest overlap among the labels that are not ignored, or
/// else among the ignored labels. If overlaps are equal, the last label wins.
fn best(
    overlaps: &[f64],
    labels: &[ComparedShape],
    order: &[usize],
    is_ignored: &[bool],
    is_taken: &[bool],
    threshold: usize,
) -> Option<usize> {
    let mut least = iou_of(threshold).min(1.0 - 1e-10);
    let mut chosen: Option<usize> = None;
    for &label in order {
        if is_taken[label] && !labels[label].is_crowd {
            continue;
        }
        if chosen.is_some_and(|it| !is_ignored[it]) && is_ignored[label] {
            break;
        }
        if overlaps[label] >= least {
            (least, chosen) = (overlaps[label], Some(label));
        }
    }
    chosen
}

/// The scores of a kind.
pub(crate) fn values(images: &[&KindTally]) -> [Option<f64>; SCORES.len()] {
    if images.iter().any(|it| it.is_unranked) {
        return [None; SCORES.len()];
    }
    let [all, small, medium, large] = [0, 1, 2, 3].map(|area| Curves::of(images, area, MOST));
    let [one, ten] = FEWER.map(|limit| Curves::of(images, 0, limit));
    let (ap, ar) = (Curves::precision, Curves::recall);
    let at = |threshold: usize| all.precisions.get(threshold).copied();
    [
        ap(&all),
        at(0),
        at(5),
        ap(&small),
        ap(&medium),
        ap(&large),
        ar(&one),
        ar(&ten),
        ar(&all),
        ar(&small),
        ar(&medium),
        ar(&large),
    ]
}

/// Precision and recall by threshold; empty without labels.
#[derive(Default)]
struct Curves {
    precisions: Vec<f64>,
    recalls: Vec<f64>,
}

impl Curves {
    fn of(images: &[&KindTally], area: usize, limit: usize) -> Self {
        let labels: u32 = images.iter().map(|it| it.labels[area]).sum();
        if labels == 0 {
            return Self::default();
        }
        let mut ranked: Vec<&RankedPrediction> = images.iter().flat_map(|it| it.found.iter().take(limit)).collect();
        ranked.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut curves = Self::default();
        for threshold in 0..THRESHOLDS {
            let (precision, recall) = curve(&ranked, area, 1 << threshold, f64::from(labels));
            curves.precisions.push(precision);
            curves.recalls.push(recall);
        }
        curves
    }

    fn precision(&self) -> Option<f64> {
        mean(&self.precisions)
    }

    fn recall(&self) -> Option<f64> {
        mean(&self.recalls)
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Mean precision over recalls, and the maximum recall.
fn curve(ranked: &[&RankedPrediction], area: usize, bit: u16, labels: f64) -> (f64, f64) {
    let (mut hits, mut misses) = (0.0, 0.0);
    let mut points: Vec<[f64; 2]> = Vec::with_capacity(ranked.len());
    for found in ranked {
        if found.is_ignored[area] & bit == 0 {
            if found.is_matched[area] & bit == 0 { misses += 1.0 } else { hits += 1.0 }
        }
        points.push([hits / labels, hits / (misses + hits + f64::EPSILON)]);
    }
    // Makes precision non-increasing with recall.
    for index in (1..points.len()).rev() {
        points[index - 1][1] = points[index - 1][1].max(points[index][1]);
    }
    let mut at = 0;
    let mut sum = 0.0;
    for step in 0..RECALLS {
        let recall = if step + 1 == RECALLS { 1.0 } else { step as f64 * (1.0 / (RECALLS - 1) as f64) };
        at += points[at..].iter().take_while(|point| point[0] < recall).count();
        sum += points.get(at).map_or(0.0, |point| point[1]);
    }
    (sum / RECALLS as f64, points.last().map_or(0.0, |point| point[0]))
}
