//! Occlusion order: which object occludes which.

use crate::image::ImagePair;
use crate::masked_object::MaskedObject;
use crate::measure::{Measurement, Metric, Ratio, Ratios};
use crate::register_metric;
use syntable_formats::read::{occludes, order_by};
use syntable_model::product::Mask;
use syntable_model::scene::InstanceId;

/// IoU above which SynTable's release has an edge.
const RELEASE_IOU: f64 = 0.1;

register_metric!(
    Metric {
        name: "order",
        doc: "ACC_OO by the paper and by the released code, and precision, recall and F1 of edges \"i occludes j\".",
        build: |_| {
            let names = ["acc_oo", "acc_oo_release", "edge_p", "edge_r", "edge_f1"];
            Measurement::of(Ratios { names, of: syntable })
        },
        crate_name: env!("CARGO_PKG_NAME"),
    },
    Metric {
        name: "insta_order",
        doc: "InstaOrder's recall, precision and F1 of the occlusion order: means over images of two objects or more.",
        build: |_| {
            let names = ["insta_order_r", "insta_order_p", "insta_order_f1"];
            Measurement::of(Ratios { names, of: insta_order })
        },
        crate_name: env!("CARGO_PKG_NAME"),
    },
    Metric {
        name: "deocclusion",
        doc: "De-occlusion's accuracy of the order of all pairs of objects, and of the pairs that occlude each other.",
        build: |_| { Measurement::of(Ratios { names: ["deocclusion_all", "deocclusion_occluded"], of: deocclusion }) },
        crate_name: env!("CARGO_PKG_NAME"),
    },
);

fn syntable(pair: &ImagePair) -> [Ratio; 5] {
    let (labels, predictions, matched) = (&pair.labels, &pair.predictions, pair.matched());
    let pairs = labels.len() * labels.len().saturating_sub(1);
    let (truth, predicted) = (paper(labels), paper(predictions));
    let edges = [&truth, &predicted].map(|order| order.iter().flatten().filter(|edge| **edge).count());
    let found = equal(matched, &truth, &predicted, |edge| edge);
    [
        Ratio::micro(equal(matched, &truth, &predicted, |_| true), pairs),
        Ratio::micro(equal(matched, &release(labels), &iou(predictions), |_| true), pairs),
        Ratio::micro(found, edges[1]),
        Ratio::micro(found, edges[0]),
        Ratio::micro(2 * found, edges[0] + edges[1]),
    ]
}

/// Edges among labeled objects only. Unmatched predictions have no edges. 0 of 0 is 1.
fn insta_order(pair: &ImagePair) -> [Ratio; 3] {
    if pair.labels.len() < 2 {
        return [Ratio::default(); 3];
    }
    let truth = paper(&pair.labels);
    let predicted = of_labels(pair, &paper(&pair.predictions));
    let count = |counts: fn(bool, bool) -> bool| {
        let entries = truth.iter().flatten().zip(predicted.iter().flatten());
        entries.filter(|(truth, predicted)| counts(**truth, **predicted)).count()
    };
    let (both, of_truth, of_predicted) = (count(|a, b| a && b), count(|a, _| a), count(|_, b| b));
    let share = |part: usize, whole: usize| Ratio::mean(if whole == 0 { 1.0 } else { part as f64 / whole as f64 });
    [share(both, of_truth), share(both, of_predicted), share(2 * both, of_truth + of_predicted)]
}

/// The order of predictions, transferred to the labels with which they are matched.
fn of_labels(pair: &ImagePair, predicted: &OcclusionMatrix) -> OcclusionMatrix {
    let mut own = vec![None; pair.labels.len()];
    pair.matched().iter().for_each(|&(label, prediction)| own[label] = Some(prediction));
    order(own.len(), |i, j| own[i].zip(own[j]).is_some_and(|(i, j)| predicted[i][j]))
}

/// Compares pairs of objects: the object in front has 1, the other −1; both have 0 if neither or each occludes the
/// other.
fn deocclusion(pair: &ImagePair) -> [Ratio; 2] {
    let (truth, predicted) = (paper(&pair.labels), paper(&pair.predictions));
    let sign = |order: &OcclusionMatrix, i: usize, j: usize| i8::from(order[i][j]) - i8::from(order[j][i]);
    let n = pair.labels.len();
    let ordered = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| sign(&truth, i, j) != 0).count();
    let mut equal = [0; 2];
    for &(i, p) in pair.matched() {
        for &(j, q) in pair.matched() {
            let said = sign(&truth, i, j);
            if i != j && said == sign(&predicted, p, q) {
                equal[0] += 1;
                equal[1] += usize::from(said != 0);
            }
        }
    }
    [Ratio::micro(equal[0], n * n.saturating_sub(1)), Ratio::micro(equal[1], ordered)]
}

/// Whether object i (row) occludes object j (column).
type OcclusionMatrix = Vec<Vec<bool>>;

/// Numbers of ordered pairs of matched objects with equal values in both matrices, among the selected pairs.
fn equal(
    matched: &[(usize, usize)],
    truth: &OcclusionMatrix,
    predicted: &OcclusionMatrix,
    counts: fn(bool) -> bool,
) -> usize {
    let all = matched.iter().flat_map(|a| matched.iter().map(move |b| (a, b))).filter(|(a, b)| a != b);
    all.filter(|((i, p), (j, q))| truth[*i][*j] == predicted[*p][*q] && counts(truth[*i][*j])).count()
}

fn order(n: usize, occludes: impl Fn(usize, usize) -> bool) -> OcclusionMatrix {
    (0..n).map(|i| (0..n).map(|j| i != j && occludes(i, j)).collect()).collect()
}

/// The paper's Algorithm 1: the visible mask of one object meets the occlusion mask of the other.
pub fn paper(all: &[MaskedObject]) -> OcclusionMatrix {
    // Objects are identified by position, because predictions have no ids.
    let objects = all.iter().enumerate().map(|(at, it)| (InstanceId(at as u16), &it.visible, Some(&it.occlusion)));
    let found = order_by(&objects.collect::<Vec<_>>(), occludes);
    order(all.len(), |i, j| found.occludes(i, j))
}

/// Edges of predictions as the release computes them.
fn iou(all: &[MaskedObject]) -> OcclusionMatrix {
    order(all.len(), |i, j| exceeds(&all[i].visible, &all[j].occlusion))
}

/// Edges of labels as the release computes them: the union of all visible masks replaces each visible mask, so all rows
/// are equal.
fn release(all: &[MaskedObject]) -> OcclusionMatrix {
    let Some(first) = all.first() else { return Vec::new() };
    let union = all[1..].iter().fold(first.visible.clone(), |union, it| union.or(&it.visible));
    let is_hidden: Vec<bool> = all.iter().map(|it| exceeds(&union, &it.occlusion)).collect();
    order(all.len(), |_, j| is_hidden[j])
}

fn exceeds(visible: &Mask, occlusion: &Mask) -> bool {
    let both = visible.shared_area(occlusion);
    f64::from(both) > RELEASE_IOU * f64::from(visible.area() + occlusion.area() - both)
}
